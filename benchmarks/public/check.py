"""Check motions of a robot along a cut by the rules of the benchmark set; needs only numpy.

    python check.py ANSWER.json [ANSWER.json ...]

An answer names its instance and has the joints at every node, one row per node:

    {"instance": "random-abb_irb2600_12_165-00", "planner": "mine 1.0", "seconds": 3.2,
     "q": [[0.1, ...], ...]}

"q" is null if the planner finds none. This file imports nothing else from the repository: you can
copy it with the instances. Angles are in rad, lengths in m, times in s.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "INSTANCES",
    "KNOWN",
    "Instance",
    "Verdict",
    "check",
    "forward",
    "instance",
    "names",
    "turned",
]

Array = NDArray[np.float64]

INSTANCES = Path(__file__).parent / "instances"
KNOWN = Path(__file__).parent / "known"

TIP = 1e-6
"""m: largest distance of the tip from its point."""
AXIS = 1e-6
"""rad: largest angle between the beam and its axis."""
RANGE = 1e-9
"""rad or m: tolerance for rounding of a joint at the end of its range."""
SHARE = 1e-6
"""Tolerance for rounding of a velocity or acceleration at its limit, as a share of the limit."""


@dataclass(frozen=True, eq=False)
class Instance:
    """A robot, a cut and its timing; n joints, those of the arm first, and K nodes.

    Parameters
    ----------
    name, family : str
    model : str
        Name of the robot.
    origins : (m, 4, 4)
        Frame of each joint of the arm at zero, in the frame of the joint before it; the first is
        in the robot base.
    turns : (m, 3)
        Unit vector about which each joint of the arm turns, in its own frame.
    flange, tool : (4, 4)
        Flange in the frame of the last joint; tip, beam along z, in the frame of the flange.
    closed_form : dict
        "family" of the arm ("opw", "ur"), "lengths", "offset" and "sign" of its joints, to solve
        its inverse kinematics in closed form; the chain describes the same arm.
    external : list of dict
        Axes that carry the robot or the part, stacked in this order: "name", "kind" ("linear" or
        "rotary"), "carries" ("robot" or "part"), "axis" and "point" in the robot base with all
        external axes at zero.
    lower, upper : (n,)
        Ranges; infinite for endless joints.
    velocity, acceleration : (n,)
        Limits.
    points, axes : (K, 3)
        Required tip and beam, in the robot base with all external axes at zero; they move with the
        part.
    closed : bool
        Whether the last point equals the first; the joints there may differ.
    interval : float
        Time from node to node.
    """

    name: str
    family: str
    model: str
    origins: Array
    turns: Array
    flange: Array
    tool: Array
    closed_form: dict[str, Any]
    external: list[dict[str, Any]]
    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    points: Array
    axes: Array
    closed: bool
    interval: float

    @property
    def endless(self) -> NDArray[np.bool_]:
        """The endless joints, (n,); only their angle within a turn counts."""
        return np.isinf(self.upper)


@dataclass(frozen=True)
class Verdict:
    """The worst values of a motion.

    Parameters
    ----------
    tip, axis : float m, rad
        Distance of the tip from its point, angle of the beam from its axis.
    range : float rad or m
        How far a joint leaves its range.
    velocity, acceleration : float
        Share of a limit.
    cost : float
        Sum over all intervals and joints of the share of the velocity limit.
    """

    tip: float
    axis: float
    range: float
    velocity: float
    acceleration: float
    cost: float

    @property
    def faults(self) -> list[str]:
        """The rules that are broken, and by how much."""
        rules = {
            f"tip {self.tip * 1e3:.3g} mm off": self.tip <= TIP,
            f"beam {np.degrees(self.axis):.3g} deg off": self.axis <= AXIS,
            f"range left by {self.range:.3g}": self.range <= RANGE,
            f"velocity {self.velocity:.4g} of its limit": self.velocity <= 1 + SHARE,
            f"acceleration {self.acceleration:.4g} of its limit": self.acceleration <= 1 + SHARE,
        }
        return [rule for rule, kept in rules.items() if not kept]


def instance(name: str, folder: Path = INSTANCES) -> Instance:
    """Return an instance of the set by its name."""
    data = json.loads((folder / f"{name}.json").read_text())
    joints = [*data["arm"], *data["external"]]
    endless = np.array([joint["endless"] for joint in joints])
    limits = {
        key: np.array([joint[key] for joint in joints], dtype=float)
        for key in ("lower", "upper", "velocity", "acceleration")
    }
    axes = np.array(data["axes"])
    return Instance(
        name=data["name"],
        family=data["family"],
        model=data["model"],
        origins=np.array([joint["origin"] for joint in data["arm"]]),
        turns=np.array([joint["axis"] for joint in data["arm"]], dtype=float),
        flange=np.array(data["flange"]),
        tool=np.array(data["tool"]),
        closed_form=data["closed_form"],
        external=data["external"],
        lower=np.where(endless, -np.inf, limits["lower"]),
        upper=np.where(endless, np.inf, limits["upper"]),
        velocity=limits["velocity"],
        acceleration=limits["acceleration"],
        points=np.array(data["points"]),
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        closed=data["closed"],
        interval=data["interval"],
    )


def names(folder: Path = INSTANCES) -> list[str]:
    """Return the names of all instances, sorted."""
    return sorted(file.stem for file in folder.glob("*.json"))


def forward(task: Instance, q: Array) -> Array:
    """Return the pose of the tip relative to the part, (K, 4, 4), at joints q (K, n)."""
    T = {what: np.tile(np.eye(4), (len(q), 1, 1)) for what in ("robot", "part")}
    arm = len(task.turns)
    for axis, x in zip(task.external, q[:, arm:].T, strict=True):
        moved = np.tile(np.eye(4), (len(q), 1, 1))
        along, point = np.array(axis["axis"], dtype=float), np.array(axis["point"])
        if axis["kind"] == "linear":
            moved[:, :3, 3] = x[:, None] * along
        else:
            moved[:, :3, :3] = turned(along, x)
            moved[:, :3, 3] = point - moved[:, :3, :3] @ point
        T[axis["carries"]] = T[axis["carries"]] @ moved
    reached = np.linalg.inv(T["part"]) @ T["robot"]
    for origin, about, angle in zip(task.origins, task.turns, q[:, :arm].T, strict=True):
        turn = np.tile(np.eye(4), (len(q), 1, 1))
        turn[:, :3, :3] = turned(about, angle)
        reached = reached @ origin @ turn
    return np.asarray(reached @ task.flange @ task.tool)


def check(task: Instance, q: Array) -> Verdict:
    """Return the verdict on a motion q (K, n); ValueError if it is not an array of that shape."""
    q = np.asarray(q, dtype=float)
    shape = (len(task.points), len(task.velocity))
    if q.shape != shape or not np.isfinite(q).all():
        raise ValueError(f"{task.name}: expected {shape} finite joint values, got {q.shape}")
    T = forward(task, q)
    tip = np.linalg.norm(T[:, :3, 3] - task.points, axis=1)
    across = np.linalg.norm(np.cross(T[:, :3, 2], task.axes), axis=1)
    lean = np.arctan2(across, (T[:, :3, 2] * task.axes).sum(axis=1))
    beyond = np.maximum(task.lower - q, q - task.upper)
    step = np.diff(q, axis=0)
    step = np.where(task.endless, (step + np.pi) % (2 * np.pi) - np.pi, step)
    v = np.abs(step) / (task.velocity * task.interval)
    a = np.abs(np.diff(step, axis=0)) / (task.acceleration * task.interval**2)
    return Verdict(
        tip=float(tip.max()),
        axis=float(lean.max()),
        range=max(float(beyond.max()), 0.0),
        velocity=float(v.max()),
        acceleration=float(a.max(initial=0.0)),
        cost=float(v.sum()),
    )


def turned(axis: Array, angle: Array) -> Array:
    """Return rotations (K, 3, 3) about a unit axis (3,) by angles (K,): Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.asarray(np.eye(3) + s * cross + (1 - c) * (cross @ cross))


