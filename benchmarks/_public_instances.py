"""Draw the instances of the public set: random cuts, drawings, too fast cuts, rails, tables.

The files are the set; this module generated them. Speeds are shares of the fastest that kerfpath
finds on coarse samples, so that most cuts are feasible and hard; name and seed decide the rest.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks._random_contours import contour as random_contour
from benchmarks._random_contours import head, posed
from benchmarks._shipped import PARTS
from benchmarks.public.check import INSTANCES
from kerfpath import Contour, NoFeasiblePath, PlanOptions, Robot, cad, fastest_speed, plan, robot
from kerfpath.arrays import Array
from kerfpath.planner import node_interval
from kerfpath.robots import chain_of

__all__ = ["FAMILIES", "draw"]

ROBOTS = {
    "abb_irb2600_12_165": "cybertech_8_to_20kg",
    "abb_irb4600_60_205": "iontec_20_to_70kg",
    "kuka_kr16_r1610_2": None,
    "staubli_tx2_90xl": "payload_up_to_20kg_agilus",
    "ur_ur10e": "cybertech_8_to_20kg",
    "yaskawa_gp25": "cybertech_8_to_20kg",
}
"""Robots by id, with the ratio that replaces accelerations that their maker does not publish."""
COARSE = {"gamma_step": np.radians(5.0)}
"""Samples on which the speeds are based."""
SHARES = (0.6, 1.0)
"""Range of the speed, as a share of the fastest on those samples."""
TOO_FAST = 1.5
"""Speed of the cuts that are too fast, as a multiple of the fastest off the grid."""
LOOPS = {
    "opening": ("b_pillar.step", "skin/hole6"),
    "slot": ("b_pillar.step", "skin/hole11"),
    "flange": ("bracket.step", "skin1/outer"),
    "notch": ("bracket.step", "skin1/hole2"),
    "window": ("tube.step", "face1/hole1"),
    "ellipse": ("blank.dxf", "CUT/hole4"),
    "trim": ("blank.dxf", "CUT/outer"),
}
"""Loops of the shipped drawings."""
FAMILIES = {"random": 18, "part": len(LOOPS), "too-fast": 4, "out-of-reach": 1}
"""Number of instances of each robot, by family."""
EXTERNAL = {"rail": 12, "table": 12, "rail-and-table": 6}
"""Number of instances with external axes, of one robot."""
CARRIED = "abb_irb4600_60_205"

_Drawn = tuple[Robot, Contour, float]


def draw(only: str = "") -> Iterator[str]:
    """Write every instance whose name begins with `only`; yield their names."""
    for family, count in FAMILIES.items():
        for model in ROBOTS:
            for i in range(count):
                what = list(LOOPS)[i] if family == "part" else f"{i:02}"
                name = f"{family}-{model}-{what}"
                if name.startswith(only):
                    yield _written(name, family, _arm(model, endless=i % 2 == 0), _DRAW[family])
    for family, count in EXTERNAL.items():
        for i in range(count):
            if (name := f"{family}-{i:02}").startswith(only):
                yield _written(name, family, _arm(CARRIED, endless=True), _external)


def _arm(model: str, *, endless: bool) -> Robot:
    """Return a robot, joints 4 and 6 endless or in its maker's ranges; a UR within one turn."""
    made = robot(model, acceleration_ratio=ROBOTS[model])
    if model.startswith("ur_"):
        turn = np.full(6, np.pi)
        return made.with_limits(lower=-turn, upper=turn, endless=np.zeros(6, bool))
    return made.with_limits(endless=[0, 0, 0, endless, 0, endless])


def _written(name: str, family: str, arm: Robot, drawn: Callable[..., Any]) -> str:
    rng = np.random.default_rng([2026, *name.encode()])
    machine, cut, speed = drawn(rng, arm, name)
    (INSTANCES / f"{name}.json").write_text(_text(name, family, machine, cut, speed))
    return name


def _text(name: str, family: str, arm: Robot, cut: Contour, speed: float) -> str:
    chain, limits = chain_of(arm), arm.joint_limits()
    velocity, acceleration = arm.speed_limits()
    joints: list[dict[str, Any]] = [
        {
            "lower": float(limits.lower[i]),
            "upper": float(limits.upper[i]),
            "endless": bool(arm.endless[i]),
            "velocity": float(velocity[i]),
            "acceleration": float(acceleration[i]),
        }
        for i in range(len(velocity))
    ]
    m = len(chain.axes)
    for joint, origin, axis in zip(joints[:m], chain.origins, chain.axes, strict=True):
        joint |= {"origin": origin.tolist(), "axis": axis.tolist()}
    for joint, axis in zip(joints[m:], arm.externals, strict=True):
        joint |= {"name": axis.name, "kind": axis.kind, "carries": axis.carries}
        joint |= {"axis": axis.axis.tolist(), "point": axis.point.tolist()}
    data: dict[str, Any] = {
        "format": 1,
        "license": "CC0-1.0",
        "name": name,
        "family": family,
        "model": arm.id,
        "interval": node_interval(cut, speed),
        "closed": cut.closed,
        "arm": joints[:m],
        "closed_form": {
            "family": arm.kinematics,
            "lengths": {key: float(value) for key, value in arm.geometry.items()},
            "offset": arm.offset.tolist(),
            "sign": arm.sign.tolist(),
        },
        "flange": chain.end.tolist(),
        "external": joints[m:],
        "tool": head().tolist(),
        "points": np.round(cut.points, 9).tolist(),
        "axes": np.round(cut.axes, 9).tolist(),
    }
    # One line per key, because version control compares lines.
    rows = (f"{json.dumps(key)}: {json.dumps(value)}" for key, value in data.items())
    return "{\n" + ",\n".join(rows) + "\n}\n"


