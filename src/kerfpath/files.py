"""Write files atomically: complete or not at all, even if the process is stopped."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock

_WRITING = Lock()

OTHER_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a FIFO",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
"""What may lie at a path instead of a regular file."""


def write_whole(files: Mapping[Path, bytes]) -> None:
    """Write all files or none: first to temporary files beside them, then renamed in order.

    Only regular files are replaced, not a FIFO or a device.

    Raises
    ------
    OSError
        A file cannot be written or replaced; `filename` is its path. No temporary file is left.
    """
    beside = {path: path.with_name(f".{path.name}.{os.getpid()}.tmp") for path in files}
    with _WRITING:
        try:
            for path in files:
                _require_replaceable(path)
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


def _require_replaceable(path: Path) -> None:
    """Raise OSError if something other than a regular file lies at the path."""
    try:
        kind = stat.S_IFMT(path.stat().st_mode)
    except OSError:  # nothing is there, or writing will tell
        return
    if kind != stat.S_IFREG:
        what = OTHER_KINDS.get(kind, "something else")
        raise OSError(errno.EINVAL, f"it is {what}, not a file", str(path))


@contextmanager
def _about(path: Path) -> Iterator[None]:
    """Let errors name the file instead of its temporary file."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None


def finish_writes(timeout: float) -> None:
    """Wait, for `timeout` s at most, until a file in progress is written; begin no other.

    Call it just before the process ends: every later `write_whole` waits forever.
    """
    _WRITING.acquire(timeout=timeout)
