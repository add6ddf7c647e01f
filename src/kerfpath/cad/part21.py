"""Check the grammar of STEP files (ISO 10303-21), to explain faults that OCCT does not."""

from __future__ import annotations

import re
from collections import Counter

from kerfpath.errors import InputError

BLANKS = re.compile(rb"'[^']*'|/\*.*?\*/|\s+", re.DOTALL)
SECTION = re.compile(rb";DATA(?:\([^;]*\))?;(.*?)ENDSEC;", re.DOTALL | re.IGNORECASE)
NUMBER = rb"[+-]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][+-]?\d++)?"
ITEM = rb"(?:\$++|\*|#\d++|%s|\.\w++\.|\"[0-9A-Fa-f]*+\")" % NUMBER
LIST = re.compile(rb"!?(?:[A-Za-z_]\w*+)?\((?:%s(?:,%s)*+)?\)" % (ITEM, ITEM))
"""A list without inner lists; with a type in front of it, an entity."""
ENTITY = re.compile(rb"#\d+=\$+")
DEEPEST = 32
"""Deepest nesting of lists; files have about six levels."""
LARGEST = 2**31 - 1
"""Largest number of an entity: OCCT keeps them in 32 bits."""


def require_grammar(content: bytes) -> None:
    """Check the grammar of a STEP file.

    Raises
    ------
    InputError
        No data, a statement that is no entity, a number out of range or used twice, a reference to
        a missing entity.
    """
    plain = BLANKS.sub(lambda found: b"$" if found[0][:1] == b"'" else b"", content)
    data = b"".join(SECTION.findall(plain))
    if not data:
        raise InputError("the file cannot be parsed: it has no DATA; export the part as STEP again")
    # From the innermost lists on, each becomes one value, until every entity reads #1=$.
    reduced, count, depth = data, 1, 0
    while count and depth < DEEPEST:
        reduced, count = LIST.subn(b"$", reduced)
        depth += 1
    for statement in reduced.split(b";")[:-1]:
        if not ENTITY.fullmatch(statement):
            raise _damaged(f"{_line(content, statement)}: Incorrect syntax")
    made = Counter(map(int, re.findall(rb"#(\d+)=", data)))
    number, times = made.most_common(1)[0]
    if times > 1:
        raise _damaged(f"#{number} is defined {times} times")
    if (largest := max(made)) > LARGEST:
        raise _damaged(f"#{largest} is more than {LARGEST}")
    if missing := set(map(int, re.findall(rb"#(\d+)(?![\d=])", data))) - made.keys():
        raise _damaged(f"Unresolved Reference to #{min(missing)}")


def _line(content: bytes, statement: bytes) -> str:
    """Return the line of the entity of a statement, or how the statement begins."""
    number = re.match(rb"#\d+", statement)
    place = number and re.search(number[0] + rb"\s*=", content)
    if not place:
        return f"at {statement[:32].decode('ascii', 'replace')!r}"
    line = content.count(b"\n", 0, place.start()) + 1
    return f"Line {line}"


def _damaged(reason: str) -> InputError:
    return InputError(f"the file is damaged ({reason}); copy or export it again")
