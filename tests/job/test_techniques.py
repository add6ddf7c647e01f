"""Contours with techniques of their own: pierce, gas and power of each in programs, and audits."""

import json
import re
from dataclasses import replace

import pytest
from benchmarks.program_edits import ACCELERATION, ARM, ARMS, JOB, Subject, _draw
from tests.job.test_power import POWER, STEPS

from commands import run
from jobs import DEMO, SMALL
from kerfpath.cli.plan_output import cut_entry
from kerfpath.errors import InputError
from kerfpath.execution import with_power
from kerfpath.job import (
    Audit,
    origins_of,
    prepare,
    program_from_file,
    read_job,
    require_foreseen,
    run_job,
    run_prepared,
    touch_up,
    write_result,
)
from kerfpath.post import (
    ProgramOptions,
    ReadPower,
    ReadWait,
    build_program,
    languages,
    unsafe_paths,
)

PROCESS = """\
[process]
material = "steel"
thickness_mm = 2
[[process.row]]
material = "steel"
thickness_mm = 2
speed_m_min = 4
gas_lead_s = 0.3
power_w = 3000
power_by_speed = [[0.0, 0.3], [1.0, 1.0]]
pierce = [{ time_s = 0.2, power_w = 1200 }, { time_s = 0.1, power_w = 2400 }]
[[process.row]]
material = "steel"
thickness_mm = 2
technique = "small-hole"
speed_m_min = 3
gas_lead_s = 0.2
power_w = 1500
pierce = [{ time_s = 0.15, power_w = 600 }]
[[contour]]
pick = "hole"
technique = "small-hole"
"""
POWERED = [name for name in STEPS if name != "csv"]
PLAIN = ["val3", "ros", "inform", "csv"]
"""Languages that set no power in steps, and the table, whose settings name no output."""
LANGUAGES, FAST = [*POWERED, *PLAIN], ("rapid", "krl", "val3")
NOT_WRITTEN = {(name, "gas_lead") for name in ("fanuc", "val3", "linuxcnc", "inform")}
"""Lead times that are not in the text: the gas is switched where a move begins."""


def job_text(name):
    arm, chosen = ARMS.get(name, ARM), languages()[name]
    text = JOB.replace("gas_lead_s = 0.3\npierce_time_s = 0.25\n", "")
    text = text.format(
        arm=arm, acceleration=ACCELERATION, reach=1200 if arm == ARM else 900, language=name,
        lead=0.01 if chosen.ahead else 0.0, more="", external="",
    )  # fmt: skip
    text = text.replace('[[contour]]\npick = "hole"\n', PROCESS, 1)
    for each in POWERED:
        text = text.replace(table := f"[program.{each}]\n", table + POWER[each])
    return text


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """The job in each language, planned once for each robot, and its program."""
    folder = tmp_path_factory.mktemp("techniques")
    _draw(folder / "points.csv")
    plans, found = {}, {}
    for name in LANGUAGES:
        path = folder / f"{name}.toml"
        path.write_text(job_text(name))
        audit = Audit.of(path)
        arm = ARMS.get(name, ARM)
        if arm not in plans:
            plans[arm] = run_job(audit.expected.job)
        assert plans[arm].passed
        found[name] = plans[arm], subject_of(audit, plans[arm].plans, audit.expected.job.program)
    return found


def subject_of(audit, plans, options):
    chosen = languages()[options.language]
    settings = chosen.completed(options.settings)
    program = with_power(build_program(plans, options), options)
    if chosen.sayable is not None:
        program = chosen.sayable(program, settings)
    return Subject(
        audit=audit,
        language=chosen,
        settings=settings,
        program=program,
        files=chosen.formatter(program, settings).files(),
    )


