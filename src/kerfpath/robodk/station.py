"""A machining project of a RoboDK station: its path as a request, the answer as a program.

This file needs the `robodk` package and the standard library, and no more: it is copied into the
add-in, whose Python is RoboDK's own, and starts the Python that has kerfpath as a process of its
own (``python=``). RoboDK has mm and deg; requests and answers have m and rad.
"""

from __future__ import annotations

import json
import math
import os
import random
import socket
import struct
import subprocess
import sys

from robodk import robolink

FOREIGN = ("PYTHONHOME", "PYTHONPATH", "LD_LIBRARY_PATH", "QT_PLUGIN_PATH", "SSL_CERT_FILE")
"""Variables by which RoboDK would lead another Python astray."""
COMPARED = 24
"""Random joints at which the robot of the station is compared with that of the library."""
LARGEST_MM, LARGEST_DEG = 0.1, 0.02
"""Largest distance of the tool, by the kinematics of the station, from a node of the path."""
STEP_MM, STEP_DEG, STEP_S = 1.0, 1.0, 0.05
"""Steps at which RoboDK checks the program."""
FAULTS = {
    0b1: "not reachable",
    0b10: "beyond a joint limit",
    0b100: "singular",
    0b1000: "near a singularity",
    0b100000: "collision",
}
"""What RoboDK's check finds, by the bits of its numbers."""


class StationError(Exception):
    """What a station lacks, or why there is no program, in one line."""


class Settings:
    """What a machining project does not say.

    Parameters
    ----------
    python : str, optional
        Path of a Python in which kerfpath is installed. Default: the kerfpath of this Python.
    speed : float mm/s, optional
        Speed along the path. Default: the operation speed of the project.
    acceleration : float or one for each joint, deg/s^2, or str, optional
        Limits of the joints, or the name of a ratio to the speeds. RoboDK has none. Default: those
        of the library, and an error for a robot without.
    model : str, optional
        Id of the robot in the library of kerfpath. Default: by its name in the station.
    curve : int, optional
        Number of the curve of the object, from 0. Default: its only curve.
    spacing : float mm
        Largest distance of two targets.
    rounding : float mm
        Rounding of the program; -1: the robot stops at each target.
    gamma_step : float deg
        Step of the free rotation about the tool axis.
    collisions : bool
        Whether RoboDK checks the program for collisions.
    seconds : float s, optional
        Time limit of planning.
    """

    def __init__(
        self, python=None, speed=None, acceleration=None, model=None, curve=None, spacing=2.0,
        rounding=1.0, gamma_step=10.0, collisions=False, seconds=None,
    ):  # fmt: skip
        self.python, self.speed, self.acceleration = python, speed, acceleration
        self.model, self.curve, self.spacing = model, curve, spacing
        self.rounding, self.gamma_step = rounding, gamma_step
        self.collisions, self.seconds = collisions, seconds


class Outcome:
    """The program that was written, and what is said about it.

    Parameters
    ----------
    program : robolink.Item
    message : str
        With the message of RoboDK's check.
    sound : bool
        Whether that check found nothing.
    """

    def __init__(self, program, message, sound):
        self.program, self.message, self.sound = program, message, sound


class Connection(socket.socket):
    """A connection to RoboDK that gives all bytes asked for, or raises where it has ended.

    The socket of the `robodk` package waits for ever once RoboDK is gone, and sends its many small
    packets late.
    """

    def __init__(self):
        super().__init__(socket.AF_INET, socket.SOCK_STREAM)
        self.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def recv(self, size, flags=0):
        """Return exactly `size` bytes."""
        found = b""
        while len(found) < size:
            more = super().recv(size - len(found), flags)
            if not more:
                raise ConnectionError("RoboDK has closed it")
            found += more
        return found


def connect(port=None):
    """Return the link to RoboDK on this machine, which is started if it does not run."""
    return robolink.Robolink(port=port, com_object=Connection)


def plan_project(rdk, project, settings=None):
    """Plan the path of a machining project and write it to the station as a program.

    Its first move is a joint move from anywhere to the first target, all others are linear moves;
    the targets are joints. Until the whole program is known the station is only read.

    Parameters
    ----------
    rdk : robolink.Robolink
        As of `connect`.
    project : robolink.Item
        A machining project, such as a curve follow project, with an object that has curves with
        normals, and a robot.
    settings : Settings, optional

    Returns
    -------
    Outcome

    Raises
    ------
    StationError
        The project lacks something, the robot is not known or moves otherwise than expected, there
        is no motion, or the connection is lost.
    """
    settings, name, written = settings or Settings(), "", []
    try:
        name = project.Name()
        place = _place(project, name)
        request = _request(project, place, settings)
        found = _ask(request, settings)
        if "error" in found:
            raise StationError("no program: {}".format(found["message"]))
        first = found["waypoints"][0]
        targets = [[math.degrees(v) for v in q] for q in found["q"][first:]]
        _require_met(place, targets, found)
        program = None
        try:
            program = _write(rdk, name, place, targets, request["speed"], settings, written)
        finally:
            if program is None:
                for item in reversed(written):
                    item.Delete()
        return _outcome(program, targets, found, request["speed"], settings)
    except (OSError, struct.error) as error:
        left = "; delete what is left of program {!r}".format(_named(name)) if written else ""
        raise StationError("the connection to RoboDK was lost: {}{}".format(error, left)) from None


