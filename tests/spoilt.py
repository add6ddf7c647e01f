"""Files spoilt as people, programs, disks and wires spoil them; `fuzz.py` does so by the thousand.

Bytes, tokens and structure: whatever a reader is given, it reads or refuses in one line.
"""

from __future__ import annotations

import contextlib
import copy
import io
import json
import random
import re
import tomllib
import traceback
import tracemalloc
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import tomlkit

from kerfpath.errors import InputError, KerfpathError

LONGEST = 600
"""Characters of a message."""
NUMBERS = (
    b" 0 -0 -1 1 2 3 17 1. -0. 1E-300 5e-324 1.E+300 1e308 -1E20 1e400 nan NaN inf -inf Infinity"
    b" 99999999999999999999 2147483648 -2147483649 9223372036854775808 1e 0x10 1_0 1,5 1.D5 +7 ++7"
    b" true null 1e-7 6553700 \xd9\xa3"
).split(b" ")
NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eEdD][-+]?\d+)?")
WORD = re.compile(rb"#\d+|[A-Za-z_]\w*")
WORDS = (
    b"", b"$", b"*", b"()", b"x" * 70_000, b"\xc3\xa9\xe2\x80\xa8", b"nan", b"a\nb", b"\0", b"..",
    b"/dev/zero", b"../" * 40, b"%s%n{0}", b"[bold]", b"'", b'"', b"\\", b"-1", b"None",
)  # fmt: skip
ODD: tuple[Any, ...] = (
    0, -0.0, -1, 1, 2, 1e308, -1e308, 5e-324, 10**30, -(2**63) - 1, 2**31, 0.5, float("nan"),
    float("inf"), "", "1.0", "x" * 5000, "é\u2028\0\x1b[31m", None, True, False, [], {}, [[]],
    [1, [2]], [[1.0], [1.0, 2.0]], {"a": 1}, [None], ["x"],
)  # fmt: skip
"""Values that stand where others are expected."""


class Whole(NamedTuple):
    """A sound file that is spoilt, and the file that is then read: itself, or one that needs it."""

    spoilt: Path
    main: Path


class Reader(NamedTuple):
    """A reader of files, and a function that writes small sound ones into a folder."""

    wholes: Callable[[Path], list[Whole]]
    read: Callable[[Path], object]


def spoil(raw: bytes, rng: random.Random, suffix: str = "") -> bytes:
    """Return a file's bytes after one to three of the accidents that befall files."""
    accidents = [*ACCIDENTS, *[STRUCTURE[suffix]] * 5] if suffix in STRUCTURE else ACCIDENTS
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        raw = rng.choice(accidents)(raw, rng)
    return raw


def _truncated(raw: bytes, rng: random.Random) -> bytes:
    return raw[: rng.randint(0, len(raw))]