@pytest.mark.parametrize("name", LANGUAGES)
def test_each_contour_has_the_pierce_gas_and_power_of_its_technique(planned, name):
    """Shares are those of the largest power of the rows; the job's audit passes."""
    _, subject = planned[name]
    options = subject.audit.expected.job.program
    hole, slit = options.of("hole"), options.of("slit")
    assert (hole.pierce_time, slit.pierce_time) == pytest.approx((0.15, 0.3))
    if name in POWERED:
        assert hole.pierce == ((0.2, 0.15),)
        assert slit.pierce == ((0.4, 0.2), (0.8, 0.1))
        assert (hole.power.full, slit.power.full) == (0.5, 1.0)
    assert subject.outcome(subject.files) == ("passed", "")
    waits = [
        [step.time for step in section.steps if isinstance(step, ReadWait)]
        for section in subject.read(subject.files).sections
    ]
    if waits := [each for each in waits if each]:
        assert [sum(each) for each in waits] == pytest.approx([0.15, 0.3], abs=1e-3)
    powers = [s.share for s in subject.read(subject.files).steps if isinstance(s, ReadPower)]
    assert not powers or powers[0] == pytest.approx(0.2, abs=1e-3)
    assert bool(powers) == (name in POWERED)


@pytest.mark.parametrize(
    "name",
    [name if name in FAST else pytest.param(name, marks=pytest.mark.slow) for name in LANGUAGES],
)
@pytest.mark.parametrize("what", ["pierce_time", "gas_lead", "power_by_speed"])
def test_a_program_with_a_value_of_the_other_technique_does_not_pass(planned, name, what):
    result, subject = planned[name]
    options = subject.audit.expected.job.program
    keys = ("pierce_time", "pierce_stages") if what == "pierce_time" else (what,)
    hole, slit = (options.contours[each] for each in ("hole", "slit"))
    if not {*keys} & {*hole}:
        assert name in PLAIN
        return
    kept = {key: value for key, value in hole.items() if key not in keys}
    other = kept | {key: value for key, value in slit.items() if key in keys}
    changed = replace(options, contours={"hole": other, "slit": slit})
    edited = subject_of(subject.audit, result.plans, changed)
    if (name, what) in NOT_WRITTEN:
        assert edited.files == subject.files
    else:
        assert subject.outcome(edited.files)[0] == "caught"


@pytest.mark.parametrize("name", ["rapid", "fanuc"])
def test_techniques_with_the_same_values_change_nothing(planned, tmp_path, name):
    """The program is, letter by letter, that of a job that says the values itself."""
    result, _ = planned[name]
    _draw(tmp_path / "points.csv")
    small = "gas_lead_s = 0.2\npower_w = 1500\npierce = [{ time_s = 0.15, power_w = 600 }]\n"
    normal = PROCESS.partition("[[process.row]]\n")[2].partition("[[process.row]]\n")[0]
    normal = normal.partition("gas_lead_s")
    assert job_text(name).count(small) == 1
    texts = {"alike": job_text(name).replace(small, normal[1] + normal[2])}
    rows = texts["alike"].partition("[process]\n")[2].partition("[[contour]]")[0]
    keys = "gas_lead_s = 0.3\npower_by_speed = [[0.0, 0.3], [1.0, 1.0]]\n"
    keys += "pierce_stages = [[0.4, 0.2], [0.8, 0.1]]\n"
    said = (
        texts["alike"]
        .replace(f"[process]\n{rows}", "")
        .replace("\n[program]\n", f"\n[program]\n{keys}")
    )
    said = said.replace('technique = "small-hole"\n', "")
    texts["said"] = said.replace('pick = "hole"\n', 'pick = "hole"\n', 1)
    files = {}
    for which, text in texts.items():
        (tmp_path / f"{which}.toml").write_text(text)
        audit = Audit.of(tmp_path / f"{which}.toml")
        options = replace(audit.expected.job.program, remarks=())
        assert options.contours == {}
        files[which] = subject_of(audit, result.plans, options).files
    assert files["alike"] == files["said"]


