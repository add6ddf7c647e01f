"""Drawing frames and title blocks in a DXF, which are no lines to cut."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.cad.chains import Stroke, Style
from kerfpath.cad.curves import Line
from kerfpath.cad.part import Loop
from kerfpath.cad.units import MM

Choice = Literal["leave_out", "cut"]
"""What to do with a drawing frame."""
NAMED = re.compile(
    r"title.?bl|schriftfeld|schriftkopf|(?:zeichnungs|blatt)rahmen|cartouche|cartiglio|cajet[ií]n"
    r"|(?:drawing|sheet|page|paper).?(?:frame|border)|(?:frame|border).?(?:a[0-4]|sheet)\b",
    re.IGNORECASE,
)
"""Names of layers and blocks that only drawing frames and title blocks have."""
SHARE = 1e-3
"""Lines on a side of a frame, or that meet it, are this close to it, as a share of its size."""
COVERED = 0.98
"""Share of each side of a frame that is drawn."""
BLOCK_SHARE = 0.25
"""Largest share of the area of a frame that its title block takes."""
FIELDS = 4
"""Fewest lines of a title block without a text, as where the texts are drawn as lines."""
MARK = 0.05
"""Longest mark on a side of a frame, as a share of its size."""
MOST_JOINED = 3000
"""Most lines that are followed from the sides of a frame."""
MOST_FRAMES = 4
"""Most rectangles around each other."""
ASK = (
    'it seems to be a drawing frame: write drawing_frame = "leave_out" in [part], or "cut" if it '
    "is to be cut (--drawing-frame)"
)
"""What is asked where a frame is only recognised by its shape."""


class DrawingFrame(NamedTuple):
    """Strokes of a drawing frame, by style and number, and whether it has a title block."""

    strokes: frozenset[tuple[Style, int]]
    has_title: bool


def drawing_frame(
    drawn: Mapping[Style, Sequence[Stroke]], texts: Sequence[Array]
) -> DrawingFrame | None:
    """Return the frame of a drawing, or None if no rectangle is around all else.

    With a title block, these are all rectangles around each other up to that which it joins, the
    marks on their sides, and all lines that join it. A title block is of lines along x and y that
    take a small part of the frame, with a text inside, or at least `FIELDS` of them in a corner.
    Without one it is the outer rectangle.

    Parameters
    ----------
    drawn : mapping of Style to sequence of Stroke
    texts : sequence of (3,) mm
        Places of the texts in the drawing.
    """
    keys = [(style, k) for style, strokes in drawn.items() for k in range(len(strokes))]
    lines = _Lines([stroke for each in drawn.values() for stroke in each])
    left = np.ones(len(keys), dtype=bool)
    frames, marks = list[Ints](), list[Ints]()
    while len(frames) < MOST_FRAMES:
        box = _around(lines.boxes[left[lines.owner]])
        near = SHARE * float(np.ptp(box, axis=0).max())
        sides = lines.on_sides(left, box, near)
        if sides.size in (0, np.count_nonzero(left)):
            break
        frames.append(sides)
        left[sides] = False
        marks.append(lines.marks(left, box, near))
        left[marks[-1]] = False
        blocks = [
            (group, around)
            for group, around in lines.joined(left, box, near)
            if np.ptp(around, axis=0).prod() <= BLOCK_SHARE * np.ptp(box, axis=0).prod()
        ]
        if any(
            _has_text(around, texts) or lines.are_fields(group, around, box, near)
            for group, around in blocks
        ):
            taken = np.concatenate([*frames, *marks, *(group for group, _ in blocks)])
            return DrawingFrame(frozenset(keys[k] for k in taken.tolist()), True)
    return DrawingFrame(frozenset(keys[k] for k in frames[0].tolist()), False) if frames else None


def is_around_islands(loops: Sequence[Loop]) -> bool:
    """Return whether one loop is around all others, and outlines are among those inside it."""
    closed = [loop for loop in loops if loop.closed]
    box = _around(np.array([loop.bounding_box[:, :2] for loop in loops]))
    around = [bool(np.abs(loop.bounding_box[:, :2] - box).max() <= SHARE * MM) for loop in closed]
    others = [loop for loop, is_around in zip(closed, around, strict=True) if not is_around]
    return sum(around) == 1 and any(loop.kind == "outer" for loop in others)


def _around(boxes: Array) -> Array:
    """Return the box (2, 2) around boxes (N, 2, 2)."""
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def _has_text(box: Array, texts: Sequence[Array]) -> bool:
    return any(bool((box[0] <= at[:2]).all() and (at[:2] <= box[1]).all()) for at in texts)


class _Lines:
    """The curves of strokes: their boxes, those that are lines along x or y, and their strokes."""

    def __init__(self, strokes: Sequence[Stroke]) -> None:
        curves = [curve for stroke in strokes for curve in stroke]
        self.boxes = np.array([curve.bounds()[:, :2] for curve in curves])
        """(M, 2, 2) mm: least and greatest x and y of each curve."""
        self.owner = np.repeat(np.arange(len(strokes)), [len(stroke) for stroke in strokes])
        """(M,): its stroke."""
        sizes = np.ptp(self.boxes, axis=1)
        is_line = np.array([isinstance(curve, Line) for curve in curves])
        thin = sizes.min(axis=1) <= SHARE * sizes.max(axis=1)
        self._straight = self._of_all(is_line & thin)

    def _of_all(self, true: Bools) -> Bools:
        """Return for each stroke whether something is true of all its curves (M,)."""
        return np.asarray(np.bincount(self.owner, ~true) == 0)

    def on_sides(self, left: Bools, box: Array, near: float) -> Ints:
        """Return those of the strokes `left` that lie on the sides of a box; none if these gape."""
        off = np.abs(self.boxes[:, :, None, :] - box)  # of each end of a curve from each side
        on = np.asarray((off <= near).all(axis=1))
        sides = left & self._straight & self._of_all(np.asarray(on.any(axis=(1, 2))))
        for side, axis in ((0, 0), (1, 0), (0, 1), (1, 1)):
            there = on[:, side, axis] & sides[self.owner]
            spans = self.boxes[there][:, :, 1 - axis]
            spans = spans[np.argsort(spans[:, 0])]
            upto = np.maximum.accumulate(np.append(box[0, 1 - axis], spans[:, 1]))
            gaps = np.append(spans[:, 0], box[1, 1 - axis]) - upto
            if np.maximum(gaps, 0.0).sum() > (1 - COVERED) * np.ptp(box[:, 1 - axis]):
                return np.zeros(0, dtype=np.int64)
        return np.flatnonzero(sides)

    def marks(self, left: Bools, box: Array, near: float) -> Ints:
        """Return those of the strokes `left` that are short lines from the sides of a box."""
        short = np.ptp(self.boxes, axis=1).max(axis=1) <= MARK * np.ptp(box, axis=0).max()
        touch = np.bincount(self.owner, self._touches(box, near)) > 0
        return np.flatnonzero(left & self._straight & self._of_all(short) & touch)

    def _touches(self, box: Array, near: float) -> Bools:
        low, high = self.boxes[:, 0, None], self.boxes[:, 1, None]
        return np.asarray(((low <= box + near) & (high >= box - near)).any(axis=(1, 2)))

    def are_fields(self, group: Ints, around: Array, box: Array, near: float) -> bool:
        """Return whether strokes are the fields in a corner of a box, with their box `around`."""
        many = np.isin(self.owner, group).sum() >= FIELDS
        at_sides = (np.abs(around - box) <= near).any(axis=0)
        return bool(many and at_sides.all() and (np.ptp(around, axis=0) > near).all())

    def joined(self, left: Bools, box: Array, near: float) -> list[tuple[Ints, Array]]:
        """Return groups of strokes `left` that join the sides of a box, each with the box around.

        The lines of a group touch each other, and one of them touches a side.
        """
        unseen = (left & self._straight)[self.owner]
        groups, looked_at = [], 0
        for seed in np.flatnonzero(unseen & self._touches(box, near)).tolist():
            if not unseen[seed]:
                continue
            front, members = [seed], list[int]()
            while front and looked_at < MOST_JOINED:
                looked_at += 1
                members.append(k := front.pop())
                unseen[k] = False
                meets = (self.boxes[:, 0] <= self.boxes[k, 1] + near).all(axis=1)
                meets &= (self.boxes[:, 1] >= self.boxes[k, 0] - near).all(axis=1)
                more = np.flatnonzero(unseen & (meets | (self.owner == self.owner[k])))
                unseen[more] = False
                front += more.tolist()
            groups.append((np.unique(self.owner[members]), _around(self.boxes[members])))
        return groups
