"""Messages that a page may send to the server; README.md in this folder defines their keys."""

from __future__ import annotations

from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, JsonValue, TypeAdapter

from kerfpath.job import VARIABLES, Goal

__all__ = [
    "Ask",
    "Cut",
    "Edit",
    "Edits",
    "FrontOf",
    "Keep",
    "LayoutOf",
    "Leave",
    "OfContour",
    "OfKept",
    "Place",
    "Plain",
    "PointOf",
    "ReachOf",
    "ReasonOf",
    "Relax",
    "Rename",
    "Save",
    "ShadeOf",
    "Take",
    "TechniqueOf",
    "Text",
    "TextOf",
    "parse",
]

_T = TypeVar("_T")
MOST_KEYS = 6
"""Largest number of parts in the path of a key: no job nests deeper."""
MOST_EDITS = 50
"""Largest number of keys that change in one step: no table of a job has more."""
MOST_WORDS = 200
"""Largest number of characters in a name: no contour has a longer one."""
MOST_LOOPS = 500
"""Largest number of loops that are added at once."""
MOST_TEXT = 10_000_000
"""Largest number of characters of a job, the limit of its reader."""


FARTHEST = 1e5
"""Largest offset of a placement, mm or deg."""


def _of_variables(table: dict[str, _T]) -> dict[str, _T]:
    """Return a table whose keys are variables of a layout."""
    if not table.keys() <= set(VARIABLES):
        raise ValueError(f"expected variables out of {', '.join(VARIABLES)}")
    return table


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if not span[0] < span[1]:
        raise ValueError("expected a range from a smaller to a larger value")
    return span


class _Strict(BaseModel):
    """A table of a message; it refuses unknown keys and cannot be changed."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


Words = Annotated[str, Field(max_length=MOST_WORDS)]
Index = Annotated[int, Field(ge=0, lt=1_000_000)]
Offset = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
Offsets = Annotated[dict[str, Offset], AfterValidator(_of_variables)]
Span = Annotated[tuple[Offset, Offset], Field(strict=False), AfterValidator(_rising)]
Ranges = Annotated[dict[str, Span], Field(min_length=1), AfterValidator(_of_variables)]
Path = Annotated[tuple[Words | Index, ...], Field(min_length=1, max_length=MOST_KEYS, strict=False)]


class Edit(_Strict):
    """Set one key of the job; null removes it."""

    type: Literal["edit"]
    path: Path
    value: JsonValue
    gesture: Words | None = None


class Change(_Strict):
    """One key of the job and its new value; null removes it."""

    path: Path
    value: JsonValue


class Edits(_Strict):
    """Set some keys of the job, in one step."""

    type: Literal["edits"]
    edits: Annotated[tuple[Change, ...], Field(min_length=1, max_length=MOST_EDITS, strict=False)]


class Text(_Strict):
    """Replace the text of the job."""

    type: Literal["text"]
    text: Annotated[str, Field(max_length=MOST_TEXT)]


class Plain(_Strict):
    """A request without parameters: undo, redo, plan again, or stop."""

    type: Literal["undo", "redo", "plan", "cancel"]


class Save(_Strict):
    """Write the job file."""

    type: Literal["save"]
    over: bool = False


class OfContour(_Strict):
    """A request about one contour."""

    type: Literal["focus", "map", "fastest"]
    contour: Words


class ReasonOf(_Strict):
    """Ask for the joints at a node and gamma, and the reason if they are lost."""

    type: Literal["reason"]
    contour: Words
    node: Index
    gamma: float
    posture: Annotated[int, Field(ge=0, lt=64)]


class ShadeOf(_Strict):
    """Ask for a quantity over the map of a contour; null stops its computation."""

    type: Literal["shade"]
    contour: Words
    by: Words | None


class TechniqueOf(_Strict):
    """Ask for the course of another technique along a contour; null stops its computation."""

    type: Literal["technique"]
    contour: Words
    method: Literal["paper", "known"] | None


class Relax(_Strict):
    """Make the edits of a relaxation."""

    type: Literal["relax"]
    contour: Words
    index: Index


class Cut(_Strict):
    """Make loops of the part contours of the job."""

    type: Literal["cut"]
    loops: Annotated[tuple[Words, ...], Field(min_length=1, max_length=MOST_LOOPS, strict=False)]


class Leave(_Strict):
    """Remove a [[contour]] table from the job."""

    type: Literal["leave"]
    index: Index


class Keep(_Strict):
    """Keep the current job with its plans, to compare it later."""

    type: Literal["keep"]
    name: Words | None = None


class Rename(_Strict):
    """Rename a kept job."""

    type: Literal["rename"]
    id: Index
    name: Words


class OfKept(_Strict):
    """Restore a kept job, or forget it."""

    type: Literal["restore", "forget"]
    id: Index


class FrontOf(_Strict):
    """Search for the Pareto set of a contour."""

    type: Literal["front"]
    contour: Words
    criteria: Annotated[tuple[Words, ...], Field(min_length=2, max_length=5, strict=False)]
    runs: Annotated[int, Field(ge=10, le=1000)]


class PointOf(_Strict):
    """Ask for the motion of a point of the Pareto set."""

    type: Literal["point"]
    contour: Words
    number: Index


class ReachOf(_Strict):
    """Ask for the nodes out of reach with the part, the robot or its head moved by offsets."""

    type: Literal["reach"]
    offsets: Offsets
    number: Index


class Place(_Strict):
    """Move the part, the robot or its head by offsets from their place in a scene."""

    type: Literal["place"]
    scene: Index
    offsets: Offsets


class LayoutOf(_Strict):
    """Search for the best placement."""

    type: Literal["layout"]
    goal: Goal
    ranges: Ranges
    evaluations: Annotated[int, Field(ge=8, le=100_000)]
    grid: bool


class Take(_Strict):
    """Apply a placement that the search has tried to the job."""

    type: Literal["take"]
    number: Index


class TextOf(_Strict):
    """Ask for the text of the program."""

    type: Literal["program"]
    language: Words | None = None


Ask = (
    Edit
    | Edits
    | Text
    | Plain
    | Save
    | OfContour
    | ReasonOf
    | ShadeOf
    | TechniqueOf
    | Relax
    | Cut
    | Leave
    | Keep
    | Rename
    | OfKept
    | FrontOf
    | PointOf
    | ReachOf
    | Place
    | LayoutOf
    | Take
    | TextOf
)
"""A message of a page."""

_ASK: TypeAdapter[Ask] = TypeAdapter(Annotated[Ask, Field(discriminator="type")])


def parse(text: str) -> Ask:
    """Return the message in a JSON text of a page.

    Raises
    ------
    pydantic.ValidationError
        The text is not one of the messages.
    """
    return _ASK.validate_json(text)