def _task(arm: Robot) -> dict[str, Any]:
    return {"robot": arm, "tool": head(), "placement": np.eye(4)}


def _reached(drawn: Callable[[], Contour], arm: Robot, **asked: Any) -> tuple[Contour, float]:
    """Return the first contour drawn that the robot can cut, and its fastest speed, m/s."""
    while True:
        cut = drawn()
        try:
            return cut, fastest_speed(cut, **_task(arm), **asked).speed
        except NoFeasiblePath:
            continue


def _random(rng: np.random.Generator, arm: Robot, _: str) -> _Drawn:
    cut, fastest = _reached(lambda: _in_front(rng, arm), arm, **COARSE)
    return arm, cut, fastest * rng.uniform(*SHARES)


def _in_front(rng: np.random.Generator, arm: Robot) -> Contour:
    assert arm.reach is not None
    return random_contour(rng, arm.reach)


def _of_part(rng: np.random.Generator, arm: Robot, name: str) -> _Drawn:
    shape, count = _loop(name.rpartition("-")[2]), int(rng.integers(60, 101))
    middle = shape.points.mean(axis=0)
    # Its axes point straight down on average; the part is then posed like a random contour.
    down = -shape.axes.mean(axis=0)
    level = _levelled(down / np.linalg.norm(down))

    def placed() -> Contour:
        assert arm.reach is not None
        T = posed(rng, arm.reach)
        turn = T[:3, :3] @ level
        points = (shape.points - middle) @ turn.T + T[:3, 3]
        return Contour(points, shape.axes @ turn.T, closed=True).resample(count=count)

    cut, fastest = _reached(placed, arm, **COARSE)
    return arm, cut, fastest * rng.uniform(*SHARES)


@cache
def _loop(what: str) -> Contour:
    file, pick = LOOPS[what]
    return cad.read(_PILLAR if file == _PILLAR.name else PARTS / file).contour(pick)


def _levelled(up: Array) -> Array:
    """Return the shortest rotation (3, 3) that takes a unit vector to z."""
    turn, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [up])
    return np.asarray(turn.as_matrix())


def _too_fast(rng: np.random.Generator, arm: Robot, _: str) -> _Drawn:
    cut, _speed = _reached(lambda: _in_front(rng, arm), arm, **COARSE)
    fastest = fastest_speed(cut, **_task(arm), gamma_step=np.radians(1), refine=True)
    return arm, cut, fastest.speed * TOO_FAST


def _out_of_reach(rng: np.random.Generator, arm: Robot, _: str) -> _Drawn:
    """Return a cut that was moved away from the robot until part of it is out of reach."""
    cut, fastest = _reached(lambda: _in_front(rng, arm), arm, **COARSE)
    assert arm.reach is not None
    away = cut.points.mean(axis=0) * [1, 1, 0]
    away *= 0.02 * arm.reach / np.linalg.norm(away)
    while True:
        cut = Contour(cut.points + away, cut.axes, closed=cut.closed)
        try:
            plan(cut, **_task(arm), speed=fastest / 2, options=PlanOptions(certify=None))
        except NoFeasiblePath as refusal:
            if refusal.closed is not None and refusal.closed.limit == "pose":
                return arm, cut, fastest / 2


def _external(rng: np.random.Generator, arm: Robot, name: str) -> _Drawn:
    """Return a robot with rail, table or both; a wavy line or a ring; and a speed."""
    each, point = arm, np.array([1.3, 0.0, rng.uniform(0.4, 0.8)])
    if "rail" in name:
        each = each.on_rail([0, 1, 0], lower=-1.2, upper=1.2, velocity=1.5, acceleration=3.0)
    if "table" in name:
        each = each.with_positioner(
            [0, 1, 0], point, name="chuck", lower=-np.pi, upper=np.pi, endless=True,
            velocity=3.0, acceleration=6.0,
        )  # fmt: skip

    def drawn() -> Contour:
        shape = _ring(rng) if "table" in name else _wavy(rng)
        cut = shape.resample(count=int(rng.integers(60, 81)))
        return Contour(cut.points + point, cut.axes, closed=cut.closed)

    cut, fastest = _reached(drawn, each, gamma_step=np.radians(10))
    return each, cut, fastest * rng.uniform(*SHARES)


def _ring(rng: np.random.Generator) -> Contour:
    t, radius = np.linspace(0, 2 * np.pi, 2001), rng.uniform(0.05, 0.2)
    along = radius * rng.uniform(0, 0.6) * np.sin(rng.integers(1, 4) * t)
    axes = np.c_[-np.cos(t), 0 * t, -np.sin(t)]
    return Contour(np.c_[radius * np.cos(t), along, radius * np.sin(t)], axes, closed=True)


def _wavy(rng: np.random.Generator) -> Contour:
    y, wave = np.linspace(-1, 1, 2001) * rng.uniform(0.6, 1.0), rng.uniform(0.02, 0.15, 2)
    lean = rng.uniform(0.1, 0.5) * np.sin(rng.uniform(3, 9) * y + rng.uniform(0, 6))
    points = np.c_[
        wave[0] * np.sin(rng.uniform(4, 12) * y), y, wave[1] * np.sin(rng.uniform(2, 6) * y)
    ]
    return Contour(points, np.c_[lean, 0 * y, -np.ones_like(y)])


_PILLAR = Path(str(cad.__file__)).parents[1] / "demo" / "b_pillar.step"
_DRAW = {
    "random": _random,
    "part": _of_part,
    "too-fast": _too_fast,
    "out-of-reach": _out_of_reach,
}
