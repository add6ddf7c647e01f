"""Tesseract's Descartes planner on the benchmark's poses, in a separate process.

The wheel contains no robots, so a URDF and SRDF of the arm are written here, without geometry
unless solids are given.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from itertools import combinations, pairwise
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from benchmarks._arm import chain
from benchmarks._figures import available_gigabytes, peak_megabytes
from kerfpath import Robot
from kerfpath.arrays import Array, Ints

__all__ = ["NotRun", "Solid", "Solved", "Task", "solve"]


class NotRun(Exception):
    """The peer did not run; the message gives the reason."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Solid:
    """A closed mesh carried by a joint, vertices (V, 3) m in the base at joint angles zero."""

    name: str
    frame: int
    vertices: Array
    triangles: Ints


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Tip poses whose rotation about z is free, as Descartes takes them.

    Parameters
    ----------
    robot : Robot
        An arm with plain ranges of at most one turn per joint.
    tool : (4, 4)
        T_flange_tip.
    frames : (K, 4, 4)
        Task frames in the robot base.
    samples : int
        Samples of gamma in (-pi, pi].
    sizes : sequence of int
        Vertices of each layer, as kerfpath counts them, to estimate the memory needed.
    runs : int
        Number of runs, after one that is not measured.
    solids : sequence of Solid
        If given, poses and the straight joint motions between them are checked for collisions.
    apart : sequence of (name, name)
        Pairs of solids that may not touch each other.
    longest : float s
        Time after which the process counts as hung.
    """

    robot: Robot
    tool: Array
    frames: Array
    samples: int
    sizes: Sequence[int]
    runs: int
    solids: Sequence[Solid] = ()
    apart: Sequence[tuple[str, str]] = ()
    longest: float = 600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Solved:
    """The result: seconds of each run, the path (K, 6) rad, and the resources used."""

    seconds: list[float]
    q: Array
    peak_megabytes: float
    cores_busy: float


def solve(task: Task) -> Solved:
    """Return the planner's path and its times, from a fresh process.

    Raises
    ------
    NotRun
        The wheel is not installed, the process died or hung, or the planner found nothing.
    """
    needed = _edges_gigabytes(task)
    if needed > available_gigabytes():
        raise NotRun(f"its graph would take about {needed:.0f} GB, more than is free")
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        work = pool.submit(_solve_here, task)
        try:
            return work.result(timeout=task.longest)
        except ImportError as error:
            raise NotRun(f"tesseract-robotics does not import here ({error})") from None
        except BrokenProcessPool:
            raise NotRun("its process died (out of memory, or a crash)") from None
        except TimeoutError:
            for process in pool._processes.values():
                process.kill()
            raise NotRun(f"no answer within {task.longest:.0f} s") from None


def _edges_gigabytes(task: Task) -> float:
    """Return the memory of the stored edges of the layered graph, GB: 16 bytes each, measured."""
    return 16e-9 * sum(a * b for a, b in pairwise(task.sizes))


def _solve_here(task: Task) -> Solved:
    from benchmarks import _tesseract

    robot, ends = task.robot, {"base": "base_link", "tip": "tool0"}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        named = _tesseract.plugins(
            folder,
            **ends,
            lengths=robot.geometry,
            offsets=robot.offset.tolist(),
            signs=robot.sign.tolist(),
        )
        environment = _tesseract.environment(_urdf(task, folder), _srdf(task, named))
    if environment is None:
        raise NotRun("its environment refused the URDF, SRDF or plugin list")
    request = _tesseract.request(
        environment,
        **ends,
        tool=task.tool,
        frames=list(task.frames),
        samples=task.samples,
        collisions=bool(task.solids),
    )

    def one_plan() -> None:
        wall, cpu = perf_counter(), process_time()
        responses[:] = [_tesseract.solved(request)]
        seconds.append(perf_counter() - wall)
        busy.append((process_time() - cpu) / seconds[-1])

    responses: list[Any] = []
    seconds: list[float] = []
    busy: list[float] = []
    peak = peak_megabytes(one_plan)
    for _ in range(task.runs):
        responses.clear()  # a response may keep its graph in memory
        one_plan()
    response = responses[0]
    if not response.successful:
        raise NotRun(f"it found no plan ({response.message})")
    return Solved(
        seconds=seconds[1:],
        q=_tesseract.waypoints(response),
        peak_megabytes=peak,
        cores_busy=float(np.median(busy[1:])),
    )


def _urdf(task: Task, folder: Path) -> str:
    robot = task.robot
    axes, origins = chain(robot)
    assert robot.lower is not None
    assert robot.upper is not None
    text = '<robot name="arm"><link name="base_link"/>'
    parents = ["base_link", *(f"link_{i + 1}" for i in range(6))]
    for i in range(6):
        text += (
            f'<link name="{parents[i + 1]}"/><joint name="joint_{i + 1}" type="revolute">'
            f'<parent link="{parents[i]}"/><child link="{parents[i + 1]}"/>'
            f'<origin xyz="{_row(origins[i])}" rpy="0 0 0"/><axis xyz="{_row(axes[i])}"/>'
            f'<limit effort="0" velocity="1" lower="{float(robot.lower[i])!r}" '
            f'upper="{float(robot.upper[i])!r}"/></joint>'
        )
    places = np.vstack([np.zeros(3), np.cumsum(origins[:6], axis=0)])
    for i, solid in enumerate(task.solids):
        file = folder / f"{i}.stl"
        file.write_bytes(_stl(solid.vertices - places[solid.frame], solid.triangles))
        text += (
            f'<link name="{solid.name}"><collision><geometry><mesh filename="file://{file}"/>'
            f'</geometry></collision></link><joint name="fixed_{i}" type="fixed">'
            f'<parent link="{parents[solid.frame]}"/><child link="{solid.name}"/></joint>'
        )
    # z of the flange along x of the last link: Ry(90 deg).
    return (
        f'{text}<link name="tool0"/><joint name="flange" type="fixed"><parent link="link_6"/>'
        f'<child link="tool0"/><origin xyz="{_row(origins[6])}" rpy="0 {np.pi / 2!r} 0"/></joint>'
        "</robot>"
    )


def _stl(vertices: Array, triangles: Ints) -> bytes:
    """Return a binary STL file; normals are left to the reader."""
    facets = np.zeros(len(triangles), np.dtype([("xyz", "<f4", (4, 3)), ("end", "<u2")]))
    facets["xyz"][:, 1:] = vertices[triangles]
    return bytes(80) + np.uint32(len(triangles)).tobytes() + facets.tobytes()


def _srdf(task: Task, named: str) -> str:
    judged = {frozenset(pair) for pair in task.apart}
    names = [solid.name for solid in task.solids]
    may_touch = "".join(
        f'<disable_collisions link1="{a}" link2="{b}" reason="Never"/>'
        for a, b in combinations(names, 2)
        if frozenset((a, b)) not in judged
    )
    return f'<robot name="arm" version="1.0.0">{named}{may_touch}</robot>'


def _row(values: Array) -> str:
    return " ".join(repr(float(v)) for v in values)
