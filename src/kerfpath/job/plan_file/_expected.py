"""The plans that a plan.json should have: its joints, with all else from the job."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath._arrays import Array
from kerfpath.auditor import Check, retract_checks
from kerfpath.contour import Contour
from kerfpath.job.format import Candidate, Job, PreparedJob, divide_nodes
from kerfpath.job.plan_file._checks import check, count
from kerfpath.job.plan_file._read import PlanFile
from kerfpath.job.plan_file._recompute import recompute
from kerfpath.options import PlanOptions
from kerfpath.plans import Plan
from kerfpath.retime import feed, retime

__all__ = ["ExpectedPlan", "expect_plans"]

SAME_PLACE = 1e-6
"""Largest distance in m between a node and the same node of the job."""
RETIMED = 1e-3
"""Share of an interval by which times of a reduced feed may differ: they are a local optimum."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExpectedPlan:
    """The plan that is expected for one contour, or piece, of a plan.json.

    Parameters
    ----------
    name : str
        Name of the plan in the file.
    number : int
        Number of its contour in the job, from 0; -1 for none.
    plan : Plan or None
        The joints of the file with all else from the job; None if the two do not fit.
    path : Contour or None
        The path that its nodes were sampled from.
    checks : tuple of Check
        Whether contour, nodes and joints fit the job.
    drawing : tuple of Check
        Checks of rounded corners against the drawing; the file has a record of them.
    """

    name: str
    number: int
    plan: Plan | None = None
    path: Contour | None = None
    checks: tuple[Check, ...] = ()
    drawing: tuple[Check, ...] = ()


def expect_plans(prepared: PreparedJob, file: PlanFile) -> tuple[list[ExpectedPlan], list[Check]]:
    """Return the expected plan for each plan of a file, and the checks of its contours."""
    names = prepared.names
    members = [[p for p in file.plans if file.contours[p.name] == name] for name in names]
    found: dict[str, ExpectedPlan] = {}
    for number, plans in enumerate(members):
        for each in _of_contour(prepared, number, plans, file.picked):
            found[each.name] = each
    foreign = [p.name for p in file.plans if p.name not in found]
    for name in foreign:
        row = count("contour", "contours that the job does not ask for", 1)
        found[name] = ExpectedPlan(name=name, number=-1, checks=(row,))
    missing = [
        name
        for name, plans in zip(names, members, strict=True)
        if not plans and name not in file.missing
    ]
    which = f": {', '.join(missing)}" if missing else ""
    rows = [
        count("contours", f"contours of the job that the plan lacks{which}", len(missing)),
        count("contour", "contours that the job does not ask for", len(foreign)),
    ]
    return [found[p.name] for p in file.plans], rows


def _of_contour(
    prepared: PreparedJob, number: int, plans: Sequence[Plan], picked: frozenset[str]
) -> list[ExpectedPlan]:
    """Return the expected plans of one contour: a single one, or its pieces."""
    if not plans:
        return []
    name, job = prepared.names[number], prepared.job
    if len(plans) == 1 and plans[0].name == name:
        (made,) = plans
        candidate = _nearest(prepared.contours[number].candidates, made, job.options.refine_parts)
        if candidate is None:
            counts = sorted({len(c.nodes) for c in prepared.contours[number].candidates})
            row = _node_count(made, " or ".join(map(str, counts)))
            return [ExpectedPlan(name=name, number=number, checks=(row,))]
        own = _divided(candidate, made, job.options.refine_parts)
        return [_expected(prepared, number, made, candidate, own, picked=made.name in picked)]
    words = [f"{name}, piece {k + 1} of {len(plans)}" for k in range(len(plans))]
    by_name = {p.name: p for p in plans}
    if len(plans) == 1 or job.options.interruptions == "none" or set(by_name) != set(words):
        row = count("once", "plans of a contour that is cut once", len(plans))
        return [ExpectedPlan(name=p.name, number=number, checks=(row,)) for p in plans]
    return _pieces(prepared, number, [by_name[word] for word in words])


def _pieces(prepared: PreparedJob, number: int, plans: Sequence[Plan]) -> list[ExpectedPlan]:
    """Return the expected plans of the pieces of a contour, in the order along it."""
    job = prepared.job

    def off(candidate: Candidate) -> float:
        ends = [candidate.path.at(p.contour.s[[0, -1]])[0] for p in plans]
        return max(
            float(np.linalg.norm(p.contour.points[[0, -1]] - end, axis=1).max())
            for p, end in zip(plans, ends, strict=True)
        )

    candidate = min(prepared.contours[number].candidates, key=off)
    whole, found, at = candidate.nodes, [], 0
    for p in plans:
        last = int(np.argmin(np.abs(whole.s - p.contour.s[-1])))
        last = len(whole) - 1 if p is plans[-1] else min(max(last, at + 1), len(whole) - 1)
        if at >= last:
            row = count("pieces", "pieces that do not begin where the piece before them ends", 1)
            found.append(ExpectedPlan(name=p.name, number=number, checks=(row,)))
            continue
        part = replace(whole.part(at, last, job.options.frames), name=p.name)
        path = candidate.path.between(float(whole.s[at]), float(whole.s[last]))
        own = _divided(Candidate(path=path, nodes=part), p, job.options.refine_parts)
        found.append(_expected(prepared, number, p, candidate, own, picked=False))
        at = last
    return found


