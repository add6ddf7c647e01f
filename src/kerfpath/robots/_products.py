"""The library of rails and positioners, one TOML file each, with their sources."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.robots._external import ExternalAxis
from kerfpath.robots._known_axis import KnownAxis
from kerfpath.robots._library import nearest

__all__ = ["ExternalProduct", "external", "external_axes", "external_ids"]

_HERE = files("kerfpath.robots") / "externals"
_KEYS = {
    "linear": ("lower_mm", "upper_mm", "velocity_mm_s", "acceleration_mm_s2"),
    "rotary": ("lower_deg", "upper_deg", "velocity_deg_s", "acceleration_deg_s2"),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExternalProduct:
    """A rail or a positioner of the library.

    Parameters
    ----------
    id, manufacturer, model : str
    payload : float kg
    axes : tuple of KnownAxis
        Axes in the product's own frame, z up; each carries the next. A rail runs along x; a
        positioner has its origin on the floor and its tilt axis along x. Limits that no source
        gives are None.
    notes : tuple of str
        Remarks for the user.
    sources : mapping of str to str
        Where the data come from.
    """

    id: str
    manufacturer: str
    model: str
    payload: float
    axes: tuple[KnownAxis, ...]
    notes: tuple[str, ...]
    sources: Mapping[str, str]

    __repr__ = short_repr

    @property
    def axis_ids(self) -> tuple[str, ...]:
        """Names of the axes in a job, such as "kuka_dkp400.tilt"; a single axis has the id."""
        if len(self.axes) == 1:
            return (self.id,)
        return tuple(f"{self.id}.{known.axis.name}" for known in self.axes)


@cache
def external_ids() -> tuple[str, ...]:
    """Return the ids of all rails and positioners in the library, sorted."""
    names = (f.name for f in _HERE.iterdir())
    return tuple(sorted(n.removesuffix(".toml") for n in names if n.endswith(".toml")))


def external(name: str) -> ExternalProduct:
    """Return a rail or positioner of the library by its id.

    Parameters
    ----------
    name : str
        One of `external_ids()`.

    Raises
    ------
    InputError
        The id is unknown; the message names the nearest ones.
    """
    if name not in external_ids():
        raise InputError(
            f"{name!r} is not in the library of {len(external_ids())} rails and positioners; "
            f"{nearest(name, external_ids())}; 'kerfpath robots' lists all"
        )
    data = tomllib.loads((_HERE / f"{name}.toml").read_text(encoding="utf-8"))
    axes = []
    for said in data["axis"]:
        factor = 1e-3 if said["kind"] == "linear" else np.pi / 180
        lower, upper, velocity, acceleration = (
            None if key not in said else factor * said[key] for key in _KEYS[said["kind"]]
        )
        axes.append(
            KnownAxis(
                axis=ExternalAxis(
                    name=said["name"],
                    kind=said["kind"],
                    carries=said["carries"],
                    axis=np.array(said["axis"], dtype=float),
                    point=np.array(said.get("point_mm", (0, 0, 0)), dtype=float) / 1000,
                ),
                lower=lower,
                upper=upper,
                velocity=velocity,
                acceleration=acceleration,
                endless=said.get("endless", False),
                source=f"the library ({name})",
            )
        )
    return ExternalProduct(
        id=data["id"],
        manufacturer=data["manufacturer"],
        model=data["model"],
        payload=data["payload_kg"],
        axes=tuple(axes),
        notes=tuple(data.get("notes", ())),
        sources=data["source"],
    )


@cache
def external_axes() -> dict[str, KnownAxis]:
    """Return every external axis of the library by its name in a job."""
    products = [external(name) for name in external_ids()]
    return {
        name: known
        for product in products
        for name, known in zip(product.axis_ids, product.axes, strict=True)
    }
