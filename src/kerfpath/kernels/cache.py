"""Keep compiled kernels in a cache, where damage is noticed.

Numba's cache does not notice an edited helper in another file, so the name of the cache folder is
a hash of all kernels and of the codes that they use, of the processor, and of what else changes
compiled code: an edit anywhere starts a new folder. It is in the user's cache, so that a new
version, checkout or environment with the same kernels uses it.

Numba would unpickle whatever is in its files, and run it. Here each file begins with a hash of its
name and its content, and a file without the right one counts as missing: it is compiled again and
replaced.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import shutil
import stat
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from secrets import token_hex
from time import time
from typing import Any

import llvmlite
import numba
import numpy as np
import platformdirs
from numba.core.caching import FunctionCache, InTreeCacheLocator
from numba.core.registry import cpu_target
from numba.core.serialize import dumps

from kerfpath.isolated import OF_NUMBA
from kerfpath.kernels.alone import config

FOLDERS_KEPT = 8
"""Cache folders that are kept, those that were used last: of this and of other kernels."""
HALF_WRITTEN = 3600.0
"""Age from which a temporary file in the cache is one that a killed process has left, s."""
PROBE = bytes(1 << 20)
"""Written to see whether there is room: the largest file of the cache has a tenth of it."""
HASH = hashlib.sha256().digest_size
"""Bytes with which each file begins: the hash of its name and of the rest."""


def _digest() -> str:
    """Return the hash of all that compiled kernels depend on."""
    here = Path(__file__).parent
    versions = numba.__version__, np.__version__, llvmlite.__version__
    processor = cpu_target.target_context.codegen().magic_tuple()
    settings = sorted((n, v) for n, v in os.environ.items() if n.startswith("NUMBA_"))
    settings = [(name, value) for name, value in settings if name not in OF_NUMBA]
    digest = hashlib.sha256(repr((versions, processor, settings)).encode())
    for source in (*sorted(here.glob("*.py")), here.parent / "losses.py"):
        digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    """Return the first folder that can be written to, or the first; never one by a relative path.

    Without a home, the path of the user's cache would be relative to the current folder.
    """
    if config.CACHE_DIR:
        folders = [Path(config.CACHE_DIR).absolute()]
    else:
        folders = [platformdirs.user_cache_path("kerfpath"), Path(__file__).parent / "__pycache__"]
    folders = [folder for folder in folders if folder.is_absolute()]
    for folder in folders:
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return folder / f"numba-{_digest()}"
    return folders[0] / f"numba-{_digest()}"


CACHE = _cache_folder()
"""Folder of the compiled kernels of exactly these sources, for this processor."""
with suppress(OSError):
    os.utime(CACHE)  # it is used


_loss: list[OSError] = []


def _note_loss(error: OSError) -> None:
    """Warn that compiled kernels are not kept, once."""
    if not _loss:
        _loss.append(error)
        warnings.warn(
            f"compiled kernels cannot be kept in {CACHE} ({error.strerror}), so every run compiles "
            "them again; make room there, or set NUMBA_CACHE_DIR to another folder",
            stacklevel=2,
        )


def is_kept() -> bool:
    """Return whether compiled kernels can be kept; make their folder, and remove old ones."""
    if _loss:
        return False
    try:
        CACHE.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=CACHE) as probe:
            probe.write(PROBE)
    except OSError as error:
        _note_loss(error)
        return False
    _remove_old()
    return True


def _remove_old() -> None:
    """Remove folders of other kernels but those used last, and temporary files of killed runs."""
    ages: dict[Path, float] = {}
    for folder in CACHE.parent.glob("numba-*"):
        with suppress(OSError):
            found = folder.lstat()
            ours = re.fullmatch("numba-[0-9a-f]{16}", folder.name) and folder != CACHE
            if ours and stat.S_ISDIR(found.st_mode):
                ages[folder] = -found.st_mtime
    for folder in sorted(ages, key=ages.__getitem__)[FOLDERS_KEPT - 1 :]:
        shutil.rmtree(folder, ignore_errors=True)
    for left in CACHE.glob("*.tmp.*"):
        with suppress(OSError):
            if left.lstat().st_mtime < time() - HALF_WRITTEN:
                left.unlink()


class Locator(InTreeCacheLocator):
    """Makes numba keep compiled kernels in `CACHE`, wherever the package is installed."""

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(CACHE)

    def ensure_cache_path(self) -> None:
        """Make no folder before there is something to keep."""


class _Files:
    """The files of a kernel: an index, and compiled code for each type of arguments."""

    def __init__(self, base: str) -> None:
        self._base, self._index = base, f"{base}.nbi"

    def load(self, key: object) -> Any:
        """Return what was kept under a key; None if there is nothing."""
        name = self._names().get(key)
        return None if name is None else _read(name)

    def save(self, key: object, data: object) -> None:
        """Keep compiled code, if that is possible."""
        # Two processes that compile at the same time must not choose one name for two keys.
        name = f"{self._base}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"
        try:
            CACHE.mkdir(parents=True, exist_ok=True)
            _write(name, data)
            _write(self._index, self._names() | {key: name})
        except OSError as error:
            _note_loss(error)

    def flush(self) -> None:
        """Forget all that is kept."""
        _write(self._index, {})

    def _names(self) -> dict[object, str]:
        found = _read(self._index)
        return found if isinstance(found, dict) else {}


def _read(name: str) -> Any:
    """Return what is in a file of the cache; None if it is missing, damaged or another one."""
    try:
        number = os.open(CACHE / name, os.O_RDONLY | os.O_NONBLOCK)  # a FIFO would wait
        with os.fdopen(number, "rb") as file:
            whole = file.read() if stat.S_ISREG(os.fstat(number).st_mode) else b""
    except OSError:
        return None
    digest, content = whole[:HASH], whole[HASH:]
    return pickle.loads(content) if digest == _hash(name, content) else None


def _write(name: str, data: object) -> None:
    content: bytes = dumps(data)  # type: ignore[no-untyped-call]  # of numba
    half = CACHE / f"{name}.tmp.{token_hex(8)}"
    try:
        half.write_bytes(_hash(name, content) + content)
        half.replace(CACHE / name)
    finally:
        half.unlink(missing_ok=True)


def _hash(name: str, content: bytes) -> bytes:
    return hashlib.sha256(f"{CACHE.name}/{name}\0".encode() + content).digest()


class KernelCache(FunctionCache):
    """The cache of a kernel, in `CACHE` and checked."""

    def __init__(self, function: Callable[..., object]) -> None:
        kept = config.CACHE_LOCATOR_CLASSES
        config.CACHE_LOCATOR_CLASSES = f"{__name__}.{Locator.__name__}"
        try:
            super().__init__(function)  # type: ignore[no-untyped-call]  # of numba
        finally:
            config.CACHE_LOCATOR_CLASSES = kept
        files: Any = _Files(self._impl.filename_base)
        self._cache_file = files
