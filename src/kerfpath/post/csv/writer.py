"""A table with one row for each target and wait: this module only formats.

The first row names the columns and their units. Joints are in deg, external axes in mm or deg, tips
in mm and as unit quaternions (w first) in the part's frame, times in s from the first target.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from kerfpath.names import identifier
from kerfpath.post.arcs import quaternions, timetable
from kerfpath.post.build import arm_joints, controller_unit, to_controller_units
from kerfpath.post.languages import (
    Formatter,
    LanguageSettings,
    LinesPerFile,
    Rules,
    number,
    require_one_file,
)
from kerfpath.post.program import (
    CircularMove,
    JointMove,
    LinearMove,
    Move,
    SetPower,
    Switch,
    Wait,
    targets_of,
)
from kerfpath.robots import Robot

POSE = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")


class CsvSettings(LanguageSettings):
    """Settings of a table: its length."""

    lines_per_file: LinesPerFile = 1_000_000


def rules(settings: CsvSettings) -> Rules:
    """Return the rules of programs: the digits of the table."""
    return Rules(slowest=1e-6, speed_step=1e-6, point_step=0.5e-10, angle_step=1e-11)


def is_reserved(name: str) -> bool:
    """Return whether a run of a job writes a file of that name already."""
    return name.lower() == "trajectory"


def columns(robot: Robot) -> list[str]:
    """Return the names of the columns of a robot."""
    axes = [f"q{i}_deg" for i in range(1, robot.family.joints + 1)]
    for i, axis in enumerate(robot.externals, 1):
        axes.append(f"e{i}_{identifier(axis.name)}_{controller_unit(axis)}")
    rest = ["speed_mm_s", "speed_percent", "zone_mm", "events"]
    return ["section", "kind", "t_s", *axes, *POSE, *rest]


def event(switch: Switch) -> str:
    """Return a switch in words."""
    state = ("on" if switch.on else "off") if switch.share is None else number(switch.share, 4)
    return f"{switch.signal} {state} {number(switch.lead_time, 4)} s ahead"


class Csv(Formatter):
    """Formatter of the one table."""

    settings: CsvSettings

    def files(self) -> dict[str, str]:
        """Return the one table."""
        program = self.program
        self._ends = iter([number(end, 12) for _, end in timetable(program)])
        lines = [",".join(columns(program.robot))]
        for section in program.sections:
            lines += (f"{section.name},{row}" for row in self.lines(section))
        return require_one_file(f"{program.name}.csv", lines, self.settings.lines_per_file)

    def names(self) -> list[tuple[str, str]]:
        """Return the name of the file; sections are only words in a column."""
        return [(self.program.name, "the program")]

    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield the row of a joint move; its speed is in per cent of the full one."""
        share = number(move.speed * 100, 2)
        yield self._row("joint", move, f",{share},{number(move.zone * 1e3, 4)},")

    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield the row of a linear move."""
        yield self._row("linear", move, self._along(move))

    def circular_move(self, move: CircularMove) -> Iterator[str]:
        """Yield a row for the point on the way, which has no time, and one for the target."""
        yield f"via,,{self._targets[move][0]},,,,"
        yield self._row("circular", move, self._along(move))

    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield the row of a wait, which only contains its end."""
        fields = self.program.robot.joints + len(POSE) + 4
        yield f"wait,{next(self._ends)}{',' * fields}"

    def power(self, power: SetPower) -> Iterator[str]:
        """Yield the row of a power that is set while the robot stands, in the last column."""
        fields = self.program.robot.joints + len(POSE) + 4
        yield f"power{',' * (fields + 1)}power {number(power.share, 4)}"

    def comment(self, text: str) -> Iterator[str]:
        """Yield nothing: a table has no comments."""
        yield from ()

    def _row(self, kind: str, move: Move, rest: str) -> str:
        return f"{kind},{next(self._ends)},{self._targets[move][-1]},{rest}"

    def _along(self, move: LinearMove) -> str:
        speed, zone = number(move.speed * 1e3, 3), number(move.zone * 1e3, 4)
        return f"{speed},,{zone},{' and '.join(event(switch) for switch in move.switches)}"

    @cached_property
    def _targets(self) -> dict[Move, list[str]]:
        """Joints and tip of each target, those on the way first."""
        program, moves = self.program, list(dict.fromkeys(self.program.moves))
        points, tips = targets_of(moves), dict(zip(moves, program.tips(moves), strict=True))
        robot, q = program.robot, np.array([q for _, q, _ in points])
        q_deg = np.hstack([np.degrees(arm_joints(robot, q)), to_controller_units(robot, q)]).round(
            9
        )
        T = np.array([tips[move] if T is None else T for move, _, T in points])
        point_mm, wxyz = (T[:, :3, 3] * 1e3).round(7), quaternions(T).round(11)
        text = ",".join(["%.9f"] * q_deg.shape[1] + ["%.7f"] * 3 + ["%.11f"] * 4)
        texts: dict[Move, list[str]] = {move: [] for move in moves}
        for (move, _, _), row in zip(points, np.hstack([q_deg, point_mm, wxyz]) + 0.0, strict=True):
            texts[move].append(text % tuple(row.tolist()))
        return texts
