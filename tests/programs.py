"""Small programs for the tests of robot languages: made by hand, no search that might change."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath import Contour
from kerfpath.options import PlanOptions
from kerfpath.plans import Plan, Proof
from kerfpath.post import (
    CircularMove,
    JointMove,
    LinearMove,
    Program,
    Section,
    Switch,
    preflight,
    read_program,
)
from kerfpath.robots import Arm, Robot, RobotLimits

STEEP = np.radians(20.0)


def hand_plan(contour, arm, tool, placement, speed=0.1, posture=0):
    """A plan at gamma 0, each node solved next to the one before; no search that might change."""
    T = placement @ contour.frames() @ np.linalg.inv(tool)
    q = []
    for k, pose in enumerate(T):
        found = arm.inverse(pose, within_limits=False)
        near = found.q[found.posture == posture]
        before = q[-1] if q else np.radians([0, 0, 0, 0, 45, 0])
        assert len(near), k
        near = near + 2 * np.pi * np.round((before - near) / (2 * np.pi))
        q.append(near[np.argmin(np.abs(near - before).max(axis=1))])
    K = len(contour)
    return Plan(
        contour=contour,
        robot=arm,
        T_flange_tip=tool,
        T_base_part=placement,
        q=np.array(q),
        gamma=np.zeros(K),
        posture=np.full(K, posture),
        turn=np.zeros((K, 6), int),
        time=np.arange(K) * contour.length / (K - 1) / speed,
        settings=PlanOptions(gamma_step=0.1, frames="tangent", method="paper", weights=np.ones(6)),
        cost=0.0,
        proof=Proof(optimal=False, statement="made by hand"),
        counts={},
    )


def frames():
    """A tool whose beam leaves the flange by 35 deg, and a part turned about all axes."""
    tool, placement = np.eye(4), np.eye(4)
    tool[:3, :3] = Rotation.from_euler("y", 35, degrees=True).as_matrix()
    tool[:3, 3] = 0.0513, 0.0, 0.2487
    placement[:3, :3] = Rotation.from_euler("zyx", [31, 3, -2], degrees=True).as_matrix()
    placement[:3, 3] = 1.0537, -0.1511, 0.6123
    return tool, placement


def arc(name="skin/outer", count=8, radius=0.0871):
    t = np.linspace(0.2, 1.9, 200)
    points = np.c_[radius * np.cos(t), radius * np.sin(t), 0.0123 * np.cos(3 * t)]
    axes = np.c_[-np.sin(STEEP) * np.cos(t), -np.sin(STEEP) * np.sin(t), -np.ones_like(t)]
    return Contour(points, axes, name=name).resample(count=count)


def changed(program, number, **changes):
    """The program with one step of its first section replaced in part."""
    steps = list(program.sections[0].steps)
    steps[number] = replace(steps[number], **changes)
    return with_steps(program, steps)


def with_steps(program, steps):
    """The program with other steps in its one section."""
    return replace(program, sections=(Section(name=program.sections[0].name, steps=tuple(steps)),))


def arced(program, numbers):
    """The program with some moves of the path made the way to an arc's end, the next move's."""
    steps = list(program.sections[0].steps)
    for n in numbers:
        via, end = program.moves[n], program.moves[n + 1]
        made = {f: getattr(end, f) for f in ("T_part_tip", "q", "speed", "duration", "zone")}
        switches = (*via.switches, *end.switches)
        steps.remove(via)
        steps[steps.index(end)] = CircularMove(
            T_part_via=via.T_part_tip, q_via=via.q, switches=switches, **made
        )
    return with_steps(program, steps)


def codes(program, level=None, language="rapid", settings=None):
    """Codes of the issues that a preflight finds."""
    found = preflight(program, language, settings)
    return [issue.code for issue in found if level in (None, issue.level)]


def read_text(text, robot, language="rapid", settings=None):
    """What the text of a program of one file says."""
    return read_program({"a program": text}, language, robot, settings)


def edited(files, file, old, new, count=1):
    """The files of a program with a place in one of them edited, which has to be there."""
    assert old in files[file]
    return {**files, file: files[file].replace(old, new, count)}


def assert_at(T, expected, point=1e-6):
    """Require a pose where it is expected, within `point` (m) and 1e-3 deg."""
    assert np.linalg.norm(T[:3, 3] - expected[:3, 3]) < point
    turned = Rotation.from_matrix(T[:3, :3].T @ expected[:3, :3])
    assert np.degrees(turned.magnitude()) < 1e-3


def text_of(files):
    """The text of a program of one file."""
    (text,) = files.values()
    return text


def five_axis_program():
    """A program of an arm of five axes, straight from stop to stop and through three nodes."""
    five = Robot(
        id="five",
        arm=Arm(
            kinematics="five",
            geometry={"a1": 0.3, "a2": -0.1, "b": 0.0, "c1": 0.7, "c2": 0.9, "c3": 0.8, "c4": 0.12},
        ),
        limits=RobotLimits(
            lower=np.radians([-170, -90, -60, -180, -180]),
            upper=np.radians([170, 120, 170, 180, 180]),
            velocity=np.radians([120, 110, 130, 300, 300]),
            acceleration=np.radians([400, 300, 500, 1500, 1500]),
            endless=[0, 0, 0, 1, 1],
        ),
    )
    tool, placement = np.eye(4), np.eye(4)
    tool[:3, 3] = 0.06, 0.02, 0.2
    q = np.array([0.3, 0.2, 0.4, 0.5, 0.9]) + np.linspace(0, 0.1, 6)[:, None]
    tips = five.forward(q) @ tool
    on, off = (Switch(signal="laser", on=state, lead_time=0.01) for state in (True, False))
    path = [
        LinearMove(T_part_tip=T, q=joints, speed=0.1, duration=0.3, zone=zone, switches=switches)
        for T, joints, zone, switches in zip(
            tips[1:], q[1:], (0, 1e-4, 1e-4, 0, 0), ((on,), (), (), (off,), ()), strict=True
        )
    ]
    return Program(
        name="five",
        robot=five,
        T_flange_tip=tool,
        T_base_part=placement,
        sections=(Section(name="cut", steps=(JointMove(q=q[0], speed=0.5), *path)),),
    )
