"""The answer to a request: a plan, as joints over time from stop to stop.

Requests and answers are plain data, as JSON has it; lengths are in m, angles in rad, times in s.
"""

from __future__ import annotations

import re
import struct
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from kerfpath.arrays import Array, Ints, as_pose, floats, integers, positive, scalar
from kerfpath.cell import Body, Cell, Hull, Mesh, Shape, allowed_pairs, cell_of, link_bodies
from kerfpath.contour import Contour, angle_between, slerp, unit
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.pipe.station import StationRobot, station_robot
from kerfpath.planner import plan
from kerfpath.plans import Plan, TransferMove, node_rates
from kerfpath.robots import Robot, chain_of
from kerfpath.transfer import share_of_way
from kerfpath.windows import GammaWindow

SNAP = 5e-5
"""m and rad: as descriptions round their numbers, see `kerfpath.urdf.read_urdf`."""
LEAST_STEP = 1e-7
"""m: waypoints nearer than this are at one point."""
EVEN = 0.8
"""Least ratio of two distances of nodes, so that they count as evenly spaced."""
MOST_NODES = 20_000
"""Most nodes of a path."""
PLATE = 1e-3
"""m: thickness of a plate that stands for a flat surface."""
STEP_TIME = 0.05
"""s: longest time between two points of a move to the first waypoint."""


def answer(request: Mapping[str, Any]) -> dict[str, Any]:
    """Return the answer to a request, such as those of `kerfpath.compas`.

    Parameters
    ----------
    request : mapping
        "urdf" (text), "base", "tip" (links), "joints" (names from base to tip), "start" (n,) rad,
        "acceleration" rad/s^2, "gamma_step" rad, "T_world_base", "T_flange_tip" (4, 4) m, "points",
        "axes" and "x" (K, 3) m of the waypoints in the world ("x" None: the rotation about the axis
        is free), "name", "speed" m/s, "max_step" m. Those of `kerfpath.robodk` have a "station"
        (see `station_robot`) in place of "urdf", "base", "tip", "joints" and "T_world_base": points
        are in the robot base of the station, "start" may be None, and the path is a curve, whose
        nodes are at its ends and corners and evenly between. With a "cell" the motion is clear:
        "meshes" of the description by their file names, "disabled" pairs of links, and "bodies":
        "name", "of" (what it belongs to), "mesh", "T" in the flange if "held" and else in the
        world, "touch" (names). A mesh has "vertices" (V, 3) m and "triangles" (F, 3). In place of
        "urdf", those of `kerfpath.ros` have the path of a "file" and folders of its "packages", by
        name, and no "meshes"; their "end" (n,) rad is where the robot goes afterwards.

    Returns
    -------
    dict
        "joints", "time", "q", "v", "a", "waypoints" (numbers of their points; for a curve of all
        nodes), "cost", and "seconds" of planning; for a station also "robot" (its id),
        "acceleration" (its source), "apart_mm" and "apart_deg" (of its forward kinematics), and
        "points" and "axes" of the nodes, with "chord", the largest distance (m) of the curve from
        the straight lines between them. Or "error" ("start", "end": it collides there, "reach",
        "path" or "input"), "message", and for "reach" the number of the "waypoint".
    """
    begun, path = time.perf_counter(), None
    try:
        path = _curve_of(request) if "station" in request else _path_of(request)
        made, seen = _planned(request, path)
    except InputError as error:
        return {"error": "input", "message": str(error)}
    except NoFeasiblePath as none:
        said = str(none)
        for name in ("start", "end"):
            if said.startswith(f"{name}_q: "):
                return {"error": name, "message": said}
        if path is not None and "no admissible pose at node" in said:
            at = min(int(np.searchsorted(path.waypoints, none.node + 1)), len(path.waypoints) - 1)
            return {"error": "reach", "message": said, "waypoint": at}
        return {"error": "path", "message": said}
    timed, first = _from_stop_to_stop(made)
    moved = [each if seen is None else each @ seen.counts.T for each in timed[1:]]
    return {
        "joints": list(request.get("joints", made.robot.joint_names)),
        **{name: values.tolist() for name, values in zip("qva", moved, strict=True)},
        "time": timed[0].tolist(),
        "waypoints": (path.waypoints + first).tolist(),
        "cost": made.cost,
        "seconds": time.perf_counter() - begun,
        **({} if seen is None else _about(seen, path)),
    }


