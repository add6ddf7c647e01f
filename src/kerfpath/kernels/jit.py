"""Compile the kernels, and keep the compiled code in the cache."""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
from typing import Any, Generic, ParamSpec, TypeVar, cast

import numba
import numpy as np
from llvmlite import ir
from numba.cpython.unsafe import numbers
from numba.extending import intrinsic

from kerfpath.kernels.cache import KernelCache

_P = ParamSpec("_P")
_R = TypeVar("_R")

VECTOR_FLAGS = {"nnan", "nsz"}
"""Fast-math flags that let a minimum over an array vectorise. They assume that there is no NaN
(callers refuse it) and ignore the sign of zero. Infinity is kept and sums keep their order, so that
the result is the same to the bit at every vector width."""


def _compiled(function: Callable[_P, _R], **options: Any) -> Callable[_P, _R]:
    compiled: Any = numba.njit(nogil=True, **options)(function)
    compiled._cache = KernelCache(function)
    return cast("Callable[_P, _R]", compiled)


variable = cast("Callable[[int], int]", np.int64)
"""Convert a literal int to the type of a variable: numba compiles a callee again for each literal
argument."""


class _Part(Generic[_P, _R]):
    """A kernel that only other kernels can call: Python cannot."""

    def __init__(self, function: Callable[_P, _R], **options: Any) -> None:
        compiled: Any = _compiled(
            function, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options
        )
        self._name = function.__qualname__
        self._compiled, self._numba_type_ = compiled, compiled._numba_type_
        update_wrapper(self, function)

    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        raise TypeError(f"{self._name}: only kernels can call it")


def jit(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` with strict IEEE arithmetic; it releases the interpreter lock."""
    return _compiled(function)


def jit_part(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` as `jit` does, but only for calls from kernels: Python cannot call it.

    Without the wrapper that converts Python objects, compiling takes a fifth less time.
    """
    return _Part(function)


def jit_inline(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` as `jit_part` does, inlined into its callers; it must not create arrays.

    It is for functions that inner loops call. Passing a tuple of arrays takes a hundred moves, and
    taking an array out of one counts a reference, at twenty times the cost of a multiplication.
    Without the runtime that could create arrays, references are not counted.
    """
    return _Part(function, forceinline=True, _nrt=False)


def jit_callee(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` as `jit_inline` does, but called: for long ones that few calls share."""
    return _Part(function, _nrt=False)


def jit_equation(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` as `jit_inline` does, for an equation that Python also evaluates."""
    return _compiled(function, forceinline=True, _nrt=False)


def jit_vector(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` as `jit_inline` does, with `VECTOR_FLAGS`, for the innermost loops.

    A loop vectorises if no index is signed (a negative one would count from the end), if the
    number of joints is a constant in the caller, and if there are no jumps.
    """
    return _Part(function, fastmath=VECTOR_FLAGS, forceinline=True, _nrt=False)


def _of_two(name: str) -> Callable[[float, float], float]:
    """Return the LLVM intrinsic `name` of two floats.

    Python's min and max become comparisons, which LLVM does not recognise as a reduction and runs
    one number at a time. The intrinsics vectorise; they do not handle NaN.
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
"""The number of 0 bits of an unsigned integer below its lowest 1."""

larger = _of_two("llvm.maxnum")
"""The larger of two floats, in loops that are to vectorise."""


@jit_vector
def either(condition: bool, a: float, b: float) -> float:
    """Return a if the condition holds, else b; both are evaluated, which avoids a jump."""
    return a if condition else b
