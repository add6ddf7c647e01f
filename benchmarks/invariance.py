"""Costs of plans of the same task in different forms: sampling, frame, direction, start, units."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from os import environ
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any
from unittest.mock import patch
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks._certified import Task
from benchmarks._figures import Report, Sheet, kept_rows
from benchmarks._random_contours import contour, head
from kerfpath import Contour, NoFeasiblePath, PlanOptions, Robot, fastest_speed, robot
from kerfpath.planner import node_interval

__all__ = ["FORMS", "KINDS", "TOLERANCE", "drawn", "run"]

TASKS, QUICK = 400, 2
TOLERANCE = 0.002
"""Relative difference of the costs of two forms from which on it is counted."""
ROBOTS = {
    "abb_irb2600_12_165": "cybertech_8_to_20kg",
    "abb_irb4600_60_205": "iontec_20_to_70kg",
    "fanuc_m10ia": "cybertech_8_to_20kg",
    "kuka_kr16_r1610_2": None,
    "staubli_tx2_90xl": "payload_up_to_20kg_agilus",
    "ur_ur10e": "cybertech_8_to_20kg",
    "yaskawa_gp25": "cybertech_8_to_20kg",
}
"""Robots by id, with the ratio that replaces accelerations that their maker does not publish."""
KINDS = {
    "ordinary": (0.3, 0.95),
    "fast": (0.95, 1.0),
    "low": (0.02, 0.2),
    "singular": (0.2, 0.9),
    "metric": (0.3, 0.95),
    "periodic": (0.3, 0.95),
}
"""Kinds of tasks, in turn, with the range of the speed as a share of the fastest on `COARSE`."""
COARSE = np.radians(5.0)
"""rad: step of gamma of the grid on which that speed is the fastest."""
SEED = 2027
SCALE = 4.0
"""Factor between the units of time, and square root of that between the units of the weights."""

HOW = f"""\
Random contours in front of seven robots, at speeds up to the fastest on a grid of 5 deg, of these
kinds in turn: ordinary, fast (0.95 to 1 of that speed), low (at most 0.2 of it), singular (a node
in a singularity of the wrist), metric (random weights, metric and objective), periodic (closed,
ends as it begins). Each is planned as it is drawn, gamma sampled every 2 deg, and in changed forms,
without certificates. 5, 10 deg: steps of gamma. turned: contour and placement changed by opposite
rigid motions, and the tool turned about the beam. reversed: from the last node to the first, the
frames of the contour with it. start: a periodic task from its
middle node on. units: another unit of time and of the weights. joints: the robot read from its
URDF, the joints in opposite order there. threads: two instead of one. Of the forms that have a
plan: those whose cost differs from the task's own by over {100 * TOLERANCE:g} %, and by how much;
dearer is what it costs beyond the cheapest form of the task. No plan: forms without one where
another form has one. Processor seconds: of one plan, with its graph."""
COLUMNS = (
    "form", "plans", "no plan", f"over {100 * TOLERANCE:g} %", "share %", "worst %",
    "dearer than best", "worst %", "median s", "worst s",
)  # fmt: skip

Change = Callable[[Task, np.random.Generator], Task | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A random task, and its seed, which decides all of it."""

    seed: int
    kind: str
    task: Task


def run(
    *, quick: bool, tasks: int | None = None, first: int = 0, rows: Path | None = None
) -> Report:
    """Plan so many tasks in all forms, from a first one on.

    With `rows`, a file of one JSON object a line, the tasks are added to those that are in it, and
    are not planned again; the report is on all tasks of the file.
    """
    count = tasks if tasks is not None else QUICK if quick else TASKS
    return report(kept_rows(planned, range(first, first + count), rows))


def planned(seed: int, forms: Sequence[str] = ()) -> dict[str, Any]:
    """Return kind, costs and seconds of the forms of a task: all, or those named."""
    made = drawn(seed)
    costs, seconds = dict[str, float | None](), dict[str, float]()
    for name, change in FORMS.items():
        form = change(made.task, np.random.default_rng([SEED, seed, 1]))
        if form is None or (forms and name not in forms):
            continue
        threads = "2" if name == "threads" else "1"
        with patch.dict(environ, NUMBA_NUM_THREADS=threads):
            begun = process_time()
            found = form.planned()
            seconds[name] = round(process_time() - begun, 3)
        scale = SCALE**2 if name == "units" else 1.0
        costs[name] = None if found is None else found.cost / scale
    robot = made.task.robot.id
    return {"seed": seed, "kind": made.kind, "robot": robot, "costs": costs, "seconds": seconds}


