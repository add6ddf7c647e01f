"""Local programs that try to beat the plans of a Pareto front in one criterion, the others held.

They share no code with the planner but the kinematics: joints follow from gamma of every node in
the postures of a plan; criteria and limits are evaluated here; and sequential linear programming
with HiGHS minimises an exact penalty within a box of changes of gamma. Each plan of a front is
attacked from itself, from its neighbours on the front, and from random changes of itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from kerfpath import ParetoSet, Plan, PlanOptions, audit
from kerfpath.arrays import Array, Ints
from kerfpath.planner import longest_step
from kerfpath.plans import on_turns

__all__ = ["Attack", "attacks"]

FIRST, SMALLEST = 0.03, 1e-6
"""rad: largest change of gamma of the first program, and where a descent ends."""
PROGRAMS, GAIN = 40, 1e-6
"""Most programs of a descent, and the relative promise of gain at which it ends."""
PENALTY = 30.0
"""Price of breaking a limit by once the limit, in objectives of about 1."""
SMALL = 1e-3
"""Share of the scale of a front that a value counts as at least: gains of nothing are rounding."""
KEPT = 1e-7
"""Share by which a motion found may break a limit: that of the audit is larger."""
OTHERS = 1e-3
"""Weight of the other criteria where one is minimised."""
NEIGHBOURS, CHANGES = 2, (0.03, 0.15)
"""Neighbours from which a plan is attacked, and the sizes of random changes, rad."""
H = 1e-6
"""rad: step of central differences."""
KINDS = ("displacement", "range", "increment", "velocity", "acceleration", "speed", "rotation")
"""Criteria that are known here; the first two also of one joint, the third only, as "range_6"."""


class Attack(NamedTuple):
    """The best that was found against one plan."""

    gain: float
    """Largest relative gain in one criterion where no other is worse; 0: none."""
    criterion: str
    start: str
    """From where: "itself", "neighbour" or "change"."""
    valid: bool
    """Whether the motion found passes the audit."""


class _Part(NamedTuple):
    """A piece of a convex function of q: coefficient times the size of linear forms of gamma.

    `kind` "sum": sum of |form|; "max": largest |form|; "span": largest minus least form.
    """

    coefficient: float
    kind: str
    value: Array
    rows: Any
    offset: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Motion:
    gamma: Array
    q: Array
    posture: Ints


@dataclass(kw_only=True, eq=False)
class Problem:
    """The motions along the contour of a plan, their limits and criteria."""

    plan: Plan
    criteria: tuple[str, ...]
    eta_v: float
    eta_a: float
    programs: int = field(default=0)

    def __post_init__(self) -> None:
        plan = self.plan
        self.dt = float(plan.time[1] - plan.time[0])
        self.v, self.a = plan.robot.speed_limits()
        limits = plan.robot.joint_limits()
        free = np.asarray(plan.robot.endless)
        self.lower = np.where(free, -np.inf, limits.lower)
        self.upper = np.where(free, np.inf, limits.upper)
        self.frames, self.inverse = plan.frames, np.linalg.inv(plan.T_flange_tip)
        self.step = longest_step(plan.contour)

    def motion(self, gamma: Array, near: Array, posture: Ints) -> _Motion | None:
        c, s = np.cos(gamma), np.sin(gamma)
        T = np.tile(np.eye(4), (len(gamma), 1, 1))
        T[:, 0, 0], T[:, 0, 1], T[:, 1, 0], T[:, 1, 1] = c, -s, s, c
        q = self.plan.robot.arm.follow(self.frames @ T @ self.inverse, near, posture)
        return _Motion(gamma=gamma, q=q, posture=posture) if np.isfinite(q).all() else None

    def value(self, name: str, at: _Motion) -> float:
        """Return a criterion, less is better (a speed as the inverse)."""
        d1, d2 = np.abs(np.diff(at.q, axis=0)), np.abs(np.diff(at.q, n=2, axis=0))
        fast, sharp = d1 / (self.v * self.dt), d2 / (self.a * self.dt**2)
        kind, _, joint = name.partition("_")
        size = {
            "displacement": lambda: d1.sum(axis=0),
            "range": lambda: np.ptp(at.q, axis=0),
            "increment": lambda: d1.max(axis=0),
        }
        if kind in size:
            each = size[kind]()
            return float(each[int(joint) - 1] if joint else (each / self.v).sum())
        if kind == "velocity":
            return float(fast.max())
        if kind == "acceleration":
            return float(sharp.max())
        if kind == "speed":
            least = max(fast.max() / self.eta_v, np.sqrt(sharp.max() / self.eta_a))
            return float(least * self.dt / self.step)
        assert kind == "rotation", f"expected one of {KINDS}, got {name!r}"
        return float(np.ptp(at.gamma))

    def losses(self, at: _Motion) -> Array:
        return np.array([self.value(name, at) for name in self.criteria])

    def excess(self, at: _Motion) -> float:
        """Return the largest share by which a limit is broken; below 0: none."""
        d1, d2 = np.diff(at.q, axis=0), np.diff(at.q, n=2, axis=0)
        fast = np.abs(d1) / (self.eta_v * self.v * self.dt)
        sharp = np.abs(d2) / (self.eta_a * self.a * self.dt**2)
        out = np.maximum(self.lower - at.q, at.q - self.upper)
        return float(max(fast.max() - 1, sharp.max(initial=0) - 1, out.max()))

    def parts(self, name: str, at: _Motion, S: _Slopes) -> list[_Part]:
        kind, _, joint = name.partition("_")
        one = None if not joint else int(joint) - 1
        n = at.q.shape[1]
        if kind == "rotation":
            return [_Part(1.0, "span", at.gamma, sparse.eye(len(at.gamma), format="csr"))]
        if kind in ("displacement", "increment", "range"):
            which = range(n) if one is None else [one]
            scale = 1 / self.v if one is None else np.ones(n)
            shape = {"displacement": "sum", "increment": "max", "range": "span"}[kind]
            first = kind != "range"
            return [
                _Part(scale[j], shape, S.d1[:, j] if first else at.q[:, j],
                      S.D1[j] if first else S.D0[j])
                for j in which
            ]  # fmt: skip
        fast = [
            _Part(1.0, "max", S.d1[:, j] / (self.v[j] * self.dt), S.D1[j] / (self.v[j] * self.dt))
            for j in range(n)
        ]
        per = self.a * self.dt**2
        sharp = [_Part(1.0, "max", S.d2[:, j] / per[j], S.D2[j] / per[j]) for j in range(n)]
        if kind == "speed":  # sqrt(x) by its tangent, from above
            now = max(float(np.abs(S.d2 / per).max()), 1e-12)
            root = np.sqrt(now / self.eta_a)
            per_speed = self.dt / self.step
            scaled = [(p, per_speed / self.eta_v, 0.0) for p in fast]
            slope, offset = per_speed / (2 * root * self.eta_a), per_speed * root / 2
            scaled += [(p, slope, offset) for p in sharp]
            return [
                p._replace(value=p.value * by, rows=p.rows * by, offset=more)
                for p, by, more in scaled
            ]
        return fast if kind == "velocity" else sharp


class _Slopes(NamedTuple):
    """First and second differences of the joints, and the slopes of each joint by gamma."""

    d1: Array
    d2: Array
    D0: list[Any]
    D1: list[Any]
    D2: list[Any]


def _slopes(problem: Problem, at: _Motion) -> _Slopes | None:
    ahead = problem.motion(at.gamma + H, at.q, at.posture)
    behind = problem.motion(at.gamma - H, at.q, at.posture)
    if ahead is None or behind is None:
        return None
    slope = (ahead.q - behind.q) / (2 * H)
    K = len(at.gamma)
    first = sparse.diags([-1.0, 1.0], [0, 1], shape=(K - 1, K), format="csr")
    second = sparse.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(K - 2, K), format="csr")
    own = [sparse.diags(column).tocsr() for column in slope.T]
    return _Slopes(
        np.diff(at.q, axis=0), np.diff(at.q, n=2, axis=0),
        own, [first @ d for d in own], [second @ d for d in own],
    )  # fmt: skip


class _Program:
    """A linear program that is put together row by row; the first K unknowns change gamma."""

    def __init__(self, K: int, radius: float) -> None:
        self.low, self.high = [-radius] * K, [radius] * K
        self.cost = [0.0] * K
        self.blocks: list[tuple[Any, Array, dict[int, Any]]] = []

    def new(self, count: int = 1, cost: float = 0.0, low: float = -np.inf) -> range:
        first = len(self.low)
        self.low += [low] * count
        self.high += [np.inf] * count
        self.cost += [cost] * count
        return range(first, first + count)

    def at_most(self, rows: Any, value: Array, more: dict[int, Any]) -> None:
        """Add value + rows x + sum of coefficients times further unknowns <= 0."""
        self.blocks.append((rows, value, more))

    def solve(self, K: int) -> Array | None:
        total, parts, bounds = len(self.low), [], []
        for rows, value, more in self.blocks:
            m = len(value)
            at, to, what = [], [], []
            for column, coefficient in more.items():
                at.append(np.arange(m))
                if isinstance(coefficient, tuple):  # its own unknown for each row
                    to.append(column + np.arange(m))
                    what.append(np.full(m, coefficient[0]))
                else:
                    to.append(np.full(m, column))
                    what.append(np.full(m, coefficient))
            extra = (
                sparse.csr_matrix(
                    (np.concatenate(what), (np.concatenate(at), np.concatenate(to))),
                    shape=(m, total),
                )
                if at
                else sparse.csr_matrix((m, total))
            )
            wide = (
                sparse.csr_matrix((rows.data, rows.indices, rows.indptr), shape=(m, total))
                if rows is not None
                else sparse.csr_matrix((m, total))
            )
            parts.append(wide + extra)
            bounds.append(-value)
        found = linprog(  # type: ignore[call-overload]  # sparse matrices are not in its stubs
            self.cost, A_ub=sparse.vstack(parts).tocsc(), b_ub=np.concatenate(bounds),
            bounds=np.column_stack([self.low, self.high]), method="highs",
        )  # fmt: skip
        return np.asarray(found.x[:K]) if found.status == 0 else None


def _function(program: _Program, parts: list[_Part], into: dict[int, float]) -> None:
    """Add unknowns that are at least the parts, and note their coefficients."""
    largest: int | None = None
    for part in parts:
        rows, value, c = part.rows.tocsr(), part.value, part.coefficient
        if part.kind == "sum":
            own = program.new(len(value), low=0.0)
            for sign in (1.0, -1.0):
                program.at_most(sign * rows, sign * value, {own[0]: (-1.0,)})
            for column in own:
                into[column] = into.get(column, 0.0) + c
        elif part.kind == "span":
            top, low = program.new()[0], program.new()[0]
            program.at_most(rows, value, {top: -1.0})
            program.at_most(-rows, -value, {low: 1.0})
            into[top], into[low] = c, -c
        else:
            if largest is None:
                largest = program.new()[0]
                into[largest] = 1.0
            for sign in (1.0, -1.0):
                program.at_most(sign * rows, sign * value + part.offset, {largest: -1.0})


def _step(
    problem: Problem, at: _Motion, weights: Array, most: Array, radius: float
) -> Array | None:
    """Return the change of gamma that minimises weights . criteria within `most` and the limits."""
    S = _slopes(problem, at)
    if S is None:
        return None
    problem.programs += 1
    K = len(at.gamma)
    program = _Program(K, radius)
    over = program.new(1, PENALTY, 0.0)[0]
    v = problem.eta_v * problem.v * problem.dt
    a = problem.eta_a * problem.a * problem.dt**2
    for j in range(len(v)):
        for sign in (1.0, -1.0):
            program.at_most(sign * S.D1[j] / v[j], sign * S.d1[:, j] / v[j] - 1, {over: -1.0})
            program.at_most(sign * S.D2[j] / a[j], sign * S.d2[:, j] / a[j] - 1, {over: -1.0})
        if np.isfinite(problem.upper[j]):
            program.at_most(S.D0[j], at.q[:, j] - problem.upper[j], {over: -1.0})
            program.at_most(-S.D0[j], problem.lower[j] - at.q[:, j], {over: -1.0})
    for name, weight, bound in zip(problem.criteria, weights, most, strict=True):
        into: dict[int, float] = {}
        _function(program, problem.parts(name, at, S), into)
        for column, coefficient in into.items():
            program.cost[column] += weight * coefficient
        columns, values = list(into), np.array(list(into.values()))
        row = sparse.csr_matrix(
            (values / bound, (np.zeros(len(columns), int), columns)),
            shape=(1, len(program.low)),
        )
        program.at_most(row, np.array([-1.0]), {over: -1.0})
    return program.solve(K)


def _merit(problem: Problem, at: _Motion, weights: Array, most: Array) -> tuple[float, float]:
    losses = problem.losses(at)
    broken = max(problem.excess(at), float((losses / most - 1).max()))
    return float(weights @ losses) + PENALTY * max(broken, 0.0), broken


def _descent(problem: Problem, at: _Motion, weights: Array, most: Array, first: float) -> _Motion:
    radius = first
    value, _ = _merit(problem, at, weights, most)
    for _ in range(PROGRAMS):
        change = _step(problem, at, weights, most, radius)
        if change is None:
            break
        there = problem.motion(at.gamma + change, at.q, at.posture)
        new = np.inf if there is None else _merit(problem, there, weights, most)[0]
        if there is not None and new < value - GAIN * 0.01 * abs(value):
            # the correction: the same program about the point reached
            gained = value - new
            at, value = there, new
            radius = min(2 * radius, 0.3)
            if gained < GAIN * abs(value) and radius < 1e-3:
                break
        else:
            radius = min(radius, float(np.abs(change).max())) / 3
        if radius < SMALLEST:
            break
    return at


def _restored(problem: Problem, at: _Motion, most: Array) -> _Motion:
    """Return a motion near `at` that keeps limits a little narrower, if it breaks them."""
    zero = np.zeros(len(most))
    near = Problem(
        plan=problem.plan, criteria=problem.criteria,
        eta_v=problem.eta_v * (1 - KEPT), eta_a=problem.eta_a * (1 - KEPT),
    )  # fmt: skip
    for _ in range(6):
        if _merit(problem, at, zero, most)[1] <= KEPT:
            break
        change = _step(near, at, zero, most * (1 - KEPT), 1e-3)
        there = None if change is None else near.motion(at.gamma + change, at.q, at.posture)
        if there is None:
            break
        at = there
    return at


def attacks(
    front: ParetoSet, options: PlanOptions, *, seed: int = 0, say: Callable[[str], None] = print
) -> list[Attack]:
    """Return the best attack on every plan of a front."""
    rng, found = np.random.default_rng(seed), []
    plans = front.plans
    own = [_of(plan) for plan in plans]
    for i, plan in enumerate(plans):
        problem = Problem(
            plan=plan, criteria=front.criteria,
            eta_v=options.eta_v, eta_a=options.eta_a,
        )  # fmt: skip
        least = problem.losses(own[i])
        assert problem.excess(own[i]) < 1e-5, problem.excess(own[i])
        expected = front.values[i] * front.sense
        expected = np.where(front.sense > 0, expected, 1 / np.abs(expected))
        assert np.allclose(least, expected, rtol=1e-6), (least, expected)
        apart = np.abs(front.scaled - front.scaled[i]).max(axis=1)
        near = [j for j in np.argsort(apart, kind="stable") if j != i][:NEIGHBOURS]
        begin = [("neighbour", own[j]) for j in near]
        for change in CHANGES:
            wave = _wave(rng, len(own[i].gamma)) * change
            moved = problem.motion(own[i].gamma + wave, own[i].q, own[i].posture)
            if moved is not None:
                begin.append(("change", moved))
        size = np.maximum(least, SMALL * np.abs(front.reference - front.ideal))
        scale, least = 1 / size, np.maximum(least, SMALL * size)
        tries = list[tuple[str, _Motion, Array]]()
        for c in range(len(least)):
            weights = scale * np.where(np.arange(len(least)) == c, 1.0, OTHERS)
            tries.append(("itself", own[i], weights))
        tries += [(name, at, scale / len(least)) for name, at in begin]
        best = Attack(0.0, "-", "-", True)
        for name, at, weights in tries:
            first = FIRST if name != "neighbour" else 3 * FIRST
            ended = _descent(problem, at, weights, least, first)
            ended = _restored(problem, ended, least)
            losses = problem.losses(ended)
            if problem.excess(ended) > 2 * KEPT or (losses > least * (1 + 2 * KEPT)).any():
                continue
            gains = (least - losses) / size
            c = int(gains.argmax())
            if gains[c] > best.gain:
                best = Attack(float(gains[c]), front.criteria[c], name, _valid(plan, ended))
        found.append(best)
        say(f"{i} {least.round(4)} run {front.numbers[i]} {best} programs {problem.programs}")
    return found


def _of(plan: Plan) -> _Motion:
    return _Motion(gamma=np.unwrap(plan.gamma), q=np.array(plan.unwrapped), posture=plan.posture)


def _valid(plan: Plan, at: _Motion) -> bool:
    q, turn = on_turns(plan.robot, at.q)
    made = replace(plan, q=q, gamma=(at.gamma + np.pi) % (2 * np.pi) - np.pi, turn=turn)
    wrong = audit(made, interpolation=made.settings.interpolation)
    codes = {issue.code for issue in wrong} - {"cost"}
    return not codes


def _wave(rng: np.random.Generator, K: int) -> Array:
    t, wave = np.linspace(0, np.pi, K), np.zeros(K)
    for m in range(5):
        wave += rng.normal() / (1 + m) * np.cos(m * t + rng.uniform(0, 2 * np.pi))
    return np.asarray(wave / np.abs(wave).max())
