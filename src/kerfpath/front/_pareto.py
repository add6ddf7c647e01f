"""pareto(): many runs of the planner over one graph, and the plans that none of them beats."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, Literal, get_args

import moocore
import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, freeze
from kerfpath.auditor import audit as full_audit
from kerfpath.cell import Cell
from kerfpath.comfort import Comfort
from kerfpath.contour import Contour, FrameKind
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.front._adaptive import AT_ONCE, Adaptive, Made, reach_of
from kerfpath.front._criteria import Criterion, criteria_of, losses
from kerfpath.front._runs import WINDOW, Run, anchors, grid, whole, within
from kerfpath.front._set import ParetoSet
from kerfpath.graph import LayeredGraph
from kerfpath.planner import layered_graph, node_interval, plan, relaxations
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.search import Closure
from kerfpath.tilt import Tilt

__all__ = ["Search", "pareto"]

Search = Literal["adaptive", "grid"]

LEAST_ROOM = 0.1
"""Share of an ideal value by which the reference is beyond the worst, at least."""
TINY = 1e-9
"""Of whatever unit: where an ideal value is zero."""
RUN_OPTIONS = ("objective", "metric", "weights", "eta_v", "eta_a")
_Found = Plan | NoFeasiblePath | Sequence[object]
"""What comes of a run: a plan, why there is none, or what is wrong with it."""


def pareto(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | None = None,
    criteria: Sequence[str] = ("displacement", "velocity", "range"),
    runs: int = 100,
    search: Search = "adaptive",
    seed: int = 0,
    gamma_step: float = np.pi / 180,
    frames: FrameKind = "rotation-minimising",
    tilt: Tilt | None = None,
    postures: Sequence[int] | None = None,
    eta_v: float = 1.0,
    eta_a: float = 1.0,
    closure: Closure = "free",
    cell: Cell | None = None,
    comfort: Comfort | None = None,
    graph: LayeredGraph | None = None,
    audit: Callable[[Plan], Sequence[object]] | None = None,
    workers: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> ParetoSet:
    """Return plans of which none is as good as another in all criteria and better in one.

    The designer's collection of section 3.2: the layered graph is built once, and the planner run
    over it with other objectives, metrics, weights and eta, and with windows on the joints, which
    are the epsilon constraint for the range (9). Every plan is the proved optimum of what its run
    asked for.

    Parameters
    ----------
    contour, robot, tool, placement, speed, gamma_step, frames, tilt, postures, closure
        As in `kerfpath.plan`.
    criteria : sequence of str
        Less is better of: "displacement" (7) and "range" (9), over the joints' velocity limits and
        added up (s); "velocity", the largest increment (8) of any joint, and "acceleration", as
        shares of the limits; "displacement_J", "increment_J" and "range_J" of joint J, from 1
        (rad, of a rail m). More is better of the measures of `kerfpath.comfort`, at their least.
    runs : int
        How often the planner is run.
    search : {"adaptive", "grid"}
        Where the front is sparse, or over a plain grid of weights and eta.
    seed : int
        Of all that is random; the same seed gives the same set, whatever `workers`.
    eta_v, eta_a : float
        Largest share of the velocity and acceleration limits that any run may use.
    cell, comfort : optional
        As in `kerfpath.plan`; in a cell runs go one after another.
    graph : LayeredGraph, optional
        The layered graph of this very task, kept from `kerfpath.planner.layered_graph`.
    audit : callable, optional
        Returns what is wrong with a plan; only plans with nothing wrong are kept. Default:
        `kerfpath.audit`, with the cell.
    workers : int, optional
        Runs at a time, in threads; default: the processor's cores.
    progress : callable, optional
        Called with the number of runs done since the last call.

    Raises
    ------
    NoFeasiblePath
        No run has a plan that passes its audit; `counts` says why not, by number of runs.
    InputError
        Unknown criteria or search, fewer than one run, and what `kerfpath.plan` refuses.
    """
    wanted = criteria_of(criteria, robot)
    if search not in get_args(Search):
        raise InputError(f"search: expected one of {', '.join(get_args(Search))}, got {search!r}")
    runs, workers = (
        _number(runs, "runs"),
        _number((os.cpu_count() or 1) if workers is None else workers, "workers"),
    )
    if graph is None:
        graph = layered_graph(
            contour,
            robot,
            tool=tool,
            placement=placement,
            gamma_step=gamma_step,
            frames=frames,
            tilt=tilt,
            postures=postures,
            comfort=comfort,
        )
    runner = _Runner(
        contour=contour,
        robot=robot,
        graph=graph,
        criteria=wanted,
        options={
            "tool": tool,
            "placement": placement,
            "speed": speed,
            "gamma_step": gamma_step,
            "frames": frames,
            "tilt": tilt,
            "closure": closure,
            "cell": cell,
            "comfort": comfort,
        },
        audit=audit or (lambda made: full_audit(made, cell=cell)),
    )
    velocity, _ = robot.speed_limits()
    first = whole(freeze(1 / (velocity * node_interval(contour, speed))), eta_v, eta_a)
    (found,) = runner.do([first], map)
    if isinstance(found, NoFeasiblePath):
        raise found.retold(f"{found}; no run can have a plan: this one had all that is allowed")
    least = None
    if runs > 1 and any(c.kind == "acceleration" for c in wanted):
        least = relaxations(contour, robot, graph, speed, eta_v=eta_v, eta_a=eta_a).eta_a
    rng, todo = np.random.default_rng(seed), anchors(first, wanted, least)
    runner.beginning += len(todo)
    plain, adaptive = grid(first, rng), Adaptive(wanted, [first, *todo], robot, graph, rng)
    with ThreadPoolExecutor(1 if cell else workers) as pool:
        told = 0
        while True:
            runner.do(todo[: runs - runner.tried], pool.map)
            if progress is not None:
                progress(runner.tried - told)
            told = runner.tried
            if runner.tried == runs:
                return runner.result(tuple(criteria))
            if search == "adaptive" and runner.made:
                ideal, reference = runner.box()
                todo = adaptive.next(runner.front(), reference - ideal)
            else:
                todo = list(islice(plain, AT_ONCE))


@dataclass(slots=True, kw_only=True, eq=False)
class _Runner:
    """Does runs over one graph, and keeps what they came to."""

    contour: Contour
    robot: Robot
    graph: LayeredGraph
    criteria: tuple[Criterion, ...]
    options: dict[str, Any]
    audit: Callable[[Plan], Sequence[object]]
    tried: int = 0
    beginning: int = 1
    made: list[Made] = field(default_factory=list)
    failures: Counter[str] = field(default_factory=Counter)

    def do(self, runs: Sequence[Run], each: Callable[..., Iterable[_Found]]) -> list[_Found]:
        """Do some runs, `each` like map; which plans come of them depends on no clock."""
        outcomes = list(each(self._plan, runs))
        for run, found in zip(runs, outcomes, strict=True):
            if isinstance(found, Plan):
                self.made.append(
                    Made(
                        number=self.tried,
                        run=run,
                        plan=found,
                        losses=losses(found, self.criteria),
                        reach=reach_of(found),
                    )
                )
            else:
                self.failures[_why(found)] += 1
            self.tried += 1
        return outcomes

    def _plan(self, run: Run) -> _Found:
        graph = within(self.graph, run.window, self.robot.endless)
        wish = {name: getattr(run, name) for name in RUN_OPTIONS}
        try:
            made = plan(self.contour, self.robot, graph=graph, **wish, **self.options)
        except NoFeasiblePath as broken:
            return broken
        return self.audit(made) or made

    def front(self) -> list[Made]:
        """Return those that none dominates, of equal ones the first."""
        kept = moocore.is_nondominated(np.array([made.losses for made in self.made]))
        return [made for made, keep in zip(self.made, kept, strict=True) if keep]

    def box(self) -> tuple[Array, Array]:
        """Return the ideal and the reference (C,) that the first runs leave, less being better.

        The reference is beyond their worst by as much as that is from the ideal, and by a share
        of it at least. Later runs do not move them, so that hypervolumes are comparable.
        """
        some = [made for made in self.made if made.number < self.beginning] or self.made[:1]
        values = np.array([made.losses for made in some])
        ideal, worst = values.min(axis=0), values.max(axis=0)
        return ideal, worst + np.maximum(worst - ideal, LEAST_ROOM * np.abs(ideal) + TINY)

    def result(self, names: tuple[str, ...]) -> ParetoSet:
        """Return the Pareto set; raise NoFeasiblePath where it is empty."""
        failures = dict(self.failures.most_common())
        if not self.made:
            told = ", ".join(f"{why}: {number}" for why, number in failures.items())
            raise NoFeasiblePath(
                f"contour {self.contour.name!r}: none of {self.tried} runs has a plan; {told}",
                proved=False,
                node=-1,
                counts=failures,
            )
        front = sorted(self.front(), key=lambda made: (*made.losses,))
        sense = np.array([c.sense for c in self.criteria])
        ideal, reference = self.box()
        return ParetoSet(
            criteria=names,
            units=tuple(c.unit for c in self.criteria),
            plans=tuple(made.plan for made in front),
            runs=tuple(made.run for made in front),
            values=freeze(sense * np.array([made.losses for made in front])),
            ideal=freeze(sense * ideal),
            reference=freeze(sense * reference),
            tried=self.tried,
            feasible=len(self.made),
            failures=failures,
        )


def _why(found: NoFeasiblePath | Sequence[object]) -> str:
    """Say in a few words why a run has no plan that can be kept."""
    if not isinstance(found, NoFeasiblePath):
        return f"audit: {getattr(found[0], 'code', found[0])}"
    windows = [why for why in found.counts if why.startswith(WINDOW)]
    if windows:
        return f"no pose in the {windows[0]}"
    most = max(found.counts, key=lambda why: found.counts[why], default="the seam")
    return f"no edge within {most}"


def _number(value: int, name: str) -> int:
    if not isinstance(value, int) or value < 1:
        raise InputError(f"{name}: expected a whole number, at least 1, got {value!r}")
    return value
