"""The plan: what the robot does at every node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, Bools, Ints, as_pose, floats, freeze, integers, scalar
from kerfpath._extras import require_extra
from kerfpath._repr import html_table, in_degrees
from kerfpath.comfort import measures
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.kernels import metric
from kerfpath.limits import rates_of
from kerfpath.options import PlanOptions
from kerfpath.plans._columns import joint_columns
from kerfpath.plans._criteria import Criteria, Feed, Proof
from kerfpath.plans._motion import JointMotion, in_model, node_rates
from kerfpath.robots import Robot, can_back_off, joint_identifiers
from kerfpath.tilt import tilt_frames

if TYPE_CHECKING:
    import pandas
    from plotly.graph_objects import Figure

__all__ = ["Plan", "has_room", "on_turns"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """Joint motion along one contour.

    Parameters
    ----------
    contour : Contour
        The nodes, in the part frame.
    robot : Robot
        With the limits that the plan keeps.
    T_flange_tip, T_base_part : (4, 4)
        Tool and placement of the part, m.
    q : (K, n) rad
        Joints at the nodes; external axes are the last columns (a rail: m).
    gamma : (K,) rad
        Free rotation about the tool axis at the nodes.
    tilt : (K, 2) rad, optional
        Lead and lean of the tool axis at the nodes, see `kerfpath.Tilt`; default none.
    posture : (K,) int
        Posture mu; see `kerfpath.robots.posture_name`.
    turn : (K, n) int
        Turns of 2 pi of each joint away from (-pi, pi].
    time : (K,) s
        Time of each node, from 0.
    settings : PlanOptions
        How it was asked for, with the weights that were used.
    cost : float
        Objective (14) or (15), with what tilt and comfort cost.
    proof : Proof
    feed : Feed or None
        Where the speed dips; None at constant speed.
    counts : mapping of str to int
        Candidates (node, tilt, gamma, posture) of the layered graph that was searched by what
        became of them; of very many nodes that may be some.
    """

    contour: Contour
    robot: Robot
    T_flange_tip: Array
    T_base_part: Array
    q: Array
    gamma: Array
    posture: Ints
    turn: Ints
    time: Array
    settings: PlanOptions
    cost: float
    proof: Proof
    counts: Mapping[str, int]
    feed: Feed | None = None
    tilt: Array = None  # type: ignore[assignment]  # filled in by __post_init__

    def __repr__(self) -> str:
        best = ", best of its grid" if self.proof.optimal else ""
        if self.proof.gap is not None:
            best += f", gap {self.proof.gap_shown} %"
        return (
            f"Plan({self.name!r}, {len(self.q)} nodes, {self.time[-1] - self.time[0]:.2f} s, cost "
            f"{self.cost:.6g}{best}, {self.robot.id})"
        )

    def __post_init__(self) -> None:
        K, n = len(self.contour), self.robot.joints
        cast: dict[str, Any] = {
            "T_flange_tip": as_pose(self.T_flange_tip, "T_flange_tip"),
            "T_base_part": as_pose(self.T_base_part, "T_base_part"),
            "q": floats(self.q, "q", (K, n)),
            "gamma": floats(self.gamma, "gamma", (K,)),
            "posture": integers(self.posture, "posture", (K,)),
            "turn": integers(self.turn, "turn", (K, n)),
            "time": floats(self.time, "time", (K,)),
            "tilt": floats(np.zeros((K, 2)) if self.tilt is None else self.tilt, "tilt", (K, 2)),
            "cost": scalar(self.cost, "cost"),
        }
        if (np.diff(cast["time"]) <= 0).any():
            raise InputError("time: must increase from node to node")
        if self.settings.weights is None:
            cast["settings"] = self.settings.resolve(self.robot, _mean_step(cast["time"]))
        for name, value in cast.items():
            object.__setattr__(self, name, value)

    @property
    def name(self) -> str:
        """Name of the contour."""
        return self.contour.name

    @property
    def dt(self) -> float:
        """Mean time from node to node, s."""
        return _mean_step(self.time)

    @property
    def points(self) -> Array:
        """Tool-tip positions asked for at the nodes, robot base frame, (K, 3) m."""
        rotation, origin = self.T_base_part[:3, :3], self.T_base_part[:3, 3]
        return freeze(self.contour.points @ rotation.T + origin)

    @property
    def axes(self) -> Array:
        """Tool axes asked for at the nodes, tilt included, robot base frame, (K, 3)."""
        if not self.tilt.any():
            return freeze(self.contour.axes @ self.T_base_part[:3, :3].T)
        return freeze(self.frames[:, :3, 2])

    @property
    def frames(self) -> Array:
        """Task frames that gamma counts from, tilt included, robot base frame, (K, 4, 4) m."""
        H = self.contour.frames(self.settings.frames)
        if self.tilt.any():
            H = tilt_frames(H, self.contour.along, self.tilt)
        return freeze(self.T_base_part @ H)

    @property
    def T_part_tip(self) -> Array:
        """Tip poses in the part frame, (K, 4, 4) m: points of the contour, orientation of FK(q).

        A placement of few printed decimals is not quite a rotation; these are.
        """
        T_base_tip = self.robot.forward(self.q) @ self.T_flange_tip
        T = np.asarray(np.linalg.solve(self.T_base_part, T_base_tip), dtype=np.float64)
        T[:, :3, :3] = Rotation.from_matrix(T[:, :3, :3]).as_matrix()
        T[:, :3, 3], T[:, 3] = self.contour.points, (0.0, 0.0, 0.0, 1.0)
        return freeze(T)

    @property
    def node_cost(self) -> Array | None:
        """What tilt and comfort cost at each node, (K,); None where they cost nothing.

        Without what clearance costs, which only a cell tells.
        """
        tilt, comfort, costs = self.settings.tilt, self.settings.comfort, []
        if tilt is not None and tilt.cost:
            costs.append(tilt.price(self.tilt))
        if comfort is not None and any(band.cost for band in comfort.bands.values()):
            costs.append(comfort.price(self.robot, self.q, self.T_flange_tip))
        return freeze(np.sum(costs, axis=0)) if costs else None

    @property
    def increments(self) -> Array:
        """Joint increments between nodes, (K-1, n) rad; endless joints the short way (13)."""
        return freeze(metric.increments(self.q, self.robot.endless))

    @property
    def external(self) -> Array | None:
        """Values (K, E) of the external axes, rad or m; None where the robot has none."""
        return freeze(self.q[:, self.robot.family.joints :]) if self.robot.externals else None

    @property
    def course(self) -> Array:
        """Values (K, E) rad or m of what poses leave free beside gamma, as `Robot.free` has it."""
        return freeze(self.q[:, self.robot.free])

    @property
    def unwrapped(self) -> Array:
        """The joints (K, n) rad with endless joints turned on, not wrapped."""
        return np.vstack([self.q[:1], self.q[:1] + np.cumsum(self.increments, axis=0)])

    @property
    def _rates(self) -> tuple[Array, Array]:
        return rates_of(self.increments, np.diff(self.time))

    @property
    def velocity_share(self) -> Array:
        """Joint speed between nodes over its limit, (K-1, n), signed."""
        return freeze(self._rates[0] / self.robot.speed_limits()[0])

    @property
    def acceleration_share(self) -> Array:
        """Second difference at the inner nodes over the acceleration limit, (K-2, n), signed."""
        return freeze(self._rates[1] / self.robot.speed_limits()[1])

    @property
    def criteria(self) -> Criteria:
        """The criteria (7) to (9), the peak shares of the limits, and the nearest comfort."""
        dq = self.increments
        measured = measures(self.robot, self.q, tool=self.T_flange_tip)
        return Criteria(
            displacement=metric.total_displacement(dq),
            largest_increment=metric.largest_increment(dq),
            range=metric.coordinate_range(dq),
            peak_velocity=np.abs(self.velocity_share).max(axis=0),
            peak_acceleration=np.abs(self.acceleration_share).max(axis=0, initial=0.0),
            nearest={name: (float(of.min()), int(of.argmin())) for name, of in measured.items()},
        )

    @property
    def columns(self) -> dict[str, Array | Ints | list[str]]:
        """A table of the nodes: K values of each column by its name, which ends in the unit.

        Columns are named as in trajectory.csv, in SI: contour, node, kind, t_s; s_m, the way along
        the contour; the joints, q1_rad and on, then external axes by their names (`rail_m`,
        `table_rad`); x_m, y_m, z_m, axis_x, axis_y, axis_z, as `points` and `axes`; gamma_rad;
        lead_rad and lean_rad, where a tilt was asked for; posture; speed_m_s, that of the tip on
        its way to the next node, which the last has not: NaN.
        """
        units = zip(joint_columns(self.robot), self.robot.units, strict=True)
        joints = [f"{name}_{unit}" for name, unit in units]
        s, tilted = self.contour.s, self.settings.tilt is not None
        return {
            "contour": [self.name] * len(s),
            "node": np.arange(len(s)),
            "kind": list(self.contour.kinds),
            "t_s": self.time,
            "s_m": freeze(s - s[0]),
            **dict(zip(joints, self.q.T, strict=True)),
            **dict(zip(("x_m", "y_m", "z_m"), self.points.T, strict=True)),
            **dict(zip(("axis_x", "axis_y", "axis_z"), self.axes.T, strict=True)),
            "gamma_rad": self.gamma,
            **(dict(zip(("lead_rad", "lean_rad"), self.tilt.T, strict=True)) if tilted else {}),
            "posture": self.posture,
            "speed_m_s": freeze(np.append(np.diff(s) / np.diff(self.time), np.nan)),
        }

    def to_pandas(self) -> pandas.DataFrame:
        """Return the nodes as a DataFrame, a row each, with the columns of `columns`.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        require_extra("tables", "Plan.to_pandas")
        import pandas

        return pandas.DataFrame(self.columns)

    @property
    def motion(self) -> JointMotion:
        """Time (K,), joints, velocities and accelerations (K, n) at the nodes, SI.

        Endless joints are not wrapped. Rates are those of the parabola through a node and its
        neighbours. At the ends the robot moves: stops there are the program's.
        """
        q = self.unwrapped
        v, a = node_rates(self.time, q)
        return JointMotion(self.time, freeze(q), freeze(v), freeze(a))

    def to_pinocchio(self, model: Any) -> JointMotion:
        """Return `motion` as a pinocchio model counts joints: q (K, nq), v and a (K, nv).

        Parameters
        ----------
        model : pinocchio.Model
            Of `Robot.to_urdf`, or another with joints of the same names and no others.

        Raises
        ------
        InputError
            Other joints.
        """
        return in_model(self.motion, joint_identifiers(self.robot), model)

    def to_ros(self) -> dict[str, object]:
        """Return a program of this plan as the fields of a trajectory_msgs/JointTrajectory.

        As `kerfpath.post.joint_trajectory`, which also takes several plans and settings.

        Raises
        ------
        InputError
            The extra `programs` is not installed; a program that its preflight refuses.
        """
        return dict(import_module("kerfpath.post").joint_trajectory([self]))

    def plot(self, what: Literal["joints", "limits", "speed"] = "joints") -> Figure:
        """Return a figure, as reports have it: plotly's, to show, change or save.

        Parameters
        ----------
        what : {"joints", "limits", "speed"}
            Each joint over time with its limits, deg or mm; joint speeds and accelerations over
            time, % of their limits; the speed along the contour, m/min.

        Raises
        ------
        InputError
            The extra `report` is not installed; another word.
        """
        return import_module("kerfpath.report").plot(self, what)

    def _repr_html_(self) -> str:
        """Return a small table for notebooks: the joints, their way, and shares of their limits."""
        of, robot = self.criteria, self.robot
        rows = [
            [
                name,
                in_degrees(way, unit),
                in_degrees(span, unit),
                f"{100 * velocity:.0f} %",
                f"{100 * acceleration:.0f} %",
            ]
            for name, unit, way, span, velocity, acceleration in zip(
                robot.joint_names,
                robot.units,
                of.displacement,
                of.range,
                of.peak_velocity,
                of.peak_acceleration,
                strict=True,
            )
        ]
        heads = ["joint", "displacement", "range", "peak velocity", "peak acceleration"]
        proved = f"<p>{escape(self.proof.statement)}</p>" if self.proof.statement else ""
        return html_table(repr(self), heads, rows) + proved


def on_turns(robot: Robot, q: Array) -> tuple[Array, Ints]:
    """Return joints q (K, n) rad as a plan has them, endless ones wrapped, and their turns (K, n).

    The turns of endless joints, and of what a pose leaves free, are 0.
    """
    turning = ~robot.endless
    turning[robot.free] = False
    turn = np.where(turning, metric.turns_of(q), 0).astype(np.int64)
    return np.where(robot.endless, metric.wrap(q), q), turn


def _mean_step(time: Array) -> float:
    return float(time[-1] - time[0]) / (len(time) - 1)


def has_room(options: PlanOptions, robot: Robot, q: Array, posture: Ints, tool: Array) -> Bools:
    """Return of which joints (B, n) rad of an end the tool can back off as the options ask for.

    The margin of the joint limits is kept where it has backed off to, too.
    """
    limits = None if options.comfort is None else options.comfort.limits
    margin = 0.0 if limits is None else limits.margin
    return can_back_off(robot, q, posture, tool, options.retract or 0.0, margin)
