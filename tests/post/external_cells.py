"""Robots with rails and positioners, and plans on them whose axes move along given courses."""

from dataclasses import dataclass

import numpy as np
from tests.post.cases import CASES, DATA, ZONE

from kerfpath.options import PlanOptions
from kerfpath.plans import Plan, Proof
from kerfpath.post import build_program, deviations, language, post, read_program
from kerfpath.robots import base_in_part
from programs import arc

RAIL = {"lower": -0.5, "upper": 3.0, "velocity": 2.0, "acceleration": 4.0}
TURN = {"lower": -4.0, "upper": 4.0, "velocity": 2.5, "acceleration": 8.0}
COURSES = {"rail": (0.02, 0.31), "chuck": (-0.15, 0.35), "tilt": (0.1, -0.2), "turn": (0.0, 0.4)}
"""First and last value of each axis, m and rad, along a contour."""
CELLS = {
    "rail": ("rail",),
    "chuck": ("chuck",),
    "turn-tilt": ("tilt", "turn"),
    "rail+table": ("rail", "turn"),
}
"""The external axes of each cell, in order."""
UNITS = {"rail": "TRACK_1", "chuck": "STN_1", "tilt": "STN_1", "turn": "STN_1"}
SETTINGS = {
    "rapid": lambda axes: {"mechanical_units": [UNITS[axis] for axis in axes]},
    "krl": lambda axes: {"laser_output": 5, "gas_output": 6},
    "fanuc": lambda axes: {"laser_output": 1},
    "inform": lambda axes: {
        "external_pulses": [2500.0 if axis == "rail" else -1019.7 for axis in axes]
    },
}
"""What a cell's program needs in a language beyond the settings of its golden program."""
SAYING = ("csv", "fanuc", "inform", "krl", "linuxcnc", "rapid", "ros")
"""Languages that say external axes."""


def with_axes(arm, names, point):
    """The arm on a rail, its part on what turns about axes through a point (m), as named."""
    for name in names:
        if name == "rail":
            arm = arm.on_rail([0.0, 1.0, 0.0], **RAIL)
        else:
            axis = {"chuck": [0, 1, 0], "tilt": [1, 0, 0], "turn": [0, 0, 1]}[name]
            endless = name in ("chuck", "turn")
            arm = arm.with_positioner(axis, point, name=name, endless=endless, **TURN)
    return arm


def moving_plan(contour, robot, tool, placement, courses, speed=0.1):
    """A plan at gamma 0 whose external axes go along courses (K, E); no search that might change.

    The arm alone is solved at every node: where base and part stand then, it sees the tip.
    """
    K, arm = len(contour), robot.alone()
    T = placement @ contour.frames() @ np.linalg.inv(tool)
    q = []
    for pose in np.linalg.inv(base_in_part(robot.externals, courses)) @ T:
        found = arm.inverse(pose, within_limits=False)
        near, before = found.q[found.posture == 0], q[-1] if q else np.radians([0, 0, 0, 0, 45, 0])
        near = near + 2 * np.pi * np.round((before - near) / (2 * np.pi))
        q.append(near[np.argmin(np.abs(near - before).max(axis=1))])
    return Plan(
        contour=contour,
        robot=robot,
        T_flange_tip=tool,
        T_base_part=placement,
        q=np.hstack([q, courses]),
        gamma=np.zeros(K),
        posture=np.zeros(K, int),
        turn=np.zeros((K, robot.joints), int),
        time=np.arange(K) * contour.length / (K - 1) / speed,
        settings=PlanOptions(
            gamma_step=0.1, frames="tangent", method="paper", weights=np.ones(robot.joints)
        ),
        cost=0.0,
        proof=Proof(optimal=False, statement="made by hand"),
        counts={},
    )


@dataclass(frozen=True)
class ExternalCase:
    """A cell and a language: its plan, its program, and what is read back of it."""

    cell: str
    name: str

    def __str__(self):
        return f"{self.name} {self.cell}"

    @property
    def axes(self):
        return CELLS[self.cell]

    @property
    def language(self):
        return language(self.name)

    @property
    def settings(self):
        more = SETTINGS.get(self.name, lambda axes: {})(self.axes)
        return self.language.settings(**CASES[self.name].options | more)

    def plan(self, count=8):
        arm, tool, placement = CASES[self.name].cell
        arm = arm.with_limits(acceleration=np.full(6, 20.0))
        robot = with_axes(arm, self.axes, placement[:3, 3] + [0.0, 0.0, -0.05])
        ends = np.array([COURSES[axis] for axis in self.axes]).T
        part = np.linspace(0, 1, count)[:, None]
        courses = ends[0] + part * (ends[1] - ends[0])
        return moving_plan(arc(count=count), robot, tool, placement, courses, speed=0.05)

    def program(self, count=8):
        return build_program([self.plan(count)], zone=ZONE, pierce_time=0.4)

    def files(self, program=None):
        return post(program or self.program(), self.name, self.settings)

    def text(self):
        """All files of the program, one behind the other, each behind its name."""
        return "".join(f"=== {name}\n{text}" for name, text in self.files().items())

    @property
    def golden(self):
        return DATA / "golden_external" / f"{self.name}_{self.cell.replace('+', '_')}.txt"

    def read(self, files, robot=None):
        robot = self.plan().robot if robot is None else robot
        return read_program(files, self.name, robot, self.settings)

    def deviations(self, program, read):
        return deviations(program, read, self.language, self.settings)


GOLDEN = [
    ExternalCase(cell, name) for name in SAYING if name not in ("linuxcnc", "ros") for cell in CELLS
]
"""Kept as texts; those of joints alone are read back."""

if __name__ == "__main__":  # PYTHONPATH=src:tests:. writes them again; look at what changes
    for case in GOLDEN:
        case.golden.parent.mkdir(exist_ok=True)
        case.golden.write_bytes(case.text().encode("ascii"))
