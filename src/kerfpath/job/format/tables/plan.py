"""The [plan] table: the search, the objective and the limits, as `PlanOptions` declares them."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import create_model, model_validator

from kerfpath.certificate import Certify
from kerfpath.job.format.tables.table import Table, fields_of
from kerfpath.job.format.values import Positive, fault, key
from kerfpath.options import (
    CLEARANCE,
    EXACT_OR_BETTER,
    PENALTIES,
    REVERSALS,
    OptionConflict,
    PlanOptions,
)
from kerfpath.robots import Robot, postures_named
from kerfpath.setting import keys, settings
from kerfpath.tilt import Tilt


class PlanTable(create_model("PlanKeys", __base__=Table, **fields_of(PlanOptions))):  # type: ignore[misc]  # made
    """[plan]: the search, the objective and the limits of every plan."""

    path_tolerance_mm: Annotated[
        Positive | None,
        key("a number above 0, the largest distance of the tool from the path, in mm", "0.2"),
    ] = None

    @model_validator(mode="after")
    def _details_go_with_what_they_are_of(self) -> PlanTable:
        if self.tilt_deg is None and (more := self._given(Tilt)):
            raise fault(f"tilt_deg with {more[0]}", "none", "add tilt_deg", (more[0],))
        if not self.certify and (more := self._given(Certify)):
            expected, got = f"no {more[0]} with certify = false", _toml(getattr(self, more[0]))
            raise fault(expected, got, "remove one", (more[0],))
        return self

    def _given(self, kind: type) -> list[str]:
        """Return the keys of an option's details that the job gives."""
        given = [name for name in keys(kind) if name in self.model_fields_set]
        return [name for name in given if getattr(self, name) is not False]

    @property
    def executed_tolerance(self) -> float | None:
        """Largest distance of the executed tip from the path, m; None if it is only reported."""
        return None if self.path_tolerance_mm is None else self.path_tolerance_mm / 1000

    def resolve(self, robot: Robot, **others: Any) -> PlanOptions:
        """Return the plan options of the table, and `others` of other tables, in SI.

        Raises
        ------
        OptionConflict
            Two options conflict.
        """
        values = self.si(PlanOptions) | {"interpolation": "linear"} | others
        if self.posture is not None:
            values["postures"] = postures_named(self.posture, robot.kinematics)
        if self.rotation_deg is not None:
            values["rotation"] = np.where(robot.endless, values["rotation"], np.inf)
        if self.refine is None:
            values["refine"] = self.method in EXACT_OR_BETTER
        values["tilt"] = None if self.tilt_deg is None else Tilt(**self.si(Tilt))
        values["certify"] = Certify(**self.si(Certify)) if self.certify else None
        return PlanOptions(**values)


# -----------------------------------------------------------------------------
# Options that do not go together, in the words of a job.


def said_in_keys(conflict: OptionConflict, table: PlanTable) -> tuple[tuple[str, str], str]:
    """Return the key of two options in conflict, and the message in the words of a job."""
    names = {CLEARANCE: "clearance_band_mm", PENALTIES: "costs in [comfort]"}
    names[REVERSALS] = "reversals_cost"
    for name, each in settings(PlanOptions).items():
        names[name] = next(iter(each.keys), name)
    key = names[conflict.option]
    expected = f"no {key}" if conflict.expected is None else f"{key} = {_toml(conflict.expected)}"
    beside = " and ".join(
        f"{names[name]} = {_toml(value)}" if isinstance(value, str) else names[name]
        for name, value in conflict.beside.items()
    )
    said = f"expected {expected} with {beside}, got {_toml(getattr(table, key))}; change one"
    for name in (CLEARANCE, REVERSALS):
        if name in conflict.beside:
            return ("comfort", names[name]), said
    of_both = (key, *(names[name] for name in conflict.beside))
    return ("plan", next((each for each in of_both if each in table.model_fields_set), key)), said


def _toml(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return " or ".join(map(_toml, value))
    return f'"{value}"' if isinstance(value, str) else f"{value}"
