"""Tesseract's Descartes planner on the benchmark's poses, in a process of its own.

The wheel brings neither robots nor plugin lists, so both are written here: a URDF and SRDF of the
arm, without geometry unless solids are given, and lists that point at the wheel's own libraries,
whose names carry a hash.
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
from kerfpath._arrays import Array, Ints

__all__ = ["NotRun", "Solid", "Solved", "Task", "solve"]

NAMESPACE, PROFILE = "DescartesMotionPlannerTask", "benchmark"


class NotRun(Exception):
    """The peer did not run; says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Solid:
    """A closed mesh, vertices (V, 3) m in the base at joint angles zero, that joint i carries."""

    name: str
    frame: int
    vertices: Array
    triangles: Ints


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Tip poses whose z-axis is free, as Descartes takes them.

    Parameters
    ----------
    robot : Robot
        An arm with plain ranges of at most one turn a joint.
    tool : (4, 4)
        T_flange_tip.
    frames : (K, 4, 4)
        Task frames in the robot base.
    samples : int
        Samples of gamma in (-pi, pi].
    sizes : sequence of int
        Vertices of each layer, as kerfpath counts them; tells the memory it will need.
    runs : int
        How often it is solved, after one run that is not measured.
    solids : sequence of Solid
        With any, poses and the straight joint motions between them are checked for collisions.
    apart : sequence of (name, name)
        Which solids may not touch each other.
    longest : float s
        After which its process counts as hung.
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
    """What came back: seconds of each run, the path (K, 6) rad, and what it took."""

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
    """Return what the stored edges of the layered graph take: 16 bytes each, as seen."""
    return 16e-9 * sum(a * b for a, b in pairwise(task.sizes))


