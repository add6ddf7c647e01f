"""Check texts for the words of docs/terms.toml, which says what to write instead and why.

    python docs/_ext/terms.py

Read are the pages, the docstrings of public names, and the texts in the sources: messages, help,
what the report and the studio show. Code in them, in blocks or between backticks, keeps its names.
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

__all__ = ["Finding", "Term", "files", "findings", "main", "texts_of", "words"]

ROOT = Path(__file__).parents[2]
LIST = ROOT / "docs" / "terms.toml"
READ = (
    *("README.md", "CONTRIBUTING.md", "SECURITY.md", "docs/**/*.md", "examples/**/*.md"),
    *(f"src/**/*.{kind}" for kind in ("md", "py", "js", "html", "toml")),
)
LEFT_OUT = ("*/vendor/*", "*/robots/library/*", "*/robots/externals/*")
LISTED = "## Words that are not used"  # of the glossary, which must name them
CODE = re.compile(
    r"^```.*?^```|^ {4}.*?$|``[^`]+``|`[^`\n]*`|\]\([^)\s]*\)|<[^>\n]*>", re.DOTALL | re.MULTILINE
)
IN_SCRIPT = re.compile(
    r"""//[^\n]*|/\*.*?\*/|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*'|`(?:[^`\\]|\\.)*`""", re.DOTALL
)
TEXT = re.compile(r"[A-Za-z]{2,}[,;:]? [A-Za-z]|^[A-Z][a-z]+$")


@dataclass(frozen=True)
class Term:
    """A word that is not used: what to write instead, why, and where (nowhere else it counts)."""

    words: str
    instead: str
    why: str
    pattern: str
    wrong: str
    right: str
    where: tuple[str, ...] = ("*",)
    expression: re.Pattern[str] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        found = self.pattern.replace(" ", r"\s+")  # a phrase may go on in the next line
        object.__setattr__(self, "expression", re.compile(found, re.IGNORECASE | re.MULTILINE))


@dataclass(frozen=True)
class Finding:
    """A word that is not used, where it is."""

    file: str
    line: int
    found: str
    term: Term

    def __str__(self) -> str:
        said = f'"{self.found}": write {self.term.instead}, because {self.term.why}'
        return f"{self.file}:{self.line}: {said}"


@cache
def words() -> tuple[Term, ...]:
    """Return the words that are not used."""
    listed = tomllib.loads(LIST.read_text(encoding="utf-8"))["term"]
    return tuple(Term(**{**each, "where": tuple(each.get("where", "*"))}) for each in listed)


def files() -> list[Path]:
    """Return the files that are read."""
    found = {path for pattern in READ for path in ROOT.glob(pattern)}
    names = {path: path.relative_to(ROOT).as_posix() for path in found}
    return sorted(p for p in found if not any(fnmatch(names[p], each) for each in LEFT_OUT))


def findings(text: str, name: str) -> Iterator[Finding]:
    """Yield the words in a file that are not used, by the kind of its name."""
    terms = [term for term in words() if any(fnmatch(name, each) for each in term.where)]
    lines = text.splitlines()
    for first, last, prose in texts_of(text, name.rpartition(".")[2]):
        for term in terms:
            for hit in term.expression.finditer(prose):
                line = first + prose.count("\n", 0, hit.start())
                if last > first and "\n" not in prose:  # a text in pieces over several lines
                    start = hit[0].split()[0]
                    line = next((n for n in range(first, last) if start in lines[n - 1]), last)
                yield Finding(name, line, " ".join(hit[0].split()), term)


def texts_of(text: str, kind: str) -> Iterator[tuple[int, int, str]]:
    """Yield first line, last line and words of the texts in a file, without what is code."""
    if kind == "py":
        found = _texts_of_python(text)
    elif kind == "js":
        found = _texts_of_script(text)
    else:
        if kind == "toml":  # what a comment says
            text = re.sub(r"^[^#\n]*#?", "", text, flags=re.MULTILINE)
        before, title, _ = text.partition(f"\n{LISTED}")
        found = iter([(1, 1, before if title else text)])
    for first, last, each in found:
        yield first, last, CODE.sub(lambda code: re.sub(r"[^\n]", " ", code[0]), each)


def _texts_of_python(text: str) -> Iterator[tuple[int, int, str]]:
    """Yield the docstrings of public names, and strings of several words."""
    tree = ast.parse(text)
    passed: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            first = node.body[0]
            private = node.name.startswith("_")
            if private and isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                passed.add(id(first.value))
        elif isinstance(node, ast.JoinedStr):
            pieces = [p for p in node.values if isinstance(p, ast.Constant)]
            passed.update(map(id, pieces))
            joined = "`x`".join(str(piece.value) for piece in pieces)
            yield node.lineno, node.end_lineno or node.lineno, joined
        elif (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in passed
            and TEXT.search(node.value)
        ):
            yield node.lineno, node.end_lineno or node.lineno, node.value


def _texts_of_script(text: str) -> Iterator[tuple[int, int, str]]:
    """Yield the strings of several words in JavaScript."""
    for found in IN_SCRIPT.finditer(text):
        if found[0][0] != "/" and TEXT.search(found[0][1:-1]):
            line = 1 + text.count("\n", 0, found.start())
            yield line, line, re.sub(r"\$\{[^}]*\}", " ", found[0][1:-1])


def main() -> int:
    """Print what is found; 1 if there is something."""
    found = []
    for path in files():
        name = path.relative_to(ROOT).as_posix()
        found += list(findings(path.read_text(encoding="utf-8"), name))
    print(*found, sep="\n", end="\n" if found else "")
    print(f"{len(found)} words to change; {LIST.relative_to(ROOT)} has the list.")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