def _about(seen: StationRobot, path: _Path) -> dict[str, Any]:
    """Return what an answer says about the robot of a station, and the nodes of its curve."""
    return {
        "robot": seen.robot.id,
        "acceleration": seen.robot.acceleration_source,
        "apart_mm": seen.apart_mm,
        "apart_deg": seen.apart_deg,
        "points": path.contour.points.tolist(),
        "axes": path.contour.axes.tolist(),
        "chord": path.chord,
    }


# -----------------------------------------------------------------------------
# The path through the waypoints, with nodes that are evenly spaced.


class _Path(NamedTuple):
    """A path in the world, the number of the node at each waypoint, and its distance (m) from it.

    The distance is that of a curve from the straight lines between the nodes.
    """

    contour: Contour
    waypoints: Ints
    chord: float = 0.0


def _path_of(request: Mapping[str, Any]) -> _Path:
    """Return the path: between waypoints straight, while the tool turns evenly."""
    points = floats(request["points"], "waypoints", (None, 3))
    if len(points) < 2:
        raise InputError(f"waypoints: expected two or more, got {len(points)}")
    axes = floats(request["axes"], "axes of waypoints", (len(points), 3))
    most = scalar(request["max_step"], "max_step_distance", unit="m", above=0.0)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if (still := np.flatnonzero(length < LEAST_STEP)).size:
        k = int(still[0])
        raise InputError(
            f"waypoints: {k} and {k + 1} are at the same point; a path that only turns the tool "
            "cannot be planned: leave one out"
        )
    parts = _parts(length, most)
    if parts.sum() >= MOST_NODES:
        raise InputError(
            f"waypoints: {parts.sum() + 1} nodes are needed for steps up to {most * 1e3:g} mm that "
            f"are even, at most {MOST_NODES} are planned; make max_step_distance longer, or "
            "distribute the waypoints evenly"
        )
    waypoints = np.concatenate([[0], np.cumsum(parts)])
    at = np.interp(np.arange(waypoints[-1] + 1), waypoints, np.arange(len(points)))
    every = np.arange(len(points))
    fine = np.array([np.interp(at, every, each) for each in points.T]).T
    if request["x"] is None:
        contour = Contour(fine, _turned_evenly(axes, at), closed=False, name=request["name"])
        return _Path(contour, waypoints)
    x = floats(request["x"], "x of waypoints", (len(points), 3))
    frames = np.stack([x, np.cross(axes, x), axes], axis=-1)
    turned = Slerp(every, Rotation.from_matrix(frames))(at).as_matrix()
    axes, x = turned[:, :, 2], turned[:, :, 0]
    return _Path(Contour(fine, axes, closed=False, x=x, name=request["name"]), waypoints)


def _curve_of(request: Mapping[str, Any]) -> _Path:
    """Return a curve at its ends and corners, and at evenly spaced nodes between them."""
    points = floats(request["points"], "curve", (None, 3))
    axes = floats(request["axes"], "axes of the curve", (len(points), 3))
    curve = Contour(points, axes, closed=False, name=request["name"])
    nodes = curve.resample(spacing=scalar(request["max_step"], "spacing", unit="m", above=0.0))
    if len(nodes) > MOST_NODES:
        raise InputError(
            f"spacing: {len(nodes)} nodes are needed, at most {MOST_NODES} are planned; make it "
            "longer"
        )
    straight = np.array([np.interp(curve.s, nodes.s, each) for each in nodes.points.T]).T
    chord = np.linalg.norm(straight - curve.points, axis=1).max()
    return _Path(nodes, np.arange(len(nodes)), float(chord))


def _parts(length: Array, most: float) -> Ints:
    """Return into how many parts (S,) segments (S,) m are divided so that all are nearly equal."""
    longest = min(float(length.min()), most)
    for several in range(1, 10):
        parts = np.maximum(np.ceil(length / (longest / several) - 1e-6), 1).astype(np.int64)
        steps = length / parts
        if steps.min() >= EVEN * steps.max() and steps.max() <= most * (1 + 1e-6):
            return parts
    raise AssertionError("parts of a ninth differ by less than a fifth")


def _turned_evenly(axes: Array, at: Array) -> Array:
    """Return axes at places between nodes, turned evenly from each to the next."""
    if (zero := np.flatnonzero(~axes.any(axis=1))).size:
        raise InputError(f"axes of waypoints: axis {zero[0]} has no length")
    axes = unit(axes)
    if (back := np.flatnonzero(angle_between(axes[:-1], axes[1:]) > np.pi - 1e-6)).size:
        raise InputError(f"axes of waypoints: {back[0]} and {back[0] + 1} point opposite ways")
    k = np.clip(at.astype(np.int64), 0, len(axes) - 2)
    return slerp(axes[k], axes[k + 1], (at - k)[:, None])


# -----------------------------------------------------------------------------
# The plan, with the robot and the cell of the request.


def _planned(request: Mapping[str, Any], path: _Path) -> tuple[Plan, StationRobot | None]:
    """Return the plan, and the robot of the station if it is for one."""
    tool = as_pose(request["T_flange_tip"], "T_flange_tip")
    around, cell, seen, start = request.get("cell"), None, None, request["start"]
    if "station" in request:
        seen = station_robot(request["station"], request["acceleration"])
        robot = seen.robot
        T_base_world = as_pose(np.linalg.inv(seen.T_station_base), "T_station_base")
        tool = as_pose(seen.T_end_flange @ tool, "T_flange_tip")
        if start is not None:
            start = np.linalg.solve(seen.counts, floats(start, "start", (robot.joints,)))
    else:
        T_world_base = as_pose(request["T_world_base"], "T_world_base")
        T_base_world = as_pose(np.linalg.inv(T_world_base), "T_world_base")
        with TemporaryDirectory() as folder:  # the meshes of links are read for the cell
            robot = _robot(request, around, Path(folder))
            cell = None if around is None else _cell(robot, tool, T_base_world, around)
    end = float(path.contour.s[-1])
    fixed = GammaWindow(start=0.0, end=end, low=0.0, high=0.0)
    made = plan(
        path.contour,
        robot,
        tool=tool,
        placement=T_base_world,
        speed=scalar(request["speed"], "speed", unit="m/s", above=0.0),
        gamma_step=request["gamma_step"],
        gamma_windows=() if path.contour.x is None else (fixed,),
        cell=cell,
        start_q=start,
        end_q=request.get("end"),
        certify=None,
    )
    return made, seen


def _robot(request: Mapping[str, Any], around: Mapping[str, Any] | None, folder: Path) -> Robot:
    """Return the robot of the description, with the meshes of its links for what is around it."""
    n, file = len(request["joints"]), folder / "robot.urdf"
    limit = positive(np.atleast_1d(request["acceleration"]), "acceleration", (None,))
    if "file" in request:
        file, meshes = Path(request["file"]), around is not None
    else:
        text, given = str(request["urdf"]), {} if around is None else around["meshes"]
        meshes = bool(given)
        for k, (name, mesh) in enumerate(given.items()):
            (folder / f"{k}.stl").write_bytes(_stl(*_surface(mesh, name)))
            text = text.replace(f'filename="{name}"', f'filename="{k}.stl"')
        file.write_text(text, encoding="utf-8")
    try:
        return Robot.from_urdf(
            file,
            base=request["base"],
            tip=request["tip"],
            externals=None,
            packages=request.get("packages"),
            meshes=meshes,
            snap=SNAP,
            acceleration=np.tile(limit, n) if len(limit) == 1 else limit,
        )
    except InputError as error:
        raise InputError(str(error).replace(str(file), "the description")) from None


def _cell(robot: Robot, tool: Array, T_base_world: Array, around: Mapping[str, Any]) -> Cell:
    """Return the cell: the links as convex hulls, the other bodies as they are if closed."""
    chain = chain_of(robot)
    head, fixtures = list[Body](), dict[str, Shape]()
    names: dict[str, list[str]] = {}
    for body in around["bodies"]:
        shape = _solid(body["mesh"], body["name"])
        names.setdefault(body["of"], []).append(body["name"])
        if body["held"]:
            shape = shape.moved(chain.end @ as_pose(body["T"], body["name"]))
            head.append(Body(name=body["name"], shape=shape, frame=chain.joints, kind="head"))
        else:
            T = T_base_world @ as_pose(body["T"], body["name"])
            fixtures[body["name"]] = shape.moved(T)
    links = link_bodies(robot)
    for link in links:
        names.setdefault(re.sub(r" \d+$", "", link.name), []).append(link.name)
    disabled = {(one, two): "disabled by the semantics" for one, two in around["disabled"]}
    known = {described.link for described in robot.bodies}
    may_touch = allowed_pairs(robot, {p: w for p, w in disabled.items() if set(p) <= known})
    for body in around["bodies"]:
        for other in body["touch"]:
            for name in names.get(other, ()):
                may_touch[body["name"], name] = "allowed to touch"
    kept = {frozenset(pair): (pair, why) for pair, why in may_touch.items()}
    return cell_of(
        robot, tool=tool, head=head, fixtures=fixtures, links=links, may_touch=dict(kept.values())
    )


