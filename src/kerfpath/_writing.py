"""Files are written whole or not at all, also when the process is stopped in the middle."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from threading import Lock

__all__ = ["no_more_writing", "write_whole"]

_WRITING = Lock()


def write_whole(target: Path, content: bytes) -> None:
    """Write `content` to a file beside `target` first, then put that in its place.

    Raises
    ------
    OSError
        It cannot be written; nothing is left beside the target.
    """
    beside = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    with _WRITING:
        try:
            beside.write_bytes(content)
            beside.replace(target)
        finally:
            with suppress(OSError):
                beside.unlink(missing_ok=True)


def no_more_writing(timeout: float) -> None:
    """Let a file that is being written be finished, for `timeout` s at most, and begin no other.

    For who is about to end the process: what comes after waits for ever.
    """
    _WRITING.acquire(timeout=timeout)
