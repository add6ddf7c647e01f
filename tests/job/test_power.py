"""The power by the speed: a job in each language, its audit, and what harmful edits come to."""

import re

import numpy as np
import pytest
from benchmarks.program_edits import ACCELERATION, ARM, ARMS, JOB, Subject, _draw

from kerfpath.execution import power_along, with_power
from kerfpath.job import Audit, run_job
from kerfpath.post import ReadMove, ReadPower, build_program, languages, unsafe_paths

POWER = {
    "rapid": 'power_output = "aoPower"\npower_full = 10.0\n',
    "krl": "power_output = 3\npower_full = 1.0\n",
    "fanuc": "power_output = 3\npower_full = 1000.0\n",
    "urscript": "power_output = 1\npower_full = 1.0\n",
    "linuxcnc": "power_output = 2\npower_full = 100.0\n",
    "csv": "",
}
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
    text = JOB.format(
        arm=arm, acceleration=ACCELERATION, reach=1200 if arm == ARM else 900, language=name,
        lead=0.01 if chosen.ahead else 0.0, more=more, external="",
    )  # fmt: skip
    table = f"[program.{name}]\n"
    return text.replace(table, table + POWER[name]) if table in text else text


@pytest.fixture(scope="module")
def subjects(tmp_path_factory):
    folder = tmp_path_factory.mktemp("power")
    _draw(folder / "points.csv")
    plans, found = {}, {}
    for name in POWER:
        path = folder / f"{name}.toml"
        path.write_text(job_text(name))
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


@pytest.mark.parametrize("name", POWER)
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


def edited(subject, file, k, line):
    lines = subject.files[file].split("\n")
    lines[k : k + 1] = [] if line is None else [line]
    return {**subject.files, file: "\n".join(lines)}


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    "share", [pytest.param(0.8, marks=SLOW), 0.95, pytest.param(1.1, marks=SLOW)]
)
@pytest.mark.parametrize("name", POWER)
def test_a_power_that_is_scaled_does_not_pass(subjects, name, share):
    subject, tried = subjects[name], 0
    for file, k, found in lines_that_set(subject, name):
        group = "value" if found["value"] else "other"
        value = float(found[group])
        if not value or (name == "urscript" and "movej" in found.string):
            continue
        scaled = f"{value * share:.0f}" if name == "fanuc" else f"{value * share:.5f}"
        line = subject.files[file].split("\n")[k]
        line = line[: found.start(group)] + scaled + line[found.end(group) :]
        assert subject.outcome(edited(subject, file, k, line))[0] != "passed", line
        tried += 1
    assert tried >= 4


@pytest.mark.parametrize("name", POWER)
def test_a_power_that_is_left_out_or_stays_on_does_not_pass(subjects, name):
    subject, tried = subjects[name], 0
    for file, k, _ in lines_that_set(subject, name):
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
    assert tried >= 4
