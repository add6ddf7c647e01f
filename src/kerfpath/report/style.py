"""Colours and the common layout of all figures."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import cycle
from textwrap import wrap
from typing import Any

import numpy as np
import plotly.graph_objects as go

from kerfpath.arrays import Array
from kerfpath.losses import Loss, Reason
from kerfpath.robots import Robot

INK, QUIET, FAINT, GRID = "#1d2530", "#5b6675", "#98a1ad", "#e6e9ee"
ACCENT, ALERT, CHOSEN = "#0b6b66", "#b3261e", "#e8590c"
SCALE = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151")
"""Viridis up to four fifths; lighter colours do not show on white."""
DARK_SCALE = ("#fde725", "#7ad151", "#22a884", "#2a788e", "#414487")
"""Viridis from its light end down to a fifth; darker colours do not show on a dark page."""

# Six hues with a light and a dark shade each, from a search in which all pairs differ by a CIELAB
# distance of 12 for normal, protan and deutan sight (Machado, Oliveira, Fernandes 2009).
JOINT_COLOURS = ("#0061cc", "#f4a918", "#0ea069", "#df5ac2", "#f05d16", "#55bdff")
SEVENTH_COLOUR = "#8a8d00"
EXTERNAL_COLOURS = ("#6b4fbb", "#7a5c3e", "#5b6675")
"""Colours of external axes, whose lines also have names."""
_LOW = ("#4089d9", "#fce3b4", "#6bc5a3", "#f6ceed", "#f6a076", "#86d0ff")
_HIGH = ("#003875", "#be8313", "#09603f", "#c34fa9", "#742d0b", "#2f688d")
_REASONS = {
    Reason(Loss.ADMITTED): "#eef7ee",
    Reason(Loss.UNREACHABLE): "#b4bac4",
    Reason(Loss.UNWANTED): "#d9d4e2",
    Reason(Loss.COLLISION): "#d7263d",
    Reason(Loss.PINNED): "#c9d3dc",
    **{Reason(Loss.LOW, f"joint {i + 1}"): colour for i, colour in enumerate(_LOW)},
    **{Reason(Loss.HIGH, f"joint {i + 1}"): colour for i, colour in enumerate(_HIGH)},
}
_SPARE = ("#d3e7a4", "#f7c46c", "#f08a4b")
_OTHER_REASONS = ("#7a7f88", "#33373e")

FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif'


def reason_colours(reasons: Sequence[Reason]) -> tuple[str, ...]:
    """Return one colour per reason: the joint's light shade below its limits, dark above them.

    Clearances run from green to orange. Reasons without their own colour (couplings, low and
    high) alternate between two greys.
    """
    greys, spare = cycle(_OTHER_REASONS), cycle(_SPARE)
    return tuple(
        _REASONS[why] if why in _REASONS else next(spare if why.loss is Loss.SPARE else greys)
        for why in reasons
    )


def joint_colours(robot: Robot) -> tuple[str, ...]:
    """Return a colour for each joint of a robot, external axes last."""
    arm = (*JOINT_COLOURS, SEVENTH_COLOUR)[: robot.family.joints]
    return arm + EXTERNAL_COLOURS[: len(robot.externals)]


def base_layout(height: int, **more: Any) -> go.Layout:
    """Return a plain white layout of `height` px, without plotly's default template."""
    look: dict[str, object] = {
        "template": go.layout.Template(),
        "height": height,
        "font": {"family": FONT, "size": 12, "color": INK},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "margin": {"l": 62, "r": 16, "t": 24, "b": 46},
        "hoverlabel": {
            "bgcolor": "white",
            "bordercolor": FAINT,
            "font": {"family": FONT, "size": 12, "color": INK},
        },
    }
    return go.Layout(**(look | more))


def seen_by(camera: dict[str, Any]) -> dict[str, Any]:
    """Return a scene's camera, and a way of dragging that keeps it: turntables turn z upright."""
    return {"camera": camera, "dragmode": "turntable" if camera["up"]["z"] == 1 else "orbit"}


def axis(**more: Any) -> dict[str, object]:
    """Return the look of a plot axis."""
    return {
        "showgrid": True,
        "gridcolor": GRID,
        "zeroline": False,
        "showline": True,
        "linecolor": FAINT,
        "ticks": "outside",
        "ticklen": 4,
        "tickcolor": FAINT,
        "tickfont": {"size": 11, "color": QUIET},
        "title": {"font": {"size": 12, "color": QUIET}},
    } | more


def short(values: Array) -> Any:
    """Return `values` in single precision, whose seven digits are enough for a screen."""
    return values.astype(np.float32)


def axis_title(text: str) -> dict[str, object]:
    """Return an axis title."""
    return {"text": text, "font": {"size": 12, "color": QUIET}, "standoff": 8}


def axis_id(kind: str, panel: int) -> str:
    """Return the name of an axis ("x", "yaxis") of a panel, counted from 0, as plotly counts it."""
    return kind if panel == 0 else f"{kind}{panel + 1}"


def label(
    text: str, at: tuple[tuple[float, str], tuple[float, str]], *, size: int = 12,
    colour: str = QUIET, **anchor: Any,
) -> dict[str, object]:  # fmt: skip
    """Return a text without an arrow; `at` has its x and y, each with what they refer to."""
    (x, xref), (y, yref) = at
    return {
        "text": text,
        "font": {"size": size, "color": colour},
        "x": x,
        "xref": xref,
        "y": y,
        "yref": yref,
        "showarrow": False,
    } | anchor


def say_why_empty(figure: go.Figure, why: str) -> None:
    """Say in the middle of a figure why nothing is drawn in it."""
    figure.add_annotation(
        text="<br>".join(wrap(escape(why, quote=False), 90)),
        font={"size": 14, "color": QUIET},
        x=0.5,
        y=0.5,
        xref="paper",
        yref="paper",
        showarrow=False,
    )


def band(x0: float, x1: float, **where: Any) -> dict[str, object]:
    """Return a pale vertical band from x0 to x1, below the lines."""
    return {
        "type": "rect",
        "x0": x0,
        "x1": x1,
        "y0": 0,
        "y1": 1,
        "fillcolor": "#eef2f6",
        "line": {"width": 0},
        "layer": "below",
    } | where
