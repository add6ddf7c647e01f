"""Identifiers made from the names of contours, and the known names nearest to a wrong one."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from difflib import get_close_matches

LONGEST_NAME = 32
"""Most characters of an identifier made from a contour's name; ABB's limit."""
MOST_NEAR = 6
"""Most names in an answer to a wrong one."""


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


def squeezed(text: str) -> str:
    """Return the letters and digits of a text in lower case: "KR 30 HA" and "kr30_ha" are one."""
    return re.sub(r"[\W_]+", "", text.casefold())


def nearest(name: str, known: Sequence[str]) -> str:
    """Return the known names that contain `name`, or else are similar, in words for messages.

    Blanks, dashes, underscores and case make no difference.
    """
    near = [one for one in known if squeezed(name) and squeezed(name) in squeezed(one)]
    if not near:
        plain = {squeezed(one): one for one in known}
        near = [plain[one] for one in get_close_matches(squeezed(name), plain, n=3, cutoff=0.4)]
    if not near:
        return "no id there is similar"
    return f"nearest: {listed(near, MOST_NEAR)}"


def listed(names: Sequence[str], most: int, between: str = ", ") -> str:
    """Return the first names in words for messages, and how many there are beyond `most`."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return between.join(names[:most]) + more
