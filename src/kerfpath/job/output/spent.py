"""What each contour of a job takes: time, gas and energy, and what these cost by the job's prices.

Gas and energy follow from the row of the contour's technique. Gas flows from its lead time before
the start to the end of the cut; where the program does not switch it, while the robot pierces and
cuts. The beam has the power that the program sets, or else that of the row and of the stages of its
pierce, times the duty, with none along micro joints.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kerfpath.arrays import short_repr
from kerfpath.errors import InputError
from kerfpath.execution import PowerAlong, power_along
from kerfpath.job.as_run import programmed
from kerfpath.job.format import CostTable, Job, JobRowTable, ProcessTable, full_power
from kerfpath.job.run.results import CutResult, JobResult
from kerfpath.post import build_program, laser_start

LITRES, JOULES, SECONDS = 1e3, 3.6e6, 3600.0
"""Litres of a m3, joules of a kWh, seconds of an hour."""
SHORTEST = 1e-12
"""Least share of the speed in a move."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What something costs, in the currency of the job; None where there is no price."""

    currency: str
    gas: float | None = None
    power: float | None = None
    machine: float | None = None

    __repr__ = short_repr

    @property
    def total(self) -> float:
        """The sum of what has a price."""
        return sum(each for each in (self.gas, self.power, self.machine) if each is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spent:
    """What a contour takes, or all of them.

    Parameters
    ----------
    cutting, piercing : float s
    air : float s or None
        Time of the moves between contours; None if they are not planned.
    gas_time : float s or None
        How long the gas flows; None if the program does not switch it.
    gas : float l or None
        Gas at the pressure of the room; None if the flow is not known.
    energy : float J or None
        Energy of the beam; None if its power is not known.
    cost : Cost or None
    """

    cutting: float
    piercing: float
    air: float | None = None
    gas_time: float | None = None
    gas: float | None = None
    energy: float | None = None
    cost: Cost | None = None

    __repr__ = short_repr


def spent_on(job: Job, cut: CutResult) -> Spent:
    """Return what a planned contour takes."""
    assert cut.plan is not None
    options = job.program.of(cut.contour)
    took, pierced = float(cut.plan.time[-1] - cut.plan.time[0]), options.pierce_time
    wait, lead = laser_start(options)[1], options.gas_lead
    flows = None if lead is None else lead + wait + took
    row = row_of(job, cut)
    flow = None if row is None else row.gas_flow_l_min
    gas = None if flow is None else flow / 60 * (took + pierced if flows is None else flows)
    energy = None if row is None else _energy(job, cut, row, took)
    return Spent(
        cutting=took,
        piercing=pierced,
        gas_time=flows,
        gas=gas,
        energy=energy,
        cost=_cost(job.cost, row, took + pierced, gas, energy),
    )


def spent_by_contour(outcome: JobResult) -> dict[str, Spent]:
    """Return what each planned contour takes, by its name."""
    planned = (cut for cut in outcome.cuts if cut.plan is not None)
    return {cut.name: spent_on(outcome.job, cut) for cut in planned}


def spent_on_all(outcome: JobResult, each: Sequence[Spent]) -> Spent:
    """Return what all planned contours take together, and the moves between them.

    `each` is what every one of them takes.
    """
    air, cost = None if outcome.part is None else outcome.part.air_time, None
    if (prices := outcome.job.cost) is not None:
        costs = [one.cost for one in each if one.cost is not None]
        moves = _cost(prices, None, air or 0.0, None, None)
        costs += [] if moves is None else [moves]
        cost = Cost(
            currency=prices.currency,
            gas=_sum(one.gas for one in costs),
            power=_sum(one.power for one in costs),
            machine=_sum(one.machine for one in costs),
        )

    def whole(name: str) -> float | None:
        values = [getattr(one, name) for one in each]
        return None if None in values else _sum(values)

    return Spent(
        cutting=sum(one.cutting for one in each),
        piercing=sum(one.piercing for one in each),
        air=air,
        gas_time=whole("gas_time"),
        gas=whole("gas"),
        energy=whole("energy"),
        cost=cost,
    )


def row_of(job: Job, cut: CutResult) -> JobRowTable | None:
    """Return the row of a contour's technique with its gas; None without [process]."""
    if "process" not in job.source:
        return None
    process = ProcessTable.model_validate(job.source["process"])
    technique = cut.request.task.table.technique or process.technique
    row = next(row for row in process.row if row.technique == technique)
    return row.model_copy(update={"gas": row.gas or process.gas})


def power_of(job: Job, cut: CutResult) -> PowerAlong | None:
    """Return the power along a cut as the program sets it; None without a plan, or if it does not.

    It is None, too, if the program cannot be made, which is reported when it is written.
    """
    if cut.plan is None or job.program.language == "none":
        return None
    if job.program.of(cut.contour).power is None:
        return None
    try:
        program = build_program([programmed(job, cut.plan, cut.as_run)], job.program)
        return power_along(program, program.sections[0], job.program)
    except InputError:
        return None


def _energy(job: Job, cut: CutResult, row: JobRowTable, took: float) -> float | None:
    """Return the energy (J) of the beam along a cut and its pierce; None if it is not known."""
    assert cut.plan is not None
    options = job.program.of(cut.contour)
    power, duty = row.beam_power, (row.duty_percent or 100.0) / 100
    full = full_power(job.source, ProcessTable.model_validate(job.source["process"]).row) or power
    if power is None or full is None:
        return None
    if options.power is not None:
        if (along := power_of(job, cut)) is None:
            return None
        time = np.diff(along.s) / np.maximum(along.speed, SHORTEST)
        share = float((along.set * along.lit * time).sum() / time.sum())
        stages = sum(share * time for share, time in options.pierce)
        return full * duty * (share * took + stages)
    lit = [kind != "micro joint" for kind in cut.plan.contour.kinds[:-1]]
    beam = float(np.diff(cut.plan.time)[lit].sum())
    pierce = options.pierce_time * power * duty
    if row.pierce and row.pierce_time == options.pierce_time:
        pierce = sum(
            stage.time_s
            * (stage.power_w or power)
            * (duty if stage.duty_percent is None else stage.duty_percent / 100)
            for stage in row.pierce
        )
    return power * duty * beam + pierce


def _cost(
    prices: CostTable | None, row: JobRowTable | None, seconds: float, gas: float | None,
    energy: float | None,
) -> Cost | None:  # fmt: skip
    """Return what machine time (s), gas (l) and beam energy (J) cost; None without prices."""
    if prices is None:
        return None
    of_gas = of_power = None
    if gas is not None and row is not None and row.gas is not None and prices.gas_per_m3:
        of_gas = prices.gas_per_m3[row.gas] * gas / LITRES
    if energy is not None and prices.power_per_kwh is not None:
        assert prices.source_efficiency is not None
        of_power = prices.power_per_kwh * energy / prices.source_efficiency / JOULES
    hourly = prices.machine_per_h
    return Cost(
        currency=prices.currency,
        gas=of_gas,
        power=of_power,
        machine=None if hourly is None else hourly * seconds / SECONDS,
    )


def _sum(values: Iterable[float | None]) -> float | None:
    """Return the sum of the values that are known; None if none is."""
    known = [value for value in values if value is not None]
    return sum(known) if known else None


# -----------------------------------------------------------------------------
# The table of the report and of the command line.


def spent_table(
    outcome: JobResult, by_contour: Mapping[str, Spent] | None = None
) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """Return names and units of columns, and a row for each contour and for all together.

    Only jobs with [process] or [cost] have rows, and only columns with values. What each contour
    takes is computed where it is not given.
    """
    job = outcome.job
    if "process" not in job.source and job.cost is None:
        return [], []
    by_contour = spent_by_contour(outcome) if by_contour is None else by_contour
    cuts = [cut for cut in outcome.cuts if cut.plan is not None]
    each = [*by_contour.values()]
    spent = [*each, spent_on_all(outcome, each)]
    currency = "" if job.cost is None else job.cost.currency
    columns: list[tuple[str, str, list[float | None], int]] = [
        ("Cutting", "s", [one.cutting for one in spent], 2),
        ("Piercing", "s", [one.piercing for one in spent], 2),
        ("Moves", "s", [one.air for one in spent], 2),
        ("Gas", "s", [one.gas_time for one in spent], 2),
        ("Gas", "l", [one.gas for one in spent], 1),
        ("Beam", "kJ", [None if one.energy is None else one.energy / 1e3 for one in spent], 2),
        *(
            (f"{name} cost", currency, [_part(one.cost, key) for one in spent], 4)
            for name, key in (("Gas", "gas"), ("Power", "power"), ("Machine", "machine"))
        ),
        ("Cost", currency, [_part(one.cost, "total") for one in spent], 4),
    ]
    shown = [column for column in columns if any(value is not None for value in column[2])]
    names = [*(cut.name for cut in cuts), "all"]
    techniques = [*(cut.request.task.technique or "-" for cut in cuts), ""]
    rows = [
        [name, technique, *("-" if v[k] is None else f"{v[k]:.{d}f}" for _, _, v, d in shown)]
        for k, (name, technique) in enumerate(zip(names, techniques, strict=True))
    ]
    heads = [("Contour", ""), ("Technique", ""), *((name, unit) for name, unit, _, _ in shown)]
    return heads, rows


def _part(cost: Cost | None, key: str) -> float | None:
    return None if cost is None else getattr(cost, key)


def spent_entry(spent: Spent) -> dict[str, object]:
    """Return times, gas, energy and cost as JSON data, with units in the names."""
    cost = spent.cost
    energy = None if spent.energy is None else spent.energy / 1e3
    return {
        "cutting_s": spent.cutting,
        "piercing_s": spent.piercing,
        "moves_s": spent.air,
        "gas_s": spent.gas_time,
        "gas_l": spent.gas,
        "beam_kj": energy,
        "cost": cost
        and {
            "currency": cost.currency,
            "gas": cost.gas,
            "power": cost.power,
            "machine": cost.machine,
            "total": cost.total,
        },
    }