def _solve_here(task: Task) -> Solved:
    from tesseract_robotics import tesseract_command_language as language
    from tesseract_robotics import tesseract_common as common
    from tesseract_robotics import tesseract_environment as environments
    from tesseract_robotics import tesseract_motion_planners as planners
    from tesseract_robotics import tesseract_motion_planners_descartes as descartes

    with tempfile.TemporaryDirectory() as folder:
        plugins = Path(folder) / "plugins.yaml"
        plugins.write_text(_plugins(task.robot))
        contacts = Path(folder) / "contacts.yaml"
        contacts.write_text(_contacts())
        urdf, srdf = _urdf(task, Path(folder)), _srdf(task, plugins, contacts)
        environment = environments.Environment()
        if not environment.init(urdf, srdf, common.GeneralResourceLocator()):
            raise NotRun("its environment refused the URDF, SRDF or plugin list")
    info = common.ManipulatorInfo()
    info.manipulator, info.manipulator_ik_solver = "manipulator", "OPWInvKin"
    info.working_frame, info.tcp_frame = "base_link", "tool0"
    info.tcp_offset = common.Isometry3d(task.tool)

    profile = descartes.DescartesDefaultPlanProfileD()
    profile.target_pose_fixed = False
    profile.target_pose_sample_axis = np.array([0.0, 0.0, 1.0])
    profile.target_pose_sample_min, profile.target_pose_sample_max = -np.pi, np.pi
    # Both ends are sampled: one sample more than ours, the last the same as the first.
    profile.target_pose_sample_resolution = 2 * np.pi / task.samples * (1 + 1e-9)
    profile.enable_collision = profile.enable_edge_collision = bool(task.solids)
    # Else poses that nobody checked count as colliding.
    profile.allow_collision = not task.solids
    profiles = language.ProfileDictionary()
    profiles.addProfile(NAMESPACE, PROFILE, descartes.cast_DescartesPlanProfileD(profile))

    program = language.CompositeInstruction()
    program.setManipulatorInfo(info)
    for H in task.frames:
        waypoint = language.CartesianWaypoint(common.Isometry3d(np.array(H)))
        move = language.MoveInstruction(
            language.CartesianWaypointPoly_wrap_CartesianWaypoint(waypoint),
            language.MoveInstructionType_LINEAR,
            PROFILE,
            info,
        )
        program.appendMoveInstruction(language.MoveInstructionPoly_wrap_MoveInstruction(move))
    request = planners.PlannerRequest()
    request.instructions, request.env, request.profiles = program, environment, profiles

    def one_plan() -> None:
        planner = descartes.DescartesMotionPlannerD(NAMESPACE)
        wall, cpu = perf_counter(), process_time()
        responses[:] = [planner.solve(request)]
        seconds.append(perf_counter() - wall)
        busy.append((process_time() - cpu) / seconds[-1])

    responses: list[Any] = []
    seconds: list[float] = []
    busy: list[float] = []
    peak = peak_megabytes(one_plan)
    for _ in range(task.runs):
        responses.clear()  # an answer may hold on to its graph
        one_plan()
    response = responses[0]
    if not response.successful:
        raise NotRun(f"it found no plan ({response.message})")
    rows = []
    for instruction in response.results.flatten():
        # Each wrapper must outlive the next: chained calls read freed memory.
        moved = language.InstructionPoly_as_MoveInstructionPoly(instruction)
        reached = moved.getWaypoint()
        state = language.WaypointPoly_as_StateWaypointPoly(reached)
        rows.append(np.array(state.getPosition(), dtype=float).ravel())
    return Solved(
        seconds=seconds[1:],
        q=np.array(rows),
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


def _srdf(task: Task, plugins: Path, contacts: Path) -> str:
    judged = {frozenset(pair) for pair in task.apart}
    names = [solid.name for solid in task.solids]
    may_touch = "".join(
        f'<disable_collisions link1="{a}" link2="{b}" reason="Never"/>'
        for a, b in combinations(names, 2)
        if frozenset((a, b)) not in judged
    )
    return (
        '<robot name="arm" version="1.0.0"><group name="manipulator">'
        '<chain base_link="base_link" tip_link="tool0"/></group>'
        f'<kinematics_plugin_config filename="file://{plugins}"/>'
        f'<contact_managers_plugin_config filename="file://{contacts}"/>{may_touch}</robot>'
    )


def _libraries(pattern: str) -> tuple[Path, list[str]]:
    """Return where the wheel keeps its libraries, and those that match, as its lists name them."""
    import tesseract_robotics

    libraries = Path(tesseract_robotics.__file__).parent.parent / "tesseract_robotics.libs"
    found = sorted(libraries.glob(f"libtesseract_{pattern}.so"))
    if not found:
        raise NotRun(f"its wheel has no {pattern} in {libraries}")
    return libraries, [f.name.removeprefix("lib").removesuffix(".so") for f in found]


def _contacts() -> str:
    libraries, found = _libraries("collision_bullet_factor*")
    text = f"contact_manager_plugins:\n  search_paths:\n    - {libraries}\n  search_libraries:\n"
    text += "".join(f"    - {name}\n" for name in found)
    for kind in ("Discrete", "Cast"):
        group = "discrete" if kind == "Discrete" else "continuous"
        manager = f"Bullet{kind}BVHManager"
        text += (
            f"  {group}_plugins:\n    default: {manager}\n    plugins:\n"
            f"      {manager}:\n        class: {manager}Factory\n"
        )
    return text


def _plugins(robot: Robot) -> str:
    libraries, found = _libraries("kinematics_*_factor*")
    names = "".join(f"    - {name}\n" for name in found)
    lengths = "".join(f"              {k}: {float(v)!r}\n" for k, v in robot.geometry.items())

    def group(kind: str, plugin: str, factory: str, params: str = "") -> str:
        return (
            f"  {kind}:\n    manipulator:\n      default: {plugin}\n      plugins:\n"
            f"        {plugin}:\n          class: {factory}\n          config:\n"
            f"            base_link: base_link\n            tip_link: tool0\n{params}"
        )

    opw = (
        f"            params:\n{lengths}"
        f"              offsets: {_list(robot.offset)}\n"
        f"              sign_corrections: {[int(s) for s in robot.sign]}\n"
    )
    return (
        f"kinematic_plugins:\n  search_paths:\n    - {libraries}\n  search_libraries:\n{names}"
        + group("fwd_kin_plugins", "KDLFwdKinChain", "KDLFwdKinChainFactory")
        + group("inv_kin_plugins", "OPWInvKin", "OPWInvKinFactory", opw)
    )


def _row(values: Array) -> str:
    return " ".join(repr(float(v)) for v in values)


def _list(values: Array) -> str:
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"
