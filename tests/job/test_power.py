"""The power by the speed: a job in each language, its audit, and what harmful edits come to."""

import re
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.program_edits import ACCELERATION, ARM, ARMS, JOB, Subject, _draw

from kerfpath.cli.plan_output import power_entry
from kerfpath.execution import power_along, with_power
from kerfpath.job import Audit, power_of, read_job, run_job
from kerfpath.job.output.writing import report_text
from kerfpath.post import ReadMove, ReadPower, build_program, languages, unsafe_paths

POWER = {
    "rapid": 'power_output = "aoPower"\npower_full = 10.0\n',
    "krl": "power_output = 3\npower_full = 1.0\n",
    "fanuc": "power_output = 3\npower_full = 1000.0\n",
    "urscript": "power_output = 1\npower_full = 1.0\n",
    "linuxcnc": "power_output = 2\npower_full = 100.0\n",
    "csv": "",
    "inform": "power_output = 3\npower_full = 10.0\n",
}
STEPS = [name for name in POWER if name != "inform"]
"""Settings of the power in each language that can set it along the path."""
SETS = {
    "rapid": r"SetAO aoPower,(?P<value>[\d.]+)|AOp:=aoPower,(?P<other>[\d.]+)",
    "krl": r"\$ANOUT\[3\]=(?P<value>[\d.]+)",
    "fanuc": r"AO\[3\]=\(?(?P<value>\d+)",
    "urscript": r"power_set\((?P<value>[\d.]+)\)|(?<=, )(?P<other>[\d.]+)\)$",
    "linuxcnc": r"M6[78] E2 Q(?P<value>[\d.]+)",
    "csv": r"power (?P<value>[\d.]+)",
}
"""What sets the power, and its value."""
CURVE = "power_by_speed = [[0.0, 0.3], [0.5, 0.6], [1.0, 1.0]]\npierce_power = 0.55\n"


TRIGGERED = r"\\T\d:=trPower\w+| TB +[\d.]+sec,AO\[\d\]=\d+|,trPower\w+|power [\d.]+ [\d.]+ s ahead"
"""The part of the line of a move that sets the power."""


def job_text(name, more=CURVE):
    arm, chosen = ARMS.get(name, ARM), languages()[name]
    text = (JOB.replace("pierce_time_s = 0.25\n", "") if "stages" in more else JOB).format(
        arm=arm, acceleration=ACCELERATION, reach=1200 if arm == ARM else 900, language=name,
        lead=0.01 if chosen.ahead else 0.0, more=more, external="",
    )  # fmt: skip
    table = f"[program.{name}]\n"
    return text.replace(table, table + POWER[name]) if table in text else text


STAGED = """\
power_by_speed = [[0.0, 0.3], [1.0, 1.0]]
pierce_stages = [[0.4, 0.2], [0.8, 0.1], [0.6, 0.3]]
"""
LINE = (
    'power_by_speed = [[0.0, 0.0], [1.0, 0.9]]\npierce_power = 0.55\npower_follows = "controller"\n'
)
BY_CONTROLLER = {
    "rapid": r"TriggSpeed trFollow|SetAO aoPower,[1-9]|trFollow,|trFollowEnd|PowerEnd",
    "krl": r"ANOUT|SIGNAL",
    "inform": r"ARATION|ARATIOF|AOUT AO",
}
"""Lines about the power in each language whose controller sets it by the speed."""


@pytest.fixture(scope="module")
def subjects(tmp_path_factory):
    return made_subjects(tmp_path_factory.mktemp("power"), STEPS, CURVE)


@pytest.fixture(scope="module")
def by_controller(tmp_path_factory):
    return made_subjects(tmp_path_factory.mktemp("controller"), BY_CONTROLLER, LINE)