def _lines(raw: bytes, rng: random.Random) -> bytes:
    """Return it with lines deleted, doubled, moved, swapped with others, or one split."""
    lines = raw.split(b"\n")
    k, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    many = rng.choice([1, 1, 2, 5, 20])
    way = rng.randrange(5)
    if way == 0:
        del lines[k : k + many]
    elif way == 1:
        lines[k:k] = lines[k : k + many]
    elif way == 2:
        lines[k], lines[j] = lines[j], lines[k]
    elif way == 3:
        taken = lines[k : k + many]
        del lines[k : k + many]
        lines[j:j] = taken
    else:
        lines[k] = lines[k][: len(lines[k]) // 2] + b"\n" + lines[k][len(lines[k]) // 2 :]
    return b"\n".join(lines)


def _numbers(raw: bytes, rng: random.Random) -> bytes:
    """Return it with some numbers replaced by odd ones, by their neighbours or scaled."""
    found = list(NUMBER.finditer(raw))

    def other(at: re.Match[bytes]) -> bytes:
        return rng.choice([*NUMBERS, rng.choice(found)[0], b"-" + at[0], at[0] + b"0"])

    return _replaced(raw, found, other, rng)


def _words(raw: bytes, rng: random.Random) -> bytes:
    """Return it with some words (references in STEP) swapped with others or with odd ones."""
    found = list(WORD.finditer(raw))

    def other(at: re.Match[bytes]) -> bytes:
        return rng.choice([rng.choice(found)[0], rng.choice(WORDS), at[0].swapcase()])

    return _replaced(raw, found, other, rng)


def _replaced(
    raw: bytes,
    found: list[re.Match[bytes]],
    other: Callable[[re.Match[bytes]], bytes],
    rng: random.Random,
) -> bytes:
    if not found:
        return raw
    chosen = rng.sample(found, min(len(found), rng.choice([1, 1, 2, 8])))
    for at in sorted(chosen, key=lambda m: -m.start()):
        raw = raw[: at.start()] + other(at) + raw[at.end() :]
    return raw


def _bytes(raw: bytes, rng: random.Random) -> bytes:
    """Return it with bytes flipped, or with junk put in, in place of a few bytes or of none."""
    k = rng.randint(0, len(raw))
    if rng.random() < 0.3 and raw:
        flipped = bytearray(raw)
        for _ in range(rng.choice([1, 1, 3, 10])):
            flipped[rng.randrange(len(raw))] ^= 1 << rng.randrange(8)
        return bytes(flipped)
    junk = rng.choice(
        [b"\0", b"\0" * 50, b"\xff\xfe", b"\xc3", rng.randbytes(rng.randint(0, 20)), b"\r",
         b"\x85", b"'", b"(", b")", b";", b'"', b"/*", b"<!--", b"]]>", b"[" * 3000, b"(" * 3000,
         b"{" * 3000, b"<a>" * 1500, b"\xe2\x80\xa8"]
    )  # fmt: skip
    return raw[:k] + junk + raw[k + rng.choice([0, 0, 1, 8, 60]) :]


def _ranges(raw: bytes, rng: random.Random) -> bytes:
    """Return it with a stretch of bytes deleted, doubled, many times over or moved."""
    a, b = sorted((rng.randint(0, len(raw)), rng.randint(0, len(raw))))
    b = min(b, a + rng.choice([10, 100, 1000, 10_000]))
    stretch, k = raw[a:b], rng.randint(0, len(raw))
    return rng.choice(
        [
            raw[:a] + raw[b:],
            raw[:b] + raw[a:],
            raw[:k] + stretch + raw[k:],
            raw[:a] + stretch * rng.choice([2, 30]) + raw[b:],
        ]
    )


def _whole(raw: bytes, rng: random.Random) -> bytes:
    """Return it with other line ends, in another encoding, upper or lower case, or twice."""
    text = raw.decode("latin-1")
    return rng.choice(
        [
            lambda: text.replace("\r\n", "\n").replace("\n", "\r\n").encode("latin-1"),
            lambda: text.replace("\n", "\r").encode("latin-1"),
            lambda: text.replace("\n", "").encode("latin-1"),
            lambda: text.encode("utf-16"),
            lambda: text.encode("utf-16-le"),
            lambda: text.encode("utf-8-sig"),
            lambda: text.replace("e", "é").encode("utf-8"),
            lambda: text.replace("e", "é").encode("latin-1"),
            lambda: text.upper().encode("latin-1", "ignore"),
            lambda: raw + raw,
            lambda: raw[: len(raw) // rng.choice([3, 10, 30, 100])] + raw[-200:],
            lambda: b"",
            lambda: b"\n" * 3,
        ]
    )()


ACCIDENTS = [
    _truncated, _lines, _lines, _numbers, _numbers, _numbers, _words, _words, _bytes, _ranges,
    _whole,
]  # fmt: skip


def _places(value: Any, into: Any = None, key: Any = None) -> Iterator[tuple[Any, Any]]:
    """Yield every place inside a value: what holds it, and its key or index there."""
    if into is not None:
        yield into, key
    keys = (
        value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    )
    for each in keys:
        yield from _places(value[each], value, each)


def _restructured(value: Any, rng: random.Random) -> None:
    """Change a tree of dicts and lists: take out, rename, swap, nest, or put in what is odd."""
    # Rows of numbers would be all that is ever chosen: each kind of place gets its share.
    places = list(_places(value))
    if not places:
        return
    named = [p for p in places if isinstance(p[0], dict)]
    into, key = rng.choice(rng.choice([named or places, places]))
    other, its = rng.choice(rng.choice([named or places, places]))
    way = rng.randrange(8)
    if way == 0:
        del into[key]
    elif way == 1 and isinstance(into, dict):
        into[rng.choice(["", "x", key + "s", key.upper()])] = into.pop(key)
    elif way == 2:
        into[key], other[its] = copy.deepcopy(other[its]), copy.deepcopy(into[key])
    elif way == 3:
        for _ in range(rng.choice([1, 2, 30])):
            into[key] = [into[key]] if rng.random() < 0.5 else {"x": into[key]}
    elif way == 4 and isinstance(into, list):
        into[key:key] = [copy.deepcopy(into[key])] * rng.choice([1, 2, 10])
    elif way == 5 and isinstance(into[key], int | float):
        into[key] = rng.choice(
            [into[key] * f for f in (-1.0, 1e-9, 0.1, 10.0, 1000.0, 1e9)] + [str(into[key])]
        )
    else:
        into[key] = rng.choice(ODD)


def _json(raw: bytes, rng: random.Random) -> bytes:
    try:
        tree = [json.loads(raw)]
    except (ValueError, RecursionError):
        return raw
    _restructured(tree, rng)
    return json.dumps(tree[0] if tree else None).encode()


def _toml(raw: bytes, rng: random.Random) -> bytes:
    try:
        tree = tomllib.loads(raw.decode())
        _restructured(tree, rng)
        # What TOML cannot hold, such as null, is left out by going through JSON's words.
        return tomlkit.dumps(tree).encode("utf-8", "replace")
    except (ValueError, TypeError, AttributeError, RecursionError):
        return raw


def _xml(raw: bytes, rng: random.Random) -> bytes:
    """Return it with an element taken out, doubled, moved or changed."""
    try:
        root = ElementTree.fromstring(raw)
    except (ElementTree.ParseError, ValueError, LookupError):
        return raw
    pairs = [(parent, child) for parent in root.iter() for child in parent]
    if not pairs:
        return raw
    parent, child = rng.choice(pairs)
    way = rng.randrange(6)
    if way == 0:
        parent.remove(child)
    elif way == 1:
        parent.append(copy.deepcopy(child))
    elif way == 2:
        rng.choice(pairs)[1].append(copy.deepcopy(child))
    elif way == 3:
        child.tag = rng.choice([rng.choice(pairs)[1].tag, "x"])
    elif child.attrib:
        key = rng.choice(list(child.attrib))
        value = child.attrib.pop(key)
        if way == 4:
            child.attrib[key] = str(rng.choice([*ODD[:14], "", "a b c", f"{value} 1", f"-{value}"]))
    else:
        child.text = str(rng.choice(ODD[:14]))
    return ElementTree.tostring(root, encoding="utf-8")


STRUCTURE = {
    ".json": _json, ".toml": _toml, ".urdf": _xml, ".dae": _xml, ".pjx": _xml, ".pgx": _xml,
    ".dtx": _xml,
}  # fmt: skip
"""Accidents to the structure of formats that have one."""


def spoilt(wholes: list[Whole], sound: dict[Path, bytes], seed: int) -> tuple[Whole, bytes]:
    """Return the file of a seed and the bytes that it is spoilt to.

    Parameters
    ----------
    wholes : list of Whole
    sound : dict
        The bytes of each file as it was.
    seed : int
    """
    rng = random.Random(seed)
    whole = rng.choice(wholes)
    return whole, spoil(sound[whole.spoilt], rng, whole.spoilt.suffix.lower())


def complaint(read: Callable[[Path], object], whole: Whole) -> str:
    """Return what is wrong with the answer to a spoilt file, "" if it is one as promised.

    Promised: it is read, or refused in one short line that names the file; no warning.
    """
    try:
        with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("error")
            read(whole.main)
    except InputError as error:
        line = str(error)
        names = {path.name for path in whole} | {path.name for path in whole.main.parent.iterdir()}
        if not line.isprintable() or not any(name in line for name in names):
            return f"not one line that names the file: {line[:2000]!r}"
        if len(line) > LONGEST:
            return f"a line of {len(line)} characters: {line[:600]!r}"
    except KerfpathError:
        return ""
    except (Exception, RecursionError):
        return traceback.format_exc()
    return ""


def taken(read: Callable[[Path], object], whole: Whole) -> float:
    """Return how much memory (MB) Python took at most in reading a file, read or not."""
    tracemalloc.start()
    try:
        complaint(read, whole)
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()
