"""Write files atomically: complete or not at all, even if the process is stopped.

Also folders for temporary files, which do not stay either.
"""

from __future__ import annotations

import errno
import fcntl
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import RLock
from time import monotonic, sleep, time

_WRITING = RLock()
_locked: set[Path] = set()
"""Folders that this process has locked; only the thread that holds `_WRITING` looks at it."""

OTHER_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFLNK: "a link",
    stat.S_IFIFO: "a FIFO",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
"""What may lie at a path instead of a regular file."""
TEMPORARY = ".kerfpath.*.tmp"
"""Names of temporary files; the asterisk stands for random digits."""
PATIENCE = 10.0
"""Longest wait for another process that writes into the same folder, s."""


def write_whole(files: Mapping[Path, bytes | None]) -> None:
    """Write all files or none: first to temporary files, then renamed in order.

    Only regular files are replaced, and each keeps its permissions; links, FIFOs, devices and
    read-only files are refused. The temporary files are in the folder of the first file, as
    `only_writer` of it, or beside a file that is not inside that.

    Parameters
    ----------
    files : mapping of Path to bytes or None
        The content of each file, in the order of the renames; None removes the file.

    Raises
    ------
    OSError
        A file cannot be written, replaced or removed; `filename` is its path. No temporary file is
        left.
    """
    if not files:
        return
    folder = next(iter(files)).parent
    beside = {
        path: (folder if folder in path.parents else path.parent)
        / TEMPORARY.replace("*", secrets.token_hex(8))
        for path, content in files.items()
        if content is not None
    }
    with only_writer(folder):
        try:
            for path in files:
                require_replaceable(path)
            for path, temporary in beside.items():
                with _about(path):
                    _write_new(temporary, files[path] or b"", like=path)
            for path in files:
                with _about(path):
                    if path in beside:
                        beside[path].replace(path)
                    else:
                        path.unlink(missing_ok=True)
        finally:
            for temporary in beside.values():
                with suppress(OSError):
                    temporary.unlink(missing_ok=True)


@contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """Let no other thread or process write into a folder meanwhile.

    Temporary files that killed processes have left in it are removed.

    Raises
    ------
    OSError
        Another process is writing there and does not end.
    """
    with _WRITING:
        if folder in _locked:
            yield
            return
        try:
            number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        except OSError:  # writing will tell
            yield
            return
        try:
            if _lock(number, folder):
                for left in folder.glob(TEMPORARY):
                    with suppress(OSError):
                        left.unlink()
            _locked.add(folder)
            yield
        finally:
            _locked.discard(folder)
            os.close(number)


def require_replaceable(path: Path) -> None:
    """Require that nothing or a writable regular file, no link to one, lies at the path.

    Raises
    ------
    OSError
        With the reason.
    """
    try:
        mode = path.lstat().st_mode
    except OSError:  # nothing is there, or writing will tell
        return
    if not stat.S_ISREG(mode):
        what = OTHER_KINDS.get(stat.S_IFMT(mode), "something else")
        raise OSError(errno.EINVAL, f"it is {what}, not a file", str(path))
    if not mode & stat.S_IWUSR or not os.access(path, os.W_OK):  # root may write everything
        raise OSError(errno.EACCES, "it is read-only", str(path))


def require_writable(path: Path) -> None:
    """Require that a file can be written, before any work is done for it.

    Raises
    ------
    OSError
        Its folder does not exist or cannot be written to, or as `require_replaceable`.
    """
    folder = path.absolute().parent
    if not folder.is_dir():
        code = errno.ENOTDIR if folder.exists() else errno.ENOENT
        raise OSError(code, os.strerror(code), str(path))
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OSError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    require_replaceable(path)


def _write_new(path: Path, content: bytes, *, like: Path) -> None:
    """Write a new file to the disk, with the permissions of another file if that exists."""
    with path.open("xb") as file:
        file.write(content)
        with suppress(FileNotFoundError):
            os.fchmod(file.fileno(), stat.S_IMODE(like.lstat().st_mode) & 0o777)
        file.flush()
        os.fsync(file.fileno())  # a power cut after the rename must not leave an empty file


def _lock(number: int, folder: Path) -> bool:
    """Lock an open folder; return False if its file system has no locks.

    Raises
    ------
    OSError
        Another process keeps it locked.
    """
    end = monotonic() + PATIENCE
    while True:
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if monotonic() > end:
                said = "another process is writing there"
                raise OSError(errno.EAGAIN, said, str(folder)) from None
            sleep(0.02)
        except OSError:
            return False
        else:
            return True


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


# -----------------------------------------------------------------------------
# Folders for temporary files.

SCRATCH = "kerfpath-scratch-"
"""Beginning of the names of such folders."""
YOUNG = 60.0
"""Age up to which a folder may be one that its process has not locked yet, s."""

_scratch: set[Path] = set()


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Make a folder for temporary files, and remove it at the end.

    Those that killed processes of this user have left are removed first.
    """
    for left in Path(tempfile.gettempdir()).glob(f"{SCRATCH}*"):
        with suppress(OSError):
            _remove_left(left)
    folder = Path(tempfile.mkdtemp(prefix=SCRATCH))
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    _lock(number, folder)
    _scratch.add(folder)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        _scratch.discard(folder)
        os.close(number)


def _remove_left(folder: Path) -> None:
    """Remove a folder of this user that no process has locked."""
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        found = os.fstat(number)
        if found.st_uid == os.getuid() and found.st_mtime < time() - YOUNG:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(folder, ignore_errors=True)
    finally:
        os.close(number)


def remove_scratch() -> None:
    """Remove all folders of `scratch_folder`; only the end of the process may follow."""
    for folder in list(_scratch):
        shutil.rmtree(folder, ignore_errors=True)
