"""The task of the study of a layout: what the worst of some placements is worth."""

from __future__ import annotations

from kerfpath.study._job import loaded
from kerfpath.study.placing._place import moved, numbers_of
from kerfpath.study.placing._subject import middle_of, subjects_of
from kerfpath.study.placing._worth import Answer, Worth, beats, worst_of

__all__ = ["look"]


def look(
    *,
    job: str,
    digest: str,
    goal: str,
    places: list[dict[str, float]],
    stretches: list[list[int]],
    exact: bool = False,
    whole: bool = False,
    floor: float | None = None,
) -> Answer:
    """Return what the worst of some placements is worth: a task of a sweep.

    Parameters
    ----------
    job, digest
        As in `loaded`.
    goal : {"speed", "margin", "motion"}
        m/min of the slowest contour, least share of the asked speeds, or displacement (14).
    places : list of mapping
        Offsets by variable; the first is the nominal placement, others are its errors.
    stretches : list of (contour, first node, last node)
        Solved for the bound.
    exact : bool
        Also solve the contours, unless they are lost before.
    whole : bool
        Solve every contour of the nominal placement to its own optimum.
    floor : float, optional
        Nobody asks for values that do not beat it.

    Returns
    -------
    dict
        "status": "feasible", or why not: "unreachable", "collision", "speed"; "stage": the test
        that decided; "bound": what the value cannot beat, None where that is not known; "value":
        exact, or None; "progress": how far an infeasible placement got; "contours": of the nominal
        one; "place": which was worst; "seconds" by test.
    """
    at = loaded(job, digest)
    subjects = subjects_of(job, digest, goal)
    middle = middle_of(at.job, subjects)
    seconds = dict.fromkeys(("reach", "stretch", "exact"), 0.0)
    worst: Answer = {}
    contours: list[Answer] = []
    for i, offsets in enumerate(places):
        numbers = numbers_of(at.job, offsets, middle)
        here = Worth(
            job=moved(at.job, numbers), part=at.part, goal=goal, subjects=subjects, seconds=seconds
        )
        found = here.answer(
            stretches, exact=exact, whole=whole and i == 0, floor=floor, least=worst.get("value")
        )
        contours = contours or found.pop("contours", [])
        found["place"] = i
        worst = found if not worst else _worse(goal, worst, found)
        beaten = floor is not None and worst["bound"] is not None
        if worst["status"] != "feasible" or (beaten and not beats(goal, worst["bound"], floor)):
            break
    return worst | {"contours": contours, "seconds": seconds}


def _worse(goal: str, one: Answer, two: Answer) -> Answer:
    """Return what two placements are worth together."""
    if two["status"] != "feasible":
        return two
    both = [one, two]
    bounds = [found["bound"] for found in both if found["bound"] is not None]
    bound = worst_of(goal, bounds) if bounds else None
    values = [found["value"] for found in both]
    value = None if None in values else worst_of(goal, values)
    place = one["place"] if bound == one["bound"] else two["place"]
    return two | {"bound": bound, "value": value, "place": place}
