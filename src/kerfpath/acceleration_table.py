"""Acceleration limits that depend on where joints 2 and 3 are: a table over both.

What an arm can accelerate depends on its inertia and on gravity, which change most with joints 2
and 3. Makers publish such tables rarely; they are measured on a controller.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Ints, floats, freeze, in_radians, positive, short_repr
from kerfpath.errors import InputError

__all__ = ["LIMIT", "OVER", "AccelerationTable"]

OVER = (1, 2)
"""Columns of q over which a table is: joints 2 and 3."""
TURNS = 4 * np.pi
"""rad: no joint 2 or 3 turns further; larger numbers are in deg."""
AXES = ("joint_2_deg", "joint_3_deg")
LIMIT = "joint_{}_deg_s2"
"""Names of columns and keys in files."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AccelerationTable:
    """Acceleration limits of some joints of an arm as functions of its joints 2 and 3.

    Between the nodes they are bilinear. Outside the table each is its least value in the table,
    which also holds wherever a computation needs one number for all configurations.

    Parameters
    ----------
    joint_2 : (A,) rad
        Nodes along joint 2, increasing, at least two.
    joint_3 : (B,) rad
        Nodes along joint 3, likewise.
    limits : mapping of int to (A, B) rad/s^2
        The limits, above 0 and for both directions, by the number of the joint, from 1.
    source : str
        Where the table comes from.

    Attributes
    ----------
    joints : (J,) int
        The columns of q whose limits the table has, ascending.
    values : (A, B, J) rad/s^2
    least, most : (J,) rad/s^2
        Smallest and largest limit of each of these joints.

    Raises
    ------
    InputError
        Nodes that do not increase or are in deg, a hole, NaN, a limit that is not positive, or a
        joint that is not a whole number from 1.
    """

    joint_2: Array
    joint_3: Array
    limits: Mapping[int, Array]
    source: str = "given by the user"
    joints: Ints = field(init=False)
    values: Array = field(init=False)
    least: Array = field(init=False)
    most: Array = field(init=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        _set = object.__setattr__
        axes = [_axis(getattr(self, name), name) for name in ("joint_2", "joint_3")]
        if not self.limits:
            raise InputError("acceleration table: expected the limits of a joint, got none")
        limits = {}
        for joint, values in sorted(self.limits.items()):
            if not (isinstance(joint, int | np.integer) and joint >= 1):
                raise InputError(
                    f"acceleration table: joints are whole numbers from 1, got {joint!r}"
                )
            name = f"acceleration table of joint {joint}"
            limits[int(joint)] = positive(values, name, (len(axes[0]), len(axes[1])))
        values = np.stack([*limits.values()], axis=-1)
        _set(self, "joint_2", axes[0])
        _set(self, "joint_3", axes[1])
        _set(self, "limits", limits)
        _set(self, "joints", freeze(np.array([*limits], np.int64) - 1))
        _set(self, "values", freeze(values))
        _set(self, "least", freeze(values.min(axis=(0, 1))))
        _set(self, "most", freeze(values.max(axis=(0, 1))))

    @classmethod
    def from_degrees(
        cls,
        joint_2: ArrayLike,
        joint_3: ArrayLike,
        limits: Mapping[int, ArrayLike],
        *,
        source: str = "given by the user",
    ) -> AccelerationTable:
        """Return the table with nodes in deg and limits in deg/s^2.

        Raises
        ------
        InputError
            As the class.
        """
        return cls(
            joint_2=np.radians(floats(joint_2, "joint_2", (None,))),
            joint_3=np.radians(floats(joint_3, "joint_3", (None,))),
            limits={
                joint: np.radians(floats(values, f"limits of joint {joint}", (None, None)))
                for joint, values in limits.items()
            },
            source=source,
        )

    @classmethod
    def from_csv(cls, path: str | Path) -> AccelerationTable:
        """Return the table of a CSV file with one row for each node, in any order.

        The header names the columns with their units: joint_2_deg, joint_3_deg, and joint_1_deg_s2
        and so on for the limits of each joint.

        Raises
        ------
        InputError
            The file cannot be read, other columns, a row that is not numbers, a node missing or
            there twice, and as the class.
        """
        path = Path(path)
        try:
            with path.open(encoding="utf-8-sig", newline="") as file:
                rows = [row for row in csv.reader(file) if any(cell.strip() for cell in row)]
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise InputError(f"{path}: {error}") from None
        names = [name.strip() for name in rows[0]] if rows else []
        known = {LIMIT.format(joint): joint for joint in range(1, 8)}
        wrong = [name for name in names if name not in (*AXES, *known)]
        if wrong or len(set(names)) < len(names) or not {*AXES} < {*names}:
            said = f"the column {wrong[0]!r}" if wrong else ",".join(names) or "nothing"
            raise InputError(
                f"{path}: expected columns {', '.join(AXES)} and {LIMIT.format(1)} and so on, each "
                f"once, got {said}"
            )
        numbers = np.empty((len(rows) - 1, len(names)))
        for i, row in enumerate(rows[1:]):
            try:
                numbers[i] = [float(cell) for cell in row]
            except ValueError:
                raise InputError(
                    f"{path}, row {i + 2}: expected {len(names)} numbers, got {','.join(row)}"
                ) from None
        table = dict(zip(names, floats(numbers, f"{path}", (None, None)).T, strict=True))
        try:
            return cls._of_rows(table, known, source=f"file {path.name}")
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

    @classmethod
    def _of_rows(
        cls, table: Mapping[str, Array], known: Mapping[str, int], source: str
    ) -> AccelerationTable:
        axes = [np.unique(table[name], return_inverse=True) for name in AXES]
        (x, i), (y, j) = axes
        count = np.zeros((len(x), len(y)), np.int64)
        np.add.at(count, (i, j), 1)
        if (count != 1).any():
            at = tuple(int(k) for k in np.argwhere(count != 1)[0])
            what = "a hole" if count[at] == 0 else "two rows"
            raise InputError(
                f"expected one row for each of {len(x)} x {len(y)} nodes, got {what} at "
                f"joint_2_deg {x[at[0]]:g}, joint_3_deg {y[at[1]]:g}"
            )
        limits = {}
        for name, joint in known.items():
            if name in table:
                limits[joint] = np.empty(count.shape)
                limits[joint][i, j] = table[name]
        return cls.from_degrees(x, y, limits, source=source)

    def require_arm(self, joints: int) -> None:
        """Raise InputError unless the joints of the table are among those of an arm."""
        if joints <= max(OVER) or self.joints[-1] >= joints:
            last = max(int(self.joints[-1]), *OVER) + 1
            raise InputError(
                f"acceleration table: it is over or for joint {last}, but the arm has {joints} "
                "joints"
            )

    def at(self, q: Array) -> Array:
        """Return the limits (..., J) rad/s^2 of the joints of the table at q (..., n) rad."""
        q = np.asarray(q, dtype=float)
        x, y = q[..., OVER[0]], q[..., OVER[1]]
        i, u = _cell_of(self.joint_2, x)
        j, w = _cell_of(self.joint_3, y)
        v, u, w = self.values, u[..., None], w[..., None]
        # This form gives a constant table its value without rounding.
        low = v[i, j] + w * (v[i, j + 1] - v[i, j])
        high = v[i + 1, j] + w * (v[i + 1, j + 1] - v[i + 1, j])
        inside = ((x >= self.joint_2[0]) & (x <= self.joint_2[-1]))[..., None]
        inside = inside & ((y >= self.joint_3[0]) & (y <= self.joint_3[-1]))[..., None]
        return np.asarray(np.where(inside, low + u * (high - low), self.least))

    def into(self, limits: Array, own: Array) -> Array:
        """Return limits (..., n) with those of the joints of the table replaced by own (..., J)."""
        replaced = np.array(np.broadcast_to(limits, (*own.shape[:-1], limits.shape[-1])))
        replaced[..., self.joints] = own
        return freeze(replaced)


def _axis(nodes: Array, name: str) -> Array:
    nodes = floats(nodes, f"acceleration table, {name}", (None,))
    if len(nodes) < 2 or not (np.diff(nodes) > 0).all():
        raise InputError(
            f"acceleration table: {name} must increase from node to node, at least two, got "
            f"{nodes.tolist()}"
        )
    if (largest := float(np.abs(nodes).max())) > TURNS:
        raise in_radians(largest, f"acceleration table, {name}", "the nodes in rad")
    return nodes


def _cell_of(nodes: Array, x: Array) -> tuple[Ints, Array]:
    """Return the cell of each value, outside the nearest one, and the share of it passed."""
    i = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, len(nodes) - 2)
    return i, (x - nodes[i]) / (nodes[i + 1] - nodes[i])
