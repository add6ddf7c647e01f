"""Open a DXF, text or binary, with ezdxf, and find what ezdxf repaired and dropped."""

from __future__ import annotations

import logging
import re
import struct
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO

from ezdxf import recover
from ezdxf.audit import Auditor
from ezdxf.document import Drawing
from ezdxf.lldxf.const import DXFError
from ezdxf.lldxf.tagger import binary_tags_loader

__all__ = ["DAMAGED", "document_of"]

logger = logging.getLogger("ezdxf")
DAMAGED = (
    DXFError, ArithmeticError, AssertionError, AttributeError, LookupError, RecursionError,
    TypeError, ValueError, struct.error,
)  # fmt: skip
"""Exceptions that ezdxf and splines raise on bad values and on damaged structures."""
BINARY = b"AutoCAD Binary DXF"
LINES = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "LWPOLYLINE", "POLYLINE", "SPLINE", "INSERT")
"""Kinds of entities that are lines to cut; none of them may be lost without a note."""
STANDS = re.compile(
    rf"^[ \t]*0[ \t]*\r?\n[ \t]*({'|'.join(LINES)})[ \t]*\r?$".encode(), re.MULTILINE
)
MARKERS = {b"LWPOLYLINE": b"AcDbPolyline", b"SPLINE": b"AcDbSpline"}
"""Kinds that ezdxf reads only after the marker of their class, which some writers leave out."""
MARKED = re.compile(
    rb"^([ \t]*0[ \t]*\r?\n[ \t]*(%s)[ \t]*\r?\n)(.*?)(?=^[ \t]*0[ \t]*\r?\n[ \t]*[A-Z])"
    % b"|".join(MARKERS),
    re.MULTILINE | re.DOTALL,
)
COMMON = frozenset(map(str, (
    5, 6, 8, 48, 60, 62, 67, 92, 100, 102, 160, 284, 310, 330, 347, 348, 360, 370, 390, 410, 420,
    430, 440,
)))  # fmt: skip
"""Codes before the marker, the same for all kinds (DXF reference, common group codes)."""
DROPPED = re.compile(
    r"(?:Removed|Deleted) (?:[a-zDXF]+ )*([A-Z][A-Z0-9_]+)(?:\(#\w+\))? (?:entity )?(.*)"
)
"""Message of ezdxf when it drops an entity."""


def document_of(content: bytes) -> tuple[Drawing, list[str], Counter[tuple[str, str]]]:
    """Return the drawing, the repaired faults, and the count of lost entities by kind and reason.

    Raises
    ------
    one of DAMAGED
        Not a DXF, or one that cannot be repaired.
    """
    is_binary = content.startswith(BINARY)
    if not (is_binary or b"SECTION" in content[:4096]):
        raise DXFError(f"expected SECTION at its start, got {content[:32]!r}")
    with _overheard() as said:
        if is_binary:
            document = Drawing.load(binary_tags_loader(content))
            auditor: Auditor = document.audit()
        else:
            document, auditor = recover.read(BytesIO(MARKED.sub(_with_markers, content)))
    faults = [*said, *(fault.message for fault in (*auditor.fixes, *auditor.errors))]
    faults = [" ".join(fault.split())[:200] for fault in faults]
    return document, faults, _lost(document, content, faults)


def _with_markers(entity: re.Match[bytes]) -> bytes:
    """Return an entity with the markers of its classes, adding those that are missing."""
    head, kind, body = entity.groups()
    if MARKERS[kind] in body:
        return entity[0]
    lines = body.splitlines(keepends=True)
    pairs = [b"".join(lines[k : k + 2]) for k in range(0, len(lines), 2)]
    codes = [pair.split(b"\n", 1)[0].strip().decode("ascii", "replace") for pair in pairs]
    end = b"\r\n" if head.endswith(b"\r\n") else b"\n"
    own = next((k for k, code in enumerate(codes) if code not in COMMON), len(pairs))
    pairs.insert(own, b"100" + end + MARKERS[kind] + end)
    if b"AcDbEntity" not in body:
        common = codes.index("8") if "8" in codes[:own] else own
        pairs.insert(common, b"100" + end + b"AcDbEntity" + end)
    return head + b"".join(pairs)


def _lost(document: Drawing, content: bytes, faults: list[str]) -> Counter[tuple[str, str]]:
    """Return which lines of the file are not in the drawing."""
    kept = Counter(entity.dxftype() for entity in document.entitydb.values() if entity.is_alive)
    stand = Counter(kind.decode() for kind in STANDS.findall(content))
    lost: Counter[tuple[str, str]] = Counter()
    for fault in faults:
        dropped = DROPPED.match(fault)
        if dropped and dropped[1] in LINES:
            lost[dropped[1], dropped[2].rstrip(".")] += 1
    for kind, count in stand.items():
        explained = sum(n for (lost_kind, _), n in lost.items() if lost_kind == kind)
        if (missing := count - kept[kind] - explained) > 0:
            lost[kind, "the file is damaged there"] += missing
    return lost


class _Listener(logging.Handler):
    """Keep the messages that are logged."""

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a message."""
        self.said.append(record.getMessage())


@contextmanager
def _overheard() -> Iterator[list[str]]:
    """Collect what ezdxf logs about faults, instead of printing it on the terminal."""
    handler = _Listener(logging.WARNING)
    propagates, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield handler.said
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagates
