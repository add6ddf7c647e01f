"""Arrays and numbers of users: checks of their dtype and shape, and how they are printed."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from html import escape
from pathlib import PurePath
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kerfpath.errors import InputError

# -----------------------------------------------------------------------------
# Input checks: cast the arrays of users to the dtype and shape that the kernels assume.
#
# Every array inside kerfpath is float64 (or an integer type), C-contiguous, finite and read-only.

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
_A = TypeVar("_A", bound=NDArray[Any])

WHOLE = 2.0**53
"""From here on float64 does not represent every whole number."""
POSE = "a pose is a rotation (3, 3) beside a translation (3, 1) in m, above the row 0 0 0 1"
FAR = 100.0
"""m: a cell is smaller; larger lengths are in another unit."""
_ROTATION_TOLERANCE = 1e-6
"""How far R^T R may be from the identity: seven printed decimals pass, a typo fails."""

# OpenBLAS takes its memory at the first product, and ends the process if there is none. Taken here,
# before anything large is loaded, too little memory is an error of Python, which says so.
np.linalg.inv(np.eye(2))


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
    hint: str = "",
) -> Array:
    """Return `value` as a read-only float64 array of `shape` (None: any length), all finite.

    Without `copy` the result may be a view of `value`: for arrays that are not kept. With
    `infinite`, infinity is accepted. `hint` says what to give instead of another shape.

    Raises
    ------
    InputError
        Not numbers, another shape, NaN or infinity; the message names the first bad index.
    """
    array = np.asarray(_converted(value, name, np.float64), order="C")
    _require_shape(array, name, shape, hint)
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


def require_keywords(given: Iterable[str], allowed: type, **hints: str) -> None:
    """Raise TypeError unless all keywords are those of a TypedDict; `hints` replace the list."""
    known = allowed.__annotations__
    for name in given:
        if name not in known:
            hint = hints.get(name, f"the options are {', '.join(sorted(known))}")
            raise TypeError(f"unexpected keyword argument {name!r}; {hint}")


def as_pose(value: ArrayLike, name: str) -> Array:
    """Return `value` as a read-only (4, 4) homogeneous transform, its rotation orthonormal.

    Raises
    ------
    InputError
        Another shape, a last row that is not (0, 0, 0, 1), or a matrix that is not a rotation.
    """
    pose = floats(value, name, (4, 4), hint=POSE)
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


def require_metres(size: float, name: str) -> None:
    """Raise InputError for a length that is surely in another unit than m; it asks for the unit."""
    if size > FAR:
        raise InputError(
            f"{name}: unit? lengths are in m, got {size:g} m; if that is in mm, divide by 1000, "
            f"which gives {size / 1e3:g} m"
        )


def in_radians(value: float, name: str, expected: str) -> InputError:
    """Return the error for an angle in rad that was surely meant in deg."""
    return InputError(
        f"{name}: expected {expected}, got {value:g} rad, which is {np.degrees(value):.4g} deg; "
        f"unit? for {value:g} deg give np.radians({value:g})"
    )


def require_instance(value: object, kind: type, name: str, cure: str) -> None:
    """Raise InputError, with what to do, unless `value` is an object of a class of kerfpath."""
    if not isinstance(value, kind):
        raise InputError(
            f"{name}: expected a kerfpath.{kind.__name__}, got {_type_of(value)}; {cure}"
        )


def _type_of(value: object) -> str:
    """Return the type of a value, and the value itself if it is a short text."""
    if value is None:
        return "None"
    shape = f" of shape {value.shape}" if isinstance(value, np.ndarray) else ""
    shown = f" {value!r}" if isinstance(value, str) and len(value) <= SHORT else ""
    return f"{type(value).__name__}{shown}{shape}"


def _converted(value: ArrayLike, name: str, dtype: type[np.float64]) -> Array:
    if value is None:
        raise InputError(f"{name}: expected an array of numbers, got None")
    try:
        return np.asarray(value, dtype=dtype)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name}: expected an array of numbers ({error})") from None


def _require_shape(
    array: NDArray[Any], name: str, shape: tuple[int | None, ...], hint: str = ""
) -> None:
    fits = array.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        want = "(" + ", ".join("any" if s is None else str(s) for s in shape) + ")"
        cure = f"; {hint}" if hint else ""
        raise InputError(f"{name}: expected shape {want}, got {array.shape}{cure}")


# -----------------------------------------------------------------------------
# One line that describes a data object, as a notebook prints it.

LONGEST = 240
"""Most characters of a line; fields that do not fit are left out."""
FEW = 6
"""Most numbers of an array, or items of a collection, that are all shown."""
SHORT = 40
"""Most characters of a text, or of a collection whose items are shown."""
SHOWN_UNITS = {"m": (1e3, "mm"), "rad": (180 / np.pi, "deg")}
"""For the unit of a joint: the factor to the unit that people and files see, and that unit."""


def lengths_along(points: Array) -> Array:
    """Return the length (K,) of a polyline up to each of its points (K, d)."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


def spread(count: int, most: int) -> Ints:
    """Return at most so many of the numbers from 0 to count - 1, evenly spread, both ends."""
    return np.unique(np.linspace(0, count - 1, most).astype(np.int64))


def places_within(count: Ints) -> Ints:
    """Return the numbers from 0 to each count (R,) less one, ranges of that length in a row."""
    return np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)


def counted(number: int, noun: str) -> str:
    """Return a number with its noun in singular or plural: "1 face", "2 faces"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def short_repr(thing: Any) -> str:
    """Return the class of a dataclass and its fields in short; arrays by their shapes."""
    said, left = [f"{type(thing).__name__}("], LONGEST
    for field in fields(thing):
        value = getattr(thing, field.name)
        if value is None or not field.repr:
            continue
        part = f"{field.name}={_short(value)}"
        left -= len(part) + 2
        if left < 0:
            said.append("..., ")
            break
        said.append(f"{part}, ")
    return "".join(said).removesuffix(", ") + ")"


def html_table(caption: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as HTML, for notebooks: text alone, everything escaped."""
    lines = [("th", heads), *(("td", row) for row in rows)]
    body = "".join(
        f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"
        for tag, cells in lines
    )
    return f"<table><caption>{escape(caption)}</caption>{body}</table>"


def in_degrees(value: float, unit: str) -> str:
    """Return a value in rad or m, or per s or s^2, in deg or mm: "12.50 deg/s", "40.00 mm"."""
    of, slash, per = unit.partition("/")
    factor, word = SHOWN_UNITS[of]
    return f"{factor * value:.2f} {word}{slash}{per}"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        if value.ndim == 1 and value.size <= FEW and value.dtype != object:
            return "[" + ", ".join(_short(each) for each in value.tolist()) + "]"
        return f"array {' x '.join(map(str, value.shape))}"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, str):
        return repr(value if len(value) <= SHORT else f"{value[:SHORT]}...")
    if isinstance(value, PurePath):
        return repr(value.name)
    if isinstance(value, Mapping):
        return f"{len(value)} keys"
    if isinstance(value, Collection):
        return _several(value)
    if is_dataclass(value):
        name = getattr(value, "name", getattr(value, "id", None))
        return (
            f"{type(value).__name__}({name!r})" if isinstance(name, str) else type(value).__name__
        )
    plain = repr(value)
    return plain if len(plain) <= SHORT else type(value).__name__


def _several(values: Collection[Any]) -> str:
    if len(values) <= FEW:
        all_of_them = ", ".join(_short(value) for value in values)
        if len(all_of_them) <= SHORT:
            return f"({all_of_them})"
    return f"{len(values)} x {type(next(iter(values))).__name__}"
