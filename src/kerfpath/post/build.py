"""Build the neutral program from plans, with external axes, and its dry run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, floats, freeze, scalar, short_repr
from kerfpath.cell import UNPROVED
from kerfpath.errors import InputError
from kerfpath.names import identifier, identifiers
from kerfpath.plans import Plan, TransferMove
from kerfpath.post.arcs import euler, from_euler, with_arcs, zones_at
from kerfpath.post.checks import LOWEST_SHARE
from kerfpath.post.options import ProgramKeywords, ProgramOptions
from kerfpath.post.program import (
    Await,
    Comment,
    JointMove,
    LinearMove,
    Program,
    Request,
    Section,
    SetPower,
    Signal,
    Step,
    Switch,
    Wait,
)
from kerfpath.post.thinning import Thinning
from kerfpath.robots import ExternalAxis, Robot, carried, posture_name
from kerfpath.transfer import End, back_off, least_time, speed_share

# -----------------------------------------------------------------------------
# External axes in programs: their values in the controller's units, and their set-up.
#
# The targets of a program are poses of the tip in the part, wherever external axes carry robot
# and part. Some controllers couple the work object to the axes that carry the part, and have the
# same poses (RAPID, KRL); others have poses of the tip in the fixed frame (FANUC), see
# `part_motion`. In both cases the controller itself takes account of axes that carry the robot.

SAME_DIRECTION = 0.1
"""Sine below which x of the base does not define how a frame about an axis is turned."""


def controller_unit(axis: ExternalAxis) -> str:
    """Return the unit of the values of an axis in programs: mm or deg."""
    return "mm" if axis.kind == "linear" else "deg"


def arm_joints(robot: Robot, q: ArrayLike) -> Array:
    """Return the joints (K, m) rad of the arm alone from joint vectors q (K, n)."""
    return floats(q, "q", (None, robot.joints))[:, : robot.family.joints]


def to_controller_units(robot: Robot, q: ArrayLike) -> Array:
    """Return the values (K, E) of the external axes, mm and deg, from joint vectors q (K, n)."""
    values = floats(q, "q", (None, robot.joints))[:, robot.family.joints :]
    return np.asarray(values * _scales(robot))


def from_controller_units(robot: Robot, values: ArrayLike) -> Array:
    """Return values (..., E) of the external axes in m and rad, given in mm and deg."""
    return freeze(np.asarray(values, dtype=np.float64) / _scales(robot))


def _scales(robot: Robot) -> Array:
    return np.array([1e3 if a.kind == "linear" else np.degrees(1.0) for a in robot.externals])


def axes_that_carry(robot: Robot, what: str) -> list[int]:
    """Return the numbers, from 0, of the external axes that carry "robot" or "part"."""
    return [i for i, axis in enumerate(robot.externals) if axis.carries == what]


def carrier_frame(robot: Robot, values: Sequence[float] | None = None) -> Array:
    """Return the frame that moves with the part, (4, 4) m in the robot base, all axes at zero.

    It is the identity if no axis carries the part.

    Parameters
    ----------
    robot : Robot
    values : six numbers, optional
        The frame at the controller: mm, and deg about fixed x, y, z. Default: a frame at the point
        of the last axis that carries the part. For a linear axis it is parallel to the base; for a
        rotary one, z is along the axis and x as close as possible to x of the base (to its y if
        the axis runs along x).
    """
    if values is not None:
        return freeze(from_euler(values, "xyz")[0])
    T = np.eye(4)
    for i in axes_that_carry(robot, "part")[-1:]:
        axis = robot.externals[i]
        T[:3, 3] = axis.point
        if axis.kind == "rotary":
            across = np.eye(3)[:2] - axis.axis[:2, None] * axis.axis
            x = across[int(np.linalg.norm(across[0]) < SAME_DIRECTION)]
            x = x / np.linalg.norm(x)
            T[:3, :3] = np.c_[x, np.cross(axis.axis, x), axis.axis]
    return freeze(T)


def part_motion(robot: Robot, T_base_part: Array, external: Array) -> Array:
    """Return the poses (K, 4, 4) m of the part in the part frame with all axes at zero.

    `external` has the values (K, E) m and rad of the external axes.
    """
    moved = carried(robot.externals, external, "part")
    return np.asarray(np.linalg.inv(T_base_part) @ moved @ T_base_part)


def words_of(values: Iterable[float], decimals: int) -> str:
    """Return numbers as text for a remark."""
    return " ".join(f"{round(float(x), decimals) + 0.0:.10g}" for x in values)


def calibration_remarks(robot: Robot, what: str, values: Sequence[float] | None) -> Iterator[str]:
    """Yield remarks on the required frame of the unit that carries the part, named `what`."""
    place = words_of(euler(carrier_frame(robot, values)[None], "xyz")[0], 4)
    yield f"At 0 the frame of {what} stands in the base at {place}"
    yield "(mm, deg about fixed x, y, z): calibrate it so, or say positioner_frame."


def axis_numbers(given: Sequence[int] | None, count: int) -> Sequence[int]:
    """Return the controller's numbers of `count` external axes; default: from 1 on."""
    return (given or range(1, count + 1))[:count]


