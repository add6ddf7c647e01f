"""What would open a closed way, as edits of the job that can be tried."""

from __future__ import annotations

from kerfpath.job import CutResult
from kerfpath.studio._messages import EditEntry, Option

__all__ = ["ways_of"]


def ways_of(cut: CutResult, index: int) -> list[Option]:
    """Return what may be changed where a cut has no plan: first what has given one.

    Parameters
    ----------
    cut : CutResult
        Without a plan, advised.
    index : int
        Of its table in the job.
    """
    found, advice = list[Option](), cut.advice
    if advice is not None:
        if advice.without_windows:
            pins = EditEntry(path=["contour", index, "gamma_windows"], value=None)
            found.append(Option(label="without the pinned windows of gamma", edits=[pins]))
        if advice.other_method:
            found.append(_plan('search the grid exactly: method = "exact"', "method", "exact"))
        for speed in (advice.refined, advice.speed):
            if speed is not None:
                found.append(
                    Option(
                        label=f"slower: {speed} m/min in place of "
                        f"{cut.request.task.speed * 60:g} m/min",
                        edits=[
                            EditEntry(path=["contour", index, "speed_m_min"], value=float(speed))
                        ],
                    )
                )
        for key, value in advice.shares.items():
            which = "velocity" if key == "eta_velocity" else "acceleration"
            words = f"more of the {which} limits: {key} = {value}"
            found.append(_plan(words, key, float(value)))
    return found + _untried(cut)


def _untried(cut: CutResult) -> list[Option]:
    """Return what nobody has tried, where the options that stand do not forbid it."""
    found, options = list[Option](), cut.request.options
    plain = options.closure == "free" and options.rotation is None and options.objective == "sum"
    grid = options.method in ("continuous", "exact")
    if plain and grid and options.feed == "constant" and options.interruptions == "none":
        found.append(_plan('not tried: slow down where it must: feed = "dip"', "feed", "dip"))
        words = 'not tried: cut in the fewest pieces: interruptions = "fewest"'
        found.append(_plan(words, "interruptions", "fewest"))
    if options.postures is not None:
        found.append(_plan("not tried: allow every posture", "posture", None))
    return found


def _plan(label: str, key: str, value: object) -> Option:
    return Option(label=label, edits=[EditEntry(path=["plan", key], value=value)])
