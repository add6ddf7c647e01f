"""Placements: offsets of the part, the robot base or the head, and the job moved by them.

The part is moved alone, or together with an external axis that carries it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.job import VARIABLES, CutRequest, Job, PreparedJob, pose
from kerfpath.placement import xyz_rpy
from kerfpath.robots import ExternalAxis
from kerfpath.study.loaded_job import out_of_reach

Numbers = dict[tuple[str | int, ...], list[float]]
"""Changes of a job file for a placement: new values by their path of keys."""

DEFAULT_RANGES = {"x_mm": (-200.0, 200.0), "y_mm": (-200.0, 200.0), "yaw_deg": (-30.0, 30.0)}
"""The default variables and their ranges."""


def ranges_of(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the ranges given by texts such as "x_mm=-200:200".

    Raises
    ------
    InputError
        A variable is unknown or given twice, an end is not a number, or a range is reversed or
        empty.
    """
    found: dict[str, tuple[float, float]] = {}
    for text in texts:
        name, _, span = text.partition("=")
        low, _, high = span.partition(":")
        name = name.strip()
        if name not in VARIABLES:
            raise InputError(f"vary: expected one of {', '.join(VARIABLES)}, got {name!r}")
        try:
            ends = float(low), float(high)
        except ValueError:
            raise InputError(
                f'vary: expected {name}=LOW:HIGH, such as "{name}=-200:200", got {text!r}'
            ) from None
        if not (np.isfinite(ends).all() and ends[0] < ends[1]):
            raise InputError(f"vary: expected {name}=LOW:HIGH with LOW below HIGH, got {text!r}")
        if name in found:
            raise InputError(f"vary: {name} is given twice; keep one")
        found[name] = ends
    return found


def middle_of(job: Job, contours: Sequence[Contour]) -> Array:
    """Return the middle (3,) m of the box around all nodes in the part frame, in the robot base."""
    points = np.concatenate([nodes.points for nodes in contours])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return np.asarray(job.placement[:3, :3] @ middle + job.placement[:3, 3])


def motions_of(offsets: Mapping[str, float], middle: Array) -> tuple[Array, Array]:
    """Return the motions (4, 4) m of the part, and of all that does not move with it, in the base.

    Parameters
    ----------
    offsets, middle
        As in `numbers_of`.
    """
    part, base, _ = _motions({name: offsets.get(name, 0.0) for name in VARIABLES}, middle)
    return np.asarray(base @ part), base


def numbers_of(job: Job, offsets: Mapping[str, float], middle: Array) -> Numbers:
    """Return the changes of a job file that move everything to the given offsets.

    The part is tilted about the base's x and then y, and turned about its z, all through `middle`;
    then it is shifted. The external axis named in [layout] moves with it, together with the axes
    that this one carries. Fixtures also move with the part, except those listed as standing, those
    on other axes, and those on the ground if the part alone is moved on an axis. If the robot base,
    with the axes that carry it, moves by B, everything else moves by inv(B) in the base. The head
    turns about the flange's z. Numbers are rounded as in a file, so that the job in the file is
    exactly the one that was evaluated. Offsets of zero change nothing.

    Parameters
    ----------
    job : Job
    offsets : mapping of variable to float
        Offsets in the units of the variables' names; missing ones are 0.
    middle : (3,) m
        Centre of the rotations of the part, in the robot base.
    """
    unknown = set(offsets) - set(VARIABLES)
    assert not unknown, unknown
    part, base, turn = _motions({name: offsets.get(name, 0.0) for name in VARIABLES}, middle)
    numbers: Numbers = {}

    def put(where: tuple[str | int, ...], T: Array, motion: Array) -> None:
        if not np.array_equal(motion, np.eye(4)):
            numbers[*where, "xyz_mm"], numbers[*where, "rpy_deg"] = xyz_rpy(motion @ T)

    put(("part",), job.placement, base @ part)
    put(("tool",), job.tool, turn)
    of_axes = _of_axes(job, part, base)
    for i, axis in enumerate(job.robot.externals):
        numbers |= _axis_numbers(("robot", "external", i), axis, of_axes[axis.name])
    if job.cell is not None:
        for i, fixture in enumerate(job.cell.fixture):
            motion = _of_fixture(job, fixture.name, fixture.on, part, base, of_axes)
            put(("cell", "fixture", i), pose(fixture.xyz_mm, fixture.rpy_deg), motion)
        head = job.cell.head
        if head.file is not None:
            put(("cell", "head"), pose(head.xyz_mm or (0, 0, 0), head.rpy_deg or (0, 0, 0)), turn)
    return numbers