def _nearest(candidates: Sequence[Candidate], made: Plan, parts: int) -> Candidate | None:
    """Return the candidate with as many nodes as a plan, or so divided, that is nearest to it."""
    K = len(made.contour)

    def off(candidate: Candidate) -> float:
        every = (K - 1) // (len(candidate.nodes) - 1)
        return float(np.abs(made.contour.points[::every] - candidate.nodes.points).max())

    fitting = [c for c in candidates if K in (len(c.nodes), (len(c.nodes) - 1) * parts + 1)]
    return min(fitting, key=off, default=None)


def _divided(candidate: Candidate, made: Plan, parts: int) -> Candidate:
    """Return the candidate with its intervals divided, if those of the plan are."""
    if parts == 1 or len(made.contour) != (len(candidate.nodes) - 1) * parts + 1:
        return candidate
    return replace(candidate, nodes=divide_nodes(candidate.path, candidate.nodes, parts))


def _expected(
    prepared: PreparedJob, number: int, made: Plan, whole: Candidate, own: Candidate,
    *, picked: bool,
) -> ExpectedPlan:  # fmt: skip
    """Return the plan that has the joints of a plan and all else of the job.

    Its nodes are those of its `own` candidate: a piece of the `whole` one, or its nodes divided.
    """
    job, nodes = prepared.job, own.nodes
    if len(nodes) != len(made.contour):
        row = _node_count(made, str(len(nodes)))
        return ExpectedPlan(name=made.name, number=number, checks=(row,))
    if made.q.shape[1] != job.robot.joints:
        row = count("joints", f"joints, where the robot has {job.robot.joints}", made.q.shape[1])
        return ExpectedPlan(name=made.name, number=number, checks=(row,))
    far = np.linalg.norm(made.contour.points - nodes.points, axis=1)
    worst = int(np.argmax(far))
    title = "distance of the nodes from those of the job"
    place = check("place", title, far[worst], SAME_PLACE, "m", worst)
    parts = _parts(whole, nodes, job.options.refine_parts)
    plan = replace(
        made,
        contour=replace(nodes, time=None),
        robot=job.robot,
        T_flange_tip=job.tool,
        T_base_part=job.placement,
        time=whole.dt / parts * np.arange(len(nodes), dtype=float),
        settings=_options(prepared, number, whole.dt, made.settings, picked=picked),
        feed=None,
    )
    if job.options.feed == "dip" and made.feed is not None and not picked:
        plan = _dipping(plan, whole.dt, made.time)
    plan = recompute(plan)
    asked = job.options.retract
    room = retract_checks(plan, None if asked == made.settings.retract else asked)
    rows = (place, *_postures(job, plan), *room)
    drawing = prepared.contours[number].drawing_checks(own, plan.contour, job.tolerances.path)
    return ExpectedPlan(
        name=made.name, number=number, plan=plan, path=own.path, checks=rows, drawing=(*drawing,)
    )


def _parts(candidate: Candidate, nodes: Contour, parts: int) -> int:
    """Return the number of parts into which the nodes divide intervals of the candidate."""
    step = float(np.median(np.diff(candidate.nodes.s)) / np.median(np.diff(nodes.s)))
    return parts if parts > 1 and step > (1 + parts) / 2 else 1


def _options(
    prepared: PreparedJob, number: int, dt: float, said: PlanOptions, *, picked: bool
) -> PlanOptions:
    """Return the plan options of the job; a picked plan may have lower shares of the limits."""
    job, task = prepared.job, prepared.contours[number].task
    # [program] may have been edited since: the current retract is checked separately.
    options = replace(task.asked(job.options).resolve(job.robot, dt), retract=said.retract)
    if not picked:
        return options
    return replace(
        options,
        objective=said.objective,
        metric=said.metric,
        weights=said.weights,
        eta_v=min(options.eta_v, said.eta_v),
        eta_a=min(options.eta_a, said.eta_a),
        method="continuous" if said.method == "continuous" else "exact",
        feed="constant",
        refine=said.refine,
    )


def _dipping(plan: Plan, dt: float, said: Array) -> Plan:
    """Return the plan in the least time within its limits; with the given times if they agree."""
    limits = plan.settings.limits(plan.robot)
    tau = retime(plan.increments, dt, limits)
    time, found = np.concatenate([[0.0], np.cumsum(tau)]), np.diff(said)
    if said[0] == 0 and (np.abs(found - tau) <= RETIMED * tau).all():
        time, tau = said, found
    dips = feed(tau, dt, plan.increments, limits, np.diff(plan.contour.s))
    return replace(plan, time=time, feed=dips)


def _postures(job: Job, made: Plan) -> list[Check]:
    allowed = job.options.postures
    if allowed is None:
        return []
    other = np.flatnonzero(~np.isin(made.posture, list(allowed)))
    node = int(other[0]) if other.size else 0
    return [count("posture", "nodes in a posture that the job does not allow", len(other), node)]


def _node_count(made: Plan, asked: str) -> Check:
    said = f"wrong number of nodes: expected {asked}, found {len(made.contour)}"
    return count("nodes", said, 1)
