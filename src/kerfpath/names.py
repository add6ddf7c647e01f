"""Identifiers made from the names of contours, and the known names nearest to a wrong one."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from difflib import get_close_matches

LONGEST_NAME = 32
"""Most characters of an identifier made from a contour's name; ABB's limit."""


def identifiers(
    texts: Iterable[str], taken: Iterable[str], longest: int = LONGEST_NAME
) -> list[str]:
    """Return an identifier for each text, unique also in languages that ignore case."""
    used = {name.lower() for name in taken}
    names = []
    for text in texts:
        name = plain = identifier(text)[:longest]
        number = 1
        while name.lower() in used:
            number += 1
            suffix = f"_{number}"
            name = plain[: longest - len(suffix)] + suffix
        used.add(name.lower())
        names.append(name)
    return names


def identifier(text: str) -> str:
    """Return a text as an identifier of ASCII letters, digits and underscores."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    name = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")
    if not name or name[0].isdigit():
        name = f"c_{name}".rstrip("_")
    return name[:LONGEST_NAME]


def nearest(name: str, known: tuple[str, ...]) -> str:
    """Return the known names most similar to `name`, in words for messages."""
    near = get_close_matches(name, known, n=3, cutoff=0.4)
    return f"nearest: {', '.join(near)}" if near else "no id there is similar"
