"""Read a robot description: its chain with angles as written or rounded, and its limits."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array
from kerfpath.errors import InputError
from kerfpath.robots.limits import LimitKeywords, RobotLimits
from kerfpath.robots.recognition import in_closed_form
from kerfpath.urdf import Description, KinematicChain, read_urdf

SNAPS = (5e-6, 5e-5, 5e-4, 5e-3)
"""rad: the rounding errors of angles written with five, four, three and two decimals."""
POSES = 256


class ChainKeywords(TypedDict, total=False):
    """The part of a description that is read: as in `kerfpath.urdf.read_urdf`."""

    base: str | None
    tip: str | None
    mount: str | None
    part: str | None
    packages: Mapping[str, str | Path] | None
    meshes: bool


def read_description(path: str | Path, snap: float | None, keywords: ChainKeywords) -> Description:
    """Return the description of an arm, its angles as written or, within snap, rounded to 15 deg.

    Raises
    ------
    InputError
        As `read_urdf`. Also without snap where the arm as written belongs to no family with a
        closed form, but does with its angles rounded: the message says how far that moves the tip.
    """
    chain: Any = {k: v for k, v in keywords.items() if k in ChainKeywords.__annotations__}
    found = read_urdf(path, snap=snap or 0.0, **chain)
    if snap is not None or in_closed_form(found.chain):
        return found
    meant = {snap: read_urdf(path, snap=snap, **chain | {"meshes": False}).chain for snap in SNAPS}
    whole = meant[SNAPS[-1]]
    if not in_closed_form(whole):
        return found
    least = next(snap for snap, chain in meant.items() if _alike(chain, whole))
    off, turned = _moved(found, whole)
    raise InputError(
        f"{found.path} ({found.base} to {found.tip}): the arm as written belongs to no family "
        "with a closed form, but it does with its angles rounded to 15 deg. A snap of "
        f"{np.degrees(least):.1g} deg ({least:g} rad) rounds them, which moves the tip by up to "
        f"{off * 1e3:.2g} mm and {np.degrees(turned):.2g} deg"
        + (
            "; a snap of 0 keeps the angles as a general arm, whose solver may need minutes to "
            "prepare"
            if len(found.joints) == 6
            else ""
        ),
        parameter="snap",
    )


def _alike(one: KinematicChain, two: KinematicChain) -> bool:
    """Return whether two chains have the same frames."""
    return np.array_equal(one.origins, two.origins) and np.array_equal(one.end, two.end)


def _moved(found: Description, meant: KinematicChain) -> tuple[float, float]:
    """Return how far rounding moves the tip, m, and turns it, rad, over random joint vectors."""
    q = np.random.default_rng(1571).uniform(-np.pi, np.pi, (POSES, len(found.joints)))
    here, there = found.chain.forward(q), meant.forward(q)
    off = np.linalg.norm(there[:, :3, 3] - here[:, :3, 3], axis=1)
    between = np.swapaxes(here[:, :3, :3], 1, 2) @ there[:, :3, :3]
    return float(off.max()), float(Rotation.from_matrix(between).magnitude().max())


def described_limits(description: Description, given: LimitKeywords) -> tuple[RobotLimits, str]:
    """Return the limits of a description, and where its accelerations come from.

    Given limits (rad, s, N m) replace those written there.

    Raises
    ------
    InputError
        A limit is missing or zero there and is not given.
    """
    lower, upper = _ranges(description, given)
    acceleration, source = given.get("acceleration"), "given by the user"
    if acceleration is None:
        acceleration = _acceleration(description)
        source = "" if acceleration is None else f"URDF {Path(description.path).name}"
    velocity, jerk, torque = given.get("velocity"), given.get("jerk"), given.get("torque")
    endless = given.get("endless")
    if endless is None:
        endless = [joint.kind == "continuous" for joint in description.joints]
    limits = RobotLimits(
        lower=lower,
        upper=upper,
        velocity=_velocity(description) if velocity is None else np.asarray(velocity),
        acceleration=None if acceleration is None else np.asarray(acceleration),
        jerk=_jerk(description) if jerk is None else np.asarray(jerk),
        torque=_torque(description) if torque is None else np.asarray(torque),
        endless=np.asarray(endless),
    )
    return limits, source


def _ranges(description: Description, given: LimitKeywords) -> tuple[Array, Array]:
    """Return lower and upper limits; an endless joint has none and gets one turn."""
    n, lower, upper = len(description.joints), given.get("lower"), given.get("upper")
    endless = given.get("endless")
    free = np.zeros(n, bool) if endless is None else np.asarray(endless, bool)
    low, high = -np.pi * np.ones(n), np.pi * np.ones(n)
    for i, joint in enumerate(description.joints):
        if joint.kind == "continuous" or free[i]:
            continue
        if (joint.lower is None and lower is None) or (joint.upper is None and upper is None):
            raise _lacks(description, joint.name, "has no position limits", "lower", "upper")
        low[i], high[i] = joint.lower or 0.0, joint.upper or 0.0
        if not low[i] < high[i] and (lower is None or upper is None):
            raise _lacks(
                description,
                joint.name,
                f"has the lower limit {low[i]:g} rad and the upper limit {high[i]:g} rad, so it "
                "cannot move",
                "lower",
                "upper",
            )
    return (
        low if lower is None else np.asarray(lower),
        high if upper is None else np.asarray(upper),
    )


def _acceleration(description: Description) -> Array | None:
    """Return the accelerations (n,) written there (URDF 1.2); None unless all joints have one."""
    found = [joint.acceleration for joint in description.joints]
    _require_positive(description, found, "acceleration", "rad/s^2")
    return None if None in found else np.array(found, dtype=float)


def _jerk(description: Description) -> Array | None:
    """Return the jerks (n,) written there (URDF 1.2), infinity for joints without one."""
    found = [joint.jerk for joint in description.joints]
    _require_positive(description, found, "jerk", "rad/s^3")
    written = np.array([np.inf if jerk is None else jerk for jerk in found])
    return written if np.isfinite(written).any() else None


def _torque(description: Description) -> Array | None:
    """Return the efforts (n,) written there; None unless all joints have one."""
    found = [joint.effort for joint in description.joints]
    return None if None in found else np.array(found, dtype=float)


def _require_positive(
    description: Description, found: list[float | None], name: str, unit: str
) -> None:
    """Raise InputError where a written limit of one kind is zero or negative."""
    for joint, value in zip(description.joints, found, strict=True):
        if value is not None and value <= 0:
            what = f"has the {name} limit {value:g} {unit}, so it cannot move"
            raise _lacks(description, joint.name, what, name)


def _velocity(description: Description) -> Array:
    for joint in description.joints:
        if joint.velocity is None:
            raise _lacks(description, joint.name, "has no velocity limit", "velocity")
        if joint.velocity <= 0:
            what = f"has the velocity limit {joint.velocity:g} rad/s, so it cannot move"
            raise _lacks(description, joint.name, what, "velocity")
    return np.array([joint.velocity for joint in description.joints], dtype=float)


def _lacks(description: Description, joint: str, what: str, *parameters: str) -> InputError:
    return InputError(
        f"{description.path}: joint {joint!r} {what}; give {' and '.join(parameters)} for all "
        f"{len(description.joints)} joints",
        parameter=parameters[0],
    )
