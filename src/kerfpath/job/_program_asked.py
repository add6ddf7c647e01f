"""What a job asks of the program that cuts along the paths that were read, in its own language."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.air import AirMove, backed_off
from kerfpath.contour import Contour
from kerfpath.job._program_read import ReadCut, poses_on_arc, followed
from kerfpath.job._read import Job
from kerfpath.job._task import ContourTask
from kerfpath.planner import node_interval
from kerfpath.plans import Plan
from kerfpath.post import (
    CircularMove,
    JointMove,
    Language,
    LinearMove,
    Program,
    ReadProgram,
    Rules,
    Settings,
    Step,
    build_program,
    said_in,
)

__all__ = ["AskedNodes", "asked_nodes", "asked_program"]

REACH = 4.0
"""Farther (m) than a tip is from any axis: the lever of what digits leave of joints."""
POINT = 1e-5
"""How far (m) a target beside the cut may be from where the job has it, beyond its digits."""
ANGLE = np.radians(0.02)
"""The same of the tool's orientation, rad."""
SAME_BRANCH = 0.2
"""How far (rad) joints may be apart that lead to the same pose: digits near a singularity."""
SAME_SPEED = 1e-3
"""Relative difference of speeds that one arc may have."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AskedNodes:
    """The nodes that a job asks for along a cut, and which of them its targets stand at.

    Parameters
    ----------
    nodes : Contour
        Of K nodes, with what they are.
    time : (K,) s
        When each is reached at the speed that is asked for.
    at : (m,) int
        The node of each target of the cut.
    off : (m,) m
        How far each is from it.
    alone : (m,) bool
        Targets that do not follow the node before, and are no arc either.
    """

    nodes: Contour
    time: Array
    at: Ints
    off: Array
    alone: Bools

    @property
    def complete(self) -> bool:
        """Whether every node has its target, or lies on an arc between two."""
        return not self.alone.any() and self.at[-1] == len(self.nodes) - 1


def asked_nodes(job: Job, task: ContourTask, cut: ReadCut, reference: Contour, s: Array) -> AskedNodes:
    """Return the nodes that the job asks for along a cut, by the arc lengths s (m,) of its targets.

    Where the job asks for finer intervals, those are taken if there are as many targets.
    """
    asked = task.sample(reference)
    dt = node_interval(asked, task.speed if asked.time is None else None)
    time = dt * np.arange(len(asked))
    targets = cut.ends
    if job.refine_parts > 1 and len(targets) > len(asked):
        k = np.arange(len(asked))
        fine = np.arange((len(asked) - 1) * job.refine_parts + 1) / job.refine_parts
        asked, time = reference.at_nodes(np.interp(fine, k, asked.s)), np.interp(fine, k, time)
    if len(targets) == len(asked):
        at = np.arange(len(asked))
    else:
        at = np.abs(asked.s[None] - s[targets][:, None]).argmin(axis=1)
    arc = np.array([move.kind == "circular" for move in cut.targets])
    step = np.diff(at, prepend=-1)
    return AskedNodes(
        nodes=asked,
        time=time,
        at=at,
        off=np.linalg.norm(cut.T_part_tip[targets, :3, 3] - asked.points[at], axis=1),
        alone=np.where(arc, step < 1, step != 1),
    )


def asked_program(
    job: Job, cuts: Sequence[tuple[ReadCut, AskedNodes, Plan]], home: Array,
    language: Language, settings: Settings,
) -> ReadProgram:  # fmt: skip
    """Return what the job's program along the paths of these cuts would say, read back.

    The paths, and with [sequence] the corners of the moves between them, are those that were read;
    they are audited for themselves. All else is by the job: speeds, zones, waits, switches, how far
    and which way the tool backs off.

    Raises
    ------
    InputError
        There is no such program: joints that leave the path, no way to back off.
    """
    rules, options = language.rules(settings), job.program
    plans = [_whole(cut, asked, plan) for cut, asked, plan in cuts]
    program = build_program(
        plans,
        moves=_moves(job, [cut for cut, _, _ in cuts], plans, home),
        name=options.name,
        retract=options.retract,
        zone=options.zone,
        lead_time=options.lead_time,
        gas_lead=options.gas_lead,
        pierce_time=options.pierce_time,
        approach_speed=options.approach_speed,
        air_speed=options.air_speed,
    )
    sections = []
    for section, (cut, asked, _) in zip(program.sections, cuts, strict=True):
        steps = _as_led(program, section.steps, cut, rules)
        if options.arc_tolerance is not None:
            steps = _with_arcs(steps, cut, asked)
        sections.append(replace(section, steps=tuple(steps)))
    program = replace(program, sections=tuple(sections))
    if language.sayable is not None:
        program = language.sayable(program, settings)
    return said_in(program, language, settings)


def _whole(cut: ReadCut, asked: AskedNodes, plan: Plan) -> Plan:
    """Return the plan of a cut with a node wherever the job asks for one, along arcs, too."""
    targets, at = cut.ends, asked.at
    T = np.empty((len(asked.nodes), 4, 4))
    q = np.empty((len(asked.nodes), cut.q.shape[1]))
    T[at], q[at] = cut.T_part_tip[targets], cut.q[targets]
    flange = np.linalg.inv(plan.T_flange_tip)
    for j, move in enumerate(cut.targets):
        first, last = (at[j - 1] if j else at[0]), at[j]
        if move.T_part_via is None or last - first < 2:
            continue
        s = asked.nodes.s[first : last + 1]
        parts = ((s - s[0]) / (s[-1] - s[0]))[1:-1]
        T[first + 1 : last] = poses_on_arc(T[first], move.T_part_via, T[last], parts)
        q[first + 1 : last] = followed(
            plan.robot, plan.T_base_part @ T[first + 1 : last] @ flange, q[first]
        )
    dips = plan.time[targets]
    time = np.interp(np.arange(len(T)), at, dips) if plan.settings.feed == "dip" else asked.time
    contour = replace(
        asked.nodes, points=T[:, :3, 3], axes=T[:, :3, 2], time=None, name=plan.name
    )
    K = len(T)
    return replace(
        plan, contour=contour, q=q, gamma=np.zeros(K), time=time,
        posture=np.full(K, plan.posture[0]), turn=np.zeros(q.shape, dtype=np.int64),
    )  # fmt: skip