def main() -> int:
    """Check the answers named; return 0 if all that have a motion keep every rule."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("answers", nargs="+", type=Path, metavar="ANSWER.json")
    parser.add_argument("--known", type=Path, default=KNOWN, help="folder of the best known")
    given, wrong = parser.parse_args(), 0
    for file in given.answers:
        try:
            answer = json.loads(file.read_text())
            task = instance(answer["instance"])
            file_known = given.known / f"{task.name}.json"
            known = json.loads(file_known.read_text()) if file_known.exists() else {}
            said = "no motion" if answer["q"] is None else _said(check(task, answer["q"]), known)
        except (OSError, KeyError, TypeError, ValueError) as error:
            said = f"not valid: {type(error).__name__}: {error}"
        wrong += said.startswith("not valid")
        print(f"{file.stem}: {said}")
    return 1 if wrong else 0


def _said(verdict: Verdict, known: dict[str, Any]) -> str:
    if verdict.faults:
        return "not valid: " + ", ".join(verdict.faults)
    said = f"valid, cost {verdict.cost:.6g}"
    if known.get("bound") is not None:
        said += f", bound {known['bound']:.6g}"
    if known.get("cost") is not None:
        said += f", {100 * (verdict.cost / known['cost'] - 1):+.2f} % against the best known"
    return said


if __name__ == "__main__":
    sys.exit(main())
