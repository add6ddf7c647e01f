"""The command line: what `--help` says, of the program and of every command."""

from __future__ import annotations

from collections.abc import Iterator

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup, TyperOption
from typer.main import get_command

from kerfpath.cli import programs, studies
from kerfpath.cli.app import app
from reference.markdown import code, prose, table

__all__ = ["page", "program"]

assert programs, studies  # their commands
EXAMPLE = "Example: "


def program() -> TyperGroup:
    """Return the program, which has every command by its name, in the order of its help."""
    group = get_command(app)
    assert isinstance(group, TyperGroup)
    return group


def page() -> str:
    """Return the help of the program and of every command."""
    group = program()
    top = typer.Context(group, info_name="kerfpath")
    parts = ["## kerfpath", *_help(group.help), _parameters(group, top)]
    for name, command in group.commands.items():
        assert isinstance(command, TyperCommand)
        context = typer.Context(command, info_name=name, parent=top)
        usage = command.get_usage(context).removeprefix("Usage: ")
        parts += [f"## kerfpath {name}", f"```text\n{usage}\n```", *_help(command.help)]
        parts.append(_parameters(command, context))
    return "\n\n".join(parts)


def _help(text: str | None) -> Iterator[str]:
    """Yield the paragraphs of a help; its examples are code."""
    for paragraph in (text or "").split("\n\n"):
        if paragraph.startswith(EXAMPLE):
            yield f"```console\n$ {paragraph.removeprefix(EXAMPLE)}\n```"
        else:
            yield prose(paragraph)


def _parameters(command: TyperCommand | TyperGroup, context: typer.Context) -> str:
    """Return a table of arguments and options: names, value, default, help."""
    rows = []
    for each in command.params:
        assert isinstance(each, TyperArgument | TyperOption)
        names, value, default = [each.metavar or each.name], "", ""
        if isinstance(each, TyperOption):
            names = [*each.opts, *each.secondary_opts]
            if not each.is_flag:
                value = code(each.metavar or each.display_type(context).strip("<>"))
                default = "" if each.default is None else code(each.default)
        said = "required" if each.required else default
        rows.append([", ".join(map(code, names)), value, said, prose(each.help or "")])
    return table(["argument or option", "value", "default", "what it does"], rows)
