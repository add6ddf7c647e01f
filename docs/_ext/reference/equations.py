"""The index of equations: where the code has each equation of the paper, and what tests it."""

from __future__ import annotations

import inspect
import re
from functools import cache, reduce
from importlib import import_module
from pathlib import Path
from typing import Any

from kerfpath import kernels
from reference.markdown import code, plain

__all__ = ["page"]

ROOT = Path(__file__).parents[3]
TO_ROOT = "../.."
"""From the page of this index."""
TEST = re.compile(r"((?:^@pytest\.mark\..*\n)+)def (test_\w+)", re.MULTILINE)


def page() -> str:
    """Return a line for each equation, and the notation of the kernels."""
    notation = (kernels.__doc__ or "").partition(":\n\n")[2]
    return "\n\n".join(
        [
            "## In the code",
            "\n".join(map(_line, kernels.EQUATIONS)),
            "## Notation",
            f"```{{eval-rst}}\n{notation}\n```",
        ]
    )


def _line(number: int) -> str:
    """Return the summary of what an equation is, without its number, its code and its tests."""
    module, _, name = kernels.EQUATIONS[number].partition(":")
    found: Any = reduce(getattr, name.split("."), import_module(module))
    function = inspect.unwrap(getattr(found, "py_func", found))  # what numba has compiled
    summary = (inspect.getdoc(function) or "").partition("\n\n")[0]
    said = plain(re.sub(r"\s*\(Eq\. \d+\)", "", summary).replace("\n", " "))
    where = _link(f"{module}.{name}", Path(inspect.getsourcefile(function) or ""))
    return f"- **({number})** {said} {where}, tested by {', '.join(_tests()[number])}"


def _link(name: str, file: Path) -> str:
    return f"[{code(name)}]({TO_ROOT}/{file.relative_to(ROOT).as_posix()})"


@cache
def _tests() -> dict[int, list[str]]:
    """Return links to the tests that name an equation, by its number."""
    found: dict[int, list[str]] = {number: [] for number in kernels.EQUATIONS}
    for file in sorted((ROOT / "tests").rglob("test_*.py")):
        for marks, name in TEST.findall(file.read_text(encoding="utf-8")):
            for number in re.findall(r"mark\.equation\((\d+)\)", marks):
                found[int(number)].append(_link(name, file))
    return found