def setup_remarks(robot: Robot, *, si: bool = False) -> Iterator[str]:
    """Yield remarks on the external axes that must be set up at the controller.

    The units are those of the program: mm and deg, or m and rad with `si`.
    """
    for axis in robot.externals:
        unit = axis.unit if si else controller_unit(axis)
        way = "along" if axis.kind == "linear" else "about"
        yield f"External axis {axis.name} ({unit}): carries the {axis.carries}"
        yield f"{way} {words_of(axis.axis, 6)} of the base"
        if axis.kind == "rotary":
            yield f"through {words_of(axis.point * 1e3, 4)} mm"
    if robot.externals:
        yield "Base: where the robot stands with all external axes at 0."


# -----------------------------------------------------------------------------
# Axes of an arm as controllers count them, and the side of the arm on which the wrist lies.


def offset_near(robot: Robot, makers_deg: ArrayLike) -> Array:
    """Return the joint offsets (6,) rad of a robot, each within half a turn of its maker's (deg).

    The geometry of an arm is the same whether joint 6 counts from -180 or from 180 deg, but the
    axes and turns of its controller are not.
    """
    # Slightly less than half a turn, so that halves always round the same way.
    makers = np.radians(np.asarray(makers_deg, dtype=float))
    off = robot.offset - makers
    return np.asarray(makers + off - 2 * np.pi * np.round(off / (2 * np.pi) - 1e-9))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AxisCount:
    """Axes of an ortho-parallel arm as a controller counts them: matrix @ angles + shift.

    The angles of the model are 0 with the arm upright.

    Parameters
    ----------
    counted_from : (6,) deg
        Joint offsets of the maker's own descriptions.
    matrix : (6, 6)
    shift : (6,) rad
    """

    counted_from: tuple[float, ...] = (0.0,) * 6
    matrix: Array = field(default_factory=lambda: np.eye(6))
    shift: Array = field(default_factory=lambda: np.zeros(6))

    __repr__ = short_repr

    def from_joints(self, robot: Robot, q: ArrayLike) -> Array:
        """Return the controller's axes (K, 6) rad for joint vectors q (K, n) rad."""
        angles = robot.sign * arm_joints(robot, q)
        return freeze(np.asarray(angles @ self.matrix.T + self._shift(robot), dtype=np.float64))

    def to_joints(self, robot: Robot, axes: ArrayLike) -> Array:
        """Return the joints (K, 6) rad of the arm for the controller's axes (K, 6) rad."""
        rows = floats(axes, "axes", (None, 6)) - self._shift(robot)
        angles = rows @ np.linalg.inv(self.matrix).T
        return freeze(np.asarray(robot.sign * angles, dtype=np.float64))

    def bounds(
        self, robot: Robot, widest: ArrayLike, *, endless: bool = False
    ) -> tuple[Array, Array]:
        """Return the least and greatest joints (6,) rad at which no axis turns beyond a bound.

        Endless joints have none, or with `endless` only these have. Of the axes that are bounded,
        each is that of one joint.

        Parameters
        ----------
        widest : (6,) rad
            Largest angle of each axis either way; inf for none.
        """
        bound = np.asarray(widest, dtype=np.float64)
        free = np.isinf(bound) | (robot.endless[:6] != endless)
        ends = np.where(free, 0.0, np.stack([-bound, bound]))
        joints = self.to_joints(robot, ends)
        lower, upper = joints.min(axis=0), joints.max(axis=0)
        return np.where(free, -np.inf, lower), np.where(free, np.inf, upper)

    def _shift(self, robot: Robot) -> Array:
        """Return the axes (6,) rad at which all joints of the robot are 0."""
        return np.asarray(self.shift - self.matrix @ offset_near(robot, self.counted_from))


