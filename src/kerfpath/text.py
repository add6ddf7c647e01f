"""What text may contain; letters and digits as files mean them: those of ASCII only."""

from __future__ import annotations

import re
import unicodedata
from string import ascii_lowercase, ascii_uppercase

from kerfpath.errors import InputError

NOT_TEXT = re.compile(
    r"[\0-\x08\v\f\x0e-\x1f\x7f-\x9f\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    r"\ud800-\udfff\U000e0000-\U000e007f]|\r(?!\n)"
)
"""Control characters, separators of lines and characters without a glyph, as those that change the
direction of writing; not the tab and the ends of lines."""
NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
"""A number; `float` also takes other digits, words, and underscores between digits."""
LONGEST_NUMBER = 60
"""Most characters of a number."""
_UPPER = str.maketrans(ascii_lowercase, ascii_uppercase)
_LOWER = str.maketrans(ascii_uppercase, ascii_lowercase)


def text_lines(text: str) -> list[str]:
    """Return the lines of a text, which all end with LF or CR LF, or all with CR.

    Raises
    ------
    InputError
        A character that no text contains, or a CR alone beside other ends of lines (the message has
        the line).
    """
    if "\n" not in text:
        text = text.replace("\r", "\n")
    if (found := NOT_TEXT.search(text)) is not None:
        line = text.count("\n", 0, found.start()) + 1
        raise InputError(f"line {line}: expected text, got {named(found[0])}; remove it")
    return [line.removesuffix("\r") for line in text.split("\n")]


def named(character: str) -> str:
    """Return the code and the name of a character."""
    return f"U+{ord(character):04X} {unicodedata.name(character, '')}".rstrip()


def upper(text: str) -> str:
    """Return a text with the letters of ASCII in upper case; str.upper makes S of U+017F."""
    return text.translate(_UPPER)


def lower(text: str) -> str:
    """Return a text with the letters of ASCII in lower case; str.lower makes k of U+212A."""
    return text.translate(_LOWER)


def number(text: str) -> float:
    """Return the number that a text is; it may be infinite, as 1e999.

    Raises
    ------
    ValueError
        It is none: other digits than 0 to 9, a word, underscores, far too many digits.
    """
    if len(text) > LONGEST_NUMBER or NUMBER.fullmatch(text) is None:
        raise ValueError(text)
    return float(text)
