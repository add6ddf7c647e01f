"""Edited plan.json files and jobs: what the audit with the job catches, refuses and lets pass."""

from __future__ import annotations

import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

from benchmarks._figures import Report, Sheet
from benchmarks._plan_grammar import edits
from benchmarks._plan_jobs import JOBS, planned
from kerfpath.errors import InputError
from kerfpath.job import Audit

__all__ = [
    "JOB_EDITS",
    "Tally",
    "campaign",
    "edited_jobs",
    "edited_plans",
    "judged",
    "judged_all",
    "run",
]

EDITS = 3000
"""Number of edits of each job."""
SEED = 14
HOW = (
    "Every value of five small plan.json files, and values of their jobs, edited by a seeded "
    "grammar; an oracle that owes the audit nothing says which edits are harmless. Counted is what "
    "the audit with the job makes of them: a finding (caught), bad input (refused), or nothing."
)
JOB_EDITS: tuple[tuple[str, str], ...] = (
    ("eta_velocity = 0.9", "eta_velocity = 0.01"),
    ("eta_acceleration = 0.9", "eta_acceleration = 0.02"),
    ("eta_velocity = 0.9", "eta_velocity = 0.8"),
    ("[320, 270, 420, 1300, 1400, 2000]", "[3, 2, 4, 13, 14, 20]"),
    ("[320, 270, 420, 1300, 1400, 2000]", "[320, 270, 420, 1300, 1400, 1999]"),
    ("speed_m_min = 3", "speed_m_min = 3.1"),
    ("speed_m_min = 3", "speed_m_min = 1.5"),
    ("speed_m_min = 20", "speed_m_min = 10"),
    ("laser-head-45", "laser-head-straight"),
    ("xyz_mm = [1200, -100, 500]", "xyz_mm = [1200, -100, 500.1]"),
    ("rpy_deg = [0, 0, 0]", "rpy_deg = [0, 0, 1]"),
    ("kerf_mm = 0.2", "kerf_mm = 0.3"),
    ("length_mm = 4", "length_mm = 3"),
    ("spacing_mm = 8", "spacing_mm = 7"),
    ("spacing_mm = 2.5", "spacing_mm = 2.4"),
    ("width_mm = 4", "width_mm = 5"),
    ("slow_share = 0.5", "slow_share = 0.4"),
    ("count = 2", "count = 3"),
    ('posture = "front/up"', 'posture = "back/up"'),
    ("home_deg = [0, -20, 10, 0, 60, 0]", "home_deg = [0, -20, 10, 0, 61, 0]"),
    ("pierce_time_s = 0.25", "pierce_time_s = 0.5"),
    ("pierce_time_s = 0.25", "pierce_time_s = 0.25\nretract_mm = 40"),
    ("endless = [4, 6]", "endless = [6]"),
    ("endless = []", "endless = [6]"),
    ("gamma_step_deg = 6", "gamma_step_deg = 3"),
    ("upper_mm = 400", "upper_mm = 1"),
    ("velocity_mm_s = 1000", "velocity_mm_s = 1"),
    ("acceleration_deg_s2 = 120", "acceleration_deg_s2 = 1"),
    ("axis = [0, 1, 0]", "axis = [1, 0, 0]"),
    ("point_mm = [1200, -100, 450]", "point_mm = [1200, -90, 450]"),
    ('carries = "robot"', 'carries = "part"'),
    ("near_miss_mm = 5", "near_miss_mm = 6"),
    ("size_mm = [300, 300, 50]", "size_mm = [300, 300, 190]"),
    ("tilt_deg = 3", "tilt_deg = 0.1"),
    ("rotation_deg = 300", "rotation_deg = 0.1"),
    ("wrist_margin_deg = 2", "wrist_margin_deg = 40"),
    ("[comfort]", "[plan]"),
    ('feed = "dip"', ""),
    ('interruptions = "fewest"', ""),
    ("refine_parts = 2", "refine_parts = 1"),
    ("[sequence]", '[sequence]\norder = "given"\nheat_spacing_mm = 60'),
    ('name = "hole"', 'name = "bore"'),
    ('pick = "0/hole1"\nspeed', 'pick = "0/outer"\nspeed'),
    ('[[contour]]\npick = "0/outer"', '[[contour]]\npick = "0/outer"\ndirection = "reversed"'),
    ("abb_irb4600_60_205", "abb_irb4600_45_205"),
    ("[plan]", '[[contour]]\npick = "0/hole1"\nname = "again"\nspeed_m_min = 1\n[plan]'),
)
"""Replacements in a job after it was planned; with any of them the plan no longer fits the job."""