def _of_axes(job: Job, part: Array, base: Array) -> dict[str, Array]:
    """Return the motion (4, 4) m of each external axis in the robot base, by its name."""
    found, moves = {}, False
    for axis in job.robot.externals:
        if axis.carries == "robot":
            found[axis.name] = np.eye(4)
            continue
        moves = moves or axis.name == job.layout.move
        found[axis.name] = base @ part if moves else base
    return found


def _of_fixture(
    job: Job, name: str, on: str | None, part: Array, base: Array, of_axes: Mapping[str, Array]
) -> Array:
    """Return the motion (4, 4) m of a fixture, which may be on an axis, in the robot base."""
    carriers = [axis.name for axis in job.robot.externals if axis.carries == "part"]
    alone = job.layout.move == "part"
    if on is not None and on not in carriers:
        return of_axes[on]  # it carries the robot
    if name in job.layout.standing:
        return base
    if on is not None:
        return base @ part if alone else of_axes[on]
    return base if alone and carriers else base @ part


def _axis_numbers(where: tuple[str | int, ...], axis: ExternalAxis, motion: Array) -> Numbers:
    """Return the direction and point of a moved axis as values of a job file."""
    numbers: Numbers = {}
    if not np.array_equal(motion[:3, :3], np.eye(3)):
        numbers[*where, "axis"] = [round(float(v), 9) + 0.0 for v in motion[:3, :3] @ axis.axis]
    if axis.kind == "rotary" and not np.array_equal(motion, np.eye(4)):
        moved = motion[:3, :3] @ axis.point + motion[:3, 3]
        numbers[*where, "point_mm"] = [round(float(v), 4) + 0.0 for v in moved * 1e3]
    return numbers


def _motions(offsets: Mapping[str, float], middle: Array) -> tuple[Array, Array, Array]:
    """Return the motion of the part, the motion of everything in the base, and the head's turn."""

    def turned(*names: str) -> Array:
        T = np.eye(4)
        angles = [offsets[name] if name else 0.0 for name in names]
        if any(angles):
            T[:3, :3] = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
        return T

    part = turned("tilt_x_deg", "tilt_y_deg", "yaw_deg")
    shift = np.array([offsets["x_mm"], offsets["y_mm"], offsets["z_mm"]]) / 1000
    if not np.array_equal(part, np.eye(4)):
        shift = shift + middle - part[:3, :3] @ middle
    part[:3, 3] = shift
    base = turned("", "", "base_yaw_deg")
    base[:3, 3] = np.array([offsets[f"base_{axis}_mm"] for axis in "xyz"]) / 1000
    return part, np.asarray(np.linalg.inv(base)), turned("", "", "mount_deg")


def move_job(job: Job, numbers: Numbers) -> Job:
    """Return the job with these numbers, as if its file had them."""

    def at(*where: str | int) -> Array | None:
        found = numbers.get((*where, "xyz_mm"))
        return None if found is None else pose(found, numbers[*where, "rpy_deg"])

    part, tool, cell = at("part"), at("tool"), job.cell
    axes = [
        _moved_axis(axis, _of(numbers, "robot", "external", i))
        for i, axis in enumerate(job.robot.externals)
    ]
    if cell is not None:
        tables: dict[str, object] = {
            "head": cell.head.model_copy(update=_of(numbers, "cell", "head"))
        }
        tables["fixture"] = tuple(
            fixture.model_copy(update=_of(numbers, "cell", "fixture", i))
            for i, fixture in enumerate(cell.fixture)
        )
        cell = cell.model_copy(update=tables)
    return replace(
        job,
        robot=replace(job.robot, externals=tuple(axes)) if axes else job.robot,
        placement=job.placement if part is None else part,
        tool=job.tool if tool is None else tool,
        cell=cell,
    )