def _surface(mesh: Mapping[str, Any], name: str) -> tuple[Array, Ints]:
    vertices = floats(mesh["vertices"], f"{name} vertices", (None, 3))
    return vertices, integers(mesh["triangles"], f"{name} triangles", (None, 3))


def _solid(mesh: Mapping[str, Any], name: str) -> Shape:
    """Return the solid in a mesh; of one that is not closed its convex hull, or a plate."""
    vertices, triangles = _surface(mesh, name)
    try:
        return Mesh(vertices=vertices, triangles=triangles, name=name)
    except InputError:
        a, b, c = (vertices[triangles[:, i]] for i in range(3))
        across = np.cross(b - a, c - a)
        largest = int(np.argmax(np.linalg.norm(across, axis=1)))
        normal = across[largest] / np.linalg.norm(across[largest])
        if np.ptp(vertices @ normal) < PLATE:  # the drawn side stays where it is
            vertices = np.vstack([vertices, vertices - PLATE * normal])
        return Hull(vertices)


def _stl(vertices: Array, triangles: Ints) -> bytes:
    """Return triangles as a binary STL; readers find the normals themselves."""
    corners = vertices[triangles].astype("<f4")
    row = np.dtype([("normal", "<f4", 3), ("at", "<f4", (3, 3)), ("unused", "<u2")])
    rows = np.zeros(len(corners), row)
    rows["at"] = corners
    return bytes(80) + struct.pack("<I", len(rows)) + rows.tobytes()


# -----------------------------------------------------------------------------
# Joints over time, from the start to a stop at the last waypoint.


class _Timed(NamedTuple):
    """Joints over time: (P,) s, and (P, n) rad, rad/s, rad/s^2."""

    time: Array
    q: Array
    v: Array
    a: Array


def _from_stop_to_stop(made: Plan) -> tuple[_Timed, int]:
    """Return moves and path over time, and the number of the first waypoint's point."""
    before, after = (
        list(_moved(made.robot, move))
        if move is not None and np.abs(np.diff(move.q, axis=0)).max() > 1e-9
        else []
        for move in (made.approach, made.retreat)
    )
    first = sum(len(piece.time) - 1 for piece in before)
    return _joined([*before, _path(made), *after]), first


def _moved(robot: Robot, move: TransferMove) -> Iterable[_Timed]:
    """Yield the straight joint motions of a move, from stop to stop."""
    for one, two, took in zip(move.q, move.q[1:], np.diff(move.time), strict=False):
        count = int(np.ceil(took / STEP_TIME)) + 1
        share = np.arange(count + 1) / count
        way = share_of_way(np.abs(two - one), *robot.speed_limits(), share)
        q = one + way[:, None] * (two - one)
        yield _timed(share * took, q)


def _path(made: Plan) -> _Timed:
    """Return the motion along the nodes, sped up from a stop and slowed down to one.

    At every node the joints keep the acceleration limits that they have at full speed.
    """
    q = made.unwrapped
    slope, bend = node_rates(np.arange(len(q), dtype=float), q)
    limit = np.broadcast_to(made.settings.eta_a * made.robot.acceleration_at(q), q.shape)
    full = 1 / made.dt**2
    square = np.full(len(q), full)  # of the nodes passed in a second
    square[[0, -1]] = 0.0
    for order in (range(len(q) - 1), range(len(q) - 1, 0, -1)):
        step = order.step
        for k in order:
            room = (limit[k] - np.abs(bend[k]) * square[k]) / np.maximum(np.abs(slope[k]), 1e-12)
            gain = 2 * max(float(room.min()), 0.0)
            square[k + step] = min(square[k + step], square[k] + gain)
    speed = np.sqrt(square)
    time = np.concatenate([[0.0], np.cumsum(2 / (speed[:-1] + speed[1:]))])
    return _timed(time, q)


def _timed(time: Array, q: Array) -> _Timed:
    """Return a motion from stop to stop with its velocities and accelerations."""
    v, a = node_rates(time, q)
    v[[0, -1]] = 0.0
    return _Timed(time, q, v, a)


def _joined(pieces: Sequence[_Timed]) -> _Timed:
    """Return motions one after the other; each begins where the one before it ends."""
    whole = pieces[0]
    for piece in pieces[1:]:
        later = piece._replace(time=piece.time + whole.time[-1])
        whole = _Timed(*(np.concatenate([a, b[1:]]) for a, b in zip(whole, later, strict=True)))
    return whole
