"""The optional parts of kerfpath: what each needs, and the command that installs it."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

from kerfpath.errors import InputError

NEEDS = {
    "cad": ("OCP", "ezdxf"),
    "cells": ("coal", "ompl"),
    "cluster": ("distributed",),
    "compas": ("compas_fab",),
    "general": ("ssik",),
    "programs": (
        "ortools", "pydantic", "python_calamine", "rich", "tomlkit", "tree_sitter",
        "tree_sitter_toml", "typer",
    ),
    "report": ("jinja2", "plotly"),
    "robodk": ("robodk",),
    "studio": ("starlette", "uvicorn", "websockets"),
    "tables": ("pandas",),
}  # fmt: skip
"""Modules that each extra of the package installs."""


def require_extra(extra: str, what: str) -> None:
    """Raise InputError if the modules of an extra, which `what` needs, are not installed.

    Nothing is imported for this check.
    """
    missing = [name for name in NEEDS[extra] if find_spec(name) is None]
    if missing:
        raise InputError(
            f"{what}: {', '.join(missing)} is needed and not installed; "
            f"run pip install 'kerfpath[{extra}]'"
        )


def imported(name: str, extra: str, what: str) -> ModuleType:
    """Return a module of an extra, or a stand-in that raises InputError when it is used."""
    return import_module(name) if find_spec(name) else _Absent(name, extra, what)


class _Absent(ModuleType):
    def __init__(self, name: str, extra: str, what: str) -> None:
        super().__init__(name)
        self._asked = extra, what

    def __getattr__(self, name: str) -> object:
        require_extra(*self._asked)
        raise AttributeError(name)