# -----------------------------------------------------------------------------
# What the station has.


class _Place:
    """The items that a project refers to, and its tool (a pose in the flange, mm)."""

    def __init__(self, robot, frame, tool_item, tool, part):
        self.robot, self.frame, self.part = robot, frame, part
        self.tool_item, self.tool = tool_item, tool


def _place(project, name):
    """Return what a project refers to."""
    if project.type != robolink.ITEM_TYPE_MACHINING:
        raise StationError("expected a machining project, got {!r}".format(name))
    robot, part = (
        project.getLink(each) for each in (robolink.ITEM_TYPE_ROBOT, robolink.ITEM_TYPE_OBJECT)
    )
    if not robot.Valid():
        raise StationError("{!r} has no robot: choose one in its settings".format(name))
    if not part.Valid():
        raise StationError(
            "{!r} has no object with curves: choose one as its path; a path of an NC file is "
            "planned by a job of kerfpath".format(name)
        )
    frame = project.getLink(robolink.ITEM_TYPE_FRAME)
    frame = frame if frame.Valid() else robot.Parent()
    item = project.getLink(robolink.ITEM_TYPE_TOOL)
    item = item if item.Valid() else None
    tool = (item or robot).PoseTool()
    turned = project.Pose()
    if _apart(turned.Pos(), [0, 0, 0]) > 1e-3 or _apart(turned.VZ(), [0, 0, 1]) > 1e-6:
        raise StationError(
            "{!r} has a path to tool offset that shifts or tilts the tool: only a rotation about "
            "its z is free; remove the rest".format(name)
        )
    same = robolink.robomath.eye(4)
    if any(_apart(*rows) > 1e-6 for rows in zip(part.GeometryPose().rows, same.rows)):
        raise StationError(
            "the geometry of {!r} is moved in its own frame: apply the move, since the interface "
            "does not say in which frame the curve is".format(part.Name())
        )
    return _Place(robot, frame, item, tool, part)


def _curve(part, number):
    """Return the name and the rows x, y, z (mm) and i, j, k (outward normal) of a curve."""
    curves = []
    while True:
        rows, name = part.GetPoints(robolink.FEATURE_CURVE, len(curves))
        if not rows or not rows[0]:
            break
        curves.append((name or "curve {}".format(len(curves)), rows))
    if not curves:
        raise StationError("{!r} has no curves".format(part.Name()))
    if number is None and len(curves) > 1:
        names = ", ".join("{} {}".format(k, name) for k, (name, _) in enumerate(curves))
        raise StationError(
            "{!r} has {} curves: set curve to one of {}".format(part.Name(), len(curves), names)
        )
    if number is not None and not 0 <= number < len(curves):
        raise StationError("curve: expected 0 to {}, got {}".format(len(curves) - 1, number))
    name, rows = curves[number or 0]
    for k, row in enumerate(rows):
        if len(row) < 6 or not sum(v * v for v in row[3:6]) > 1e-6:
            raise StationError(
                "{}: point {} has no normal, so the tool axis is not known: extract the curve from "
                "a surface, or project it onto one".format(name, k)
            )
    return name, rows


def _request(project, place, settings):
    """Return the request of a project, in m and rad, in the base of its robot."""
    name, rows = _curve(place.part, settings.curve)
    robot = place.robot
    T = robot.PoseAbs().inv() * place.part.PoseAbs()
    lower, upper, _ = robot.JointLimits()
    lower, upper = lower.list(), upper.list()
    chance = random.Random(1)
    joints = [[chance.uniform(*ends) for ends in zip(lower, upper)] for _ in range(COMPARED)]
    speed = settings.speed
    if speed is None:
        speed = _of_project(project, "SpeedOperation")
    acceleration = settings.acceleration
    if isinstance(acceleration, (int, float)):
        acceleration = math.radians(acceleration)
    elif acceleration is not None and not isinstance(acceleration, str):
        acceleration = _radians(acceleration)
    return {
        "station": {
            "name": robot.Name(),
            "model": settings.model,
            "lower": _radians(lower),
            "upper": _radians(upper),
            "q": [_radians(q) for q in joints],
            "T": [_metres(robot.SolveFK(q)) for q in joints],
        },
        "start": _radians(robot.Joints().list()),
        "acceleration": acceleration,
        "gamma_step": math.radians(settings.gamma_step),
        "T_flange_tip": _metres(place.tool),
        "points": [[v / 1000 for v in _moved(T, row[:3], 1)] for row in rows],
        "axes": [[-v for v in _moved(T, row[3:6], 0)] for row in rows],
        "name": name,
        "speed": speed / 1000,
        "max_step": settings.spacing / 1000,
    }


def _of_project(project, key):
    found = project.setParam("Machining")  # without a value this reads
    if not isinstance(found, dict) or not isinstance(found.get(key), (int, float)):
        raise StationError("speed: the project says no operation speed; give one, in mm/s")
    return found[key]


