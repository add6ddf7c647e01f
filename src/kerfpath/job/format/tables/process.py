"""The [process] table, and cut charts: rows of values by material, thickness, gas and technique."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from kerfpath.errors import InputError
from kerfpath.job.format.tables.table import (
    NotNegative,
    Number,
    Positive,
    Table,
    Text,
    fault,
    fault_in_words,
    key,
)
from kerfpath.post import power_curve

NORMAL = "normal"
"""The technique of a row, or of a job, that names none."""
SMALL_HOLE = "small-hole"
"""The technique that holes up to a size have by themselves."""
LONGEST_WORD = 40
"""Most characters of a word that rows are chosen by: it stands in comments of programs."""
MOST_ROWS = 10_000
"""Most rows of a chart."""

Word = Annotated[Text, Field(max_length=LONGEST_WORD)]
Power = Annotated[Positive | None, key("a number above 0, at most 100000, in W", "2500", le=1e5)]
Frequency = Annotated[Positive | None, key("a number above 0, in Hz", "5000")]
Duty = Annotated[
    Positive | None, key("a number above 0, at most 100, in per cent", "80", le=100)
]  # fmt: skip
Pressure = Annotated[NotNegative | None, key("a number from 0 to 100, in bar", "14", le=100)]
Height = Annotated[Positive | None, key("a number above 0, at most 100, in mm", "1", le=100)]
Length = Annotated[NotNegative | None, key("a number from 0 to 1000, in mm", "3", le=1000)]
Seconds = Annotated[NotNegative | None, key("a number from 0 to 60, in s", "0.3", le=60)]
Flow = Annotated[NotNegative | None, key("a number from 0 to 10000, in l/min", "300", le=10_000)]
Focus = Annotated[
    Number | None,
    key("a number from -100 to 100, in mm, negative below the surface", "-1.5", ge=-100, le=100),
]
Technique = Annotated[
    Word, key('"normal", "small-hole", "engraving", "thin-web" or another word', '"normal"')
]
Material = Annotated[Word, key("a material, as charts call it", '"mild steel"')]
Gas = Annotated[Word | None, key("a gas, as charts call it", '"N2"')]
Quality = Annotated[Word | None, key("a quality, as charts call it", '"fine"')]
Size = Annotated[NotNegative | None, key("a number from 0 to 100, in mm", "8", le=100)]
Thickness = Annotated[Positive, key("a number above 0, at most 500, in mm", "3", le=500)]


Pairs = list[list[float]] | None


def checked_pairs(read: Callable[[Sequence[Sequence[float]]], object]) -> Callable[[Pairs], Pairs]:
    """Return a validator of pairs, or None, that refuses what `read` refuses."""

    def checked(pairs: Pairs) -> Pairs:
        if pairs is not None:
            try:
                read(pairs)
            except InputError as error:
                raise fault_in_words(f"{error}".partition(": ")[2]) from None
        return pairs

    return checked


class StageTable(Table):
    """[[row.pierce]]: a stage of the pierce."""

    time_s: Annotated[NotNegative, key("a number from 0 to 60, in s", "0.2", le=60)]
    power_w: Power = None
    frequency_hz: Frequency = None
    duty_percent: Duty = None
    height_mm: Height = None
    gas: Gas = None
    pressure_bar: Pressure = None
    focus_mm: Focus = None


class CutTable(Table):
    """What is cut and how, by which rows are chosen."""

    material: Material
    thickness_mm: Thickness
    gas: Gas = None
    quality: Quality = None
    technique: Technique = NORMAL


class RowTable(CutTable):
    """[[row]]: the values of one material, thickness, gas, quality and technique."""

    speed_m_min: Annotated[
        Positive, key("a number above 0, at most 500, in m/min", "4.2", le=500)
    ]  # fmt: skip
    kerf_mm: Annotated[NotNegative | None, key("a number from 0 to 20, in mm", "0.2", le=20)] = None
    lead_in_mm: Length = None
    lead_out_mm: Length = None
    micro_joint_mm: Length = None
    gas_lead_s: Seconds = None
    stand_off_mm: Height = None
    gas_flow_l_min: Flow = None
    power_w: Power = None
    power_by_speed: Annotated[
        Pairs,
        AfterValidator(checked_pairs(power_curve)),
        key("pairs [share of the speed, share of power_w]", "[[0.0, 0.3], [1.0, 1.0]]"),
    ] = None
    frequency_hz: Frequency = None
    duty_percent: Duty = None
    pressure_bar: Pressure = None
    nozzle_mm: Annotated[
        Positive | None, key("a number above 0, at most 20, in mm", "1.5", le=20)
    ] = None
    focus_mm: Focus = None
    current_a: Annotated[Positive | None, key("a number above 0, in A", "45")] = None
    voltage_v: Annotated[Positive | None, key("a number above 0, in V", "128")] = None
    pause_at_end_s: Seconds = None
    note: Annotated[Text | None, key("a remark", '"mirror side up"')] = None
    small_hole_mm: Size = None
    pierce: Annotated[
        tuple[StageTable, ...],
        Field(strict=False, max_length=20),
        key("a list of stages", "[{ time_s = 0.2, power_w = 1500 }]"),
    ] = ()

    @model_validator(mode="after")
    def _size_of_small_holes(self) -> RowTable:
        if self.small_hole_mm is not None and self.technique != SMALL_HOLE:
            expected, remedy = (
                f'small_hole_mm in a row of technique "{SMALL_HOLE}"',
                "move it there",
            )
            raise fault(expected, f'it with "{self.technique}"', remedy, ("small_hole_mm",))
        return self

    @property
    def chosen_by(self) -> tuple[str, float, str, str, str]:
        """What the row is chosen by."""
        words = self.gas or "", self.quality or "", self.technique
        return (self.material, self.thickness_mm, *words)

    @property
    def beam_power(self) -> float | None:
        """Power of the beam, or of the arc, W; None if it is not known."""
        if self.power_w is None and self.current_a is not None and self.voltage_v is not None:
            return self.current_a * self.voltage_v
        return self.power_w

    @property
    def pierce_stages(self) -> list[list[float]] | None:
        """The stages as shares of `power_w` and times, s; None if powers are not known."""
        full, powers = self.power_w, [stage.power_w for stage in self.pierce]
        if full is None or not powers or None in powers:
            return None
        return [[round((s.power_w or 0.0) / full, 6), s.time_s] for s in self.pierce]

    @property
    def pierce_time(self) -> float | None:
        """The time of all stages of the pierce, s; None without stages."""
        return round(sum(stage.time_s for stage in self.pierce), 6) if self.pierce else None


class ChartFile(Table):
    """A cut chart: where its values come from, and its rows."""

    source: Annotated[Text, key("where the values come from", '"cut trials of May 2026"')]
    example: Annotated[bool, key("whether the values are only an example", "true")] = False
    machine: Annotated[Text | None, key("the source that the rows hold for", '"3 kW fibre"')] = None
    row: Annotated[
        tuple[RowTable, ...],
        Field(strict=False, min_length=1, max_length=MOST_ROWS),
    ]

    @model_validator(mode="after")
    def _rows_differ(self) -> ChartFile:
        seen: dict[tuple[str, float, str, str, str], int] = {}
        for number, row in enumerate(self.row):
            first = seen.setdefault(row.chosen_by, number)
            if first != number:
                raise fault(
                    "rows that differ in material, thickness_mm, gas, quality or technique",
                    f"those of row {first + 1} again",
                    "remove one, or name another technique or quality",
                    ("row", number, "material"),
                )
        return self


class JobRowTable(RowTable):
    """[[process.row]]: a row of a chart in the job itself; a plan.json has the rows in use."""

    chart: Annotated[Text | None, key("the chart that the row is from", '"charts/steel.toml"')] = (
        None
    )
    number: Annotated[
        int | None, key("the number of the row in its chart, from 1", "3", ge=1, le=MOST_ROWS)
    ] = None
    source: Annotated[Text | None, key("where the values come from", '"cut trials"')] = None
    example: Annotated[bool, key("whether the values are only an example", "true")] = False
    machine: Annotated[Text | None, key("the source that the row holds for", '"3 kW fibre"')] = None

    @property
    def place(self) -> str:
        """Where the row is, in words."""
        number = "" if self.number is None else f" row {self.number}"
        return f"{self.chart}{number}" if self.chart else "[[process.row]]"


class ProcessTable(CutTable):
    """[process]: what is cut, and the chart that has the values for it."""

    chart: Annotated[
        Text | None, key("the path of a chart, or the name of one", '"charts/steel.toml"')
    ] = None
    between: Annotated[
        Literal["refuse", "linear"],
        key("what to do with a thickness between two rows", '"linear"'),
    ] = "refuse"
    small_hole_mm: Size = None
    row: Annotated[tuple[JobRowTable, ...], Field(strict=False, max_length=MOST_ROWS)] = ()
    small_holes: Annotated[
        tuple[Text, ...] | None,
        Field(strict=False),
        key("the names of holes of [contour.pick_all] by size, in a plan.json alone", '["hole1"]'),
    ] = None
    cut_by: Annotated[
        dict[str, Word] | None,
        key("the technique of each contour, in a plan.json alone", '{ trim = "normal" }'),
    ] = None


class CostTable(Table):
    """[cost]: prices, by which gas, energy and time of a job cost something."""

    currency: Annotated[Word, key("a currency", '"EUR"')]
    gas_per_m3: Annotated[
        dict[str, NotNegative] | None,
        key("a price per m3 for each gas of the rows", "{ N2 = 0.4, O2 = 0.5 }"),
    ] = None
    power_per_kwh: Annotated[NotNegative | None, key("a number not below 0", "0.25")] = None
    source_efficiency: Annotated[
        Positive | None, key("a share above 0, at most 1, of the electric power", "0.35", le=1)
    ] = None
    machine_per_h: Annotated[NotNegative | None, key("a number not below 0", "80")] = None

    @model_validator(mode="after")
    def _some_price(self) -> CostTable:
        if self.gas_per_m3 is None and self.power_per_kwh is None and self.machine_per_h is None:
            expected = "gas_per_m3, power_per_kwh or machine_per_h"
            raise fault(expected, "none", "add a price, or remove [cost]", ("currency",))
        if (self.power_per_kwh is None) != (self.source_efficiency is None):
            name = "source_efficiency" if self.source_efficiency else "power_per_kwh"
            said = "both power_per_kwh and source_efficiency, or neither"
            raise fault(said, name, "add the other, or remove it", (name,))
        return self

    def lacks(self, row: RowTable, gas: str | None) -> tuple[str, str] | None:
        """Return the key of a price, and what a row lacks for it; None if it lacks nothing.

        `gas` is that of the row, or that of the job for any gas.
        """
        if self.gas_per_m3 is not None:
            if gas is None:
                return "gas_per_m3", "gas"
            if gas not in self.gas_per_m3:
                return "gas_per_m3", f"a gas with a price, it has {gas}"
            if row.gas_flow_l_min is None:
                return "gas_per_m3", "gas_flow_l_min"
        if self.power_per_kwh is not None and row.beam_power is None:
            return "power_per_kwh", "power_w"
        return None
