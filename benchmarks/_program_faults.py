"""Faults of a neutral program by their effect; written out, they become edits in any language."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array
from kerfpath.post import JointMove, LinearMove, Program, Section, Step, Switch, Wait
from kerfpath.robots import Robot

__all__ = ["Fault", "faults"]

ON = Switch(signal="laser", on=True)
OFF = Switch(signal="laser", on=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fault:
    """A program that does not do what its job asks for.

    Parameters
    ----------
    kind : str
        What is wrong, and thus what happens to the part, the cell or people.
    program : Program
    """

    kind: str
    program: Program


def faults(program: Program, rng: np.random.Generator) -> Iterator[Fault]:
    """Yield every fault of a program of at least two contours, at places chosen by `rng`."""
    for number in range(len(program.sections)):
        section = program.sections[number]
        found = [
            *_section_faults(section.steps, rng),
            *_external_faults(program.robot, section.steps, rng),
        ]
        for kind, steps in found:
            yield Fault(kind=kind, program=_with(program, number, replace(section, steps=steps)))
    for kind, sections in _order_faults(program.sections):
        yield Fault(kind=kind, program=replace(program, sections=tuple(sections)))
    for what, name in (("T_flange_tip", "tool"), ("T_base_part", "part")):
        T = np.array(getattr(program, what))
        T[int(rng.integers(3)), 3] += float(rng.choice([-1, 1, 20])) * 1e-3
        frame: dict[str, Any] = {what: T}
        yield Fault(kind=f"frame of the {name} moved", program=replace(program, **frame))


def _with(program: Program, number: int, section: Section) -> Program:
    sections = list(program.sections)
    sections[number] = section
    return replace(program, sections=tuple(sections))


Steps = tuple[Step, ...]


def _section_faults(steps: Sequence[Step], rng: np.random.Generator) -> Iterator[tuple[str, Steps]]:
    """Yield faults of the steps of one contour, in the layout of `build_program`."""
    path = [k for k, step in enumerate(steps) if isinstance(step, LinearMove)]
    joint = [k for k, step in enumerate(steps) if isinstance(step, JointMove)]
    start, last, back = path[0], path[-2], path[-1]
    inner = [k for k in path[1:-2] if not getattr(steps[k], "switches", ())]
    middle = int(rng.choice(inner[1:-1]))
    pierce = next(k for k, step in enumerate(steps) if isinstance(step, Wait))

    def way(k: int) -> LinearMove:
        move = steps[k]
        assert isinstance(move, LinearMove)
        return move

    def changed(k: int, **fields: Any) -> Steps:
        step: Any = steps[k]
        return (*steps[:k], replace(step, **fields), *steps[k + 1 :])

    def inserted(k: int, *more: Step) -> Steps:
        return (*steps[:k], *more, *steps[k:])

    def without(k: int) -> Steps:
        return (*steps[:k], *steps[k + 1 :])

    def switched(k: int, keep: Callable[[Switch], bool]) -> Steps:
        return changed(k, switches=tuple(s for s in way(k).switches if keep(s)))

    at_start, at_end, away_from = way(start), way(last), steps[joint[-1]]
    assert isinstance(away_from, JointMove)
    lead = at_start.switches[-1].lead_time
    # The beam and the gas.
    yield "laser on with the retract", changed(back, switches=(replace(ON, lead_time=0.0),))
    early = (replace(ON, lead_time=lead),)
    yield "laser on ahead of the retract's end", changed(back, switches=early)
    yield "laser on on the way down", changed(start, switches=tuple(
        replace(s, lead_time=s.lead_time + 0.2) if s.signal == "laser" else s
        for s in at_start.switches))  # fmt: skip
    yield "laser never on", switched(start, lambda s: s.signal != "laser")
    yield "laser left on at the end", switched(last, lambda s: s.signal != "laser")
    yield "laser off where it is to cut", changed(middle, switches=(replace(OFF, lead_time=lead),))
    yield "gas never on", switched(start, lambda s: s.signal != "gas")
    yield "gas left on", switched(last, lambda s: s.signal != "gas")
    yield "gas off in the cut", changed(middle, switches=(Switch(signal="gas", on=False),))
    yield "gas later", changed(start, switches=tuple(
        replace(s, lead_time=s.lead_time / 2) if s.signal == "gas" else s
        for s in at_start.switches))  # fmt: skip
    yield "laser before gas off swapped", changed(last, switches=at_end.switches[::-1])
    for k in path[1:-2]:
        if way(k).switches:
            yield "micro joint left out or not ended", changed(k, switches=())
    # Stops where the beam is on.
    wait = Wait(time=float(rng.choice([0.1, 5.0])))
    yield "wait in the cut", (
        *steps[:middle], replace(way(middle), zone=0.0), wait, *steps[middle + 1 :])  # fmt: skip
    yield "stop in the cut", changed(middle, zone=0.0)
    yield "wait at the end of the cut", inserted(last + 1, wait)
    yield "wait in the air", inserted(start, wait)
    yield "wait after the retract", inserted(back + 1, wait)
    yield "pierce left out", without(pierce)
    yield "pierce longer", changed(pierce, time=2.0)
    yield "pierce shorter", changed(pierce, time=0.1)
    yield "pierce on the fly", changed(start, zone=0.001)
    passed_by = replace(at_start, zone=0.0003)
    yield "pierce point passed by", (*steps[:start], passed_by, *steps[pierce + 1 :])
    yield "end passed by", changed(last, zone=0.0003)
    # Speeds and zones.
    for k, what in ((joint[-1], "air"), (start, "approach"), (back, "retract"), (middle, "cut")):
        share = float(rng.choice([0.3, 0.5, 2.0, 3.0]))
        if what == "air":
            took = away_from.duration
            slow = {"speed": away_from.speed * share, "duration": took and took / share}
            yield f"speed of {what}", changed(k, **slow)
        else:
            slow = {"speed": way(k).speed * share, "duration": way(k).duration / share}
            yield f"speed of {what}", changed(k, **slow)
    yield "zone larger", changed(middle, zone=0.0003 * float(rng.choice([3, 30, 100])))
    yield "zone in the air", changed(joint[-1], zone=0.01)
    yield "zone after the retract", changed(back, zone=0.01)
    # Positions.
    yield "approach from afar", _backed(steps, joint[-1], start, 10)
    yield "start joint moved", changed(joint[-1], q=_nudged(away_from.q, rng, 2.0))
    for kind, times in (("retract into the part", -1), ("retract ten times as far", 10)):
        yield kind, changed(back, T_part_tip=_shifted(at_end.T_part_tip, -0.05 * times))
    aside = np.array(way(back).T_part_tip)
    aside[:3, 3] += 0.01 * aside[:3, 0]
    yield "retract aside", changed(back, T_part_tip=aside)
    yield "no retract", without(back)
    yield "no approach", without(start)
    yield "no joint move", without(joint[-1])
    if len(joint) > 1:
        yield "contour begun fast", changed(joint[0], speed=0.5)
        yield "contour begun without its slow move", without(joint[0])
        here = steps[joint[0]]
        assert isinstance(here, JointMove)
        yield "contour begun elsewhere", changed(joint[0], q=_nudged(here.q, rng, 5.0))
    yield "node left out", without(middle)
    yield "node twice", inserted(middle, steps[middle])
    yield "nodes swapped", (*steps[:middle], steps[middle + 1], steps[middle], *steps[middle + 2 :])
    off = np.array(way(middle).T_part_tip)
    off[int(rng.integers(3)), 3] += float(rng.choice([-0.5, 0.5])) * 1e-3
    yield "node moved", changed(middle, T_part_tip=off)
    tilted = np.array(way(middle).T_part_tip)
    tilted[:3, :3] = tilted[:3, :3] @ Rotation.from_euler("x", 5, degrees=True).as_matrix()
    yield "node tilted by 5 deg", changed(middle, T_part_tip=tilted)
    yield "joint move in the cut", inserted(middle, steps[joint[-1]])
    yield "joint move behind the cut", inserted(last + 1, steps[joint[-1]])
    yield "way between in a straight line", inserted(
        back + 1, replace(at_start, switches=(), speed=at_start.speed))  # fmt: skip
    away = replace(away_from, q=_nudged(away_from.q, rng, 20.0))
    yield "another joint move", inserted(joint[-1], away)


def _external_faults(
    robot: Robot, steps: Sequence[Step], rng: np.random.Generator
) -> Iterator[tuple[str, Steps]]:
    """Yield faults of the values of external axes, one axis at one target."""
    path = [k for k, step in enumerate(steps) if isinstance(step, LinearMove)]
    joint = [k for k, step in enumerate(steps) if isinstance(step, JointMove)]
    middle = int(rng.choice(path[3:-3]))
    assert robot.upper is not None
    for i, axis in enumerate(robot.externals, robot.family.joints):
        far, near = (0.05, 0.001) if axis.kind == "linear" else (0.2, 0.004)
        over = float(robot.upper[i]) + far
        for what, k, value in (
            ("jumps in the cut", middle, None),
            ("out of range in the cut", middle, over),
            ("elsewhere at the start", joint[-1], None),
            ("out of range at the start", joint[-1], over),
            ("moves in the retract", path[-1], None),
        ):
            step: Any = steps[k]
            q = np.array(step.q)
            by = near if "retract" in what else far
            q[i] = q[i] + by * float(rng.choice([-1, 1])) if value is None else value
            yield f"external axis {what}", (*steps[:k], replace(step, q=q), *steps[k + 1 :])


def _order_faults(sections: Sequence[Section]) -> Iterator[tuple[str, Sequence[Section]]]:
    first, second, *rest = sections
    yield "contours in another order", [second, first, *rest]
    yield "contour left out", [first, *rest]
    yield "contour twice", [*sections, replace(first, name=f"{first.name}_2")]


def _nudged(q: Array, rng: np.random.Generator, by_deg: float) -> Array:
    moved = np.array(q)
    moved[int(rng.integers(6))] += np.radians(by_deg) * float(rng.choice([-1, 1]))
    return moved


def _shifted(T: Array, along: float) -> Array:
    moved = np.array(T)
    moved[:3, 3] += along * moved[:3, 2]
    return moved


def _backed(steps: Sequence[Step], joint: int, start: int, times: float) -> Steps:
    """Return steps whose joint move ends `times` as far from the start, in joint space."""
    there, here = steps[joint], steps[start]
    assert isinstance(there, JointMove)
    assert isinstance(here, LinearMove)
    q = here.q + times * (there.q - here.q)
    return (*steps[:joint], replace(there, q=q), *steps[joint + 1 :])
