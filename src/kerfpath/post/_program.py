"""The neutral program: what the robot does, in order, before any language formats it."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, as_pose, floats, freeze, scalar
from kerfpath.air import AirMove, backed_off
from kerfpath.errors import InputError
from kerfpath.plans import Plan
from kerfpath.robots import Robot, posture_name

__all__ = [
    "LONGEST_NAME",
    "Comment",
    "JointMove",
    "LaserOff",
    "LaserOn",
    "LinearMove",
    "Program",
    "Section",
    "Step",
    "Wait",
    "build_program",
]

LONGEST_NAME = 32
"""Characters that a name keeps when it is made from a contour's name; ABB's bound."""
PLAN_AND_CONTOUR = 1e-5
"""Distance (m) and sine of an angle by which the planned joints may miss the contour."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointMove:
    """Move all joints at once to a joint vector; the tip's way there is not a straight line.

    Parameters
    ----------
    q : (6,) rad
        Joints of the target.
    speed : float
        Share of the full speed, from 0.01 to 1.
    zone : float m
        Radius in which the corner may be rounded; 0 = stop at the target.
    """

    q: Array
    speed: float
    zone: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", floats(self.q, "q", (6,)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearMove:
    """Move the tool tip in a straight line, the tool turning evenly, the posture kept.

    Parameters
    ----------
    T_part_tip : (4, 4)
        Tip pose in the part frame, m.
    q : (6,) rad
        Joints that the robot has on arrival; endless joints unrolled along the contour.
    speed : float m/s
        Speed of the tip.
    zone : float m
        Radius in which the corner may be rounded; 0 = stop at the target.
    """

    T_part_tip: Array
    q: Array
    speed: float
    zone: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_part_tip", as_pose(self.T_part_tip, "T_part_tip"))
        object.__setattr__(self, "q", floats(self.q, "q", (6,)))


@dataclass(frozen=True, slots=True, kw_only=True)
class LaserOn:
    """Set the laser output on the path, at the end of the linear move just before this step.

    Parameters
    ----------
    lead_time : float s
        How long before the tip arrives there; makes up for the delay of output and laser.
    """

    lead_time: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LaserOff:
    """Reset the laser output on the path, at the end of the linear move just before this step.

    Parameters
    ----------
    lead_time : float s
        How long before the tip arrives there.
    """

    lead_time: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Wait:
    """Stay where the last move stopped, as while the beam pierces.

    Parameters
    ----------
    time : float s
    """

    time: float


@dataclass(frozen=True, slots=True)
class Comment:
    """A remark for the person who reads the program."""

    text: str


