"""Feed reduction of contours too fast for a constant speed, with and without a cell."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np

from benchmarks._figures import Report, Sheet, kept_rows
from benchmarks._random_contours import ROBOTS, arm, contour, head
from kerfpath import Contour, NoFeasiblePath, fastest_speed
from kerfpath.errors import AuditFailed, InputError
from kerfpath.job import program_from_file, read_job, run_job, write_result
from kerfpath.post import languages

__all__ = ["planned", "run"]

TASKS, QUICK = 100, 2
COARSE = np.radians(5.0)
"""rad: step of gamma for the fastest speed."""
FASTER = (1.3, 4.0)
"""Range of the speed, as a multiple of the fastest found; its logarithm is uniform."""
LONG = 60.0
"""s of processor time after which a task counts as long."""
SEED = 2031

HOW = f"""\
Random contours of 60 to 80 nodes in front of three robots, at {FASTER[0]:g} to {FASTER[1]:g} times
the fastest speed found on a grid of 5 deg, as jobs with `feed = "dip"`; every second one in a cell
with four posts beside the contour. Each is planned, audited, and written in every language that can
express its arm; each program is read back and audited. Refused: no plan, with a reason. Failed: a
plan or a program that does not pass its own audit. Time: of the plan, over that at the speed asked
for. Seconds: processor time of `run_job`, which builds graph and cell."""
COLUMNS = ("cell", "tasks", "planned", "refused", "failed", "programs", f"over {LONG:g} s",
           "median s", "worst s", "median time", "worst time")  # fmt: skip

WHAT = ("planned", "refused", "failed")
"""What may become of a task."""

CELL = "[cell]\npart = false\nnear_miss_mm = 5\n"
POST = """\
[[cell.fixture]]
name = "post {k}"
size_mm = [40, 40, 400]
xyz_mm = [{x:.3f}, {y:.3f}, {z:.3f}]
"""


def run(
    *, quick: bool, tasks: int | None = None, first: int = 0, rows: Path | None = None
) -> Report:
    """Plan so many tasks from a first one on; `rows` is a file as of `kept_rows`."""
    count = tasks if tasks is not None else QUICK if quick else TASKS
    return _report(kept_rows(planned, range(first, first + count), rows))


def planned(seed: int) -> dict[str, Any]:
    """Return what became of a task: seconds, time of the plan, and why there is none."""
    rng = np.random.default_rng([SEED, seed])
    names = list(ROBOTS)
    name = names[seed // 2 % len(names)]
    nodes, fastest = _reachable(name, rng)
    speed = fastest * float(np.exp(rng.uniform(*np.log(FASTER))))
    row: dict[str, Any] = {"seed": seed, "robot": name, "cell": seed % 2 == 1, "said": ""}
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        _write_job(folder, name, nodes, speed, rng if row["cell"] else None)
        start = process_time()
        outcome = run_job(read_job(folder / "job.toml"))
        row["seconds"] = process_time() - start
        cut = outcome.cuts[0]
        if cut.plan is None:
            return row | {"became": "refused", "said": str(cut.broken)}
        row["time"] = float(cut.plan.time[-1] / (nodes.s[-1] / speed))
        row["failed"] = [
            check.title for check in cut.checks if not check.ok and check.level == "error"
        ]
        write_result(outcome, folder / "out")
        row["programs"] = _programs(folder / "out" / "plan.json", row["failed"])
    return row | {"became": "failed" if row["failed"] else "planned"}


def _reachable(name: str, rng: np.random.Generator) -> tuple[Contour, float]:
    """Return a contour that a robot can cut at some speed, and the fastest found, m/s."""
    machine = arm(name)
    assert machine.reach is not None
    while True:
        drawn = contour(rng, machine.reach)
        try:
            found = fastest_speed(
                drawn, machine, tool=head(), placement=np.eye(4), gamma_step=COARSE, explore=False
            )
        except NoFeasiblePath:
            continue
        return drawn, found.speed


def _write_job(
    folder: Path, name: str, nodes: Contour, speed: float, rng: np.random.Generator | None
) -> None:
    """Write a table of the nodes and a job; with random numbers, in a cell with four posts."""
    spacing = nodes.s[-1] / (len(nodes) - 1) * 1e3
    table = np.hstack([nodes.points * 1e3, nodes.axes])
    lines = [",".join(f"{value:.9f}" for value in row) for row in table]
    (folder / "cut.csv").write_text("x,y,z,axis_x,axis_y,axis_z\n" + "\n".join(lines) + "\n")
    ratio = "" if ROBOTS[name] is None else f'acceleration_ratio = "{ROBOTS[name]}"\n'
    posts = []
    if rng is not None:
        centre, half = nodes.points.mean(axis=0), np.ptp(nodes.points, axis=0)[:2].max() / 2
        for k, angle in enumerate(rng.uniform(0, 2 * np.pi, 4)):
            out = centre + (half + rng.uniform(0.05, 0.2)) * np.array(
                [np.cos(angle), np.sin(angle), 0.0]
            )
            x, y, z = (out + np.array([0.0, 0.0, rng.uniform(-0.25, 0.0)])) * 1e3
            posts.append(POST.format(k=k + 1, x=x, y=y, z=z))
    T = head()
    (folder / "job.toml").write_text(
        f'[robot]\nmodel = "{name}"\nendless = [4, 6]\nfloor = false\n{ratio}'
        f"[tool]\nxyz_mm = {(T[:3, 3] * 1e3).tolist()}\nrpy_deg = [0, 45, 0]\n"
        '[part]\nfile = "cut.csv"\nunit = "mm"\nxyz_mm = [0, 0, 0]\nrpy_deg = [0, 0, 0]\n'
        f'[[contour]]\npick = "contour"\nspeed_m_min = {speed * 60:.6f}\n'
        f"spacing_mm = {spacing:.6f}\n"
        '[plan]\ngamma_step_deg = 2\nfeed = "dip"\n'
        f"{CELL if posts else ''}\n{''.join(posts)}"
        '[program]\nlanguage = "none"\n'
    )


def _programs(plan_file: Path, failed: list[str]) -> int:
    """Return the number of languages in which a program was written; add those that failed."""
    written = 0
    for language in languages():
        try:
            program_from_file(plan_file, language)
        except AuditFailed as why:
            failed.append(f"{language}: {why}")
        except InputError:
            continue  # the language cannot express this arm
        else:
            written += 1
    return written


def _report(made: Sequence[dict[str, Any]]) -> Report:
    rows = []
    for cell in (False, True):
        some = [row for row in made if row["cell"] is cell]
        if not some:
            continue
        became = Counter(row["became"] for row in some)
        seconds = [row["seconds"] for row in some]
        time = [row["time"] for row in some if "time" in row] or [np.nan]
        programs = sum(row.get("programs", 0) for row in some)
        counts = [len(some), *(became[what] for what in WHAT), programs]
        counts.append(sum(s > LONG for s in seconds))
        figures = (median(seconds), max(seconds), median(time), max(time))
        rows.append(("yes" if cell else "no", *map(str, counts), *(f"{f:.3g}" for f in figures)))
    said = [f"task {row['seed']}: {why}" for row in made for why in row.get("failed", [])]
    sheet = Sheet(columns=COLUMNS, rows=rows)
    return Report(title="Feed reduction", how=HOW, sheets=[sheet], findings=said)
