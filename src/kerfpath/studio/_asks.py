"""What a page may say to the server, see README.md beside this file."""

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
"""Parts of the path of a key: no job nests deeper."""
MOST_EDITS = 50
"""Keys that change in one step: no table of a job has more."""
MOST_WORDS = 200
"""Characters of a name that a page sends: no contour is called by more."""
MOST_LOOPS = 500
"""Loops that are added at once."""
MOST_TEXT = 10_000_000
"""Characters of a job, as its reader takes them."""


FARTHEST = 1e5
"""mm and deg: no placement is farther off."""


def _of_variables(table: dict[str, _T]) -> dict[str, _T]:
    """Return a table whose keys are variables of a layout."""
    if not table.keys() <= set(VARIABLES):
        raise ValueError(f"expected variables of {', '.join(VARIABLES)}")
    return table


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if not span[0] < span[1]:
        raise ValueError("expected the lower end of a range first")
    return span


class _Strict(BaseModel):
    """A table of a message: nothing in it that is not meant, nothing changed in it."""

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
    """Replace the whole job."""

    type: Literal["text"]
    text: Annotated[str, Field(max_length=MOST_TEXT)]


class Plain(_Strict):
    """What needs no more words: a step back or forward, plan again, stop."""

    type: Literal["undo", "redo", "plan", "cancel"]


class Save(_Strict):
    """Write the job file."""

    type: Literal["save"]
    over: bool = False


class OfContour(_Strict):
    """What is asked of one contour."""

    type: Literal["focus", "map", "fastest"]
    contour: Words


class ReasonOf(_Strict):
    """Where the robot is at a node and gamma, and why it may not be."""

    type: Literal["reason"]
    contour: Words
    node: Index
    gamma: float
    posture: Annotated[int, Field(ge=0, lt=64)]


class ShadeOf(_Strict):
    """What the map of a contour is shaded by; null: nothing, stop looking for it."""

    type: Literal["shade"]
    contour: Words
    by: Words | None


class TechniqueOf(_Strict):
    """The course of another technique along a contour; null: of none, stop looking for it."""

    type: Literal["technique"]
    contour: Words
    method: Literal["paper", "known"] | None


class Relax(_Strict):
    """Make the edits of a relaxation."""

    type: Literal["relax"]
    contour: Words
    index: Index


class Cut(_Strict):
    """Loops of the part become contours of the job."""

    type: Literal["cut"]
    loops: Annotated[tuple[Words, ...], Field(min_length=1, max_length=MOST_LOOPS, strict=False)]


class Leave(_Strict):
    """A table of the job's contours is taken out of it."""

    type: Literal["leave"]
    index: Index


class Keep(_Strict):
    """Keep the job as it is, with its plans, to compare it later."""

    type: Literal["keep"]
    name: Words | None = None


class Rename(_Strict):
    """Call what is kept by another name."""

    type: Literal["rename"]
    id: Index
    name: Words


class OfKept(_Strict):
    """Go back to what is kept, or forget it."""

    type: Literal["restore", "forget"]
    id: Index


class FrontOf(_Strict):
    """Look for the Pareto set of a contour."""

    type: Literal["front"]
    contour: Words
    criteria: Annotated[tuple[Words, ...], Field(min_length=2, max_length=5, strict=False)]
    runs: Annotated[int, Field(ge=10, le=1000)]


class PointOf(_Strict):
    """The motion of a point of the Pareto set."""

    type: Literal["point"]
    contour: Words
    number: Index


class ReachOf(_Strict):
    """What is in reach where the part, the robot or its head is moved by offsets."""

    type: Literal["reach"]
    offsets: Offsets
    number: Index


class Place(_Strict):
    """Have the part, the robot or its head moved by offsets from where a scene has it."""

    type: Literal["place"]
    scene: Index
    offsets: Offsets


class LayoutOf(_Strict):
    """Look for the best placement."""

    type: Literal["layout"]
    goal: Goal
    ranges: Ranges
    evaluations: Annotated[int, Field(ge=8, le=100_000)]
    grid: bool


class Take(_Strict):
    """Make a placement that the search has tried the job's."""

    type: Literal["take"]
    number: Index


class TextOf(_Strict):
    """The program as text."""

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
"""What a page may say."""

_ASK: TypeAdapter[Ask] = TypeAdapter(Annotated[Ask, Field(discriminator="type")])


def parse(text: str) -> Ask:
    """Return what a page says.

    Raises
    ------
    pydantic.ValidationError
        It is not one of the messages.
    """
    return _ASK.validate_json(text)