Step = JointMove | LinearMove | LaserOn | LaserOff | Wait | Comment


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """The steps of one contour, under an identifier."""

    name: str
    steps: tuple[Step, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Program:
    """What one robot does with one tool on one part, contour by contour.

    Parameters
    ----------
    name : str
        Identifier of the program.
    robot : Robot
    T_flange_tip, T_base_part : (4, 4)
        Tool and placement of the part (the work object), m.
    tool_name, work_object, laser_output : str
        What the controller calls the tool, the work object and the output of the laser.
    sections : tuple of Section
        One for each contour, in order.
    air_checked : bool
        Whether the moves to and between the contours have been proved clear.
    """

    name: str
    robot: Robot
    T_flange_tip: Array
    T_base_part: Array
    tool_name: str
    work_object: str
    laser_output: str
    sections: tuple[Section, ...]
    air_checked: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_flange_tip", as_pose(self.T_flange_tip, "T_flange_tip"))
        object.__setattr__(self, "T_base_part", as_pose(self.T_base_part, "T_base_part"))

    @property
    def steps(self) -> tuple[Step, ...]:
        """All steps in order, over all sections."""
        return tuple(step for section in self.sections for step in section.steps)


def build_program(
    plans: Sequence[Plan],
    *,
    moves: Sequence[AirMove] = (),
    name: str | None = None,
    retract: float = 0.05,
    zone: float = 0.0003,
    laser_output: str = "doLaser",
    lead_time: float = 0.02,
    work_object: str = "wPart",
    tool_name: str = "tLaser",
    pierce_time: float = 0.0,
    approach_speed: float = 0.1,
    air_speed: float = 0.25,
) -> Program:
    """Return the program that cuts the planned contours one after the other.

    For each contour: a joint move to a pose backed off the start along the tool axis, a straight
    move to the start with a stop, laser on, straight moves through all nodes with a stop at the
    last, laser off, and a straight move back along the tool axis. Along micro joints the laser is
    off.

    Parameters
    ----------
    plans : sequence of Plan
        In the order of cutting; same robot, tool and placement.
    moves : sequence of AirMove
        Between the contours, as `kerfpath.sequence.plan_part` returns them, one less than plans or,
        from and to a home position, one more; default: joint moves straight to each start.
    name : str, optional
        Name of the program, made an identifier; default: "cut" and the first contour.
    retract : float m
        How far the tool backs off before and after a contour.
    zone : float m
        Radius in which the corners at the inner nodes may be rounded.
    laser_output, work_object, tool_name : str
        What the controller calls them.
    lead_time : float s
        How long before the tip arrives the laser is switched.
    pierce_time : float s
        How long to wait at the start, laser on, until the beam is through.
    approach_speed : float m/s
        Speed along the tool axis before and after a contour.
    air_speed : float
        Share of the full speed for the joint moves between contours.

    Raises
    ------
    InputError
        No plans, plans that do not belong together, joints that do not lead the tool along the
        contour, or no way to back off by `retract`.
    """
    if not plans:
        raise InputError("build_program: expected at least one plan, got none")
    first = plans[0]
    for axis in (plan.robot.external for plan in plans):
        if axis is not None:
            raise InputError(f"program: no language writes the {axis.kind} of a plan yet")
    for plan in plans[1:]:
        _require_same_cell(first, plan)
    retract = scalar(retract, "retract", unit="m", above=0.0)
    pierce_time = scalar(pierce_time, "pierce_time", unit="s", above=-1e-300)
    title = _identifier(f"cut {first.name}" if name is None else name)
    names = _identifiers(
        (plan.name for plan in plans), taken=(title, tool_name, work_object, laser_output)
    )
    *ways, home = _corners(plans, moves, retract)
    sections = []
    for plan, section_name, way in zip(plans, names, ways, strict=True):
        q = plan.q[0] + np.vstack([np.zeros(6), np.cumsum(plan.increments, axis=0)])
        T_part_tip = _tip_poses(plan, q)
        T_out = T_part_tip[-1].copy()
        T_out[:3, 3] -= retract * T_out[:3, 2]
        zones = np.append(np.full(len(q) - 2, zone), 0.0)
        cut = [
            LinearMove(T_part_tip=T, q=q_k, speed=float(speed_k), zone=float(zone_k))
            for T, q_k, speed_k, zone_k in zip(
                T_part_tip[1:], q[1:], np.diff(plan.contour.s) / np.diff(plan.time), zones,
                strict=True,
            )
        ]  # fmt: skip
        steps: tuple[Step, ...] = (
            Comment(
                f"{plan.name}: {len(q)} nodes, {plan.contour.length * 1e3:.1f} mm, "
                f"posture {posture_name(int(plan.posture[0]))}"
            ),
            *(JointMove(q=corner, speed=air_speed) for corner in way),
            LinearMove(T_part_tip=T_part_tip[0], q=q[0], speed=approach_speed),
            LaserOn(lead_time=lead_time),
            *([Wait(time=pierce_time)] if pierce_time > 0 else []),
            *_switched(cut, plan.contour.kinds, lead_time),
            LaserOff(lead_time=lead_time),
            LinearMove(T_part_tip=T_out, q=backed_off(plan, "end", retract), speed=approach_speed),
        )
        sections.append(Section(name=section_name, steps=steps))
    if home:
        back = tuple(JointMove(q=corner, speed=air_speed) for corner in home)
        sections[-1] = replace(sections[-1], steps=sections[-1].steps + back)
    return Program(
        name=title,
        robot=first.robot,
        T_flange_tip=first.T_flange_tip,
        T_base_part=first.T_base_part,
        tool_name=tool_name,
        work_object=work_object,
        laser_output=laser_output,
        sections=tuple(sections),
        air_checked=len(moves) > 0 and all(move.clear for move in moves),
    )


def _corners(plans: Sequence[Plan], moves: Sequence[AirMove], retract: float) -> list[list[Array]]:
    """Return the joint vectors on the way to each of P plans, and P + 1st those after the last."""
    if not moves:
        return [*([backed_off(plan, "start", retract)] for plan in plans), []]
    ways = [list(move.q[1:]) for move in moves]
    if len(moves) == len(plans) - 1:
        return [[backed_off(plans[0], "start", retract)], *ways, []]
    if len(moves) == len(plans) + 1:
        return [list(moves[0].q), *ways[1:]]
    raise InputError(
        f"build_program: {len(plans)} plans need {len(plans) - 1} moves between them, or "
        f"{len(plans) + 1} from and to a home position, got {len(moves)}"
    )


def _require_same_cell(first: Plan, plan: Plan) -> None:
    same = {
        "robot": _kinematics(first.robot) == _kinematics(plan.robot),
        "tool (T_flange_tip)": np.allclose(first.T_flange_tip, plan.T_flange_tip, 0, 1e-9),
        "placement (T_base_part)": np.allclose(first.T_base_part, plan.T_base_part, 0, 1e-9),
    }
    if differing := [what for what, is_same in same.items() if not is_same]:
        raise InputError(
            f"contours {first.name!r} and {plan.name!r} differ in {', '.join(differing)}; write "
            "one program for each"
        )


def _kinematics(robot: Robot) -> tuple[object, ...]:
    chain = robot.chain
    parts = [robot.sign, robot.offset, robot.T_base_foot, robot.T_end_flange]
    parts += [] if chain is None else [chain.origins, chain.axes, chain.end]
    numbers = np.concatenate([part.ravel() for part in parts])
    return robot.id, robot.kinematics, *robot.geometry.values(), *numbers.tolist()


def _tip_poses(plan: Plan, q: Array) -> Array:
    """Return tip poses (K, 4, 4) in the part frame: point of the contour, orientation of FK(q)."""
    T = _inverse(plan.T_base_part) @ plan.robot.forward(q) @ plan.T_flange_tip
    off = np.linalg.norm(T[:, :3, 3] - plan.contour.points, axis=1)
    axes = plan.axes @ plan.T_base_part[:3, :3]
    turned = np.linalg.norm(np.cross(T[:, :3, 2], axes), axis=1)
    turned[(T[:, :3, 2] * axes).sum(axis=1) < 0] = 1.0
    k = int(np.argmax(np.maximum(off, turned)))
    if max(off[k], turned[k]) > PLAN_AND_CONTOUR:
        raise InputError(
            f"contour {plan.name!r}, node {k}: the planned joints put the tool tip "
            f"{off[k] * 1e3:.4f} mm and {np.degrees(np.arcsin(turned[k])):.4f} deg off the "
            "contour; the plan belongs to another contour, tool or placement"
        )
    # A placement of few printed decimals is not quite a rotation; a quaternion can say only one.
    T[:, :3, :3] = Rotation.from_matrix(T[:, :3, :3]).as_matrix()
    T[:, :3, 3], T[:, 3] = plan.contour.points, (0.0, 0.0, 0.0, 1.0)
    return freeze(T)


def _switched(
    cut: Sequence[LinearMove], kinds: Sequence[str], lead_time: float
) -> Iterator[LinearMove | LaserOn | LaserOff]:
    """Yield the moves of a cut (K-1,), the laser switched where micro joints (K kinds) are."""
    for k, move in enumerate(cut, 1):
        yield move
        ends, begins = (kinds[i] == "micro joint" for i in (k - 1, min(k, len(cut) - 1)))
        if ends != begins:
            yield LaserOff(lead_time=lead_time) if begins else LaserOn(lead_time=lead_time)


def _inverse(T: Array) -> Array:
    inverse = np.eye(4)
    inverse[:3, :3] = T[:3, :3].T
    inverse[:3, 3] = -T[:3, :3].T @ T[:3, 3]
    return inverse


def _identifiers(texts: Iterable[str], taken: Iterable[str]) -> list[str]:
    """Return an identifier for each text, unique also where a language ignores capitals."""
    used = {name.lower() for name in taken}
    names = []
    for text in texts:
        name = plain = _identifier(text)
        number = 1
        while name.lower() in used:
            number += 1
            suffix = f"_{number}"
            name = plain[: LONGEST_NAME - len(suffix)] + suffix
        used.add(name.lower())
        names.append(name)
    return names


def _identifier(text: str) -> str:
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    name = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")
    if not name or name[0].isdigit():
        name = f"c_{name}".rstrip("_")
    return name[:LONGEST_NAME]
