"""Programs of a job with a rail and a table, as written and as people spoil their values."""

import json
import re

import numpy as np
import pytest
from benchmarks import program_edits

from commands import run

FAULTS, EDITS = 9, 6
"""One fault in so many beside those of external axes, and so many edits of the text, for each."""
LANGUAGES = ("csv", "fanuc", "inform", "krl", "linuxcnc", "rapid", "ros")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("external")


@pytest.fixture(scope="module")
def subjects(folder):
    found = program_edits.subjects(folder, external=True)
    return {subject.language.name: subject for subject in found}


def test_there_is_one_in_every_language_that_says_external_axes(subjects):
    assert tuple(subjects) == LANGUAGES
    q = np.array([move.q for move in subjects["rapid"].program.moves])
    assert (np.ptp(q[:, 6:], axis=0) > [0.05, 0.05]).all()  # m and rad: both move


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_no_fault_and_no_edit_that_does_harm_passes(subjects, language):
    subject = subjects[language]
    assert subject.outcome(subject.files) == ("passed", "")
    number, tally = LANGUAGES.index(language), program_edits.Tally()
    tally.try_faults(subject, np.random.default_rng(number), every=FAULTS, first=number)
    tally.try_edits(subject, np.random.default_rng(number), EDITS)
    assert tally.of("harmful") > 5
    assert tally.wrong == []


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_value_that_jumps_leaves_the_range_or_moves_beside_the_cut_is_found(subjects, language):
    subject, tally = subjects[language], program_edits.Tally()
    tally.try_faults(subject, np.random.default_rng(1), only="external axis")
    # Five faults of two axes in two contours; a language may not be able to say one.
    assert tally.of("harmful") >= 16
    assert tally.wrong == []


def codes(subject, files):
    """Codes of the checks that fail."""
    found = subject.audit.program(subject.read(files), "job")
    return {
        check.code
        for table in found.tables.values()
        for check in table
        if not check.ok and check.level == "error"
    }


def edited(files, pattern, number, by):
    """The files with what the one group of a pattern matches moved, at its match of a number."""
    for name, text in files.items():
        found = list(re.finditer(pattern, text))
        if len(found) > number:
            a, b = found[number].span(1)
            return {**files, name: f"{text[:a]}{float(text[a:b]) + by:.6f}{text[b:]}"}
    raise AssertionError(pattern)


RAIL = {
    "rapid": r"MoveL .*\],\[(-?[\d.]+),[-\d.]+,9E9",
    "krl": r"LIN .*,E1 (-?[\d.]+)",
    "fanuc": r"R = .*\r\n\tE1= *(-?[\d.]+)  mm",
}
"""The value of the rail at targets of the path."""


@pytest.mark.parametrize("language", RAIL)
def test_each_way_to_spoil_a_value_has_its_own_finding(subjects, language):
    subject = subjects[language]
    assert codes(subject, subject.files) == set()
    # The tenth target lies in the cut: the arm makes up for it, but no rail jumps so.
    jumped = codes(subject, edited(subject.files, RAIL[language], 10, 60.0))
    assert {"velocity", "acceleration"} & jumped
    beyond = codes(subject, edited(subject.files, RAIL[language], 10, 900.0))
    assert "external-limits" in beyond or "reach" in beyond


def test_a_table_turned_by_hand_takes_the_tool_off_the_contour_on_a_fanuc(subjects):
    """Its targets stand still: where the table is not as they were made for, the tip is off."""
    subject = subjects["fanuc"]
    turned = edited(subject.files, r"GP2:.*\r\n.*\r\n\tJ1= *(-?[\d.]+) deg", 10, 2.0)
    assert {"tip-between-nodes", "nodes"} & codes(subject, turned)


def test_a_trajectory_that_moves_one_axis_leaves_the_contour(subjects):
    subject = subjects["ros"]
    points = subject.files["job.yaml"]
    k = points.count("\n- {positions") // 3
    line = [row for row in points.splitlines() if row.startswith("- {positions")][k]
    values = re.search(r"positions: \[([^]]*)\]", line)[1].split(", ")
    values[6] = f"{float(values[6]) + 0.002:.10f}"
    spoilt = re.sub(r"positions: \[[^]]*\]", f"positions: [{', '.join(values)}]", line)
    outcome, said = subject.outcome({**subject.files, "job.yaml": points.replace(line, spoilt)})
    assert (outcome, "velocities do not follow" in said) == ("refused", True)


def as_run(subject, files):
    """The rows of the motion between the nodes, by contour and code."""
    found = subject.audit.program(subject.read(files), "job")
    return {
        (name.partition("(")[2].rstrip(")"), check.code): check
        for name, table in found.tables.items()
        for check in table
        if check.code.endswith("as-run")
    }


@pytest.mark.parametrize("language", ["rapid", "krl", "fanuc"])
def test_the_motion_between_the_nodes_is_judged_by_the_values_of_the_text(subjects, language):
    subject = subjects[language]
    rows = as_run(subject, subject.files)
    for name in ("hole", "slit"):
        for code in ("velocity-as-run", "acceleration-as-run"):
            row = rows[name, code]
            assert row.ok
            corners = ", corners assumed" if language == "fanuc" else ""
            assert row.title.endswith(f"share as run, at every instant{corners}")
    # 0.2 mm that a rail jumps and back, at one target and the next: it accelerates as sharply.
    jumped = as_run(subject, edited(subject.files, RAIL[language], 10, 0.2))
    worse = [key for key in rows if jumped[key].value > 1.5 * rows[key].value]
    assert ("hole", "acceleration-as-run") in worse
    assert "rail exceeds its limit" in jumped["hole", "acceleration-as-run"].advice


@pytest.mark.parametrize("language", ["csv", "ros"])
def test_of_joints_without_zones_nothing_is_said_between_the_nodes(subjects, language):
    assert as_run(subjects[language], subjects[language].files) == {}


def test_the_command_finds_a_value_that_is_edited_and_names_its_line(subjects, folder):
    """As a person does it: plan, edit the module, audit it."""
    subject = subjects["rapid"]
    (name, text), *_ = subject.files.items()
    (folder / "ours.mod").write_text(text)
    words = ("audit", str(folder / "ours.mod"), "--job", str(folder / "rapid.toml"))
    assert run(*words).returncode == 0
    (spoilt,) = edited({name: text}, RAIL["rapid"], 10, 60.0).values()
    line = next(
        k
        for k, (a, b) in enumerate(zip(text.split("\n"), spoilt.split("\n"), strict=True))
        if a != b
    )
    (folder / "ours.mod").write_text(spoilt)
    result = run(*words, "--json")
    assert result.returncode == 1
    failed = [
        check
        for table in json.loads(result.stdout)["contours"].values()
        for check in table
        if not check["ok"] and check["code"] in ("velocity", "acceleration")
    ]
    places = [int(re.search(r"line (\d+)", check["place"])[1]) for check in failed]
    assert failed
    assert all(abs(place - (line + 1)) <= 2 for place in places)
    (folder / "ours.mod").write_text(text.replace(",9E9,9E9,9E9,9E9]],v", ",5,9E9,9E9,9E9]],v", 1))
    refused = run(*words)
    assert refused.returncode == 2
    assert "eax_c = 5: the robot has no such axis" in refused.stderr