# -----------------------------------------------------------------------------
# Asked of kerfpath.


def _ask(request, settings):
    """Return the answer to a request, of this Python or of another one in a process."""
    if settings.python is None:
        from kerfpath.pipe import answer

        return answer(request)
    command = [str(settings.python), "-I", "-m", "kerfpath.pipe"]
    try:
        done = subprocess.run(
            command,
            input=json.dumps(request) + "\n",
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            env={k: v for k, v in os.environ.items() if k not in FOREIGN},
            timeout=settings.seconds,
            creationflags=0x08000000 if sys.platform == "win32" else 0,  # no window
        )
    except subprocess.TimeoutExpired:
        raise StationError("no program within {:g} s".format(settings.seconds)) from None
    except OSError as error:
        raise StationError(
            "python: expected the path of a Python with kerfpath, got {} ({})".format(
                settings.python, error
            )
        ) from None
    if not done.stdout:
        said = done.stderr.strip().splitlines() or ["it said nothing"]
        raise StationError("{} ended without an answer: {}".format(settings.python, said[-1]))
    return json.loads(done.stdout)


def _require_met(place, targets, found):
    """Raise StationError unless the kinematics of the station put the tool at every node."""
    worst_mm = worst_deg = 0.0
    for q, point, axis in zip(targets, found["points"], found["axes"]):
        T = place.robot.SolveFK(q) * place.tool
        worst_mm = max(worst_mm, _apart(T.Pos(), [1000 * v for v in point]))
        sine = min(_apart(T.VZ(), axis) / 2, 1.0)
        worst_deg = max(worst_deg, math.degrees(2 * math.asin(sine)))
    if worst_mm > LARGEST_MM or worst_deg > LARGEST_DEG:
        raise StationError(
            "no program: by the kinematics of the station its tool would be up to {:.3g} mm and "
            "{:.2g} deg from the path, at most {:g} mm and {:g} deg are accepted".format(
                worst_mm, worst_deg, LARGEST_MM, LARGEST_DEG
            )
        )


# -----------------------------------------------------------------------------
# What is written to the station, and checked there.


def _named(name):
    """Return the name of the program of a project."""
    return name + " kerfpath"


def _write(rdk, name, place, targets, speed, settings, written):
    """Return the program; every item is also put into `written` as soon as it is there."""
    rdk.Render(False)
    try:
        program = rdk.AddProgram(_named(name), place.robot)
        written.append(program)
        program.ShowInstructions(False)
        program.setPoseFrame(place.frame)
        program.setPoseTool(place.tool_item or place.tool)
        program.setSpeed(1000 * speed)
        program.setRounding(float(settings.rounding))
        for k, q in enumerate(targets):
            target = rdk.AddTarget("{} {}".format(name, k + 1), place.frame, place.robot)
            written.append(target)
            target.setAsJointTarget()
            target.setJoints(q)
            (program.MoveL if k else program.MoveJ)(target)
    finally:
        rdk.Render(True)
    return program


def _outcome(program, targets, found, speed, settings):
    """Return what is said about a program, with the result of RoboDK's check."""
    asked = robolink.COLLISION_ON if settings.collisions else robolink.COLLISION_OFF
    message, steps, status = program.InstructionListJoints(
        STEP_MM, STEP_DEG, None, asked, flags=3, time_step=STEP_S
    )
    n, faults = len(targets[0]), 0
    for column in list(steps):
        faults |= int(str(int(column[n])), 2)  # its decimal digits are the bits
    sound = status >= 0 and not faults
    named = [said for bit, said in FAULTS.items() if faults & bit]
    lines = [
        "{}: {} targets at {:g} mm/s, at most {:.3g} mm off the curve between them.".format(
            program.Name(), len(targets), 1000 * speed, 1000 * found["chord"]
        ),
        "Robot {} of the library; forward kinematics at most {:.2g} mm and {:.1g} deg "
        "apart.".format(found["robot"], found["apart_mm"], found["apart_deg"]),
        "Accelerations: {}.".format(found["acceleration"].rstrip(".") or "of the library"),
        "RoboDK's check{}: {}.".format(
            " with collisions" if settings.collisions else ", without collisions",
            "; ".join(filter(None, [message.strip().rstrip("."), *named])) or "no problems",
        ),
    ]
    return Outcome(program, "\n".join(lines), sound)


# -----------------------------------------------------------------------------
# Poses and units.


def _moved(T, v, w):
    """Return a point (w 1) or a direction (w 0) in another frame."""
    return [sum(a * b for a, b in zip(row, [*v, w])) for row in T.rows[:3]]


def _metres(T):
    """Return the rows of a pose in m."""
    rows = [list(row) for row in T.rows]
    return [[*row[:3], row[3] / 1000] for row in rows[:3]] + [[0.0, 0.0, 0.0, 1.0]]


def _radians(joints):
    return [math.radians(v) for v in joints]


def _apart(one, two):
    return math.sqrt(sum((a - b) ** 2 for a, b in zip(one, two)))
