"""The program that a job asks for along the paths that were read from a program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.auditor import Check, window_checks
from kerfpath.contour import Contour
from kerfpath.execution import ToolCourse
from kerfpath.job.format import Candidate, Job, divide_nodes
from kerfpath.job.programs.reading import ReadCut, branch_of, follow_poses
from kerfpath.plans import Plan
from kerfpath.post import (
    ZONE_STEP,
    CircularMove,
    JointMove,
    Language,
    LanguageSettings,
    LinearMove,
    Program,
    ReadProgram,
    Rules,
    Step,
    read_as_written,
)
from kerfpath.transfer import TransferMove, back_off
from kerfpath.windows import GammaWindow

REACH = 4.0
"""Distance (m) that no tip has from an axis: the lever of rounded joint angles."""
POINT = 1e-5
"""Tolerance (m) of a target beside the cut against the job, beyond its digits."""
ANGLE = np.radians(0.02)
"""Tolerance of the tool's orientation there, rad."""
SAME_BRANCH = 0.2
"""Largest difference (rad) of joints for the same pose, as digits cause near a singularity."""
SAME_SPEED = 1e-3
"""Largest relative difference of the speeds in one arc."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetNodes:
    """The nodes that a job asks for along a cut, and the node of each target.

    Parameters
    ----------
    nodes : Contour
        The K nodes, with their kinds.
    time : (K,) s
        When each is reached at the requested speed.
    at : (m,) int
        The node of each target of the cut.
    off : (m,) m
        Distance of each target from its node.
    alone : (m,) bool
        Whether a target is not at the next node, or for an arc not at a later one.
    """

    nodes: Contour
    time: Array
    at: Ints
    off: Array
    alone: Bools

    __repr__ = short_repr

    @property
    def complete(self) -> bool:
        """Whether every node has its target, or lies on an arc between two."""
        return not self.alone.any() and self.at[-1] == len(self.nodes) - 1


def nodes_at_targets(job: Job, candidate: Candidate, cut: ReadCut, s: Array) -> TargetNodes:
    """Return the nodes that the job asks for along a cut, by the arc lengths s (m,) of its targets.

    With refine_parts, intervals are divided if there are more targets than nodes.
    """
    nodes, dt, parts = candidate.nodes, candidate.dt, job.options.refine_parts
    targets = cut.ends
    if parts > 1 and len(targets) > len(nodes):
        nodes, dt = divide_nodes(candidate.path, nodes, parts), dt / parts
    if len(targets) == len(nodes):
        at = np.arange(len(nodes))
    else:
        at = np.abs(nodes.s[None] - s[targets][:, None]).argmin(axis=1)
    arc = np.array([move.kind == "circular" for move in cut.targets])
    step = np.diff(at, prepend=-1)
    return TargetNodes(
        nodes=nodes,
        time=dt * np.arange(len(nodes), dtype=np.float64),
        at=at,
        off=np.linalg.norm(cut.T_part_tip[targets, :3, 3] - nodes.points[at], axis=1),
        alone=np.where(arc, step < 1, step != 1),
    )


def expect_program(
    job: Job, cuts: Sequence[tuple[ReadCut, TargetNodes, Plan]], home: Array,
    language: Language, settings: LanguageSettings,
) -> ReadProgram:  # fmt: skip
    """Return the job's program along the paths of these cuts, as it would be read back.

    The paths, and with [sequence] the corners of the moves between them, are those that were read;
    they are audited separately. All else follows from the job: speeds, zones, waits, switches, and
    distance and direction of the retract.

    Raises
    ------
    InputError
        There is no such program: joints leave the path, or the tool cannot back off.
    """
    rules, options = language.rules(settings), job.program
    plans = [whole_cut(job, cut, requested, plan) for cut, requested, plan in cuts]
    moves = _moves(job, [cut for cut, _, _ in cuts], plans, home)
    # Arcs are added below, where they were read.
    program = replace(options, arc_tolerance=None).program(plans, moves)
    sections = []
    for section, (cut, requested, _) in zip(program.sections, cuts, strict=True):
        steps = [
            replace(step, q=_same_pose(program, step.q, cut.approach[-1], rules))
            if isinstance(step, JointMove)
            else step
            for step in section.steps
        ]
        if options.zone == "auto":
            steps = _with_zones(steps, cut, requested)
        if options.arc_tolerance is not None:
            steps = _with_arcs(steps, cut, requested)
        sections.append(replace(section, steps=tuple(steps)))
    return read_as_written(replace(program, sections=tuple(sections)), language, settings)


def whole_cut(job: Job, cut: ReadCut, requested: TargetNodes, plan: Plan) -> Plan:
    """Return the plan of a cut with every node that the job asks for, along arcs, too."""
    targets, at = cut.ends, requested.at
    K = len(requested.nodes)
    T, q = np.empty((K, 4, 4)), np.empty((K, cut.q.shape[1]))
    T[at], q[at] = cut.T_part_tip[targets], cut.q[targets]
    flange = np.linalg.inv(plan.T_flange_tip)
    for j, move in enumerate(cut.targets):
        first, last = at[max(j - 1, 0)], at[j]
        if move.T_part_via is not None and last - first > 1:
            inner = slice(first + 1, last)
            s = requested.nodes.s[first : last + 1]
            parts = ((s - s[0]) / (s[-1] - s[0]))[1:-1]
            T[inner] = ToolCourse.through(T[[first, last]], [move.T_part_via]).poses(parts)
            q[inner] = follow_poses(plan.robot, plan.T_base_part @ T[inner] @ flange, q[first])
    time = requested.time
    if job.options.feed != "constant":  # it may be slower, which is checked separately
        time = np.interp(np.arange(K), at, _as_fast(cut, requested.nodes.s[at]))
    return replace(
        plan,
        contour=Contour(
            T[:, :3, 3], T[:, :3, 2], s=requested.nodes.s, kind=requested.nodes.kind, name=plan.name
        ),
        q=q,
        gamma=np.zeros(K),
        time=time,
        posture=np.full(K, branch_of(plan.robot, q[0])),
        turn=np.zeros(q.shape, dtype=np.int64),
    )


def _as_fast(cut: ReadCut, s: Array) -> Array:
    """Return when (s) the targets of a cut are reached at the speeds of the text, from 0 on."""
    took = [
        float(cut.took[a:b].sum()) if np.isnan(cut.speed[a]) else float(way / cut.speed[a])
        for a, b, way in zip(cut.ends[:-1], cut.ends[1:], np.diff(s), strict=True)
    ]
    return np.append(0.0, np.cumsum(took))


def _moves(
    job: Job, cuts: Sequence[ReadCut], plans: Sequence[Plan], home: Array
) -> list[TransferMove]:
    """Return the moves between cuts with the corners that were read, and the job's home."""
    if job.sequence is None:
        return []
    corners = [
        [*cut.approach[:-1], back_off(plan, "start", job.program.retract)]
        for cut, plan in zip(cuts, plans, strict=True)
    ]
    backs = [back_off(plan, "end", job.program.retract) for plan in plans]
    ways = [[back, *way] for back, way in zip(backs, corners[1:], strict=False)]
    if job.home is not None:
        there = job.home
        # At the end, an endless joint is at home on any turn that the motion has reached.
        end = home[-1] if len(home) else backs[-1]
        turns = np.round((end - there) / (2 * np.pi)) * job.robot.endless
        ways = [[there, *corners[0][1:]], *ways, [backs[-1], *home[:-1], there + 2 * np.pi * turns]]
    return [
        TransferMove(q=np.array(way), time=np.arange(len(way), dtype=float), clear=True)
        for way in ways
    ]