def test_a_plan_has_the_techniques_for_programs_in_other_languages(planned, tmp_path):
    result, subject = planned["rapid"]
    write_result(result, tmp_path)
    plan = tmp_path / "plan.json"
    made, _ = program_from_file(plan, "krl")
    assert "WAIT SEC 0.15" in "\n".join(made.values())
    again, _ = program_from_file(tmp_path / "plan.json")
    assert subject.outcome(again) == ("passed", "")


def test_power_that_the_program_sets_is_not_to_be_set_by_hand(planned):
    _, subject = planned["rapid"]
    sheet = subject.audit.expected.job.program.remarks
    assert sum("power 3000 W" in line for line in sheet) == 2
    assert not any("1500" in line or "ROWS DIFFER" in line for line in sheet)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("gas_lead_s = 0.2\n", "", ["gas_lead_s in every row", "[program]"]),
        ("power_w = 1500\n", "", ["power_w in every row", "power_by_speed in [program]"]),
        (
            "thickness_mm = 2\n[[",
            "thickness_mm = 2\ncut_by = { hole = 'a' }\n[[",
            ["cut_by", "remove"],
        ),
    ],
)
def test_rows_that_leave_a_value_open_are_refused_in_one_line(tmp_path, old, new, words):
    _draw(tmp_path / "points.csv")
    text = job_text("rapid")
    assert old in text
    (tmp_path / "job.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        Audit.of(tmp_path / "job.toml")
    assert str(caught.value).isprintable()
    assert all(word in str(caught.value) for word in words), str(caught.value)


@pytest.mark.parametrize(
    ("contours", "words"),
    [
        ({"a": {"retract": 1.0}}, "'retract'"),
        ({"a": {"gas_lead": 0.1}, "b": {}}, "gas_lead for every contour"),
        ({"a": {"pierce_time": -1.0}, "b": {}}, "pierce_time"),
    ],
)
def test_options_of_contours_are_checked(contours, words):
    with pytest.raises(InputError, match=words):
        ProgramOptions(contours=contours)


def test_a_contour_without_options_among_others_is_refused():
    options = ProgramOptions(contours={"a": {"pierce_time": 0.5}})
    assert options.of("a, piece 1 of 2").pierce_time == 0.5
    with pytest.raises(InputError, match="'b'"):
        options.of("b")


# -----------------------------------------------------------------------------
# Small holes have their technique by their size.

BY_SIZE = 'technique = "small-hole"\nsmall_hole_mm = 12\n'


def sized(folder, row=BY_SIZE, own="", more="", process=""):
    """The job of two rows, the hole of 12 mm without a technique, prepared."""
    _draw(folder / "points.csv")
    head, _, tail = job_text("rapid").partition('[[contour]]\npick = "hole"\n')
    head = head.replace('technique = "small-hole"\n', row)
    head = head.replace("thickness_mm = 2\n[[", f"thickness_mm = 2\n{process}[[", 1)
    tail = tail.replace('technique = "small-hole"\n', own).replace("speed_m_min = 3\n", "")
    (folder / "job.toml").write_text(f'{head}[[contour]]\npick = "hole"\n{more}{tail}')
    return prepare(read_job(folder / "job.toml"))


def techniques(prepared):
    return {request.task.name: request.task.technique for request in prepared.contours}


def test_a_small_hole_is_cut_as_if_its_technique_was_named(tmp_path):
    by_size = sized(tmp_path)
    named = sized(tmp_path, own='technique = "small-hole"\n')
    assert techniques(by_size) == {"hole": "small-hole (by size)", "slit": ""}
    assert techniques(named) == {"hole": "small-hole", "slit": ""}
    assert by_size.job.source == named.job.source
    assert by_size.job.program.contours == named.job.program.contours
    assert by_size.job.program.remarks == named.job.program.remarks
    assert by_size.contours[0].task.speed == named.contours[0].task.speed == 3 / 60
    again = prepare(by_size.job)
    assert again.job.source == by_size.job.source


@pytest.mark.parametrize(
    ("how", "taken"),
    [
        ({}, True),
        ({"row": BY_SIZE.replace("12", "11.9")}, False),
        ({"row": BY_SIZE.replace("12", "11.9"), "process": "small_hole_mm = 12.1\n"}, True),
        ({"process": "small_hole_mm = 11\n"}, False),
        ({"process": "small_hole_mm = 0\n"}, False),
        ({"row": 'technique = "small-hole"\n'}, False),
        ({"row": 'technique = "small-hole"\n', "process": "small_hole_mm = 20\n"}, True),
        ({"own": 'technique = "normal"\n'}, False),
    ],
)
def test_the_size_of_the_job_or_chart_decides_and_a_technique_comes_before(tmp_path, how, taken):
    prepared = sized(tmp_path, **how)
    assert (techniques(prepared)["hole"] == "small-hole (by size)") == taken
    assert prepared.job.program.of("hole").pierce_time == pytest.approx(0.15 if taken else 0.3)
    assert techniques(prepared)["slit"] == "", "an open line is no hole"


def test_the_technique_by_size_is_in_notes_report_json_and_passes_its_audit(tmp_path):
    result = run_prepared(sized(tmp_path))
    assert result.passed
    written = write_result(result, tmp_path / "out")
    assert any("hole: cut by the technique small-hole" in note for note in written.notes)
    assert "small-hole (by size)" in (tmp_path / "out" / "report.html").read_text()
    hole, slit = (cut_entry(cut) for cut in result.cuts)
    assert (hole["technique"], hole["technique_by_size"]) == ("small-hole", True)
    assert (slit["technique"], slit["technique_by_size"]) == (None, False)
    audit = Audit.of(tmp_path / "job.toml")
    for name in ("plan.json", "job.mod"):
        assert audit.audited(tmp_path / "out" / name).passed
    sized(tmp_path, process="small_hole_mm = 0\n")
    assert not Audit.of(tmp_path / "job.toml").audited(tmp_path / "out" / "job.mod").passed


def test_the_command_says_which_holes_are_small(tmp_path):
    sized(tmp_path)
    shown = run("charts", "show", "--job", "job.toml", cwd=tmp_path)
    assert "holes of at most 12 mm: the technique small-hole" in shown.stdout.replace("\n", " ")
    said = run("charts", "show", "--job", "job.toml", "--json", cwd=tmp_path).stdout
    assert json.loads(said)["small_holes"] == {"size_mm": 12.0, "row": "[[process.row]]"}


@pytest.mark.slow
def test_a_touch_up_of_a_job_with_small_holes_finds_the_moved_target_alone(tmp_path):
    """The program that it compares with has the technique of the small hole, too."""
    write_result(run_prepared(sized(tmp_path)), tmp_path / "out")
    program = tmp_path / "out" / "job.mod"
    lines = program.read_text().split("\n")
    k = [k for k, line in enumerate(lines) if "MoveL [[" in line or "TriggL [[" in line][7]
    lines[k] = re.sub(r"\[\[([-\d.]+)", lambda x: f"[[{float(x[1]) + 0.2:.4f}", lines[k], count=1)
    program.write_text("\n".join(lines))
    found = touch_up(program, tmp_path / "out" / "plan.json", tmp_path / "job.toml")
    assert found.notes == ()
    assert [(each.contour, each.node) for each in found.targets] == [("hole", 7)]


@pytest.mark.slow
def test_loops_of_one_table_have_their_technique_each(tmp_path):
    (tmp_path / "b_pillar.step").symlink_to(DEMO / "b_pillar.step")
    rows = PROCESS.replace('technique = "small-hole"\n', BY_SIZE, 1).partition("[[contour]]")[0]
    text = SMALL.partition("[[contour]]")[0] + rows.replace("gas_lead_s", "# gas_lead_s")
    text += '[[contour]]\nspacing_mm = 1\n[contour.pick_all]\nkind = "inner"\nside = "outer"\n'
    (tmp_path / "job.toml").write_text(text)
    prepared = prepare(read_job(tmp_path / "job.toml"))
    across = {loop.name: loop.diameter or 1.0 for loop in prepared.part.loops}
    small = {name for name, taken in techniques(prepared).items() if taken}
    assert small == {name for name in prepared.names if across[name] <= 0.012 + 1e-6}
    assert 0 < len(small) < len(prepared.names)
    job = prepared.job
    assert set(job.source["process"]["small_holes"]) == small
    assert {job.program.of(name).pierce_time for name in small} == {0.15}
    sheet = " ".join(line[2:] for line in job.program.remarks)
    assert all(name in sheet for name in small)
    origins = {(each.of, each.key): each.value for each in origins_of(job.text, job.source)}
    assert origins[f"{len(small)} small holes of several loops", "speed_m_min"] == 3


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"row": 'technique = "thin-web"\n', "process": "small_hole_mm = 9\n"},
         ["process.small_hole_mm", "small-hole", "thin-web"]),
        ({"row": 'technique = "thin-web"\nsmall_hole_mm = 9\n'}, ["small_hole_mm", "move it"]),
        ({"process": "small_hole_mm = -1\n"}, ["small_hole_mm", "from 0 to 100"]),
        ({"process": 'small_holes = ["hole"]\n'}, ["small_holes", "remove it"]),
    ],
)  # fmt: skip
def test_sizes_that_cannot_be_are_refused_in_one_line(tmp_path, how, words):
    with pytest.raises(InputError) as caught:
        sized(tmp_path, **how)
    assert str(caught.value).isprintable()
    assert all(word in str(caught.value) for word in words), str(caught.value)


