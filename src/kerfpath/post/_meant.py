"""Check texts of programs, for all languages: no control characters, no absurdly large numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from kerfpath.errors import InputError
from kerfpath.post._line_reader import program_lines

__all__ = ["CheckedTexts"]

LARGEST = 1e10
"""Largest number of a program, above ABB's 9E+09 for an axis that does not exist."""
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
LONG = re.compile(r"\d{10,}|[eE]\+?\d", re.ASCII)
"""What the text of such a large number contains."""

REMARK = re.compile(r"\s*(?:\d+:\s*)?(?:!|;|//|'|#) ", re.ASCII)
"""Start of a remark in any of the languages; a remark that gives a frame has no space."""


class CheckedTexts(Mapping[str, str]):
    """Texts by name; a control character or a number too large is refused with its line."""

    def __init__(self, files: Mapping[str, str]) -> None:
        self.files = files

    def __getitem__(self, name: str) -> str:
        text = self.files[name]
        for number, line in enumerate(program_lines(name, text), start=1):
            if not LONG.search(line) or REMARK.match(line):
                continue
            for found in NUMBER.finditer(line):
                if abs(float(found[0])) > LARGEST:
                    raise InputError(
                        f"{name}, line {number}: {found[0]} is larger than any number of a "
                        f"program ({LARGEST:g}); write the program again"
                    )
        return text

    def __iter__(self) -> Iterator[str]:
        return iter(self.files)

    def __len__(self) -> int:
        return len(self.files)