class Tally:
    """How many edits of each kind were caught, refused, passed and broke the audit."""

    def __init__(self) -> None:
        self.counts: defaultdict[str, Counter[str]] = defaultdict(Counter)
        self.passed: list[str] = []
        self.broke: list[str] = []
        self.alarms: list[str] = []

    def add(self, kind: str, where: str, verdict: str, *, harmless: bool) -> None:
        """Count an edit."""
        what = verdict.partition(":")[0]
        self.counts[kind][what if not harmless or what == "broke" else f"harmless {what}"] += 1
        if what == "broke":
            self.broke.append(f"{kind} at {where}: {verdict}")
        elif what == "passed" and not harmless:
            self.passed.append(f"{kind} at {where}")
        elif what == "caught" and harmless:
            self.alarms.append(f"{kind} at {where}: {verdict}")

    def total(self, what: str) -> int:
        """Return how many edits of all kinds had the result `what`."""
        return sum(count[what] for count in self.counts.values())

    def rows(self) -> Iterator[str]:
        """Yield a line for each kind: the number of edits, then their results."""
        for kind, count in sorted(self.counts.items()):
            told = ", ".join(f"{what} {n}" for what, n in sorted(count.items()))
            yield f"{kind}: {count.total()} edits: {told}"


Judge = Callable[[Path], bool]


def _passes(audit: Audit, plan: Path) -> bool:
    return audit.audited(plan).passed


def _passes_of(job: Path, plan: Path) -> bool:
    return Audit.of(job).audited(plan).passed


def judged(judge: Judge, plan: Path) -> str:
    """Return the result of an audit of a plan.json: passed, caught, refused or broke."""
    try:
        return "passed" if judge(plan) else "caught"
    except InputError as error:
        said = str(error)
        return f"refused: {said}" if "\n" not in said else f"broke: several lines: {said}"
    except Exception as error:  # any other exception is what this benchmark looks for
        return f"broke: {type(error).__name__}: {error}"


def edited_plans(tally: Tally, judge: Judge, plan: Path, count: int, seed: int) -> None:
    """Judge `count` edits of a plan.json; the edited file is written next to it."""
    file = plan.with_name(f"edited-{plan.name}")
    for edit in edits(plan.read_text(encoding="utf-8"), count, seed):
        file.write_text(edit.text, encoding="utf-8")
        tally.add(edit.kind, edit.where, judged(judge, file), harmless=edit.harmless)


def edited_jobs(job: Path) -> Iterator[tuple[str, Path]]:
    """Yield the job with each edit that fits it: what was changed, and the path of the file."""
    text, file = job.read_text(encoding="utf-8"), job.with_name(f"edited-{job.name}")
    for before, after in JOB_EDITS:
        if before in text:
            file.write_text(text.replace(before, after, 1), encoding="utf-8")
            yield f"{before!r} to {after!r}", file


def campaign(folder: Path, names: Iterable[str], count: int, seed: int) -> Tally:
    """Plan jobs, judge `count` edits of each plan.json, and all edits of the jobs."""
    return judged_all([planned(folder, name) for name in names], count, seed)


def judged_all(made: Iterable[tuple[Path, Path]], count: int, seed: int) -> Tally:
    """Judge `count` edits of each plan.json, given with its job, and all edits of the jobs."""
    tally = Tally()
    for job, plan in made:
        name = job.stem
        audit = Audit.of(job)
        assert audit.audited(plan).passed, f"{name}: the plan as it is does not pass"
        edited_plans(tally, partial(_passes, audit), plan, count, seed)
        for what, other in edited_jobs(job):
            verdict = judged(partial(_passes_of, other), plan)
            tally.add("job edited", f"{name}: {what}", verdict, harmless=False)
    return tally


def run(*, quick: bool) -> Report:
    """Edit the plan.json files of the jobs, and the jobs."""
    count = 100 if quick else EDITS
    with tempfile.TemporaryDirectory() as folder:
        tally = campaign(Path(folder), JOBS, count, SEED)
    columns = ("caught", "refused", "passed", "harmless passed", "harmless caught", "broke")
    rows = [
        [kind, str(found.total()), *(str(found[what]) for what in columns)]
        for kind, found in sorted(tally.counts.items())
    ]
    total = [str(tally.total(what)) for what in columns]
    rows.append(["all", str(sum(c.total() for c in tally.counts.values())), *total])
    return Report(
        title="Edited plan.json files and jobs",
        how=HOW,
        sheets=[Sheet(columns=("kind of edit", "edits", *columns), rows=rows)],
        findings=[f"passed: {each}" for each in tally.passed]
        + [f"broke: {each}" for each in tally.broke],
    )
