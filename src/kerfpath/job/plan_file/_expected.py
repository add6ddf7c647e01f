"""The plans that a plan.json should hold: of its joints, and of the job in all the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath._arrays import Array
from kerfpath.auditor import Check, Unit
from kerfpath.contour import Contour
from kerfpath.job.plan_file._asked import Asked, Candidate
from kerfpath.job.plan_file._follows import following
from kerfpath.job.plan_file._read import PlanFile
from kerfpath.options import PlanOptions
from kerfpath.plans import Plan
from kerfpath.retime import feed, retime

__all__ = ["Expected", "expected_plans"]

SAME_PLACE = 1e-6
"""m: a node and one of the job's are the same up to this distance."""
RETIMED = 1e-3
"""Share of an interval by which times of a feed that dips may differ: they are a local optimum."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Expected:
    """What is expected of one contour, or piece, of a plan.json.

    Parameters
    ----------
    name : str
        Of the plan in the file.
    number : int
        Which contour of the job it is of; -1 for none.
    plan : Plan or None
        The joints of the file, all else as the job has it; None where the two do not fit.
    path : Contour or None
        The path that its nodes were sampled from.
    checks : tuple of Check
        What does not fit: a contour that is not asked for, nodes that are not its nodes, joints.
    """

    name: str
    number: int
    plan: Plan | None = None
    path: Contour | None = None
    checks: tuple[Check, ...] = ()


def expected_plans(asked: Asked, file: PlanFile) -> tuple[list[Expected], list[Check]]:
    """Return what is expected of each plan of a file, and the checks of which contours it has."""
    names = [task.name for task in asked.tasks]
    members = [[p for p in file.plans if file.contours[p.name] == name] for name in names]
    found: dict[str, Expected] = {}
    for number, plans in enumerate(members):
        for each in _of_contour(asked, number, plans, file.picked):
            found[each.name] = each
    foreign = [p.name for p in file.plans if p.name not in found]
    for name in foreign:
        row = _count("contour", "contours that the job does not ask for", 1)
        found[name] = Expected(name=name, number=-1, checks=(row,))
    missing = [
        name
        for name, plans in zip(names, members, strict=True)
        if not plans and name not in file.missing
    ]
    told = f": {', '.join(missing)}" if missing else ""
    rows = [
        _count("contours", f"contours of the job that the plan lacks{told}", len(missing)),
        _count("contour", "contours that the job does not ask for", len(foreign)),
    ]
    return [found[p.name] for p in file.plans], rows


def _of_contour(
    asked: Asked, number: int, plans: Sequence[Plan], picked: frozenset[str]
) -> list[Expected]:
    """Return what is expected of the plans of one contour: it alone, or its pieces."""
    if not plans:
        return []
    name, job = asked.tasks[number].name, asked.job
    if len(plans) == 1 and plans[0].name == name:
        (made,) = plans
        candidate = _nearest(asked.candidates[number], made, job.options.refine_parts)
        if candidate is None:
            counts = sorted({len(c.nodes) for c in asked.candidates[number]})
            row = _node_count(made, " or ".join(map(str, counts)))
            return [Expected(name=name, number=number, checks=(row,))]
        nodes, path = _fine(candidate.nodes, candidate.path, made, job.options.refine_parts)
        return [_expected(asked, number, made, candidate, nodes, path, made.name in picked)]
    words = [f"{name}, piece {k + 1} of {len(plans)}" for k in range(len(plans))]
    by_name = {p.name: p for p in plans}
    if len(plans) == 1 or job.options.interruptions == "none" or set(by_name) != set(words):
        row = _count("once", "plans of a contour that is cut once", len(plans))
        return [Expected(name=p.name, number=number, checks=(row,)) for p in plans]
    return _pieces(asked, number, [by_name[word] for word in words])


def _pieces(asked: Asked, number: int, plans: Sequence[Plan]) -> list[Expected]:
    """Return what is expected of the pieces of a contour, in the order along it."""
    job = asked.job

    def off(candidate: Candidate) -> float:
        ends = [candidate.path.at(p.contour.s[[0, -1]])[0] for p in plans]
        return max(
            float(np.linalg.norm(p.contour.points[[0, -1]] - end, axis=1).max())
            for p, end in zip(plans, ends, strict=True)
        )

    candidate = min(asked.candidates[number], key=off)
    whole, found, at = candidate.nodes, [], 0
    for p in plans:
        last = int(np.argmin(np.abs(whole.s - p.contour.s[-1])))
        last = len(whole) - 1 if p is plans[-1] else min(max(last, at + 1), len(whole) - 1)
        if at >= last:
            row = _count("pieces", "pieces that do not go on where the one before them ends", 1)
            found.append(Expected(name=p.name, number=number, checks=(row,)))
            continue
        part = replace(whole.part(at, last, job.options.frames), name=p.name)
        path = candidate.path.between(float(whole.s[at]), float(whole.s[last]))
        nodes, path = _fine(part, path, p, job.options.refine_parts)
        found.append(_expected(asked, number, p, candidate, nodes, path, picked=False))
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


def _fine(nodes: Contour, path: Contour, made: Plan, parts: int) -> tuple[Contour, Contour]:
    """Return the nodes, divided where those of the plan are, and their path."""
    coarse = np.arange(len(nodes))
    if parts == 1 or len(made.contour) != coarse[-1] * parts + 1:
        return nodes, path
    s = np.interp(np.arange(coarse[-1] * parts + 1) / parts, coarse, nodes.s)
    return replace(path.at_nodes(s), name=nodes.name), path


def _expected(
    asked: Asked, number: int, made: Plan, candidate: Candidate, nodes: Contour, path: Contour,
    picked: bool,
) -> Expected:  # fmt: skip
    """Return the plan that has the joints of a plan and all else of the job."""
    robot = asked.job.robot
    if len(nodes) != len(made.contour):
        row = _node_count(made, str(len(nodes)))
        return Expected(name=made.name, number=number, checks=(row,))
    if made.q.shape[1] != robot.joints:
        row = _count("joints", f"joints, where the robot has {robot.joints}", made.q.shape[1])
        return Expected(name=made.name, number=number, checks=(row,))
    far = np.linalg.norm(made.contour.points - nodes.points, axis=1)
    worst = int(np.argmax(far))
    place = _check("place", "nodes, off those of the job", far[worst], SAME_PLACE, "m", worst)
    parts = _parts(candidate, nodes, asked.job.options.refine_parts)
    plan = replace(
        made,
        contour=replace(nodes, time=None),
        robot=robot,
        T_flange_tip=asked.job.tool,
        T_base_part=asked.job.placement,
        time=candidate.dt / parts * np.arange(len(nodes), dtype=float),
        settings=_options(asked, candidate.dt, made.settings, picked=picked),
        feed=None,
    )
    if asked.job.options.feed == "dip" and made.feed is not None and not picked:
        plan = _dipping(plan, candidate.dt, made.time)
    plan = following(plan)
    rows = (place, *_postures(asked, plan))
    return Expected(name=made.name, number=number, plan=plan, path=path, checks=rows)


def _parts(candidate: Candidate, nodes: Contour, parts: int) -> int:
    """Return into how many parts the nodes divide the intervals of the candidate's."""
    step = float(np.median(np.diff(candidate.nodes.s)) / np.median(np.diff(nodes.s)))
    return parts if parts > 1 and step > (1 + parts) / 2 else 1