# -----------------------------------------------------------------------------
# Two gases, each by its own output.

GAS_2 = {
    "rapid": 'gas_2_output = "doGas2"\n',
    "krl": "gas_2_output = 8\n",
    "fanuc": "gas_2_output = 8\n",
    "urscript": "gas_2_output = 2\n",
    "linuxcnc": "gas_2_output = 2\n",
    "val3": "gas_2_output = 'BasicIO-1\\\\%Q3'\n",
    "inform": "gas_2_output = 8\n",
}


def two_gases(name):
    text = job_text(name).replace(
        "speed_m_min = 3\ngas_lead", 'gas = "O2"\nspeed_m_min = 3\ngas_lead'
    )
    text = text.replace("speed_m_min = 4\ngas_lead", 'gas = "N2"\nspeed_m_min = 4\ngas_lead')
    text = text.replace("[program]\n", '[program]\ngas_2 = "O2"\n')
    table = f"[program.{name}]\n"
    return text.replace(table, table + GAS_2[name])


@pytest.fixture(scope="module")
def with_gases(planned, tmp_path_factory):
    folder = tmp_path_factory.mktemp("gases")
    _draw(folder / "points.csv")
    found = {}
    for name in GAS_2:
        path = folder / f"{name}.toml"
        path.write_text(two_gases(name))
        audit = Audit.of(path)
        plans = planned[name][0].plans
        found[name] = plans, subject_of(audit, plans, audit.expected.job.program)
    return found


