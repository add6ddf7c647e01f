"""How kernels are compiled, and where the compiled code is kept.

Numba's cache does not notice an edited helper in another file, so the cache folder is named by the
content of all kernels and of the codes that they use: an edit anywhere starts a new folder. It lies
in the user's cache, so that a new version, checkout or environment with the same kernels uses it.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from functools import update_wrapper
from pathlib import Path
from typing import Any, Generic, ParamSpec, TypeVar, cast

import numba
import numpy as np
import platformdirs
from llvmlite import ir
from numba.core.caching import InTreeCacheLocator
from numba.cpython.unsafe import numbers
from numba.extending import intrinsic

__all__ = [
    "CACHE",
    "VECTOR_FLAGS",
    "either",
    "jit",
    "jit_equation",
    "jit_inline",
    "jit_part",
    "jit_vector",
    "larger",
    "smaller",
    "trailing_zeros",
    "variable",
]

_P = ParamSpec("_P")
_R = TypeVar("_R")

VECTOR_FLAGS = {"nnan", "nsz"}
"""Floating-point freedoms that let the least of many vectorise: no NaN, which the border refuses,
and no care for the sign of zero. Infinity stays, and sums keep their order: the same to the bit,
however many numbers an instruction takes."""


def _cache_folder() -> Path:
    config: Any = numba.config
    if config.CACHE_DIR:
        return Path(config.CACHE_DIR)
    here = Path(__file__).parent
    digest = hashlib.sha256(f"{numba.__version__} {np.__version__}".encode())
    for source in (*sorted(here.glob("*.py")), here.parent / "losses.py"):
        digest.update(source.name.encode() + source.read_bytes())
    kept = platformdirs.user_cache_path("kerfpath")
    with suppress(OSError):
        kept.mkdir(parents=True, exist_ok=True)
    folder = kept if os.access(kept, os.W_OK) else here / "__pycache__"
    return folder / f"numba-{digest.hexdigest()[:16]}"


CACHE = _cache_folder()
"""Where the compiled kernels of exactly these sources are kept (or NUMBA_CACHE_DIR, if set)."""


class Locator(InTreeCacheLocator):
    """Makes numba keep compiled kernels in `CACHE`, wherever the package is installed."""

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(CACHE)


def _compiled(function: Callable[_P, _R], **options: Any) -> Callable[_P, _R]:
    config: Any = numba.config
    kept = config.CACHE_LOCATOR_CLASSES
    config.CACHE_LOCATOR_CLASSES = f"{__name__}.{Locator.__name__}"
    try:
        compiled: Callable[_P, _R] = numba.njit(cache=True, nogil=True, **options)(function)
    finally:
        config.CACHE_LOCATOR_CLASSES = kept
    return compiled


variable = cast("Callable[[int], int]", np.int64)
"""Makes an int whose type is that of a variable: for a literal argument numba compiles a callee
again, once for each literal."""


class _Part(Generic[_P, _R]):
    """A kernel that only kernels call: numba sees its type, and Python has no way in."""

    def __init__(self, function: Callable[_P, _R], **options: Any) -> None:
        compiled: Any = _compiled(
            function, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options
        )
        self._name = function.__qualname__
        self._compiled, self._numba_type_ = compiled, compiled._numba_type_
        update_wrapper(self, function)

    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        raise TypeError(f"{self._name} is called by kernels alone")


def jit(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` with strict IEEE arithmetic; it releases the interpreter lock."""
    return _compiled(function)


def jit_part(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` as `jit` does, for kernels alone: Python cannot call it.

    Without the code that takes Python's objects apart, compiling takes a fifth less time.
    """
    return _Part(function)


def jit_inline(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` as `jit_part` does, to become part of what calls it; it makes no array.

    For what inner loops call. Handing over a tuple of arrays takes a hundred moves, and taking an
    array out of one counts a reference, at twenty times the cost of a multiplication; without the
    runtime that could make an array, nothing is counted.
    """
    return _Part(function, forceinline=True, _nrt=False)


def jit_equation(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` as `jit_inline` does, for an equation that Python evaluates, too."""
    return _compiled(function, forceinline=True, _nrt=False)


def jit_vector(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` as `jit_inline` does, with `VECTOR_FLAGS`; for the innermost loops.

    They vectorise where no index is signed (it would count from the end if negative), where the
    number of joints is a constant of the caller's, and where nothing jumps.
    """
    return _Part(function, fastmath=VECTOR_FLAGS, forceinline=True, _nrt=False)


def _of_two(name: str) -> Callable[[float, float], float]:
    """Return the LLVM intrinsic `name` of two floats.

    Python's min and max become comparisons, which LLVM does not take for a reduction and leaves
    as they are, one number at a time; these vectorise. Of NaN they know nothing.
    """

    @intrinsic
    def of_two(_context: Any, _a: Any, _b: Any) -> Any:
        def code(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
            double = ir.DoubleType()
            kind = ir.FunctionType(double, [double, double])
            return builder.call(builder.module.declare_intrinsic(name, [double], kind), args)

        real = numba.types.float64
        return real(real, real), code

    made: Any = of_two
    return cast("Callable[[float, float], float]", made)


smaller = _of_two("llvm.minnum")
"""The smaller of two floats, in loops that are to vectorise."""

trailing_zeros = cast("Callable[[np.uint64], np.int64]", numbers.trailing_zeros)
"""How many bits of an unsigned integer are 0 below the lowest 1."""

larger = _of_two("llvm.maxnum")
"""The larger of two floats, in loops that are to vectorise."""


@jit_vector
def either(condition: bool, a: float, b: float) -> float:
    """Return a if the condition holds, else b; both are worked out, so that nothing jumps."""
    return a if condition else b
