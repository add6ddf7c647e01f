"""The one way kernels are compiled, and where the compiled code is kept.

Numba's cache does not notice an edited helper in another file, so the cache folder is named by the
content of all kernels: an edit anywhere starts a new one, in a checkout as in an installed copy.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numba
import platformdirs

__all__ = ["CACHE", "VECTOR_FLAGS", "is_compiled", "jit", "jit_vector"]

_P = ParamSpec("_P")
_R = TypeVar("_R")

VECTOR_FLAGS = {"nnan", "nsz", "reassoc", "contract"}
"""Floating-point freedoms that let a reduction vectorise and keep infinity (no blanket fastmath).
A kernel that takes them never meets NaN: the border refuses it."""


def _cache_folder() -> Path:
    config: Any = numba.config
    if config.CACHE_DIR:
        return Path(config.CACHE_DIR)
    here = Path(__file__).parent
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(here.glob("*.py")):
        digest.update(source.name.encode() + source.read_bytes())
    name = f"numba-{digest.hexdigest()[:16]}"
    pycache = here / "__pycache__"
    writable = os.access(pycache if pycache.is_dir() else here, os.W_OK)
    return (pycache if writable else platformdirs.user_cache_path("kerfpath")) / name


CACHE = _cache_folder()
"""Where the compiled kernels of exactly these sources are kept (or NUMBA_CACHE_DIR, if set)."""


def is_compiled() -> bool:
    """Return whether kernels have been compiled into the cache before."""
    return any(CACHE.rglob("*.nbi"))


def _compiled(function: Callable[_P, _R], flags: set[str] | bool) -> Callable[_P, _R]:
    config: Any = numba.config
    kept = config.CACHE_DIR
    config.CACHE_DIR = str(CACHE)
    try:
        compiled: Callable[_P, _R] = numba.njit(cache=True, nogil=True, fastmath=flags)(function)
    finally:
        config.CACHE_DIR = kept
    return compiled


def jit(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` with strict IEEE arithmetic; it releases the interpreter lock."""
    return _compiled(function, False)


def jit_vector(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` with `VECTOR_FLAGS`; for the innermost loops over bare arrays."""
    return _compiled(function, VECTOR_FLAGS)