@pytest.mark.parametrize("name", GAS_2)
def test_each_contour_has_the_gas_of_its_row(with_gases, name):
    _, subject = with_gases[name]
    assert subject.outcome(subject.files) == ("passed", "")
    read = subject.read(subject.files)
    assert unsafe_paths(read) == []
    switched = [
        [(s.signal, s.on) for move in section.moves for s in move.switches if "gas" in s.signal]
        for section in read.sections
    ]
    assert [each for each in switched if each] == [
        [("gas_2", True), ("gas_2", False)],
        [("gas", True), ("gas", False)],
    ]
    sheet = subject.audit.expected.job.program.remarks
    differ = any("ROWS DIFFER" in line for line in sheet)
    assert differ == (name in PLAIN), "only powers that the operator sets differ"


@pytest.mark.parametrize("name", GAS_2)
@pytest.mark.parametrize(
    "gases",
    [
        pytest.param(("gas", "gas"), marks=pytest.mark.slow),
        pytest.param(("gas_2", "gas_2"), marks=pytest.mark.slow),
        ("gas", "gas_2"),
    ],
)
def test_a_program_with_the_wrong_gas_does_not_pass(with_gases, name, gases):
    plans, subject = with_gases[name]
    options = subject.audit.expected.job.program
    own = {
        contour: {**each, "gas": gas}
        for (contour, each), gas in zip(options.contours.items(), gases, strict=True)
    }
    edited = subject_of(subject.audit, plans, replace(options, contours=own))
    outcome, said = subject.outcome(edited.files)
    assert outcome == "caught"
    assert "laser on without gas" in said


