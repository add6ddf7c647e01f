"""Files are written whole or not at all, also when the process is stopped in the middle."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock

__all__ = ["no_more_writing", "write_whole"]

_WRITING = Lock()


def write_whole(files: Mapping[Path, bytes]) -> None:
    """Write all files or none: each beside its place first, then all into their places in order.

    Raises
    ------
    OSError
        One cannot be written, `filename` says which; nothing is left beside the others.
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
    """Let errors name the file that was to be written."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None


def no_more_writing(timeout: float) -> None:
    """Let a file that is being written be finished, for `timeout` s at most, and begin no other.

    For who is about to end the process: what comes after waits for ever.
    """
    _WRITING.acquire(timeout=timeout)
