"""Rails and positioners: their axes, and their limits as far as a source gives them."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import TypedDict

import numpy as np

from kerfpath.arrays import Array, as_pose, short_repr
from kerfpath.errors import InputError
from kerfpath.names import nearest
from kerfpath.robots.external_axes import ExternalAxis, Travel
from kerfpath.urdf import Description

# -----------------------------------------------------------------------------
# External axes from a robot description or the library, whose limits may be partly known.

_LIMITS = {"lower": "", "upper": "", "velocity": "/s", "acceleration": "/s^2"}
"""Limits of an axis, and the suffix that each adds to the unit of the axis value."""


class Given(TypedDict, total=False):
    """Values of an external axis that replace or complete the known ones; units as in `Travel`."""

    name: str
    lower: float
    upper: float
    velocity: float
    acceleration: float
    endless: bool
    step: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownAxis:
    """An external axis and its limits, as far as they are known.

    Parameters
    ----------
    axis : ExternalAxis
    lower, upper : float m or rad, or None
        Range of the axis; None where it is not known.
    velocity : float m/s or rad/s, or None
    acceleration : float m/s^2 or rad/s^2, or None
    endless : bool
        Whether the axis turns without end; then its range does not apply.
    source : str
        Where the limits come from, for messages.
    """

    axis: ExternalAxis
    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    acceleration: float | None = None
    endless: bool = False
    source: str

    __repr__ = short_repr

    def placed(self, T: Array) -> KnownAxis:
        """Return the axis moved with its product from the robot base to pose T (4, 4) m."""
        T = as_pose(T, "place")
        axis = replace(
            self.axis,
            axis=T[:3, :3] @ self.axis.axis,
            point=T[:3, :3] @ self.axis.point + T[:3, 3],
        )
        return replace(self, axis=axis)

    def completed(
        self,
        *,
        name: str | None = None,
        lower: float | None = None,
        upper: float | None = None,
        velocity: float | None = None,
        acceleration: float | None = None,
        endless: bool | None = None,
        step: float | None = None,
    ) -> tuple[ExternalAxis, Travel]:
        """Return the axis and its travel; given values (m, rad, s) replace the known ones.

        Raises
        ------
        InputError
            A limit is neither given nor known, or the known one does not let the axis move; or a
            range is given for an axis that turns without end.
        """
        axis = replace(self.axis, name=name or self.axis.name, step=step)
        given = {"lower": lower, "upper": upper, "velocity": velocity, "acceleration": acceleration}
        free = self.endless if endless is None else endless
        if free:
            for key in ("lower", "upper"):
                if given[key] is not None:
                    raise InputError(
                        f"{axis.name}: it turns without end, but got {key}=; remove it, or give "
                        "endless=False too"
                    )
            given |= {"lower": -np.pi, "upper": np.pi}
        values: dict[str, float] = {}
        for key, per in _LIMITS.items():
            value, known = given[key], getattr(self, key)
            if value is None and known is None:
                what = f"its {key} is not known from {self.source}"
                raise InputError(f"{axis.name}: {what}; give {key}", parameter=key)
            if value is None and per and not known > 0:
                what = f"its {key} is {known:g} {axis.unit}{per} in {self.source}"
                raise InputError(
                    f"{axis.name}: {what}, so it cannot move; give {key}", parameter=key
                )
            values[key] = known if value is None else value
        if values["lower"] == values["upper"] and (
            given["lower"] is None or given["upper"] is None
        ):
            raise InputError(
                f"{axis.name}: its lower and upper limit are both {values['lower']:g} {axis.unit} "
                f"in {self.source}, so it cannot move; give lower and upper",
                parameter="lower",
            )
        return axis, {
            "lower": values["lower"],
            "upper": values["upper"],
            "velocity": values["velocity"],
            "acceleration": values["acceleration"],
            "endless": free,
        }


def described_axes(description: Description) -> tuple[KnownAxis, ...]:
    """Return the external axes of a description in its base, with the limits written there."""
    return tuple(
        KnownAxis(
            axis=ExternalAxis(
                name=joint.name,
                kind="linear" if joint.kind == "prismatic" else "rotary",
                carries=external.carries,
                axis=external.pose[:3, :3] @ joint.axis,
                point=external.pose[:3, 3],
                joint=joint.name,
            ),
            lower=joint.lower,
            upper=joint.upper,
            velocity=joint.velocity,
            acceleration=joint.acceleration,
            endless=joint.kind == "continuous",
            source=description.path.name,
        )
        for external in description.externals
        for joint in [external.joint]
    )


def require_known(given: Mapping[str, Given], known: Iterable[KnownAxis], what: str) -> None:
    """Raise InputError where `given` names an axis that is not among the known ones."""
    names = [each.axis.name for each in known]
    for name in given:
        if name not in names:
            raise InputError(
                f"{what}: it has no external axis {name!r}; there are {', '.join(names) or 'none'}"
            )


# -----------------------------------------------------------------------------
# The library of rails and positioners, one TOML file each, with their sources.

_HERE = files("kerfpath.robots") / "externals"
_KEYS = {
    "linear": ("lower_mm", "upper_mm", "velocity_mm_s", "acceleration_mm_s2"),
    "rotary": ("lower_deg", "upper_deg", "velocity_deg_s", "acceleration_deg_s2"),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExternalProduct:
    """A rail or a positioner of the library.

    Parameters
    ----------
    id, manufacturer, model : str
    payload : float kg
    axes : tuple of KnownAxis
        Axes in the product's own frame, z up; each carries the next. A rail runs along x; a
        positioner has its origin on the floor and its tilt axis along x. Limits that no source
        gives are None.
    notes : tuple of str
        Remarks for the user.
    sources : mapping of str to str
        Where the data come from.
    """

    id: str
    manufacturer: str
    model: str
    payload: float
    axes: tuple[KnownAxis, ...]
    notes: tuple[str, ...]
    sources: Mapping[str, str]

    __repr__ = short_repr

    @property
    def axis_ids(self) -> tuple[str, ...]:
        """Names of the axes in a job, such as "kuka_dkp400.tilt"; a single axis has the id."""
        if len(self.axes) == 1:
            return (self.id,)
        return tuple(f"{self.id}.{known.axis.name}" for known in self.axes)


@cache
def external_ids() -> tuple[str, ...]:
    """Return the ids of all rails and positioners in the library, sorted."""
    names = (f.name for f in _HERE.iterdir())
    return tuple(sorted(n.removesuffix(".toml") for n in names if n.endswith(".toml")))


def external(name: str) -> ExternalProduct:
    """Return a rail or positioner of the library by its id.

    Parameters
    ----------
    name : str
        One of `external_ids()`.

    Raises
    ------
    InputError
        The id is unknown; the message names the nearest ones.
    """
    if name not in external_ids():
        raise InputError(
            f"{name!r} is not in the library of {len(external_ids())} rails and positioners; "
            f"{nearest(name, external_ids())}; 'kerfpath robots' lists all"
        )
    data = tomllib.loads((_HERE / f"{name}.toml").read_text(encoding="utf-8"))
    axes = []
    for said in data["axis"]:
        factor = 1e-3 if said["kind"] == "linear" else np.pi / 180
        lower, upper, velocity, acceleration = (
            None if key not in said else factor * said[key] for key in _KEYS[said["kind"]]
        )
        axes.append(
            KnownAxis(
                axis=ExternalAxis(
                    name=said["name"],
                    kind=said["kind"],
                    carries=said["carries"],
                    axis=np.array(said["axis"], dtype=float),
                    point=np.array(said.get("point_mm", (0, 0, 0)), dtype=float) / 1000,
                ),
                lower=lower,
                upper=upper,
                velocity=velocity,
                acceleration=acceleration,
                endless=said.get("endless", False),
                source=f"the library ({name})",
            )
        )
    return ExternalProduct(
        id=data["id"],
        manufacturer=data["manufacturer"],
        model=data["model"],
        payload=data["payload_kg"],
        axes=tuple(axes),
        notes=tuple(data.get("notes", ())),
        sources=data["source"],
    )


@cache
def external_axes() -> dict[str, KnownAxis]:
    """Return every external axis of the library by its name in a job."""
    products = [external(name) for name in external_ids()]
    return {
        name: known
        for product in products
        for name, known in zip(product.axis_ids, product.axes, strict=True)
    }
