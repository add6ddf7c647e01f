"""The task of the layout study: evaluate a placement together with its errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import lru_cache

from kerfpath.contour import Contour
from kerfpath.study._evaluator import SampledContour, sample_contours
from kerfpath.study._job import load_job
from kerfpath.study.placing._evaluator import PlacementEvaluator
from kerfpath.study.placing._off_grid import OffGridEvaluator, leaves_grid
from kerfpath.study.placing._place import middle_of, move_job, numbers_of
from kerfpath.study.placing._value import ContourValue, PlacementValue, is_better, worst_of

__all__ = ["contours_of", "evaluate_placements", "nodes_of"]


def evaluate_placements(
    *,
    job: str,
    digest: str,
    goal: str,
    places: list[dict[str, float]],
    stretches: list[list[int]],
    exact: bool = False,
    whole: bool = False,
    prove: bool = False,
    floor: float | None = None,
) -> dict[str, object]:
    """Return the `PlacementValue` of the worst of several placements; the task of a sweep.

    They are evaluated over continuous gamma if the job's method is "continuous", otherwise on its
    grid.

    Parameters
    ----------
    job, digest
        As in `load_job`.
    goal : {"speed", "margin", "motion"}
    places : list of mapping
        Offsets by variable; the first is the nominal placement, the others are its errors.
    stretches : list of (contour, first node, last node)
        Stretches that are solved for the bound or the estimate.
    exact : bool
        Also solve the contours, unless the placement is infeasible before.
    whole : bool
        Solve every contour of the nominal placement to its own optimum.
    prove : bool
        Over continuous gamma: only try to prove by the stretches that no motion is faster than the
        floor.
    floor : float, optional
        Best value so far; values that do not beat it need not be exact.
    """
    known = load_job(job, digest)
    contours = contours_of(job, digest, goal)
    middle = middle_of(known.job, nodes_of(contours))
    of_contours: tuple[ContourValue, ...] = ()
    worst: PlacementValue | None = None
    for i, offsets in enumerate(places):
        kind = OffGridEvaluator if leaves_grid(known.job) else PlacementEvaluator
        evaluator = kind(
            job=move_job(known.job, numbers_of(known.job, offsets, middle)),
            part=known.part,
            goal=goal,
            contours=contours,
        )
        if prove and floor is not None and isinstance(evaluator, OffGridEvaluator):
            here = evaluator.disproved(stretches, floor)
        else:
            here = evaluator.evaluate(
                stretches,
                exact=exact,
                whole=whole and i == 0,
                floor=floor,
                least=None if worst is None else worst.value,
            )
        of_contours, here = of_contours or here.contours, replace(here, place=i)
        worst = here if worst is None else _worse(goal, worst, here)
        if not worst.feasible:
            break
        if (
            floor is not None
            and worst.bound is not None
            and not is_better(goal, worst.bound, floor)
        ):
            break
    assert worst is not None
    return asdict(replace(worst, contours=of_contours))


def _worse(goal: str, one: PlacementValue, two: PlacementValue) -> PlacementValue:
    """Return the worse of two placement values."""
    if not two.feasible:
        return two
    bound, estimate = (
        worst_of(goal, known) if (known := [v for v in pair if v is not None]) else None
        for pair in ((one.bound, two.bound), (one.estimate, two.estimate))
    )
    first = (one.bound, one.estimate) == (bound, estimate)
    exact = None if one.value is None or two.value is None else [one.value, two.value]
    return replace(
        two,
        bound=bound,
        value=None if exact is None else worst_of(goal, exact),
        estimate=estimate,
        slowest=one.slowest if first else two.slowest,
        place=one.place if first else two.place,
    )


@lru_cache(maxsize=2)
def contours_of(job: str, digest: str, goal: str) -> tuple[SampledContour, ...]:
    """Return the sampled contours of a job: each at one speed, or for "motion" at its speeds."""
    known = load_job(job, digest)
    return sample_contours(known.job, known.part, as_asked=goal == "motion")


def nodes_of(contours: Sequence[SampledContour]) -> list[Contour]:
    """Return the nodes of sampled contours."""
    return [contour.nodes for contour in contours]
