"""What is known of a job before it is planned: every fault in one run, each with its key."""

import ezdxf
import numpy as np
import pytest

from commands import run
from jobs import ROBOT_AND_HEAD
from kerfpath.errors import InputError
from kerfpath.job import foresee, prepare, read_job, result_texts, run_job, run_prepared

HEAD = f"""\
{ROBOT_AND_HEAD}[part]
file = "holes.dxf"
xyz_mm = [1200, 0, 500]
rpy_deg = [0, 0, 0]
"""
HOLE = """\
[[contour]]
pick = "0/hole{}"
name = "{}"
speed_m_min = 1
{}
"""
PLAN = """\
[plan]
gamma_step_deg = 15
certify = false
"""


def job(folder, holes, more="", name="cut_holes", radius=4.0):
    """A job of holes (x mm, name, spacing mm or else a key) in a row, in a plate."""
    document = ezdxf.new(units=4)
    space = document.modelspace()
    right = max(x for x, _, _ in holes) + 60
    space.add_lwpolyline([(-60, -60), (right, -60), (right, 60), (-60, 60)], close=True)
    for x, _, _ in holes:
        space.add_circle((x, 0), radius)
    document.saveas(folder / "holes.dxf")
    text = HEAD + "".join(HOLE.format(i, *_keys(*hole[1:])) for i, hole in enumerate(holes, 1))
    (folder / f"{name}.toml").write_text(text + PLAN + more)
    return read_job(folder / f"{name}.toml")


def _keys(name, sampling):
    return name, sampling if isinstance(sampling, str) else f"spacing_mm = {sampling}"


def said(read):
    return [str(fault) for fault in foresee(prepare(read))]


def test_a_sound_job_has_no_faults(tmp_path):
    assert said(job(tmp_path, [(0, "one", 0.5), (40, "two", 0.5)])) == []


@pytest.mark.parametrize("tolerance", [0.02, 0.1])
def test_too_few_nodes_are_known_and_the_number_named_passes(tmp_path, tolerance):
    audit = f"[audit]\npath_tolerance_mm = {tolerance}\n"
    (fault,) = said(job(tmp_path, [(0, "one", "count = 8")], audit))
    assert "contour.count: contour 'one'" in fault
    cure = int(fault.split("count = ")[1].split(",")[0])
    assert said(job(tmp_path, [(0, "one", f"count = {cure}")], audit)) == []
    # What was foretold is what the audit would have found.
    for count, passed in ((8, False), (cure, True)):
        asked = job(tmp_path, [(0, "one", f"count = {count}")], audit)
        (cut,) = run_prepared(prepare(asked)).cuts
        rows = {row.code: row.ok for row in cut.checks}
        assert rows["tip-between-nodes"] == passed


@pytest.mark.parametrize("key", ["spacing_mm = 4", "time_step_ms = 240", "tolerance_mm = 0.5"])
@pytest.mark.parametrize("tolerance", [0.02, 0.1])
def test_nodes_come_as_close_as_the_audit_asks_for_and_no_closer(tmp_path, key, tolerance):
    audit = f"[audit]\npath_tolerance_mm = {tolerance}\n"
    outcome = run_job(job(tmp_path, [(0, "one", key)], audit))
    (cut,) = outcome.cuts
    (row,) = [row for row in cut.checks if row.code == "tip-between-nodes"]
    assert row.ok
    assert row.value > 0.5 * tolerance * 1e-3
    nodes = cut.plan.contour
    assert np.diff(nodes.s).max() < 1.05 * np.diff(nodes.s).min()  # evenly in time
    assert any(key.split(" =")[0] in note for note in result_texts(outcome).notes)


def test_small_arcs_of_leads_are_sampled_as_finely_as_they_need(tmp_path):
    """A lead of 1.5 mm at 2 mm between nodes: chords that leave it, unless there are more."""
    lead = 'spacing_mm = 2\n[contour.lead_in]\nlength_mm = 1.5\nshape = "arc"'
    (cut,) = run_job(job(tmp_path, [(0, "one", lead)])).cuts
    assert all(row.ok for row in cut.checks if row.code.endswith("between-nodes"))


def test_nodes_that_are_close_enough_are_left_as_asked_for(tmp_path):
    prepared = prepare(job(tmp_path, [(0, "one", 0.5)]))
    (request,) = prepared.contours
    assert not request.closer
    assert request.task.table.spacing_mm == 0.5


@pytest.mark.parametrize(("language", "reserved"), [("rapid", "while"), ("krl", "loop")])
def test_names_that_the_language_reserves_are_known(tmp_path, language, reserved):
    program = f'[program]\nlanguage = "{language}"\n'
    laser = "" if language == "rapid" else "[program.krl]\nlaser_output = 1\n"
    faults = said(job(tmp_path, [(0, reserved, 0.5), (40, "two", 0.5)], program + laser))
    assert len([f for f in faults if "is reserved" in f and "name in [[contour]]" in f]) == 1
    assert not said(job(tmp_path, [(0, "one", 0.5), (40, "two", 0.5)], program + laser))


def test_a_heat_spacing_without_an_order_is_known_with_the_largest_that_has_one(tmp_path):
    holes = [(0, "one", 0.5), (20, "two", 0.5), (40, "three", 0.5)]
    asked = "[sequence]\nheat_spacing_mm = {}\n"
    (fault,) = said(job(tmp_path, holes, asked.format(20)))
    assert "sequence.heat_spacing_mm" in fault
    most = float(fault.split("heat_spacing_mm = ")[1].split(",")[0])
    assert said(job(tmp_path, holes, asked.format(most))) == []
    assert said(job(tmp_path, holes, asked.format(most + 0.2)))


