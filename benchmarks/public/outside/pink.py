"""Pink: differential inverse kinematics by quadratic programs, step by step, from many starts."""

from __future__ import annotations

import numpy as np
import pinocchio
from pink import Configuration, FrameTask, solve_ik
from pink.exceptions import PinkError
from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit

from benchmarks.public.check import Array, Instance
from benchmarks.public.outside._chain import joints, least_bad, put_right, starts, urdf

__all__ = ["SETTINGS", "plan"]

STARTS = 24
PARTS = 5
"""Number of quadratic programs per interval."""
SETTINGS = (
    f"pin-pink, daqp; {STARTS} starts, {PARTS} programs an interval, turning about the beam free; "
    "limits of range, velocity and acceleration in every program; nodes put right by Newton's "
    "method afterwards; the best of the starts"
)


def plan(task: Instance, rng: np.random.Generator) -> tuple[Array | None, str]:
    """Return the best motion of all starts, and a remark."""
    motions = [_tracked(task, q) for q in starts(task, STARTS, rng)]
    whole = [put_right(task, q) for q in motions if len(q) == len(task.points)]
    return least_bad(task, whole), f"{len(whole)} of {len(motions)} starts come to the end"


def _tracked(task: Instance, first: Array) -> Array:
    """Return the nodes (k, n) that are reached before a program has no solution."""
    model = pinocchio.buildModelFromXML(urdf(task))
    columns = [joint.column for joint in joints(task)]
    at = Configuration(model, model.createData(), first[columns])
    goal = FrameTask("tip", position_cost=1.0, orientation_cost=[1.0, 1.0, 0.0], gain=1.0)
    dt = task.interval / PARTS
    speeding = AccelerationLimit(model, task.acceleration[columns])
    limits = [ConfigurationLimit(model, config_limit_gain=1.0), VelocityLimit(model)]
    rows = [first]
    for k in range(1, len(task.points)):
        for share in np.arange(1, PARTS + 1) / PARTS:
            point = (1 - share) * task.points[k - 1] + share * task.points[k]
            axis = (1 - share) * task.axes[k - 1] + share * task.axes[k]
            goal.set_target(_target(at.get_transform_frame_to_world("tip"), point, axis))
            begun = k > 1 or share > 1 / PARTS
            try:
                v = solve_ik(at, [goal], dt, "daqp", limits=[*limits, speeding][: 2 + begun])
            except (PinkError, ValueError):
                return np.array(rows)
            if v is None or not np.isfinite(v).all():
                return np.array(rows)
            speeding.set_last_integration(v, dt)
            at.integrate_inplace(v, dt)
        row = np.empty(len(columns))
        row[columns] = at.q
        rows.append(row)
    return np.array(rows)


def _target(tip: pinocchio.SE3, point: Array, axis: Array) -> pinocchio.SE3:
    """Return the target pose of the tip: its beam is turned onto the axis the shortest way."""
    z = tip.rotation[:, 2]
    turn = pinocchio.Quaternion.FromTwoVectors(z, axis / np.linalg.norm(axis)).toRotationMatrix()
    return pinocchio.SE3(turn @ tip.rotation, point)
