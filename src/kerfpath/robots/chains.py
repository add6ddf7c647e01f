"""The joint chain of a robot, from its description or from the model of its family."""

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
from kerfpath.robots.arm import Manipulator
from kerfpath.robots.described import nearest
from kerfpath.robots.external_axes import CarriedChain, ExternalAxis, Travel
from kerfpath.urdf import Description, KinematicChain, turns

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
                raise InputError(f"{axis.name}: {what}; give {key}= ({axis.unit}{per})")
            if value is None and per and not known > 0:
                what = f"its {key} is {known:g} {axis.unit}{per} in {self.source}"
                raise InputError(
                    f"{axis.name}: {what}, so it cannot move; give {key}= ({axis.unit}{per})"
                )
            values[key] = known if value is None else value
        if values["lower"] == values["upper"] and (
            given["lower"] is None or given["upper"] is None
        ):
            raise InputError(
                f"{axis.name}: its lower and upper limit are both {values['lower']:g} {axis.unit} "
                f"in {self.source}, so it cannot move; give lower= and upper= ({axis.unit})"
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


# -----------------------------------------------------------------------------
# The joint chain of a robot, from its description or from the model of its family.

X, Y, Z = np.eye(3)


def chain_of(robot: Manipulator) -> KinematicChain:
    """Return the joint chain of a robot, which ends at its flange.

    With external axes it is a `CarriedChain`, which begins at the part.

    Raises
    ------
    InputError
        The robot has no description and its family has no model with joint frames; or it has
        external axes and its joint limits are not known.
    """
    arm = arm_chain(robot)
    if not robot.externals:
        return arm
    limits = robot.joint_limits()
    return CarriedChain(
        origins=arm.origins,
        axes=arm.axes,
        end=arm.end,
        externals=robot.externals,
        travel=np.column_stack([limits.lower, limits.upper])[len(arm.axes) :],
    )


def arm_chain(robot: Manipulator) -> KinematicChain:
    """Return the joint chain of the arm alone; raises as `chain_of`."""
    return model_chain(robot) if robot.chain is None else robot.chain


def require_axes(chain: KinematicChain, robot: Manipulator) -> None:
    """Require that the chain of a cell has the external axes of a robot and all their travel.

    Raises
    ------
    InputError
        The external axes differ, or the chain covers less travel: bounds on motions hold within
        its travel only.
    """
    own = chain if isinstance(chain, CarriedChain) else None
    axes = () if own is None else own.externals
    one, two = (
        [(a.name, a.kind, a.carries, *a.axis, *a.point) for a in some]
        for some in (axes, robot.externals)
    )
    if one != two:
        here, there = (
            ", ".join(axis.name for axis in some) or "none" for some in (axes, robot.externals)
        )
        raise InputError(
            f"cell: it was built with other external axes ({here}) than the robot has ({there})"
        )
    if own is not None:
        limits, arm = robot.joint_limits(), len(own.axes)
        beyond = (limits.lower[arm:] < own.travel[:, 0]) | (limits.upper[arm:] > own.travel[:, 1])
        if (beyond & ~robot.endless[arm:]).any():
            raise InputError(
                "cell: it was built with less travel of the external axes than the robot has; "
                "build it again for this robot"
            )


def model_chain(robot: Manipulator) -> KinematicChain:
    """Return the joint chain of the family's model, ignoring the robot's description.

    Raises
    ------
    InputError
        The family has no model with joint frames.
    """
    if robot.kinematics not in _MODELS:
        raise InputError(
            f"robot {robot.id!r}: the joint frames of its family ({robot.family.words}) are known "
            "only from a robot description (URDF); read it with Robot.from_urdf"
        )
    model = _MODELS[robot.kinematics](robot.geometry)
    # q_model = sign q - offset: a frame at angle zero is turned back by the offset.
    back = [turns(axis, -robot.offset[i : i + 1])[0] for i, axis in enumerate(model.axes)]
    origins = model.origins @ np.array(back)
    origins[0] = robot.T_base_foot @ origins[0]
    return KinematicChain(
        origins=origins,
        axes=robot.sign[:, None] * model.axes,
        end=model.end @ robot.T_end_flange,
    )


def _opw(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of an OPW arm (Brandstoetter, Angerer and Hofbaur 2014, figure 1).

    The shoulder is at (a1, b, c1), the elbow c2 above it, the wrist centre at (a2, 0, c3) from the
    elbow, and the flange c4 further along.
    """
    origins, end = np.tile(np.eye(4), (6, 1, 1)), np.eye(4)
    origins[1, :3, 3] = g["a1"], g["b"], g["c1"]
    origins[2, 2, 3] = g["c2"]
    origins[3, :3, 3] = g["a2"], 0.0, g["c3"]
    end[2, 3] = g["c4"]
    return KinematicChain(origins=origins, axes=np.array([Z, Y, Y, Z, Y, Z]), end=end)


def _five(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of an OPW arm without axis 6."""
    whole = _opw(g)
    return replace(whole, origins=whole.origins[:5], axes=whole.axes[:5])


def _ur(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of a UR arm in DH frames, alpha = 90, 0, 0, 90, -90, 0 deg."""
    d = (g["d1"], 0.0, 0.0, g["d4"], g["d5"], g["d6"])
    a = (0.0, g["a2"], g["a3"], 0.0, 0.0, 0.0)
    after = turns(X, np.radians([90.0, 0.0, 0.0, 90.0, -90.0, 0.0]))
    after[:, 0, 3], after[:, 2, 3] = a, d
    return KinematicChain(
        origins=np.array([np.eye(4), *after[:5]]), axes=np.tile(Z, (6, 1)), end=after[5]
    )


def _srs(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of an S-R-S arm, upright at zero, with axes z, y, z, y, z, y, z."""
    origins, end = np.tile(np.eye(4), (7, 1, 1)), np.eye(4)
    origins[[1, 3, 5], 2, 3] = g["c1"], g["c2"], g["c3"]
    end[2, 3] = g["c4"]
    return KinematicChain(origins=origins, axes=np.array([Z, Y, Z, Y, Z, Y, Z]), end=end)


_MODELS = {"opw": _opw, "ur": _ur, "five": _five, "srs": _srs}
