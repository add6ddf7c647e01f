"""The Python interface: what a package names, each with its docstring, by Sphinx's autodoc."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from itertools import pairwise
from types import ModuleType

import kerfpath
from reference.markdown import code

__all__ = ["page", "public_names"]

KINDS = {
    "autofunction": "Functions",
    "autoclass": "Classes",
    "autoexception": "Errors",
    "py:data": "Values",
}
"""Directives, and the headings above what they describe."""


def page(package: str = "kerfpath") -> str:
    """Return a section on each kind of what a package names, and on what is at the top."""
    module = import_module(package)
    top = {id(getattr(kerfpath, name)): name for name in kerfpath.__all__}
    found: dict[str, list[str]] = {directive: [] for directive in KINDS}
    elsewhere = []
    for name, home in public_names(module).items():
        thing = getattr(module, name)
        if module is not kerfpath and id(thing) in top:
            elsewhere.append(f"{{py:obj}}`kerfpath.{top[id(thing)]}`")
            continue
        directive, said = "py:data", _comment(home, name) or _value(thing)
        if inspect.isclass(thing):
            directive, said = "autoexception" if issubclass(thing, Exception) else "autoclass", ""
        elif inspect.isfunction(inspect.unwrap(thing) if callable(thing) else thing):
            directive, said = "autofunction", ""
        found[directive].append(f".. {directive}:: {name}\n\n   {said}".rstrip())
    parts = []
    for directive, heading in KINDS.items():
        if found[directive]:
            body = "\n\n".join([f".. py:currentmodule:: {package}", *found[directive]])
            parts.append(f"## {heading}\n\n```{{eval-rst}}\n{body}\n```")
    if elsewhere:
        parts.append(f"## At the top, in {code('kerfpath')}\n\n{', '.join(elsewhere)}")
    return "\n\n".join(parts)


def public_names(module: ModuleType) -> dict[str, str]:
    """Return what a package names, and the module that it has each from."""
    imports = [node for node in ast.walk(_tree(module)) if isinstance(node, ast.ImportFrom)]
    homes = {alias.asname or alias.name: each.module for each in imports for alias in each.names}
    named = [alias.asname for each in imports for alias in each.names if alias.asname]
    names = sorted(getattr(module, "__all__", named))
    return {name: homes.get(name) or module.__name__ for name in names if name[0] != "_"}


@cache
def _tree(module: ModuleType) -> ast.Module:
    return ast.parse(inspect.getsource(module))


def _comment(home: str, name: str) -> str:
    """Return what is written under the assignment of a value, in one line."""
    module = import_module(home)
    if (deeper := public_names(module).get(name, home)) != home:
        return _comment(deeper, name)
    for statement, below in pairwise(_tree(module).body):
        targets = statement.targets if isinstance(statement, ast.Assign) else []
        if any(isinstance(target, ast.Name) and target.id == name for target in targets) and (
            isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
        ):
            return " ".join(str(below.value.value).split())
    return ""


def _value(thing: object) -> str:
    """Return a value, of a mapping its keys, as code."""
    said = ", ".join(map(repr, thing)) if isinstance(thing, Mapping) else repr(thing)
    return f"``{re.sub(r'(typing|kerfpath)[.](_?[a-z]+[.])*', '', said)}``"