def test_an_order_given_against_the_heat_spacing_is_known(tmp_path):
    holes = [(0, "a", 0.5), (20, "b", 0.5), (60, "c", 0.5), (100, "d", 0.5)]
    given = '[sequence]\nheat_spacing_mm = 15\norder = "given"\n'
    (fault,) = said(job(tmp_path, holes, given))
    assert 'or order = "best"' in fault
    assert said(job(tmp_path, holes, given.replace("given", "best"))) == []


def test_a_retract_without_room_is_known_with_one_that_has(tmp_path):
    asked = "[program]\nretract_mm = {}\n"
    (fault,) = said(job(tmp_path, [(0, "one", 0.5)], asked.format(3000)))
    assert "program.retract_mm: contour 'one'" in fault
    most = float(fault.split("retract_mm = ")[1])
    assert 100 < most < 3000
    assert said(job(tmp_path, [(0, "one", 0.5)], asked.format(most))) == []


def test_every_fault_is_told_in_one_run_before_anything_is_planned(tmp_path):
    holes = [(0, "while", "count = 8"), (20, "two", "count = 8")]
    more = "[sequence]\nheat_spacing_mm = 30\n[program]\nretract_mm = 3000\n"
    job(tmp_path, holes, more)
    for command in ("plan", "check"):
        result = run(command, "cut_holes.toml", cwd=tmp_path)
        assert result.returncode == 2
        flat = " ".join(result.stderr.split())
        for words in ("'while' is reserved", "contour 'while': chords", "contour 'two': chords",
                      "heat_spacing_mm", "contour 'while': at its start", "contour 'two': at its",
                      "(and 5 more)"):  # fmt: skip
            assert words in flat
    assert not (tmp_path / "cut_holes-plan").exists()


def test_contours_below_the_floor_are_one_fault_that_names_the_lowest(tmp_path):
    read = job(tmp_path, [(0, "one", 0.5), (40, "two", 0.5)])
    path = read.path
    low = path.read_text().replace("xyz_mm = [1200, 0, 500]", "xyz_mm = [1200, 0, -20]")
    path.write_text(low)
    with pytest.raises(
        InputError, match=r"reaches 20 mm below the floor.* \(2 of 2 contours"
    ) as found:
        run_job(read_job(path))
    assert not found.value.others
    path.write_text(
        low.replace('"one"', '"while"').replace("[plan]", '[program]\nlanguage = "rapid"\n[plan]')
    )
    faults = foresee(prepare(read_job(path)))
    assert [("reserved" in str(f), "the floor" in str(f)) for f in faults] == [
        (True, False),
        (False, True),
    ]
    path.write_text(low.replace("[robot]\n", "[robot]\nfloor_mm = -20\n"))
    assert not foresee(prepare(read_job(path)))
    path.write_text(low.replace("[robot]\n", "[robot]\nfloor = false\n"))
    assert not foresee(prepare(read_job(path)))


def test_every_fault_of_the_file_is_told(tmp_path):
    job(tmp_path, [(0, "one", 0.5)])
    path = tmp_path / "cut_holes.toml"
    broken = path.read_text().replace("speed_m_min = 1", "speed = 1").replace("gamma_step", "gama")
    path.write_text(broken)
    with pytest.raises(InputError, match=r"\(and 1 more\)$") as found:
        read_job(path)
    assert len(found.value.others) == 1
    result = run("plan", "cut_holes.toml", cwd=tmp_path)
    assert result.stderr.count("kerfpath: error:") == 2


def test_every_loop_that_does_not_exist_is_told(tmp_path):
    job(tmp_path, [(0, "one", 0.5), (40, "two", 0.5)])
    path = tmp_path / "cut_holes.toml"
    path.write_text(path.read_text().replace('"0/hole', '"0/hol'))
    with pytest.raises(InputError) as found:
        prepare(read_job(path))
    assert len(found.value.others) == 1


def test_a_fault_of_the_program_names_its_key_and_its_line(tmp_path):
    program = '[program]\nlanguage = "inform"\ngas_lead_s = 0.1\n'
    [fault] = said(job(tmp_path, [(0, "one", 0.5)], program))
    assert "program.inform.gas_output: the gas is switched, but no output" in fault
    own = f"{program}\n[program.inform]\nlaser_output = 2\n"
    [fault] = said(job(tmp_path, [(0, "one", 0.5)], own))
    lines = (tmp_path / "cut_holes.toml").read_text().splitlines()
    assert f"cut_holes.toml:{lines.index('[program.inform]') + 1}: program.inform.gas" in fault


def test_near_contours_are_cut_after_their_time_and_the_audit_measures_it(tmp_path):
    holes = [(0, "a", 1), (20, "b", 1), (90, "c", 1), (110, "d", 1)]
    asked = "[sequence]\nheat_spacing_mm = 30\nheat_time_s = {}\n"
    path = job(tmp_path, holes, asked.format(2)).path
    done = run("plan", path, "--out", "out", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert run("audit", "out/plan.json", cwd=tmp_path).returncode == 0
    text = path.read_text()
    path.write_text(text.replace("heat_time_s = 2", "heat_time_s = 100"))
    refused = run("audit", "out/plan.json", "--job", path, cwd=tmp_path)
    assert refused.returncode == 1
    assert "contours cut within 100 s after one that is too near" in " ".join(
        refused.stdout.split()
    )
    none = run("plan", path, "--out", "none", cwd=tmp_path)
    assert none.returncode == 1
    assert "the time between near ones" in " ".join((none.stdout + none.stderr).split())
    path.write_text(text.replace("heat_spacing_mm = 30\n", ""))
    fault = run("check", path, cwd=tmp_path)
    assert fault.returncode == 2
    assert "sequence.heat_time_s: expected heat_spacing_mm with heat_time_s" in fault.stderr
