"""What is written by default, and with gas and handshakes, passes its own audit."""

import json
import re
import shutil

import pytest

from commands import run
from jobs import DEMO

JOB = """\
[robot]
model = "yaskawa_gp25"
acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]
lower_deg = [-180, -105, -86, -200, -150, -350]
upper_deg = [180, 155, 160, 200, 150, 350]
[tool]
head = "laser-head-straight"
[part]
file = "b_pillar.step"
xyz_mm = [750, -600, 100]
rpy_deg = [0, 0, 90]
[[contour]]
pick = "skin/hole21"
speed_m_min = 3
spacing_mm = 2
[plan]
gamma_step_deg = 10
[program]
language = "inform"
lead_time_s = 0
[program.inform]
laser_output = 5
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("yaskawa")
    shutil.copy(DEMO / "b_pillar.step", folder)
    (folder / "job.toml").write_text(JOB)
    result = run("plan", str(folder / "job.toml"), "--out", str(folder / "out"), "--json")
    assert result.returncode == 0, result.stderr
    return folder


def audited(folder):
    main = folder / "out" / "JOB.JBI"
    result = run("audit", str(main), "--job", str(folder / "job.toml"), "--json")
    return result.returncode, result.stdout or result.stderr


def test_the_default_program_passes_its_own_audit(folder):
    code, said = audited(folder)
    assert code == 0, said
    assert list(json.loads(said)["contours"]) == ["JOB.JBI", "SKIN_HOLE21 (skin/hole21)", "air"]


def test_another_wrist_in_the_start_is_found(folder):
    air = folder / "out" / "SKIN_HOLE21_AIR.JBI"
    text = air.read_bytes()
    bit = re.search(rb"///RCONF (\d)", text)[1]
    try:
        air.write_bytes(text.replace(b"///RCONF " + bit, b"///RCONF " + (b"1", b"0")[int(bit)], 1))
        assert audited(folder)[0] != 0
    finally:
        air.write_bytes(text)


FANUC = """\
[program]
language = "fanuc"
gas_lead_s = 0.3
pierce_time_s = 0.2
request = ["shutter"]
wait_for = ["ready", "gas_pressure"]
[program.fanuc]
laser_output = 5
gas_output = 6
shutter_output = 7
ready_input = 1
gas_pressure_input = 2
"""


def test_listings_with_gas_and_handshakes_pass_their_audit_but_not_that_of_another_job(tmp_path):
    shutil.copy(DEMO / "b_pillar.step", tmp_path)
    head = JOB[: JOB.index("[program]")].replace("yaskawa_gp25", "fanuc_m20id_25")
    head = re.sub(r"(lower|upper)_deg = .*\n", "", head)
    (tmp_path / "job.toml").write_text(head + FANUC)
    made = run("plan", str(tmp_path / "job.toml"), "--out", str(tmp_path / "out"), "--json")
    assert made.returncode == 0, made.stderr
    (tmp_path / "less.toml").write_text(head + FANUC.replace(', "gas_pressure"]', "]"))
    for job, code in (("job.toml", 0), ("less.toml", 1)):
        main = str(tmp_path / "out" / "JOB.ls")
        result = run("audit", main, "--job", str(tmp_path / job), "--json")
        assert result.returncode == code, result.stdout