def test_report_and_json_have_the_power_along_each_cut(tmp_path):
    """The power in the report, and the figures of a cut, are those of the program."""
    _draw(tmp_path / "points.csv")
    path = tmp_path / "rapid.toml"
    path.write_text(job_text("rapid"))
    outcome = run_job(read_job(path))
    page = report_text(outcome, ())
    assert page.count("<h4>Power</h4>") == len(outcome.cuts) == 2
    assert "Off the power by the speed" in page
    for cut in outcome.cuts:
        entry = power_entry(outcome.job, cut)
        along = power_of(outcome.job, cut)
        assert entry["power_share"] == along.set.tolist()
        assert len(entry["s_m"]) == len(entry["speed_share"]) + 1
        assert entry["changes"] == along.switches >= 1
        assert entry["largest_difference"] <= 0.075
        assert 0 < entry["mean_difference"] < 0.1
        s, speed = entry["fine_s_m"], entry["fine_speed_share"]
        assert len(s) == len(speed)
        assert (np.diff(s) >= 0).all()
        assert max(speed) == pytest.approx(1.0, abs=0.01)
        assert entry["s_m"][-1] == pytest.approx(cut.plan.contour.length, rel=1e-6)
    without = replace(outcome.job, program=replace(outcome.job.program, power_by_speed=None))
    assert power_entry(without, outcome.cuts[0]) is None


@pytest.fixture(scope="module")
def staged(tmp_path_factory):
    return made_subjects(tmp_path_factory.mktemp("staged"), STEPS, STAGED)


def made_subjects(folder, names, more):
    """The job in each language with these lines of [program], planned once for each robot."""
    _draw(folder / "points.csv")
    plans, found = {}, {}
    for name in names:
        path = folder / f"{name}.toml"
        path.write_text(job_text(name, more))
        audit = Audit.of(path)
        options, chosen = audit.expected.job.program, languages()[name]
        arm = ARMS.get(name, ARM)
        if arm not in plans:
            plans[arm] = run_job(audit.expected.job)
        made = plans[arm]
        assert made.passed
        program = with_power(build_program(made.plans, options), options)
        settings = chosen.completed(options.settings)
        found[name] = Subject(
            audit=audit,
            language=chosen,
            settings=settings,
            program=program,
            files=chosen.formatter(program, settings).files(),
        )
    return found


@pytest.mark.parametrize("name", STEPS)
def test_the_program_passes_and_reads_back(subjects, name):
    subject = subjects[name]
    assert subject.outcome(subject.files) == ("passed", "")
    read = subject.read(subject.files)
    assert unsafe_paths(read) == []
    options = subject.audit.expected.job.program
    changes = 0
    for section, back in zip(subject.program.sections, read.sections, strict=True):
        along = power_along(subject.program, section, options)
        changes += along.switches
        assert along.difference <= options.power.tolerance + 1e-9
        now, power = 0.0, []
        for step in back.steps:
            now = step.share if isinstance(step, ReadPower) else now
            if isinstance(step, ReadMove):
                power += [now] if step.kind != "joint" else []
                assert step.kind != "joint" or now == 0, "none in air moves"
                for switch in step.switches:
                    now = now if switch.share is None else switch.share
        assert power[-1] == 0, "none while the tool backs off"
        np.testing.assert_allclose(power[1:-1], along.set, atol=1e-3)
    assert changes >= 1 or name == "csv"


def lines_that_set(subject, name):
    """File, number and match of each line that sets a power."""
    for file, text in subject.files.items():
        for k, line in enumerate(text.split("\n")):
            if "TriggIO" in line or not ("VAR" in line or "global" in line):
                for found in re.finditer(SETS[name], line.rstrip("\r")):
                    yield file, k, found


SOME = 4
"""About as many edits of each kind are tried in each language; all were, once."""


