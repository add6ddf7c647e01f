"""The audit of programs against thousands of edits: how many harmful ones it lets pass."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Literal

import numpy as np

from benchmarks._character_edits import character_edits, harmless_edits
from benchmarks._figures import Report, Sheet
from benchmarks._program_edits import edits
from benchmarks._program_faults import faults
from benchmarks._program_oracle import verdict
from kerfpath.errors import InputError
from kerfpath.job import Audit, run_job
from kerfpath.post import (
    Language,
    LanguageSettings,
    Program,
    ReadProgram,
    build_program,
    languages,
    read_program,
)

__all__ = ["Outcome", "Subject", "Tally", "run", "run_characters", "subjects"]

COLUMNS = (
    "harm: caught", "refused", "passed", "harmless: passed", "not", "not of our making", "either",
)  # fmt: skip
"""Columns of the tables: edits that do harm, harmless ones, unreadable ones, and undecided ones."""
EDITS, CHARACTERS, HARMLESS = 300, 1000, 60
"""Numbers of edits of the text, of its characters, and of harmless ones in every language."""
ARMS = {"inform": "yaskawa_gp25", "urscript": "ur_ur10e"}
"""Robots for languages that cannot express the axes of the one below."""
ARM = "abb_irb4600_60_205"
ACCELERATION = [300, 300, 400, 1000, 1000, 1500]
"""deg/s^2"""

JOB = """\
[robot]
model = "{arm}"
acceleration_deg_s2 = {acceleration}
{external}[tool]
head = "laser-head-45"
[part]
file = "points.csv"
xyz_mm = [{reach}, -100, 500]
rpy_deg = [0, 0, 30]
[[contour]]
pick = "hole"
speed_m_min = 3
spacing_mm = 2
[contour.micro_joints]
width_mm = 3
count = 1
[[contour]]
pick = "slit"
speed_m_min = 4
spacing_mm = 4
[plan]
gamma_step_deg = 10
[program]
name = "job"
language = "{language}"
gas_lead_s = 0.3
pierce_time_s = 0.25
lead_time_s = {lead}
{more}
[program.rapid]
gas_output = "doGas"
mechanical_units = ["TRACK_1", "STN_1"]
[program.krl]
laser_output = 5
gas_output = 6
[program.fanuc]
laser_output = 5
gas_output = 6
[program.val3]
laser_output = 'BasicIO-1\\%Q0'
gas_output = 'BasicIO-1\\%Q1'
[program.inform]
laser_output = 5
gas_output = 6
pulses_per_deg = [1341.4, 1341.4, 1000.0, 1000.0, 800.0, 500.0]
external_pulses = [400.0, 2000.0]
[program.urscript]
laser_output = 0
gas_output = 1
[program.linuxcnc]
laser_output = 0
gas_output = 1
"""
"""A hole with a micro joint and an open slit, gas, pierce and lead times."""
EXTERNAL = """\
floor = false
[[robot.external]]
name = "rail"
kind = "linear"
carries = "robot"
axis = [0, 1, 0]
lower_mm = -400
upper_mm = 400
velocity_mm_s = 1000
acceleration_mm_s2 = 2000
[[robot.external]]
name = "table"
kind = "rotary"
carries = "part"
axis = [0, 0, 1]
point_mm = [{reach}, -100, 450]
lower_deg = -60
upper_deg = 60
velocity_deg_s = 60
acceleration_deg_s2 = 120
"""
"""A rail under the robot and a table under the part."""

HOW = """\
A job of two contours (a hole with a micro joint, an open slit; gas, pierce and lead times), written
in each language for {arm}, and for {others}. Its program is spoilt in two ways, and
audited by the job. Faults: every fault of `_program_faults` (the laser on with the retract, a wait
in the cut, an approach from afar, ...) is put into the neutral program and written out, so that it
is an edit in each language that can say it; each does harm. Edits: {edits} edits of the text by the
grammar of `_program_edits`, whose oracle says which do harm. Caught: the audit has a finding.
Refused: no program of the job's making, with file and line. Passed: neither. Not of our making: the
reader does not take the text, so that the oracle has nothing to judge. Either: another text of the
same motion, or a move within what the job allows; it may pass."""

HOW_CHARACTERS = """\
The programs of the section before. Characters: {characters} edits in each language of how the
text is spelled (`_character_edits`: control characters, foreign digits, letters and blanks, numbers
of other languages, lines commented out, quoted, broken, joined or too long); each does harm by a
model of where remarks begin and end. Harmless: {harmless} edits that people and pendants make all
the time: remarks, blanks, case, digits, ends of lines, texts for the operator, timers, loads, heads
of files. The columns are those of the section before."""

Outcome = Literal["caught", "refused", "passed"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Subject:
    """A job, and its program in one language.

    Parameters
    ----------
    audit : Audit
    language : Language
    settings : LanguageSettings
    program : Program
        What the language can express of it.
    files : mapping of str to str
    """

    audit: Audit
    language: Language
    settings: LanguageSettings
    program: Program
    files: Mapping[str, str]

    def written(self, program: Program) -> dict[str, str]:
        """Return the files of a program in its language."""
        return self.language.formatter(program, self.settings).files()

    def read(self, files: Mapping[str, str]) -> ReadProgram:
        """Return the program as read from the files."""
        return read_program(files, self.language.name, self.program.robot, self.settings)

    def outcome(self, files: Mapping[str, str]) -> tuple[Outcome, str]:
        """Return the outcome of the audit of files, and the first finding."""
        try:
            found = self.audit.program(self.read(files), "job")
        except InputError as error:
            return "refused", str(error)
        if found.passed:
            return "passed", ""
        wrong = [(n, c) for n, table in found.tables.items() for c in table if not c.ok]
        said = [found.sentence(n, c) for n, c in wrong]
        return "caught", "; ".join([*said, *found.missing])


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """How many edits were tried, by language, kind, verdict of the oracle and outcome.

    Parameters
    ----------
    counts : Counter of (language, kind, verdict, outcome)
    wrong : list of str
        Harmful edits that passed, and harmless ones that were caught.
    told : Counter of "told" or "elsewhere"
        Whether a finding names the line of the edit or one next to it, or another.
    """

    counts: Counter[tuple[str, str, str, str]] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    told: Counter[str] = field(default_factory=Counter)

    def add(
        self, subject: Subject, kind: str, said: str, judged: str, files: Mapping[str, str],
        at: tuple[str, int] | None = None,
    ) -> None:  # fmt: skip
        """Audit and count an edited program, and whether the finding names its line if known."""
        outcome, first = subject.outcome(files)
        if at is not None and judged == "harmful" and outcome != "passed":
            near = any(f"{at[0]}, line {at[1] + k}" in first for k in (-1, 0, 1))
            self.told["told" if near else "elsewhere"] += 1
        self.counts[subject.language.name, kind, judged, outcome] += 1
        missed = judged == "harmful" and outcome == "passed"
        alarm = judged == "harmless" and outcome != "passed"
        if missed or alarm:
            word = "passed, harmful" if missed else f"{outcome}, harmless"
            self.wrong.append(f"{subject.language.name}: {word}: {kind}: {said} {first}")

    def only(self, kind: str) -> Tally:
        """Return the counts of one kind."""
        counts = Counter({key: n for key, n in self.counts.items() if key[1] == kind})
        return Tally(counts=counts)

    def of(self, judged: str, outcome: str | None = None, language: str | None = None) -> int:
        """Return how many edits have a verdict of the oracle, an outcome and a language."""
        return sum(
            n
            for (lang, _, said, came), n in self.counts.items()
            if said == judged and outcome in (None, came) and language in (None, lang)
        )

    def try_faults(
        self, subject: Subject, rng: np.random.Generator, *, every: int = 1, first: int = 0,
        only: str = "",
    ) -> None:  # fmt: skip
        """Write out and audit the program's faults of the kinds that begin with `only`.

        Only one fault in `every` is tried, from number `first` on.
        """
        found = (f for f in faults(subject.program, rng) if f.kind.startswith(only))
        for fault in islice(found, first % every, None, every):
            try:
                files = subject.written(fault.program)
            except InputError:
                continue  # the language cannot express it
            if files != subject.files:
                self.add(subject, fault.kind, "", "harmful", files)

    def try_characters(
        self, subject: Subject, rng: np.random.Generator, count: int, *, harmless: bool = False
    ) -> None:
        """Make `count` edits of the characters, which do harm or are `harmless`; audit each."""
        make = harmless_edits if harmless else character_edits
        for edit in islice(make(subject.files, subject.language.name, rng), count):
            said = f"{edit.file}, line {edit.line}: {edit.said[:80]!r}"
            kind = f"{'harmless' if harmless else 'characters'}: {edit.kind}"
            judged = "harmless" if harmless else "harmful"
            self.add(subject, kind, said, judged, edit.files)

    def try_edits(self, subject: Subject, rng: np.random.Generator, count: int) -> None:
        """Make `count` edits of the text, and audit each."""
        before = subject.read(subject.files)
        for edit in islice(edits(subject.files, subject.language.name, rng), count):
            try:
                judged: str = verdict(edit, before, subject.read(edit.files))
            except InputError:
                judged = "unread"
            said = f"{edit.file}, line {edit.line}: {edit.said}"
            self.add(subject, edit.kind, said, judged, edit.files, (edit.file, edit.line))


def subjects(
    folder: Path, only: tuple[str, ...] = (), more: str = "", *, external: bool = False
) -> Iterator[Subject]:
    """Yield the job and its program in each language, planned once for each robot.

    Parameters
    ----------
    folder : Path
        Folder to which job and drawing are written.
    only : tuple of str
        Names of languages; default: all.
    more : str
        Lines of [program].
    external : bool
        Whether the robot has a rail and the part a table, in the languages that can express them.
    """
    _draw(folder / "points.csv")
    plans = {}
    for name, chosen in sorted(languages().items()):
        if only and name not in only:
            continue
        if external and chosen.externals is None:
            continue
        arm = ARMS.get(name, ARM)
        path = folder / f"{name}.toml"
        reach = 1200 if arm == ARM else 900
        path.write_text(
            JOB.format(
                arm=arm, acceleration=ACCELERATION, reach=reach, language=name,
                lead=0.01 if chosen.ahead else 0.0, more=more,
                external=EXTERNAL.format(reach=reach) if external else "",
            )
        )  # fmt: skip
        audit = Audit.of(path)
        options = audit.expected.job.program
        if arm not in plans:
            outcome = run_job(audit.expected.job)
            assert outcome.passed, outcome
            plans[arm] = outcome.plans, () if outcome.part is None else outcome.part.moves
        made, moves = plans[arm]
        program = build_program(made, options, moves=moves)
        settings = chosen.completed(options.settings)
        files = chosen.formatter(program, settings).files()
        yield Subject(audit=audit, language=chosen, settings=settings, program=program, files=files)


def _draw(path: Path) -> None:
    """Write a round hole and an arc."""
    rows = ["contour,x_mm,y_mm,z_mm,nx,ny,nz"]
    for a in np.linspace(0, 2 * np.pi, 121):
        rows.append(f"hole,{30 + 6 * np.cos(a):.5f},{20 - 6 * np.sin(a):.5f},0,0,0,1")
    for a in np.linspace(0, 0.8, 41):
        rows.append(f"slit,{40 * np.sin(a):.5f},{25 - 40 * np.cos(a):.5f},0,0,0,1")
    path.write_text("\n".join([*rows, ""]))


def run(*, quick: bool = False) -> Report:
    """Return the results of faults and edits, by language and by kind."""
    count = 50 if quick else EDITS
    others = " and ".join(f"{arm} ({name})" for name, arm in ARMS.items())
    tries: dict[str, Try] = {
        "faults": Tally.try_faults,
        "edits": lambda tally, subject, rng: tally.try_edits(subject, rng, count),
    }
    return _report("Edited programs", HOW.format(arm=ARM, others=others, edits=count), tries)


def run_characters(*, quick: bool = False) -> Report:
    """Return the results of edits of characters and of harmless edits, by language and by kind."""
    share = 0.1 if quick else 1.0
    count, harmless = round(share * CHARACTERS), round(share * HARMLESS)
    tries: dict[str, Try] = {
        "characters": lambda tally, subject, rng: tally.try_characters(subject, rng, count),
        "harmless": lambda tally, subject, rng: tally.try_characters(
            subject, rng, harmless, harmless=True
        ),
    }
    how = HOW_CHARACTERS.format(characters=count, harmless=harmless)
    return _report("Characters of programs", how, tries)


Try = Callable[[Tally, Subject, np.random.Generator], None]
"""Makes edits of a program and audits each."""


def _report(title: str, how: str, tries: Mapping[str, Try]) -> Report:
    all_of_them, rows = Tally(), []
    with tempfile.TemporaryDirectory() as folder:
        for number, subject in enumerate(subjects(Path(folder))):
            for what, made in tries.items():
                rng, tally = np.random.default_rng(number), Tally()
                made(tally, subject, rng)
                rows.append([subject.language.name, what, *map(str, _row(tally))])
                all_of_them.counts.update(tally.counts)
                all_of_them.told.update(tally.told)
                all_of_them.wrong.extend(tally.wrong)
    kinds = sorted({kind for _, kind, _, _ in all_of_them.counts})
    told = all_of_them.told
    lines = (
        f"of {told.total()} harmful edits of the text that were found, {told['told']} are told "
        "with their own line or one beside it"
    )
    return Report(
        title=title,
        how=how,
        sheets=[
            Sheet(columns=("language", "what", *COLUMNS), rows=rows, words=2),
            Sheet(
                columns=("kind", *COLUMNS),
                rows=[[kind, *map(str, _row(all_of_them.only(kind)))] for kind in kinds],
            ),
        ],
        findings=[
            f"of {all_of_them.of('harmful')} that do harm {all_of_them.of('harmful', 'passed')} "
            f"passed; of {all_of_them.of('harmless')} that are harmless "
            f"{all_of_them.of('harmless') - all_of_them.of('harmless', 'passed')} did not",
            *([lines] if told else []),
            *all_of_them.wrong[:20],
        ],
    )


def _row(tally: Tally) -> list[int]:
    """Return the figures for `COLUMNS`."""
    fine = tally.of("harmless", "passed")
    return [
        *(tally.of("harmful", outcome) for outcome in ("caught", "refused", "passed")),
        fine,
        tally.of("harmless") - fine,
        tally.of("unread"),
        tally.of("either"),
    ]
