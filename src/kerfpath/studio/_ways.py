"""Changes that may make a path where there is none, as edits of the job."""

from __future__ import annotations

from kerfpath.job import CutResult
from kerfpath.studio._messages import EditEntry, Option

__all__ = ["ways_of"]


def ways_of(cut: CutResult, index: int) -> list[Option]:
    """Return possible changes for a cut without a plan, first those that gave one.

    Parameters
    ----------
    cut : CutResult
        A cut without a plan, with its advice.
    index : int
        Index of its [[contour]] table in the job.
    """
    found, advice = list[Option](), cut.advice
    if advice is not None:
        if advice.without_windows:
            pins = EditEntry(path=["contour", index, "gamma_windows"], value=None)
            found.append(Option(label="remove the pinned windows of gamma", edits=[pins]))
        if advice.other_method:
            found.append(_plan('search the grid exactly: method = "exact"', "method", "exact"))
        for speed in (advice.refined, advice.speed):
            if speed is not None:
                found.append(
                    Option(
                        label=f"cut slower: {speed} m/min instead of "
                        f"{cut.request.task.speed * 60:g} m/min",
                        edits=[
                            EditEntry(path=["contour", index, "speed_m_min"], value=float(speed))
                        ],
                    )
                )
        for key, value in advice.shares.items():
            which = "velocity" if key == "eta_velocity" else "acceleration"
            words = f"use more of the {which} limits: {key} = {value}"
            found.append(_plan(words, key, float(value)))
    return found + _untried(cut)


def _untried(cut: CutResult) -> list[Option]:
    """Return changes that have not been tried and that the other options allow."""
    found, options = list[Option](), cut.request.options
    plain = options.closure == "free" and options.rotation is None and options.objective == "sum"
    grid = options.method in ("continuous", "exact")
    if plain and grid and options.feed == "constant" and options.interruptions == "none":
        found.append(_plan('not tried: slow down where needed: feed = "dip"', "feed", "dip"))
        words = 'not tried: cut in the fewest pieces: interruptions = "fewest"'
        found.append(_plan(words, "interruptions", "fewest"))
    if options.postures is not None:
        found.append(_plan("not tried: allow every posture", "posture", None))
    return found


def _plan(label: str, key: str, value: object) -> Option:
    return Option(label=label, edits=[EditEntry(path=["plan", key], value=value)])
