"""Robot programs: 50 000 targets, written and read back in every language."""

from __future__ import annotations

from functools import partial
from statistics import median

import numpy as np

from benchmarks._figures import Figure, Report, in_turn
from kerfpath import robot
from kerfpath.post import (
    JointMove,
    Language,
    LanguageSettings,
    LinearMove,
    Program,
    Section,
    Step,
    Switch,
    deviations,
    languages,
    preflight,
    read_program,
)
from kerfpath.robots import Robot, robot_ids

__all__ = ["run"]

TARGETS, SECTIONS = 50_000, 25
LIMIT = 5.0
"""Time allowed for writing, and for reading back, s."""
UNDIVIDED = ("urscript", "linuxcnc", "ros", "csv")
"""Languages whose programs are one file."""
ONE_FILE = 1_000_000
"""Number of lines that these files may have."""
SWING = 0.12
"""Amplitude of the swing of each joint, rad."""
STEP = 0.004
"""Share of a swing from target to target."""

HOW = """\
{targets} linear targets in {sections} contours, each with a joint move to its start, laser on and
off: a smooth motion of all joints of a robot of the maker, its tip poses by the kinematics.
Written: the text of all files. Read back: by the reader of the language, to poses, posture, speeds
and events. Both are within `kerfpath.post.post`, as are the preflight and the comparison of what
was read with what was meant, which has to find nothing."""


def run(*, quick: bool = False) -> Report:
    """Return the figures of writing and reading programs."""
    count = 500 if quick else TARGETS // SECTIONS
    report = Report(title="Robot programs", how=HOW.format(targets=TARGETS, sections=SECTIONS))
    for name, chosen in sorted(languages().items()):
        lines = {"lines_per_file": ONE_FILE} if name in UNDIVIDED else {}
        settings = chosen.completed(chosen.settings(**lines))
        program = _program(_arm(chosen), count)
        files = chosen.formatter(program, settings).files()
        read = read_program(files, name, program.robot, settings)
        found = deviations(program, read, chosen, settings)
        assert not found, f"{name}: {found[0]}"
        seconds = in_turn(
            {
                "written": partial(_write, chosen, program, settings),
                "read back": partial(read_program, files, name, program.robot, settings),
                "compared": partial(deviations, program, read, chosen, settings),
                "preflight": partial(preflight, program, name, settings),
            },
            runs=1 if quick else 3,
        )
        size = sum(len(text) for text in files.values()) * 1e-6
        note = f"{program.robot.id}, {len(files)} files, {size:.1f} MB"
        for what, values in seconds.items():
            report.figures.append(Figure(what=f"{name}: {what}", values=values, note=note))
        worst = max(median(seconds[what]) for what in ("written", "read back"))
        verdict = "within" if worst < LIMIT else "over"
        report.findings.append(
            f"{name}: the slower of the two takes {worst:.1f} s, {verdict} {LIMIT:g} s"
        )
    return report


def _write(chosen: Language, program: Program, settings: LanguageSettings) -> None:
    chosen.formatter(program, settings).files()


def _arm(chosen: Language) -> Robot:
    """Return a robot of the library for the language."""
    for name in robot_ids():
        arm = robot(name)
        if not chosen.doubt(arm) and not chosen.refusal(arm):
            return arm
    raise LookupError(chosen.name)


def _program(arm: Robot, count: int) -> Program:
    """Return a program of contours with `count` linear targets each."""
    limits = arm.joint_limits()
    middle = np.clip((limits.lower + limits.upper) / 2, -0.5, 0.5)
    middle[4] = 0.9
    phase = np.arange(arm.joints)
    tool, part = np.eye(4), np.eye(4)
    tool[2, 3], part[:3, 3] = 0.2, (0.8, 0.1, 0.4)
    sections = []
    for number in range(SECTIONS):
        t = (np.arange(count) + 0.37 * number)[:, None] * STEP
        q = middle + SWING * np.sin(t + phase)
        T = np.linalg.inv(part) @ arm.forward(q) @ tool
        moves: list[Step] = [
            LinearMove(T_part_tip=pose, q=joints, speed=0.05, duration=0.02, zone=0.0001)
            for pose, joints in zip(T, q, strict=True)
        ]
        for k, on in ((0, True), (-1, False)):
            moves[k] = LinearMove(
                T_part_tip=T[k], q=q[k], speed=0.05, duration=0.02,
                switches=(Switch(signal="laser", on=on),),
            )  # fmt: skip
        steps = (JointMove(q=q[0] + 0.05, speed=0.5), *moves)
        sections.append(Section(name=f"contour_{number}", steps=steps))
    return Program(
        name="long",
        robot=arm,
        T_flange_tip=tool,
        T_base_part=part,
        sections=tuple(sections),
    )