def some(found):
    """About `SOME` of what is found, the first and the last among them."""
    found = list(found)
    return [*found[:: max(1, len(found) // (SOME - 1))], *found[-1:]]


def edited(subject, file, k, line):
    lines = subject.files[file].split("\n")
    lines[k : k + 1] = [] if line is None else [line]
    return {**subject.files, file: "\n".join(lines)}


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    "share", [pytest.param(0.8, marks=SLOW), 0.95, pytest.param(1.1, marks=SLOW)]
)
@pytest.mark.parametrize("name", STEPS)
def test_a_power_that_is_scaled_does_not_pass(subjects, name, share):
    subject, tried = subjects[name], 0
    for file, k, found in some(lines_that_set(subject, name)):
        group = "value" if found["value"] else "other"
        value = float(found[group])
        if not value or (name == "urscript" and "movej" in found.string):
            continue
        scaled = f"{value * share:.0f}" if name == "fanuc" else f"{value * share:.5f}"
        line = subject.files[file].split("\n")[k]
        line = line[: found.start(group)] + scaled + line[found.end(group) :]
        assert subject.outcome(edited(subject, file, k, line))[0] != "passed", line
        tried += 1
    assert tried >= 2


@pytest.mark.parametrize("name", STEPS)
def test_a_power_that_is_left_out_or_stays_on_does_not_pass(subjects, name):
    subject, tried = subjects[name], 0
    for file, k, _ in some(lines_that_set(subject, name)):
        line = subject.files[file].split("\n")[k]
        whole = re.fullmatch(
            r"\s*(\d+:)?\s*(SetAO .*|\$ANOUT.*|TRIGGER.*|AO\[.*|power_set.*|M6[78].*|\w+,power,.*)",
            line.rstrip("\r"),
        )
        if name == "fanuc" and whole:
            without = edited(subject, file, k, re.sub(r":.*;", ":  ! ;", line))
        elif whole:
            without = edited(subject, file, k, None)
        else:
            without = edited(
                subject, file, k,
                re.sub(TRIGGERED, "", line),
            )  # fmt: skip
            if without[file] == subject.files[file]:
                continue
        assert subject.outcome(without)[0] != "passed", line
        tried += 1
    assert tried >= 2


WAITS = {
    "rapid": r"WaitTime ([\d.]+)",
    "krl": r"WAIT SEC ([\d.]+)",
    "fanuc": r"WAIT +(\.\d\d)\(sec\)",
    "urscript": r"sleep\(([\d.]+)\)",
    "linuxcnc": r"G4 P([\d.]+)",
}
"""The lines that wait, and their times."""


@pytest.mark.parametrize("name", WAITS)
def test_a_staged_pierce_passes_and_no_edit_of_a_stage_does(staged, name):
    """Two stages change places, one is left out, one has another time."""
    subject = staged[name]
    assert subject.outcome(subject.files) == ("passed", "")
    (file, first), *_ = [
        (file, k)
        for file, text in subject.files.items()
        for k, line in enumerate(text.split("\n"))
        if re.search(WAITS[name], line)
    ]
    lines = subject.files[file].split("\n")
    waits = [k for k in range(first, first + 5) if re.search(WAITS[name], lines[k])]
    assert len(waits) == 3
    swapped = list(lines)
    swapped[waits[0]], swapped[waits[1]] = lines[waits[1]], lines[waits[0]]
    texts = [swapped, [*lines[: waits[1] - 1], *lines[waits[1] + 1 :]]]
    for k in waits[2:]:
        match = re.search(WAITS[name], lines[k])
        time = f"{float(match[1]) + 0.05:.{len(match[1].partition('.')[2])}f}".lstrip("0")
        other = f"{lines[k][: match.start(1)]}{time}{lines[k][match.end(1) :]}"
        texts.append([*lines[:k], other, *lines[k + 1 :]])
    for text in texts:
        said = subject.outcome({**subject.files, file: "\n".join(text)})
        assert said[0] != "passed", set(text) ^ set(lines)


@pytest.mark.slow
@pytest.mark.parametrize("name", BY_CONTROLLER)
def test_a_power_by_the_controller_passes_and_no_edit_of_it_does(by_controller, name):
    """Each line about it left out, and each number on it raised by half."""
    subject, tried = by_controller[name], 0
    assert subject.outcome(subject.files) == ("passed", "")
    for file, text in subject.files.items():
        for k, row in enumerate(text.split("\n")):
            if not re.search(BY_CONTROLLER[name], row) or "VAR " in row:
                continue
            if "Trigg" not in row or "TriggSpeed" in row:
                assert subject.outcome(edited(subject, file, k, None))[0] != "passed", row
                tried += 1
            numbers = () if "Trigg" in row and "TriggSpeed" not in row else re.finditer(
                r"\d+\.\d\d*", row
            )  # fmt: skip
            for found in numbers:
                if not float(found[0]):
                    continue
                more = f"{1.5 * float(found[0]):.{len(found[0].partition('.')[2])}f}"
                line = f"{row[: found.start()]}{more}{row[found.end() :]}"
                assert subject.outcome(edited(subject, file, k, line))[0] != "passed", line
                tried += 1
    assert tried >= 8