def _same_pose(program: Program, requested: Array, read: Array, rules: Rules) -> Array:
    """Return the joints that were read if they bring the tool to the requested pose.

    Near a singularity, the digits of a pose leave a larger error in the joints than in the pose.
    """
    T = program.robot.forward(np.array([requested, read])) @ program.T_flange_tip
    left = len(requested) * rules.angle_step
    off = np.linalg.norm(T[0, :3, 3] - T[1, :3, 3])
    turned = np.linalg.norm(T[0, :3, :3] - T[1, :3, :3]) / np.sqrt(2)
    near = off <= POINT + rules.point_step + REACH * left and turned <= ANGLE + left
    near = near and np.abs(requested - read)[program.robot.free].max(initial=0) <= POINT
    return read if near and np.abs(requested - read).max() <= SAME_BRANCH else requested


def _with_zones(steps: Sequence[Step], cut: ReadCut, requested: TargetNodes) -> list[Step]:
    """Return the steps of a cut with the zones that were read, if they are one step away.

    Zones are rounded to steps, and digits of targets may lead to the next step.
    """
    path = [k for k, step in enumerate(steps) if isinstance(step, LinearMove)]
    found = list(steps)
    for k, move in zip((path[node] for node in requested.at), cut.targets, strict=True):
        step = found[k]
        assert isinstance(step, LinearMove)
        if move.zone and abs(move.zone - step.zone) <= ZONE_STEP * step.zone + POINT:
            found[k] = replace(step, zone=move.zone)
    return found