def _options(asked: Asked, dt: float, said: PlanOptions, *, picked: bool) -> PlanOptions:
    """Return how the job asks for a plan; one that was picked may aim at less than the limits."""
    options = asked.job.options.of(asked.job.robot, dt)
    if not picked:
        return options
    return replace(
        options,
        objective=said.objective,
        metric=said.metric,
        weights=said.weights,
        eta_v=min(options.eta_v, said.eta_v),
        eta_a=min(options.eta_a, said.eta_a),
        feed="constant",
        refine=said.refine,
    )


def _dipping(plan: Plan, dt: float, said: Array) -> Plan:
    """Return the plan in the least time that its limits allow; what is said where that is it."""
    limits = plan.settings.limits(plan.robot)
    tau = retime(plan.increments, dt, limits)
    told = np.diff(said)
    if said[0] == 0 and (np.abs(told - tau) <= RETIMED * tau).all():
        tau = told
    dips = feed(tau, dt, plan.increments, limits, np.diff(plan.contour.s))
    time = np.concatenate([[0.0], np.cumsum(tau)])
    return replace(plan, time=said if tau is told else time, feed=dips)


def _postures(asked: Asked, made: Plan) -> list[Check]:
    allowed = asked.job.options.postures
    if allowed is None:
        return []
    other = np.flatnonzero(~np.isin(made.posture, list(allowed)))
    node = int(other[0]) if other.size else 0
    return [_count("posture", "nodes in a posture that the job does not allow", len(other), node)]


def _node_count(made: Plan, asked: str) -> Check:
    said = f"nodes too many or too few: expected {asked}, found {len(made.contour)}"
    return _count("nodes", said, 1)


def _count(code: str, title: str, count: float, node: int = 0) -> Check:
    return _check(code, title, count, 0, "count", node)


def _check(code: str, title: str, value: float, limit: float, unit: Unit, node: int = 0) -> Check:
    return Check(
        code=code, title=title, value=float(value), limit=float(limit), unit=unit, node=node
    )
