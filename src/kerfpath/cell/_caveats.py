"""Caveats: sentences for plans, reports and audits about what a cell does not prove."""

from __future__ import annotations

from kerfpath.cell._cell import Cell
from kerfpath.cell._pairs import BY_DESIGN, MEANT

__all__ = ["UNPROVED", "caveats", "odd_sizes"]

UNPROVED = "links drawn as capsules need not hold the real ones"
"""Text that follows "clear" wherever links are not known."""

LARGE, SMALL = {"robot": 1.0, "head": 1.0, "part": 5.0, "fixture": 20.0}, 0.005
"""Largest and smallest likely sizes in lengths of the arm; others suggest a wrong unit."""


def caveats(cell: Cell) -> tuple[str, ...]:
    """Return a sentence for each thing that a cell does not prove, or keeps less than requested.

    These are bodies that need not hold the real ones, pairs of the head or listed pairs that are
    not judged, pairs that may overlap by design, and pairs that cannot keep the requested distance.
    """
    said = []
    if cell.unproved:
        said.append(
            f"Not proved for the real links: {', '.join(cell.unproved)} are capsules of typical "
            "sizes, which need not hold the real ones. Check in a simulation that the links are "
            "clear of each other and of head, part and fixtures, or plan with the meshes of the "
            "robot's description."
        )
    kind = {body.name: body.kind for body in cell.bodies}
    left = {pair: why for pair, why in cell.unjudged.items() if why == BY_DESIGN}
    heads = [pair for pair in left if "head" in (kind[pair[0]], kind[pair[1]])]
    if heads:
        said.append(f"Not judged, as they touch at every pose by design: {_listed(heads)}.")
    allowed = {frozenset(pair) for pair in cell.may_touch}
    if meant := [
        f"{a} - {b}" + (f" ({why})" if why != MEANT else "")
        for (a, b), why in cell.unjudged.items()
        if {a, b} in allowed
    ]:
        said.append(f"Not judged, as they may touch: {', '.join(meant)}.")
    rows = zip(cell.pair_names, cell.asked, cell.required, cell.depth, strict=True)
    deep, less = [], []
    for (a, b), asked, required, depth in rows:
        if depth > 0:
            deep.append(f"{a} - {b} {depth * 1e3:g} mm")
        elif required < asked:
            less.append(f"{a} - {b} {required * 1e3:.3g} of {asked * 1e3:g} mm")
    if deep:
        said.append(
            f"Judged only for overlaps deeper than by design, which are: {', '.join(deep)}."
        )
    if less:
        said.append(f"Closer than requested by design, so these keep only: {', '.join(less)}.")
    return tuple(said)


def odd_sizes(cell: Cell) -> tuple[str, ...]:
    """Return a sentence for each body whose size is unlikely, given the arm's length."""
    arm = cell.chain.length
    said = []
    for body in (body for body in cell.bodies if body.kind != "floor"):
        size = float(body.size.max())
        most = LARGE[body.kind] * arm
        if not SMALL * arm <= size <= most:
            said.append(
                f"{body.name!r} is {size * 1e3:.4g} mm long, and the arm {arm * 1e3:.4g} mm: "
                "is its unit right?"
            )
    return tuple(said)


def _listed(pairs: list[tuple[str, str]]) -> str:
    return ", ".join(f"{a} - {b}" for a, b in pairs)
