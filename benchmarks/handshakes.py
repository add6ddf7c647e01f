"""Handshakes of all languages: every path through every program, and every line begun at."""

from __future__ import annotations

from itertools import product

import numpy as np

import kerfpath
from benchmarks._figures import Report, Sheet
from kerfpath.plans import Plan
from kerfpath.post import (
    Await,
    ReadPause,
    Request,
    build_program,
    language,
    post,
    read_program,
    unsafe_paths,
    unsafe_restarts,
)
from kerfpath.post.program import Partner

__all__ = ["run"]

ASKED: tuple[Partner, ...] = ("shutter", "height", "ready")
AWAITED: tuple[Partner, ...] = ("ready", "interlock", "gas_pressure", "height")
PORTS = {
    "laser_output": 1, "gas_output": 2, "shutter_output": 3, "height_output": 4, "ready_output": 5,
    "ready_input": 1, "interlock_input": 2, "gas_pressure_input": 3, "height_input": 4,
}  # fmt: skip
NAMED = ("rapid", "val3")
"""Languages that call inputs and outputs by names."""
ARMS = {
    "rapid": "abb_irb4600_60_205",
    "krl": "kuka_kr16_r2010_2",
    "fanuc": "fanuc_m20id_25",
    "val3": "staubli_tx2_160l",
    "inform": "yaskawa_gp25",
    "urscript": "ur_ur10e",
    "linuxcnc": "abb_irb4600_60_205",
}
ACCELERATION = [300, 300, 400, 1000, 1000, 1500]
HOW = """\
Programs of one and two holes in each language that has outputs, with 0 to 3 requests to partners, 0
to 4 waits for them, the gas with and without, and a lead time of 20 ms. Paths: every wait ends
without an answer, and after a pause the operator continues, as often as he likes, until the program
ends; unsafe is a path
with the laser on where it must not be, something left on, or a cut that goes on without what it
had. Lines: the program is begun at every step while everything is off, as after a loss of power, or
where the operator moves the cursor; unsafe is a line from which the laser comes on without an
output or an answer that it has on the planned path. The first lines of contours are among them."""


def run(*, quick: bool = False) -> Report:
    """Follow all of them."""
    rows: list[list[str]] = []
    for name, arm in ARMS.items():
        plans = _plan(arm, "one"), _plan(arm, "two")
        ports = {key: key if name in NAMED else n for key, n in PORTS.items()}
        settings = language(name).settings.model_validate(ports)
        counts = np.zeros(7, int)
        for asked, awaited, gas, contours in product(range(4), range(5), (None, 0.2), (1, 2)):
            if quick and (asked + awaited) % 3:
                continue
            shakes = [Request(partner=who, on=True) for who in ASKED[:asked]]
            waits = [Await(partner=who, timeout=1.0) for who in AWAITED[:awaited]]
            program = build_program(
                plans[:contours],
                handshakes=(*shakes, *waits),
                gas_lead=gas,
                pierce_time=0.1,
                lead_time=0.02,
            )
            read = read_program(post(program, name, settings), name, program.robot, settings)
            flow = [step for section in read.sections for step in section.flow]
            stretches = len(unsafe_restarts(read))
            counts += (
                1,
                sum(isinstance(getattr(step, "what", None), Await) for step in flow),
                sum(isinstance(step, ReadPause) for step in flow),
                len(unsafe_paths(read)),
                len(flow),
                stretches,
                stretches if asked else 0,
            )
        rows.append([name, *map(str, counts)])
    total = np.sum([[int(cell) for cell in row[1:]] for row in rows], axis=0)
    columns = (
        "language", "programs", "waits", "pauses", "unsafe paths", "lines begun at",
        "unsafe stretches", "of them with requests",
    )  # fmt: skip
    return Report(
        title="Handshakes",
        how=HOW,
        sheets=[Sheet(columns=columns, rows=[*rows, ["all", *map(str, total)]])],
        findings=[f"{total[3]} unsafe paths, {total[5]} unsafe stretches in {total[0]} programs"],
    )


def _plan(arm: str, name: str) -> Plan:
    """Return a plan of a hole."""
    t = np.linspace(0, 2 * np.pi, 61)
    points = np.c_[0.02 * np.cos(t), 0.02 * np.sin(t), 0 * t]
    hole = kerfpath.Contour(points, np.tile([0, 0, -1], (61, 1)), closed=True, name=name)
    tool, placement = np.eye(4), np.eye(4)
    tool[:3] = np.array([[0.8, 0, 0.6, 0.05], [0, 1, 0, 0], [-0.6, 0, 0.8, 0.25]])
    placement[:3, 3] = (0.7, 0.1, 0.2) if arm.startswith("ur") else (1.0, -0.15, 0.5)
    robot = kerfpath.robot(arm).with_limits(acceleration=np.radians(ACCELERATION))
    return kerfpath.plan(
        hole.resample(spacing=0.005), robot, tool=tool, placement=placement, speed=0.03,
        gamma_step=np.radians(10),
    )  # fmt: skip
