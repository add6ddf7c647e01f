"""Build named loops, and parts without faces, from the traces that the readers find."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kerfpath._arrays import freeze
from kerfpath.cad._left_out import LeftOut
from kerfpath.cad._part import Kind, Loop, Part
from kerfpath.cad._round import diameter, may_be_round
from kerfpath.cad._sample import Trace
from kerfpath.cad._units import LARGEST, MM
from kerfpath.errors import InputError

__all__ = ["loop_of", "named_loops", "part_without_faces"]

STEMS: dict[Kind, str] = {"outer": "outer", "inner": "hole", "open": "line"}
"""Last part of the names of loops, before their number."""


def loop_of(
    *,
    name: str,
    face: str,
    kind: Kind,
    trace: Trace,
    surface: str,
    gap: float,
    layer: str = "",
    colour: str = "",
) -> Loop:
    """Return the loop along `trace` with its measures; it is closed if no gap is above `gap` (m).

    Raises
    ------
    InputError
        A trace that is too long or reaches too far for any part.
    """
    length, box, widest = float(trace.lengths.sum()), trace.bounds(), trace.gaps.max(initial=0.0)
    if not (length <= LARGEST and (np.abs(box) <= LARGEST).all()):
        raise InputError(
            f"loop {name!r} reaches further than {LARGEST / 1e6:g} km; the file is damaged, or its "
            "unit is wrong"
        )
    is_round = kind != "open" and may_be_round(length, float(np.linalg.norm(trace.area)))
    return Loop(
        name=name,
        face=face,
        kind=kind,
        surface=surface,
        length=length * MM,
        bounding_box=freeze(box * MM),
        edges=len(trace.lengths),
        shortest_edge=float(trace.lengths.min()) * MM,
        largest_gap=float(widest) * MM,
        closed=kind != "open" and float(widest) * MM <= gap,
        diameter=diameter(trace.around * MM) if is_round else None,
        layer=layer,
        colour=colour,
        _trace=trace,
    )


def named_loops(
    found: Sequence[tuple[Kind, Trace, str]], *, face: str, surface: str, gap: float, layer: str
) -> list[Loop]:
    """Return the loops of a face, a skin or a layer, outer before inner, numbered by position.

    Parameters
    ----------
    found : sequence of (kind, trace, colour)
    face, surface, gap, layer
        As in `loop_of`.
    """
    loops = []
    for kind, stem in STEMS.items():
        alike = [(trace, colour) for k, trace, colour in found if k == kind]
        # Middles are rounded, so that last bits do not decide an order.
        alike.sort(key=lambda one: tuple((one[0].around.mean(axis=0).round(3) + 0.0).tolist()))
        for number, (trace, colour) in enumerate(alike, start=1):
            last = stem if kind == "outer" and len(alike) == 1 else f"{stem}{number}"
            loops.append(
                loop_of(
                    name=f"{face}/{last}", face=face, kind=kind, trace=trace, surface=surface,
                    gap=gap, layer=layer, colour=colour,
                )
            )  # fmt: skip
    return loops


def part_without_faces(
    path: Path,
    unit: str,
    loops: Sequence[Loop],
    *,
    gap: float,
    notes: Sequence[str],
    left_out: Sequence[LeftOut] = (),
) -> Part:
    """Return a part that is drawn by lines or points only."""
    boxes = np.array([loop.bounding_box for loop in loops])
    return Part(
        path=path,
        unit=unit,
        bounding_box=freeze(np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])),
        faces=0,
        loops=tuple(loops),
        notes=tuple(notes),
        left_out=tuple(left_out),
        _gap=gap,
    )