@pytest.mark.parametrize("name", ["rapid", "krl"])
def test_outputs_of_gases_that_are_left_on_or_out_do_not_pass(with_gases, name):
    _, subject = with_gases[name]
    pattern = {"rapid": r"trGas2\w+|doGas2", "krl": r"OUT\[8\]"}[name]
    tried = 0
    for file, text in subject.files.items():
        lines = text.split("\n")
        for k, line in enumerate(lines):
            if not re.search(pattern, line) or "VAR" in line:
                continue
            other = re.sub(rf",?\\\\T\d:={pattern}|,{pattern}(?=,)", "", line)
            left = [other] if other != line else []
            edited = "\n".join([*lines[:k], *left, *lines[k + 1 :]])
            assert subject.outcome({**subject.files, file: edited})[0] != "passed", line
            tried += 1
    assert tried >= 3


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('gas_2_output = "doGas2"\n', "", ["gas_2_output", "[program.rapid]"]),
        ('gas_2_output = "doGas2"', 'gas_2_output = "doGas"', ["gas_output and gas_2_output"]),
        ('gas_2 = "O2"', "gas_2 = 2", ["program.gas_2", "the gas"]),
        ('gas_2 = "O2"', 'gas_2 = "o2"', ["program.gas_2", "expected a gas of the rows in use"]),
    ],
)
def test_gases_without_an_output_of_their_own_are_refused(tmp_path, old, new, words):
    _draw(tmp_path / "points.csv")
    text = two_gases("rapid")
    assert old in text
    (tmp_path / "job.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        require_foreseen(prepare(read_job(tmp_path / "job.toml")))
    assert all(word in str(caught.value) for word in words), str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rapid", "krl", "inform"])
def test_controllers_that_follow_the_speed_have_the_power_of_each_technique(
    planned, tmp_path, name
):
    """The slope of the hole is that of 1500 W of 3000 W; with that of the slit it is caught."""
    _draw(tmp_path / "points.csv")
    line = "power_by_speed = [[0.0, 0.0], [1.0, 1.0]]\n"
    text = job_text(name).replace("power_by_speed = [[0.0, 0.3], [1.0, 1.0]]\n", line)
    text = text.replace("power_w = 1500\n", f"power_w = 1500\n{line}")
    text = text.replace("[program]\n", '[program]\npower_follows = "controller"\n')
    if name not in POWERED:
        text = text.replace(table := f"[program.{name}]\n", table + POWER[name])
    (tmp_path / "job.toml").write_text(text)
    audit = Audit.of(tmp_path / "job.toml")
    options, plans = audit.expected.job.program, planned[name][0].plans
    subject = subject_of(audit, plans, options)
    assert subject.outcome(subject.files) == ("passed", "")
    slopes = [s.per_speed for s in subject.read(subject.files).steps if isinstance(s, ReadPower)]
    hole, slit = (slope for slope in slopes if slope)
    assert hole * 3 / 60 == pytest.approx(0.5, abs=2e-3)
    assert slit * 4 / 60 == pytest.approx(1.0, abs=2e-3)
    hole_own = options.contours["hole"] | {"power_by_speed": ((0.0, 0.0), (1.0, 1.0))}
    changed = replace(options, contours={**options.contours, "hole": hole_own})
    edited = subject_of(audit, plans, changed)
    assert subject.outcome(edited.files)[0] == "caught"
