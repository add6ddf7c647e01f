"""A job whose moves are shorter than the controller allows: its program is thinned and audited."""

import re

import pytest

from jobs import DEMO, SMALL, WITHOUT_LAG
from kerfpath.job import audit_file, read_job, run_job, write_result

TEXT = SMALL.replace("[plan]", "[plan]\ncertify = false").replace("[tool]", WITHOUT_LAG)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("short")
    (folder / "b_pillar.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
    (folder / "job.toml").write_text(TEXT)
    result = run_job(read_job(folder / "job.toml"))
    write_result(result, folder / "out")
    (program,) = (folder / "out").glob("*.mod")
    return folder, result, program


def audited(folder, program):
    tables = audit_file(program, folder / "job.toml").tables
    return [row for table in tables.values() for row in table]


def targets(program):
    return len(re.findall(r"(?:Move|Trigg)L ", program.read_text()))


def test_a_thinned_program_passes_the_audit_of_its_job(written):
    folder, result, program = written
    nodes = sum(len(cut.plan.q) for cut in result.cuts)
    assert targets(program) < 0.9 * nodes
    rows = audited(folder, program)
    assert all(row.ok for row in rows if row.level == "error")
    (worst,) = {row.code for row in rows if not row.ok}
    assert worst == "cycle-as-run"
    between = [row for row in rows if row.code == "tip-between-nodes"]
    assert between
    assert all(row.value < 1e-4 for row in between)


def test_an_edited_target_of_a_thinned_program_is_found(written):
    folder, _, program = written
    text = program.read_text()
    lines = [k for k, row in enumerate(text.splitlines()) if "MoveL" in row]
    rows = text.splitlines()
    k = lines[len(lines) // 2]
    number = re.search(r"MoveL \[\[(-?[\d.]+)", rows[k])[1]
    rows[k] = rows[k].replace(number, f"{float(number) + 0.5:.4f}", 1)
    edited = program.with_name("edited.mod")
    edited.write_text("\n".join([*rows, ""]).replace(f"MODULE {program.stem}", "MODULE edited"))
    assert any(not row.ok and row.level == "error" for row in audited(folder, edited))


def test_where_moves_are_long_enough_no_node_may_be_left_out(written):
    """The same text is refused if the controller takes shorter moves."""
    folder, _, program = written
    path = folder / "job.toml"
    path.write_text(TEXT + "\n[program.rapid]\nshortest_move_ms = 4\n")
    try:
        bad = [row for row in audited(folder, program) if not row.ok and row.level == "error"]
    finally:
        path.write_text(TEXT)
    assert "every-node" in {row.code for row in bad}
