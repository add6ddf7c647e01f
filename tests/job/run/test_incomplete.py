"""A contour without a path: no program, or one without it if the job accepts that."""

import json

import numpy as np
import pytest

from commands import run
from kerfpath.errors import AuditFailed, InputError
from kerfpath.job import audit_file, program_from_file, read_job, run_job, write_result
from kerfpath.studio.program import exports_of, program_message

JOB = """\
[robot]
model = "abb_irb4600_60_205"
acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]
[tool]
head = "laser-head-45"
[part]
file = "part.csv"
xyz_mm = [1200, -200, 500]
rpy_deg = [0, 0, 30]
[plan]
gamma_step_deg = 10
certify = false
posture = "front/up"
method = "exact"
refine = false
{sequence}
[program]
language = "rapid"
name = "cut"
{program}
"""
CONTOUR = '[[contour]]\npick = "{name}"\nspeed_m_min = {speed}\nspacing_mm = 2\n'
ACCEPT = 'incomplete = "accept"'
MOVES = "[sequence]\nhome_deg = [0, -20, 10, 0, 60, 0]"


def circles():
    """Three circles as a table of points, mm."""
    t = np.linspace(0, 2 * np.pi, 60)
    rows = ["contour,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z"]
    for name, x in (("a", 0), ("b", 60), ("c", 120)):
        rows += [
            f"{name},{x + 8 * np.cos(s):.6f},{8 * np.sin(s):.6f},0,0,0,-1" for s in [*t[:-1], 0.0]
        ]
    return "\n".join([*rows, ""])


def job_of(folder, program="", sequence="", speeds=(3, 300, 3), off=None):
    (folder / "part.csv").write_text(circles())
    text = JOB.format(program=program, sequence=sequence)
    if off is not None:
        text = text.replace("[plan]", f"switched_off = {json.dumps(off)}\n[plan]")
    text += "".join(CONTOUR.format(name=n, speed=v) for n, v in zip("abc", speeds, strict=True))
    (folder / "job.toml").write_text(text)
    return read_job(folder / "job.toml")


@pytest.mark.parametrize("sequence", ["", MOVES])
def test_the_rest_is_written_if_the_job_accepts_it(tmp_path, sequence):
    result = run_job(job_of(tmp_path, ACCEPT, sequence))
    assert result.missing == ("b",)
    assert not result.passed
    assert result.may_be_written
    assert {plan.name for plan in result.plans} == {"a", "c"}
    assert len(result.moves) == (3 if sequence else 0)
    written = write_result(result, tmp_path / "out")
    assert "The program does not cut b: no path was found." in written.notes
    program = (tmp_path / "out" / "cut.mod").read_text()
    assert "! Not cut, as no path was found: b." in program
    found = audit_file(tmp_path / "out" / "cut.mod", tmp_path / "job.toml")
    assert found.missing == ("b",)
    assert not found.passed
    assert all(row.ok for table in found.tables.values() for row in table if row.level == "error")
    again, _ = program_from_file(tmp_path / "out" / "plan.json", job_file=tmp_path / "job.toml")
    assert again["cut.mod"] == program
    alone, _ = program_from_file(tmp_path / "out" / "plan.json")
    assert "! Not cut, as no path was found: b." in alone["cut.mod"]


@pytest.mark.parametrize("sequence", ["", MOVES])
def test_otherwise_none_is_written_and_the_key_is_named(tmp_path, sequence):
    job = job_of(tmp_path, "", sequence)
    result = run_job(job)
    assert not result.may_be_written
    written = write_result(result, tmp_path / "out")
    assert not list((tmp_path / "out").glob("*.mod"))
    assert any('incomplete = "accept"' in note and "for b;" in note for note in written.notes)
    with pytest.raises(AuditFailed, match=r'b has no plan; .* incomplete = "accept"'):
        program_from_file(tmp_path / "out" / "plan.json", job_file=job.path)


def test_a_contour_that_is_switched_off_is_neither_planned_nor_cut(tmp_path):
    job = job_of(tmp_path, off=["b"])
    result = run_job(job)
    assert result.passed
    assert [cut.name for cut in result.cuts] == ["a", "c"]
    written = write_result(result, tmp_path / "out")
    assert "Not cut, as switched_off in [part] names it: b." in written.notes
    assert audit_file(tmp_path / "out" / "cut.mod", job.path).passed


@pytest.mark.parametrize(
    ("off", "words"),
    [
        (["d"], r":10: part.switched_off: expected names of contours, got 'd'; "),
        (["a", "b", "c"], r":10: part.switched_off: every contour is switched off"),
    ],
)
def test_what_is_switched_off_is_a_contour_and_not_the_last_one(tmp_path, off, words):
    job = job_of(tmp_path, off=off)
    with pytest.raises(InputError, match=words):
        job.tasks(job.read_part())


def test_the_studio_says_how_to_get_a_program_of_the_rest(tmp_path):
    def program(**changes):
        result = run_job(job_of(tmp_path, **changes))
        return exports_of(result, settled=True)[1], result

    found, result = program()
    assert (found.ready, found.why, found.remedy) == (False, "no path for b", "Without b")
    assert [edit.path for edit in found.edits] == [["program", "incomplete"]]
    assert program_message(result, 1).segments == []
    found, result = program(program=ACCEPT)
    assert found.ready
    assert found.about.endswith("of a, c")
    segments = program_message(result, 1).segments
    assert {s.contour for s in segments if s.kind == "cut"} == {"a", "c"}


def test_without_any_path_there_is_no_program(tmp_path):
    result = run_job(job_of(tmp_path, ACCEPT, speeds=(300, 300, 300)))
    assert result.missing == ("a", "b", "c")
    assert not result.may_be_written
    write_result(result, tmp_path / "out")
    assert not list((tmp_path / "out").glob("*.mod"))


def test_the_command_ends_with_1_and_names_the_program(tmp_path):
    job_of(tmp_path, ACCEPT)
    found = run("plan", tmp_path / "job.toml", "--out", "out", "--json", cwd=tmp_path)
    assert found.returncode == 1, found.stderr
    said = json.loads(found.stdout)
    assert not said["passed"]
    assert (tmp_path / "out" / "cut.mod").exists()
    posted = run("post", tmp_path / "out" / "plan.json", "--language", "csv", cwd=tmp_path)
    assert posted.returncode == 0, posted.stderr