def _moved_axis(axis: ExternalAxis, numbers: Mapping[str, tuple[float, ...]]) -> ExternalAxis:
    point = np.array(numbers["point_mm"]) / 1000 if "point_mm" in numbers else axis.point
    return replace(axis, axis=np.array(numbers.get("axis", axis.axis)), point=point)


def _of(numbers: Numbers, *where: str | int) -> dict[str, tuple[float, ...]]:
    """Return the new numbers of one table, by their keys."""
    return {
        str(keys[-1]): tuple(value) for keys, value in numbers.items() if keys[:-1] == (*where,)
    }


def changes_of(job: Job, numbers: Numbers) -> list[tuple[tuple[str | int, ...], object]]:
    """Return the changes in the text of a job: values by path of keys; None removes a key.

    New numbers of the part are those of its origin; those of the tool replace its head.
    """
    gone: list[tuple[str | int, ...]] = []
    if ("part", "xyz_mm") in numbers:
        gone += [("part", key) for key in ("placed_by", "frame") if key in job.source["part"]]
    if ("tool", "xyz_mm") in numbers:
        gone += [("tool", key) for key in ("head",) if key in job.source["tool"]]
    return [*((key, None) for key in gone), *numbers.items()]


def placed_text(job: Job, numbers: Numbers, folder: Path, remark: str) -> str:
    """Return the text of the job file with these numbers, for a file in `folder`.

    Comments are kept, file names are made relative to `folder`, rows of charts that are used are
    written out, and `remark` becomes the first comment.
    """
    file = tomlkit.parse(job.text)
    for where, value in changes_of(job, numbers):
        table: Any = file
        for step in where[:-1]:
            table = table[step]
        if value is None:
            del table[where[-1]]
        else:
            table[where[-1]] = value
    if "process" in file:  # with the rows in use, no chart is needed
        file["process"]["row"] = job.source["process"]["row"]
        file["process"].pop("chart", None)
    for table, name in _named_files(file):
        table[name] = os.path.relpath(job.path.parent / str(table[name]), folder)
    return f"# {remark}\n{tomlkit.dumps(file)}"


def _named_files(file: Any) -> list[tuple[Any, str]]:
    """Return every key of a job that names a file or folder, with its table."""
    cell, robot = file.get("cell", {}), file["robot"]
    tables = [file["part"], cell.get("head", {}), *cell.get("fixture", [])]
    packages = robot.get("packages", {})
    found = [(table, "file") for table in tables if "file" in table]
    found += [(robot, key) for key in ("urdf", "srdf") if key in robot]
    return found + [(packages, name) for name in packages]


# -----------------------------------------------------------------------------
# The nodes in reach at a placement, fast enough for interactive dragging.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placement:
    """Placements of a job's part, robot base and head, and the reach at them.

    Parameters
    ----------
    job : Job
    requests : tuple of CutRequest
        The contours of the job.
    middle : (3,) m
        Centre of the rotations of the part, in the robot base.
    """

    job: Job
    requests: tuple[CutRequest, ...]
    middle: Array

    __repr__ = short_repr

    def numbers(self, offsets: Mapping[str, float]) -> Numbers:
        """Return the changes of the job file, as `numbers_of`."""
        return numbers_of(self.job, offsets, self.middle)

    def motions(self, offsets: Mapping[str, float]) -> tuple[Array, Array]:
        """Return the motions of the part and of the rest, as `motions_of`."""
        return motions_of(offsets, self.middle)

    def out_of_reach(self, offsets: Mapping[str, float]) -> list[Ints]:
        """Return, for each contour, the nodes that the robot reaches at no gamma and posture.

        Gamma is sampled as in the job, within its windows, and external axes on a coarse grid. The
        job's postures and joint margins are kept. Collisions are not checked.
        """
        moved = move_job(self.job, self.numbers(offsets))
        return [
            out_of_reach(moved, request.candidates[0].nodes, request.options.without_penalties)
            for request in self.requests
        ]


def placement_of(prepared: PreparedJob) -> Placement:
    """Return the `Placement` object of a prepared job."""
    nodes = [request.candidates[0].nodes for request in prepared.contours]
    return Placement(
        job=prepared.job,
        requests=tuple(prepared.contours),
        middle=middle_of(prepared.job, nodes),
    )