def drawn(seed: int) -> Drawn:
    """Return the task of a seed."""
    rng = np.random.default_rng([SEED, seed])
    kind = list(KINDS)[seed % len(KINDS)]
    arm = _arm(rng)
    options: dict[str, Any] = {"certify": None, "gamma_step": np.radians(2.0)}
    if kind == "metric":
        options |= {
            "metric": str(rng.choice(["manhattan", "euclid", "chebychev"])),
            "objective": str(rng.choice(["sum", "sum", "max"])),
            "weights": rng.uniform(0.1, 2.0, 6),
        }
    if kind == "periodic":
        options["closure"] = "periodic"
    share = rng.uniform(*KINDS[kind])
    where: dict[str, Any] = {"tool": head(), "placement": np.eye(4)}
    while True:
        cut = _cut(rng, arm, kind)
        with suppress(NoFeasiblePath):
            fastest = fastest_speed(cut, arm, gamma_step=COARSE, **where)
            return Drawn(
                seed=seed,
                kind=kind,
                task=Task(
                    contour=cut, robot=arm, speed=share * fastest.speed,
                    options=PlanOptions(**options), **where,
                ),
            )  # fmt: skip


def _arm(rng: np.random.Generator) -> Robot:
    """Return a robot, joints 4 and 6 endless or not; a UR within one turn."""
    name = str(rng.choice(list(ROBOTS)))
    endless = bool(rng.random() < 0.5)
    arm = robot(name, acceleration_ratio=ROBOTS[name]).with_limits(couplings=())
    if name.startswith("ur_"):
        return arm.with_limits(lower=np.full(6, -np.pi), upper=np.full(6, np.pi))
    return arm.with_limits(endless=[0, 0, 0, endless, 0, endless])


def _cut(rng: np.random.Generator, arm: Robot, kind: str) -> Contour:
    """Return a contour in front of the robot, of the kind."""
    assert arm.reach is not None
    cut = contour(rng, arm.reach)
    while kind == "periodic" and not cut.closed:
        cut = contour(rng, arm.reach)
    if kind == "singular":
        return _through_singularity(rng, arm, cut)
    return Contour(cut.points, cut.axes, closed=cut.closed)  # its length is that of its steps


def _through_singularity(rng: np.random.Generator, arm: Robot, cut: Contour) -> Contour:
    """Return the contour moved so that a node has a pose with joint 5 nearly at 0."""
    limits = arm.joint_limits()
    low, high = np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi)
    q = rng.uniform(0.6 * low, 0.6 * high)
    q[4] = rng.normal() * 0.01
    tip = arm.forward(q) @ head()
    node = int(rng.integers(len(cut)))
    turn = Rotation.from_rotvec(tip[:3, 2] * rng.uniform(0, 2 * np.pi))
    onto = Rotation.align_vectors([tip[:3, 2]], [cut.axes[node]])[0]
    R = (turn * onto).as_matrix()
    points = (cut.points - cut.points[node]) @ R.T + tip[:3, 3]
    return Contour(points, cut.axes @ R.T, closed=cut.closed)


# -----------------------------------------------------------------------------
# The forms of a task.


def _stepped(degrees: float) -> Change:
    def changed(task: Task, rng: np.random.Generator) -> Task:
        return replace(task, options=replace(task.options, gamma_step=np.radians(degrees)))

    return changed


