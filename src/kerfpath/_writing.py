"""Write files atomically: complete or not at all, even if the process is stopped."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock

__all__ = ["no_more_writing", "write_whole"]

_WRITING = Lock()


def write_whole(files: Mapping[Path, bytes]) -> None:
    """Write all files or none: first to temporary files beside them, then renamed in order.

    Raises
    ------
    OSError
        A file cannot be written; `filename` is its path. No temporary file is left.
    """
    beside = {path: path.with_name(f".{path.name}.{os.getpid()}.tmp") for path in files}
    with _WRITING:
        try:
            for path, content in files.items():
                with _about(path):
                    beside[path].write_bytes(content)
            for path in files:
                with _about(path):
                    beside[path].replace(path)
        finally:
            for path in files:
                with suppress(OSError):
                    beside[path].unlink(missing_ok=True)


@contextmanager
def _about(path: Path) -> Iterator[None]:
    """Let errors name the file instead of its temporary file."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None


def no_more_writing(timeout: float) -> None:
    """Wait, for `timeout` s at most, until a file in progress is written; begin no other.

    Call it just before the process ends: every later `write_whole` waits forever.
    """
    _WRITING.acquire(timeout=timeout)
