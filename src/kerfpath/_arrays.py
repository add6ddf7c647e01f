"""Input checks: cast the arrays of users to the dtype and shape that the kernels assume.

Every array inside kerfpath is float64 (or an integer type), C-contiguous, finite and read-only.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kerfpath.errors import InputError

__all__ = [
    "Array",
    "Bools",
    "Ints",
    "as_pose",
    "bools",
    "floats",
    "freeze",
    "integers",
    "not_negative",
    "positive",
    "require_one_of",
    "scalar",
]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
_A = TypeVar("_A", bound=NDArray[Any])

WHOLE = 2.0**53
"""From here on float64 does not represent every whole number."""
_ROTATION_TOLERANCE = 1e-6
"""How far R^T R may be from the identity: seven printed decimals pass, a typo fails."""


def freeze(array: _A) -> _A:
    """Return `array` itself, made read-only."""
    array.setflags(write=False)
    return array


def floats(
    value: ArrayLike,
    name: str,
    shape: tuple[int | None, ...],
    *,
    copy: bool = True,
    infinite: bool = False,
) -> Array:
    """Return `value` as a read-only float64 array of `shape` (None: any length), all finite.

    Without `copy` the result may be a view of `value`: for arrays that are not kept. With
    `infinite`, infinity is accepted.

    Raises
    ------
    InputError
        Not numbers, another shape, NaN or infinity; the message names the first bad index.
    """
    array = np.asarray(_converted(value, name, np.float64), order="C")
    _require_shape(array, name, shape)
    array = array.copy() if copy else array.view()
    good = ~np.isnan(array) if infinite else np.isfinite(array)
    if not good.all():
        index = tuple(int(i) for i in np.argwhere(~good)[0])
        raise InputError(
            f"{name}: every number must be {'a number' if infinite else 'finite'}, "
            f"but {name}{list(index)} is {array[index]}"
        )
    return freeze(array)


def integers(value: ArrayLike, name: str, shape: tuple[int | None, ...]) -> Ints:
    """Return `value` as a read-only int64 array of `shape`; floats must be whole numbers."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "i":
        _require_shape(value, name, shape)
        return freeze(np.array(value, dtype=np.int64, order="C"))
    array = _converted(value, name, np.float64)
    _require_shape(array, name, shape)
    if not ((np.abs(array) < WHOLE).all() and (array == np.round(array)).all()):
        raise InputError(f"{name}: expected whole numbers")
    return freeze(np.array(value, dtype=np.int64, order="C"))


def bools(value: ArrayLike, name: str, shape: tuple[int | None, ...]) -> Bools:
    """Return `value` as a read-only bool array of `shape`; it may be True, False, 0 or 1."""
    array = np.asarray(value)
    _require_shape(array, name, shape)
    if array.dtype != np.bool_ and not np.isin(array, (0, 1)).all():
        raise InputError(f"{name}: expected true or false for each entry, got {array.tolist()}")
    return freeze(np.array(array, dtype=np.bool_, order="C"))


def positive(value: ArrayLike, name: str, shape: tuple[int | None, ...]) -> Array:
    """Return `value` as `floats` does, all strictly positive."""
    array = floats(value, name, shape)
    if not (array > 0).all():
        index = [int(i) for i in np.argwhere(~(array > 0))[0]]
        raise InputError(f"{name}: must be positive, but {name}{index} is {array[tuple(index)]:g}")
    return array


def scalar(value: float, name: str, *, unit: str = "", above: float | None = None) -> float:
    """Return `value` as a finite float, above `above` if that is given."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}: expected a number, got {value!r}") from None
    unit = f" {unit}" if unit else ""
    if not np.isfinite(number) or (above is not None and not number > above):
        bound = "a finite number" if above is None else f"a number above {above:g}{unit}"
        raise InputError(f"{name}: expected {bound}, got {number:g}{unit}")
    return number


def not_negative(value: float, name: str, *, unit: str = "") -> float:
    """Return `value` as a finite float, 0 or more."""
    number = scalar(value, name, unit=unit)
    if number < 0:
        unit = f" {unit}" if unit else ""
        raise InputError(f"{name}: must not be negative, got {number:g}{unit}")
    return number


def require_one_of(value: object, name: str, known: Collection[str]) -> None:
    """Raise InputError unless `value` is one of the known words."""
    if value not in known:
        raise InputError(f"{name}: expected one of {', '.join(known)}, got {value!r}")


def as_pose(value: ArrayLike, name: str) -> Array:
    """Return `value` as a read-only (4, 4) homogeneous transform, its rotation orthonormal.

    Raises
    ------
    InputError
        Another shape, a last row that is not (0, 0, 0, 1), or a matrix that is not a rotation.
    """
    pose = floats(value, name, (4, 4))
    rotation = pose[:3, :3]
    if not np.array_equal(pose[3], (0.0, 0.0, 0.0, 1.0)):
        raise InputError(f"{name}: the last row must be 0 0 0 1, got {pose[3].tolist()}")
    error = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if error > _ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        raise InputError(
            f"{name}: the upper left 3x3 must be a right-handed rotation, "
            f"but it is off by {error:.1e} (allowed {_ROTATION_TOLERANCE:g})"
        )
    return pose


def _converted(value: ArrayLike, name: str, dtype: type[np.float64]) -> Array:
    try:
        return np.asarray(value, dtype=dtype)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name}: expected an array of numbers ({error})") from None


def _require_shape(array: NDArray[Any], name: str, shape: tuple[int | None, ...]) -> None:
    fits = array.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        want = "(" + ", ".join("any" if s is None else str(s) for s in shape) + ")"
        raise InputError(f"{name}: expected shape {want}, got {array.shape}")