def _with_arcs(steps: Sequence[Step], cut: ReadCut, requested: TargetNodes) -> list[Step]:
    """Return the steps of a cut with the arcs that were read, if there may be an arc."""
    path = [k for k, step in enumerate(steps) if isinstance(step, LinearMove)]
    found, done = list(steps[: path[0] + 1]), path[0] + 1
    for j, move in enumerate(cut.targets[1:], 1):
        first, last = path[requested.at[j - 1] + 1], path[requested.at[j]]
        run = [step for step in steps[first : last + 1] if isinstance(step, LinearMove)]
        found += steps[done:first]
        done = last + 1
        arc = move.T_part_via is not None and _is_one(run)
        found += [_arc(run, move.T_part_via)] if arc else run
    return [*found, *steps[done:]]


def _is_one(run: Sequence[LinearMove]) -> bool:
    """Return whether linear moves may be one arc: no stop, no switch, and one speed."""
    speeds = [move.speed for move in run]
    through = all(move.zone > 0 and not move.switches for move in run[:-1])
    return through and max(speeds) - min(speeds) <= SAME_SPEED * speeds[0]


def _arc(run: Sequence[LinearMove], T_part_via: Array | None) -> CircularMove:
    end, via = run[-1], run[(len(run) - 1) // 2]
    assert T_part_via is not None
    return CircularMove(
        T_part_via=T_part_via,
        q_via=via.q,
        T_part_tip=end.T_part_tip,
        q=end.q,
        speed=run[0].speed,
        duration=sum(move.duration for move in run),
        zone=end.zone,
        switches=end.switches,
    )


# -----------------------------------------------------------------------------
# Check that a program keeps gamma inside the windows of its job.

OUTSIDE = 1e-5
"""Tolerance of targets outside a window, rad, beyond their digits."""


def check_pins(
    job: Job,
    cut: ReadCut,
    requested: TargetNodes,
    plan: Plan,
    windows: Sequence[GammaWindow],
    rules: Rules,
) -> list[Check]:
    """Return the check of a cut's windows of gamma, at the nodes that the job asks for.

    Empty if the tool axis may be tilted, as a text does not state the nominal axis.
    """
    if not windows or job.options.tilt is not None:
        return []
    whole = whole_cut(job, cut, requested, plan)
    settings = replace(whole.settings, gamma_windows=tuple(windows))
    pinned = replace(whole, contour=requested.nodes, settings=settings)
    tool = job.robot.forward(pinned.q) @ job.tool
    # Digits of three angles, or of the four numbers of a quaternion.
    return window_checks(pinned, tool, slack=OUTSIDE + 4 * rules.angle_step)