def wrist_in_plane(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Return how far the wrist centre is ahead of axis 1 and of the lower arm, (K,) m each.

    The joint vectors q are (K, n) rad. In the plane of the arm, with x ahead and z up, the lower
    arm points along u = (sin q2, cos q2) and the wrist centre lies at
    w = c3 (sin q23, cos q23) + a2 (cos q23, -sin q23) from axis 3. It is behind the lower arm, and
    the second value is negative, where w turns from u towards the back: u_x w_z > u_z w_x, that is
    c3 sin q3 + a2 cos q3 < 0.
    """
    arm = robot.arm.model()
    _, q2, q3, *_ = (arm.sign * arm_joints(robot, q) - arm.offset).T
    ahead = arm.a1 + arm.c2 * np.sin(q2) + arm.c3 * np.sin(q2 + q3) + arm.a2 * np.cos(q2 + q3)
    bend = arm.c3 * np.sin(q3) + arm.a2 * np.cos(q3)
    return np.asarray(ahead), np.asarray(bend)


# -----------------------------------------------------------------------------
# A dry run before the first cut: the same motions, slower, with nothing switched.


def dry_run(program: Program, share: float) -> Program:
    """Return the program at a lower speed, without switches, waits and handshakes.

    It stops where the program stops and passes the same targets in the same posture. Its name and
    those of its sections begin with "dry_", so that neither program ever calls a routine of the
    other. Each section begins with a comment.

    Parameters
    ----------
    program : Program
    share : float
        Speed of every move as a share of that in the program, above 0 and at most 1. Joint moves
        keep at least 1 % of the full speed, because languages cannot express less.

    Raises
    ------
    InputError
        `share` is not above 0 and at most 1.
    """
    share = scalar(share, "dry run", above=0.0)
    if share > 1:
        raise InputError(f"dry run: expected a share of the speed of at most 1, got {share:g}")
    said = Comment(f"DRY RUN at {share * 100:g} % of the speed: laser and gas are never switched")
    title, *names = identifiers(
        [f"dry_{program.name}", *(f"dry_{section.name}" for section in program.sections)], ()
    )
    sections = tuple(
        Section(name=name, steps=(said, *_slow_steps(section, share)))
        for name, section in zip(names, program.sections, strict=True)
    )
    return replace(program, name=title, sections=sections)


def _slow_steps(section: Section, share: float) -> list[Step]:
    left_out = Wait | SetPower | Request | Await
    return [_slow(step, share) for step in section.steps if not isinstance(step, left_out)]


def _slow(step: Step, share: float) -> Step:
    if isinstance(step, LinearMove):
        return replace(step, speed=share * step.speed, duration=step.duration / share, switches=())
    if isinstance(step, JointMove):
        slow = max(share * step.speed, LOWEST_SHARE)
        took = None if step.duration is None else step.duration * step.speed / slow
        return replace(step, speed=slow, duration=took)
    return step


# -----------------------------------------------------------------------------
# Build the neutral program from plans.

CAPSULES = "The links were drawn as capsules: clear of the real ones is not proved."
"""Comment at the head of a program whose plans were made with capsules for links."""
PLANNED, UNPLANNED = 1.0, 0.25
"""Share of the full speed of joint moves, with and without planned transfer moves."""
MEETS = 1e-5
"""Largest distance (m) of planned moves from the point to which the tool backs off."""
PLAN_AND_CONTOUR = 1e-5
"""Largest distance (m) and sine of an angle by which the planned joints may miss the contour."""


def build_program(
    plans: Sequence[Plan],
    options: ProgramOptions | None = None,
    *,
    moves: Sequence[TransferMove] = (),
    **keywords: Unpack[ProgramKeywords],
) -> Program:
    """Return the program that cuts the planned contours one after the other.

    The steps of each contour are: a slow joint move to where the contour before it ended, joint
    moves to a pose backed off from the start along the tool axis, a straight move to the start with
    a stop, laser on, straight moves through all nodes with a stop at the last, laser off, and a
    straight move back along the tool axis. The slow move goes nowhere unless the program is begun
    at this contour, with the robot elsewhere. The laser is off along micro joints. The gas, if it
    is switched, flows from before the start to the end.

    Parameters
    ----------
    plans : sequence of Plan
        Plans in the order of cutting, for the same robot, tool and placement.
    options : ProgramOptions, optional
        Name and process values; default: `ProgramOptions()`.
    moves : sequence of TransferMove
        Transfer moves, as `kerfpath.sequence.plan_part` returns them: one less than plans, or one
        more from and to a home position. Default: the approach and the retreat of a single plan,
        else joint moves directly to each start.
    keywords : options of `ProgramOptions`
        They replace those of `options`.

    Raises
    ------
    InputError
        There are no plans, plans or moves do not belong together, one of several plans has moves of
        its own, the joints do not lead the tool
        along the contour, or the tool cannot back off by `retract`. Also as `ProgramOptions`.
    """
    if not plans:
        raise InputError("build_program: expected at least one plan, got none")
    first, options = plans[0], replace(options or ProgramOptions(), **keywords)
    if options.arc_tolerance is not None and first.robot.free.size:
        raise InputError(
            f"program: controllers move {first.robot.free_names} along an arc in different ways; "
            "leave arcs_mm out"
        )
    for plan in plans[1:]:
        _require_same_cell(first, plan)
    title = identifier(options.name or f"cut {first.name}")
    names = identifiers((plan.name for plan in plans), taken=(title,))
    *ways, home = _corners(plans, moves, options.retract)
    known = [*moves, *(m for m in (first.approach, first.retreat) if m is not None and not moves)]
    share = options.air_speed or (PLANNED if known else UNPLANNED)
    air = _Air(first, share, min(share, options.start_speed))
    sections = []
    for plan, section_name, way in zip(plans, names, ways, strict=True):
        steps = tuple(_steps(plan, air.start(way), options.of(plan.name)))
        sections.append(Section(name=section_name, steps=steps, contour=plan.name))
        air.here = back_off(plan, "end", options.retract)
    if home:
        back = tuple(air.moves(home))
        sections[-1] = replace(sections[-1], steps=sections[-1].steps + back)
    capsules = [CAPSULES] if any(UNPROVED in plan.proof.statement for plan in plans) else []
    program = Program(
        name=title,
        robot=first.robot,
        T_flange_tip=first.T_flange_tip,
        T_base_part=first.T_base_part,
        sections=tuple(sections),
        air_checked=len(known) > 0 and all(move.clear for move in known),
        caveats=(*capsules, *options.remarks),
    )
    if options.arc_tolerance is not None:
        eta_v = min(plan.settings.eta_v for plan in plans)
        eta_a = min(plan.settings.eta_a for plan in plans)
        program = with_arcs(program, options.arc_tolerance, eta_v=eta_v, eta_a=eta_a)
    if options.language == "none":
        return program
    thinning = Thinning(
        controller=options.rules.controller,
        tolerance=options.thin_tolerance,
        zone=options.zone,
        zone_error=options.zone_error,
    )
    return thinning.of(program)


def _steps(plan: Plan, way: Iterable[JointMove], options: ProgramOptions) -> Iterator[Step]:
    """Yield the steps of a contour; `way` leads to the pose where the tool is backed off."""
    _require_on_contour(plan)
    T = plan.T_part_tip
    q = plan.unwrapped
    laser, wait = laser_start(options)
    starts: tuple[Switch, ...] = (laser,)
    if options.gas_lead is not None:
        starts = (Switch(signal=options.gas, on=True, lead_time=options.gas_lead), *starts)
    yield Comment(
        f"{plan.name}: {len(q)} nodes, {plan.contour.length * 1e3:.1f} mm, "
        f"posture {posture_name(int(plan.posture[0]))}"
    )
    yield from way
    yield from options.handshakes
    yield _straight(options, T[0], q[0], starts)
    yield from (Wait(time=time) for time in waits_at_start(options, wait))
    yield from _cut(plan, T, q, options)
    T_out = T[-1].copy()
    T_out[:3, 3] -= options.retract * T_out[:3, 2]
    yield _straight(options, T_out, back_off(plan, "end", options.retract))
    for step in reversed(options.handshakes):
        if isinstance(step, Request) and step.on:
            yield replace(step, on=False)


def laser_start(options: ProgramOptions) -> tuple[Switch, float]:
    """Return the switch of the laser at a start, and how long the robot waits there, s.

    Where partners were asked, the laser needs all that is on. Controllers look at outputs only
    where the robot stands: it is switched there, and the robot waits for the lead time, too.
    """
    on = [step.partner for step in options.handshakes if isinstance(step, Request) and step.on]
    if not on:
        return _laser(options, on=True), options.pierce_time
    gas: tuple[Signal, ...] = () if options.gas_lead is None else (options.gas,)
    laser = Switch(signal="laser", on=True, needs=(*gas, *on))
    return laser, options.pierce_time + options.lead_time


def waits_at_start(options: ProgramOptions, wait: float) -> list[float]:
    """Return the waits (s) at a start that last `wait` (s) together: one for each pierce stage.

    What is longer than the pierce comes before its first stage.
    """
    waits = [time for _, time in options.pierce] or [0.0]
    waits[0] += wait - sum(waits)
    return [time for time in waits if time > 0]


def _laser(options: ProgramOptions, *, on: bool) -> Switch:
    return Switch(signal="laser", on=on, lead_time=options.lead_time)


def _straight(
    options: ProgramOptions, T: Array, q: Array, switches: tuple[Switch, ...] = ()
) -> LinearMove:
    """Return a move along the tool axis that ends with a stop."""
    speed, duration = options.approach_speed, options.retract / options.approach_speed
    return LinearMove(T_part_tip=T, q=q, speed=speed, duration=duration, switches=switches)


def _cut(plan: Plan, T: Array, q: Array, options: ProgramOptions) -> Iterator[LinearMove]:
    """Yield the moves from the second node of a contour on, laser off along micro joints."""
    took = np.diff(plan.time)
    speed = np.diff(plan.contour.s) / took
    joint = [kind == "micro joint" for kind in plan.contour.kinds]
    zones = zones_at(plan.contour.points, options.zone, options.zone_error)
    for k, radius in enumerate(zones, 1):
        switches: tuple[Switch, ...] = ()
        if k == len(took):
            # At the end of a micro joint the laser is off already.
            switches = () if joint[k - 1] else (_laser(options, on=False),)
            if options.gas_lead is not None:
                switches = (*switches, Switch(signal=options.gas, on=False))
        elif joint[k] != joint[k - 1]:
            switches = (_laser(options, on=joint[k - 1]),)
        yield LinearMove(
            T_part_tip=T[k],
            q=q[k],
            speed=float(speed[k - 1]),
            duration=float(took[k - 1]),
            zone=radius,
            switches=switches,
        )


class _Air:
    """Joint moves that take the planned times.

    A controller runs all joints from stop to stop together: the slowest joint runs at the given
    share of its full speed and accelerates as fast as it may. The share is chosen so that the move
    takes the planned time.
    """

    def __init__(self, plan: Plan, share: float, start_share: float) -> None:
        self._plan, self._share, self._start_share = plan, share, start_share
        self.here: Array | None = None
        """Joints from which the next move starts; None before the first."""

    def start(self, corners: Sequence[Array]) -> Iterator[JointMove]:
        """Yield the moves to a contour. The first is slow: a program may be begun there."""
        first, *others = corners if self.here is None else [self.here, *corners]
        self.here = first
        yield JointMove(q=first, speed=self._start_share)
        yield from self.moves(others)

    def moves(self, corners: Sequence[Array]) -> Iterator[JointMove]:
        """Yield a joint move to each corner."""
        robot, eta_v, eta_a = self._plan.robot, self._plan.settings.eta_v, self._plan.settings.eta_a
        for q in corners:
            assert self.here is not None
            way, self.here = (q - self.here)[None], q
            if not way.any() or robot.velocity is None or robot.acceleration is None:
                yield JointMove(q=q, speed=self._share)
                continue
            limits = robot.speed_limits()
            took = least_time(way, eta_v * limits[0], eta_a * limits[1]) / self._share
            speed = np.clip(speed_share(way, *limits, took), LOWEST_SHARE, 1.0)
            yield JointMove(q=q, speed=float(speed[0]), duration=float(took[0]))


def _corners(
    plans: Sequence[Plan], moves: Sequence[TransferMove], retract: float
) -> list[list[Array]]:
    """Return the joint vectors on the way to each of P plans, then those after the last."""
    if not moves:
        return _own_corners(plans, retract)
    ways = [list(move.q[1:]) for move in moves]
    if len(moves) == len(plans) - 1:
        _require_meeting(plans, moves, retract)
        return [[back_off(plans[0], "start", retract)], *ways, []]
    if len(moves) == len(plans) + 1:
        _require_meeting(plans, moves, retract)
        return [list(moves[0].q), *ways[1:]]
    raise InputError(
        f"build_program: expected {len(plans) - 1} moves between {len(plans)} plans, or "
        f"{len(plans) + 1} from and to a home position, got {len(moves)}"
    )


def _own_corners(plans: Sequence[Plan], retract: float) -> list[list[Array]]:
    """Return the corners of plans without moves between them, as `_corners`."""
    starts = [[back_off(plan, "start", retract)] for plan in plans]
    own = [plan for plan in plans if plan.approach is not None or plan.retreat is not None]
    if not own:
        return [*starts, []]
    if len(plans) > 1:
        raise InputError(
            f"build_program: contour {own[0].name!r} has an approach or a retreat of its own, but "
            f"there are {len(plans)} plans; give the moves between them, or write a program for "
            "each"
        )
    plan, back = plans[0], list[Array]()
    meetings: list[tuple[Array, Plan, End]] = []
    if plan.approach is not None:
        starts = [list(plan.approach.q)]
        meetings.append((plan.approach.q[-1], plan, "start"))
    if plan.retreat is not None:
        back = list(plan.retreat.q[1:])
        meetings.append((plan.retreat.q[0], plan, "end"))
    _require_met(meetings, retract)
    return [*starts, back]


def _require_meeting(plans: Sequence[Plan], moves: Sequence[TransferMove], retract: float) -> None:
    """Raise InputError unless moves begin and end where the tool is backed off."""
    between = len(moves) < len(plans)
    into, starts = (moves, plans[1:]) if between else (moves[:-1], plans)
    out, ends = (moves, plans[:-1]) if between else (moves[1:], plans)
    meetings: list[tuple[Array, Plan, End]] = []
    meetings += [(move.q[-1], p, "start") for move, p in zip(into, starts, strict=True)]
    meetings += [(move.q[0], p, "end") for move, p in zip(out, ends, strict=True)]
    _require_met(meetings, retract)


def _require_met(meetings: Sequence[tuple[Array, Plan, End]], retract: float) -> None:
    """Raise InputError unless joints of moves are where the tool is backed off from their plans."""
    for q, plan, end in meetings:
        T = plan.robot.forward(np.array([q, back_off(plan, end, retract)])) @ plan.T_flange_tip
        if (off := np.linalg.norm(T[0, :3, 3] - T[1, :3, 3])) > MEETS:
            raise InputError(
                f"contour {plan.name!r}: the planned transfer move is {off * 1e3:.4g} mm off the "
                f"point where the tool is backed off by {retract * 1e3:g} mm; set the retract_mm "
                "that it was planned with, or plan again"
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
            "a program for each"
        )


def _kinematics(robot: Robot) -> tuple[object, ...]:
    chain = robot.chain
    parts = [robot.sign, robot.offset, robot.T_base_foot, robot.T_end_flange]
    parts += [] if chain is None else [chain.origins, chain.axes, chain.end]
    parts += [x for axis in robot.externals for x in (axis.axis, axis.point)]
    numbers = np.concatenate([part.ravel() for part in parts])
    names = [(axis.name, axis.kind, axis.carries) for axis in robot.externals]
    return robot.id, robot.kinematics, *names, *robot.geometry.values(), *numbers.tolist()


def _require_on_contour(plan: Plan) -> None:
    T = plan.robot.forward(plan.q) @ plan.T_flange_tip
    off = np.linalg.norm(T[:, :3, 3] - plan.points, axis=1)
    turned = np.linalg.norm(np.cross(T[:, :3, 2], plan.axes), axis=1)
    turned[(T[:, :3, 2] * plan.axes).sum(axis=1) < 0] = 1.0
    k = int(np.argmax(np.maximum(off, turned)))
    if max(off[k], turned[k]) > PLAN_AND_CONTOUR:
        raise InputError(
            f"contour {plan.name!r}, node {k}: the planned joints put the tool tip "
            f"{off[k] * 1e3:.4f} mm and {np.degrees(np.arcsin(turned[k])):.4f} deg off the "
            "contour; the plan belongs to another contour, tool or placement"
        )
