"""Characters that are not what they look like, put everywhere into files that people hand in."""

from __future__ import annotations

import re
from collections.abc import Iterator

CONTROL = [chr(c) for c in (*range(9), 11, 12, *range(14, 32), *range(0x7F, 0xA0))]
SEPARATORS = list("\u2028\u2029\xa0\u2003\u3000\u1680\u202f")
DIRECTION = list(
    "\u200e\u200f\u061c\u202a\u202b\u202d\u202e\u2066\u2069\u200b\u200d\u2060\ufeff\U000e0041"
)
LOOKALIKES = list(
    "\u0663\u06f3\uff13\u0967\U0001d7d1\u00b2\u0131\u017f\u212a\uff21\u0430\u2212\uff0e\u066b\u00b7"
)
"""Digits of other scripts, and letters, signs and points like those of ASCII."""
WORDS = [
    "1_0",
    "infinity",
    "nan",
    "0x10",
    "1e999",
    "9" * 400,
    "9" * 5000,
    "+-1",
    "1.2.3",
    "\r",
    "\t",
    "\r\r\n",
]
TOKEN = re.compile(r"[-+.\w]+|[^\s\w]")


def spoilt(text: str, *, every: int) -> Iterator[str]:
    """Yield the text with each of the characters before, in and after tokens, or in their place.

    Parameters
    ----------
    text : str
    every : int
        Of all these places one in `every` is taken, another for each character.
    """
    places = [at for found in TOKEN.finditer(text) for at in (found.start(), found.end())]
    places += [(found.start() + found.end()) // 2 for found in TOKEN.finditer(text)]
    for k, odd in enumerate([*CONTROL, *SEPARATORS, *DIRECTION, *LOOKALIKES, *WORDS]):
        for at in places[k % every :: every]:
            yield text[:at] + odd + text[at:]
    tokens = list(TOKEN.finditer(text))
    for k, odd in enumerate([*LOOKALIKES, *WORDS]):
        for found in tokens[k % every :: every]:
            yield text[: found.start()] + odd + text[found.end() :]


def wholes(text: str) -> Iterator[bytes]:
    """Yield the text in other encodings and with other ends of lines."""
    yield text.encode("utf-16")
    yield text.encode("utf-16-le")
    yield text.encode("utf-16-be")
    yield text.encode("utf-32")
    yield text.encode("utf-8-sig")
    yield b"\xef\xbb\xbf" + text.encode("utf-8-sig")
    yield text.replace("\n", "\r").encode()
    yield text.replace("\n", "\r\n").encode()
    yield text.replace("\n", "\r\r\n").encode()
    yield text.replace("\n", "\r", 1).encode()
    yield text.replace("\n", "\u2028").encode()
    yield text.encode() + b"\x1a"
    yield text.encode() + b"\xff"
    yield (text + " " * 300_000).encode()
