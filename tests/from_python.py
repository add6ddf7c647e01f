"""Kernels that only kernels call, made callable for tests."""

from types import SimpleNamespace

import numba


def from_python(kernel):
    """A kernel that Python can call, with the same code inside."""
    return numba.njit(lambda *args: kernel(*args))


def all_of(module):
    """The names of a module of kernels, with every kernel callable."""
    return SimpleNamespace(
        **{
            name: from_python(value) if hasattr(value, "_numba_type_") else value
            for name, value in vars(module).items()
            if not name.startswith("__")
        }
    )