def _turned(task: Task, rng: np.random.Generator) -> Task:
    """Return the same scene, with other frames of part and tip."""
    M, about = np.eye(4), np.eye(4)
    M[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    M[:3, 3] = rng.uniform(-2, 2, 3)
    about[:3, :3] = Rotation.from_euler("z", rng.uniform(-np.pi, np.pi)).as_matrix()
    cut = task.contour
    return replace(
        task,
        contour=Contour(
            cut.points @ M[:3, :3].T + M[:3, 3], cut.axes @ M[:3, :3].T, closed=cut.closed
        ),
        placement=task.placement @ np.linalg.inv(M),
        tool=task.tool @ about,
    )


def _reversed(task: Task, rng: np.random.Generator) -> Task:
    cut = task.contour
    return replace(task, contour=Contour(cut.points[::-1], cut.axes[::-1], closed=cut.closed))


def _started_elsewhere(task: Task, rng: np.random.Generator) -> Task | None:
    """Return a periodic task that begins at another node; None if the task is not periodic."""
    if task.options.closure != "periodic":
        return None
    cut, last = task.contour, len(task.contour) - 1
    nodes = (np.arange(last + 1) + last // 2) % last  # the first node is also the last one
    return replace(task, contour=Contour(cut.points[nodes], cut.axes[nodes], closed=True))


def _in_other_units(task: Task, rng: np.random.Generator) -> Task:
    """Return the task with 1/4 s as the unit of time, and other units of the weights."""
    velocity, acceleration = task.robot.speed_limits()
    arm = task.robot.with_limits(velocity=velocity * SCALE, acceleration=acceleration * SCALE**2)
    resolved = task.options.resolve(task.robot, node_interval(task.contour, task.speed))
    options = replace(task.options, weights=np.asarray(resolved.weights) * SCALE**2)
    return replace(task, robot=arm, options=options, speed=task.speed * SCALE)


def _from_urdf(task: Task, rng: np.random.Generator) -> Task:
    """Return the task with the robot read from a URDF whose elements are in opposite order."""
    arm, limits = task.robot, task.robot.joint_limits()
    root = ElementTree.fromstring(arm.to_urdf())
    root[:] = root[::-1]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        ElementTree.ElementTree(root).write(path)
        read = Robot.from_urdf(path, tip="tool0", mount="base_link")
    velocity, acceleration = arm.speed_limits()
    read = read.with_limits(
        lower=limits.lower, upper=limits.upper, endless=arm.endless, velocity=velocity,
        acceleration=acceleration,
    )  # fmt: skip
    return replace(task, robot=read)


def _same(task: Task, rng: np.random.Generator) -> Task:
    return task


FORMS: dict[str, Change] = {
    "as drawn": _same,
    "5 deg": _stepped(5.0),
    "10 deg": _stepped(10.0),
    "turned": _turned,
    "reversed": _reversed,
    "start": _started_elsewhere,
    "units": _in_other_units,
    "joints": _from_urdf,
    "threads": _same,
}
"""Changes of a task that leave the cost of its best motion; None where one does not apply."""


# -----------------------------------------------------------------------------
# The report.


def report(made: Sequence[dict[str, Any]]) -> Report:
    """Return the results of tasks as tables, and list the differences."""
    names = [name for name in FORMS if any(name in row["costs"] for row in made)]
    return Report(
        title="Invariance: random tasks in changed forms",
        how=HOW,
        sheets=[
            Sheet(columns=COLUMNS, rows=[_row(name, made) for name in names]),
            Sheet(
                columns=("kind", "tasks", "with a difference", "worst spread %"),
                rows=list(_by_kind(made)),
            ),
        ],
        findings=list(_findings(made)),
    )


def _row(name: str, made: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    here = [row for row in made if name in row["costs"] and _costs(row)]
    cost = [row["costs"][name] for row in here]
    own = [(c, row["costs"]["as drawn"]) for c, row in zip(cost, here, strict=True)]
    apart = [abs(c / o - 1) for c, o in own if c is not None and o is not None]
    excess = [c / min(_costs(r)) - 1 for c, r in zip(cost, here, strict=True) if c is not None]
    over, dearer = (sum(e > TOLERANCE for e in each) for each in (apart, excess))
    seconds = [row["seconds"][name] for row in here] or [0.0]
    return (
        name,
        str(len(excess)),
        str(cost.count(None)),
        str(over),
        f"{100 * over / max(len(apart), 1):.1f}",
        f"{100 * max(apart, default=0.0):.2f}",
        str(dearer),
        f"{100 * max(excess, default=0.0):.2f}",
        f"{median(seconds):.3g}",
        f"{max(seconds):.3g}",
    )


def _costs(row: dict[str, Any]) -> list[float]:
    return [cost for cost in row["costs"].values() if cost is not None]


def _spread(row: dict[str, Any]) -> float:
    return max(_costs(row), default=1.0) / min(_costs(row), default=1.0) - 1


def _differs(row: dict[str, Any]) -> bool:
    some = bool(_costs(row)) and None in row["costs"].values()
    return some or _spread(row) > TOLERANCE


def _by_kind(made: Sequence[dict[str, Any]]) -> Iterator[tuple[str, ...]]:
    for kind in (*KINDS, "all"):
        rows = [row for row in made if kind in ("all", row["kind"])]
        worst = max(map(_spread, rows), default=0.0)
        yield kind, str(len(rows)), str(sum(map(_differs, rows))), f"{100 * worst:.2f}"


def _findings(made: Sequence[dict[str, Any]]) -> Iterator[str]:
    for row in filter(_differs, made):
        best = min(_costs(row))
        costs = ", ".join(
            f"{name} {'none' if cost is None else f'+{100 * (cost / best - 1):.2f} %'}"
            for name, cost in row["costs"].items()
            if cost is None or cost > (1 + TOLERANCE) * best
        )
        yield f"seed {row['seed']}, {row['kind']}, {row['robot']}: {costs}"
