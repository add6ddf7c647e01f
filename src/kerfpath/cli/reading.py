"""The options of the commands that read a drawing, which they take as one object."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from typing import Annotated, Any, Literal, get_type_hints

import typer


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingOptions:
    """How a drawing is read; a field is an option of every command that reads one."""

    unit: Annotated[
        str | None,
        typer.Option(help="Length unit, if the file has none or a wrong one: mm, cm, m, in."),
    ] = None
    gap_mm: Annotated[
        float, typer.Option(help="Largest gap between two curve ends that a loop bridges, mm.")
    ] = 0.05
    edge_turn_mm: Annotated[
        float,
        typer.Option(
            help="Distance before and behind a sharp edge within which the beam turns, mm."
        ),
    ] = 1.0
    outer_towards: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            help="Direction that the outer sides of sheets face, in the part. Default: the side "
            "that less of the part hides; for a flat sheet, the side that faces up."
        ),
    ] = None
    axis: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="Tool axis for lines in space, and for points without one."),
    ] = None
    columns: Annotated[
        str | None,
        typer.Option(help='Columns of a table: x,y,z,-,nx,... in order, or x=NAME,"y=A, B",...'),
    ] = None
    sort: Annotated[
        Literal["open", "closed"] | None,
        typer.Option(help="Sort the points of a table, which are in no order, along a curve."),
    ] = None
    beam: Annotated[
        list[str] | None,
        typer.Option(
            help="Output of a robot program that is on while it cuts, as $OUT[5]; twice: the "
            "statements that switch on and off; or the speed of its cuts, as '120 mm/s'."
        ),
    ] = None
    section: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="Normal of planes that cut a mesh: their loops are the contours."),
    ] = None
    section_mm: Annotated[
        list[float] | None,
        typer.Option(help="Distance of such a plane along its normal, mm; once for each."),
    ] = None
    machine: Annotated[
        str | None,
        typer.Option(
            metavar="TABLE",
            help="Rotary axes of the machine whose program it is, as machine of [part] in a job: "
            "'{ head = \"CB\", tcp = true }'.",
        ),
    ] = None
    drawing_frame: Annotated[
        Literal["leave_out", "cut"] | None,
        typer.Option(help="What to do with a rectangle around all else in a DXF."),
    ] = None


def reads_drawing(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command that has all options of `ReadingOptions` in place of its parameter `how`.

    typer takes the options of a command from the signature of its function.
    """
    names = [field.name for field in fields(ReadingOptions)]
    options = inspect.signature(ReadingOptions, eval_str=True).parameters
    own = inspect.signature(command, eval_str=True)
    parameters: list[inspect.Parameter] = []
    for parameter in own.parameters.values():
        parameters += options.values() if parameter.name == "how" else [parameter]

    @wraps(command)
    def with_options(**given: Any) -> None:
        how = ReadingOptions(**{name: given.pop(name) for name in names})
        command(how=how, **given)

    hints = get_type_hints(ReadingOptions, include_extras=True)
    with_options.__annotations__ = {**command.__annotations__, **hints}
    del with_options.__annotations__["how"]
    with_options.__signature__ = own.replace(  # type: ignore[attr-defined]  # functions have it
        parameters=[each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in parameters]
    )
    return with_options
