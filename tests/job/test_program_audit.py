"""Programs on disk, audited against their job: as written, and as people edit them."""

import json
import re
import shutil
from itertools import count

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from commands import assert_refused, run
from jobs import DEMO, SMALL, WHOLE
from kerfpath import audit, placed, plan
from kerfpath.job import read_job, read_plan_file
from kerfpath.placement import planned_again

SETTINGS = """
[program.krl]
laser_output = 5
[program.fanuc]
laser_output = 5
[program.val3]
laser_output = 'BasicIO-1\\%Q0'
"""
"""Of other languages."""
JOB = WHOLE.replace("0.005", "0.01") + SETTINGS
"""FANUC counts lead times in whole hundredths of a second."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("program")
    shutil.copy(DEMO / "b_pillar.step", folder)
    (folder / "job.toml").write_text(JOB.replace("[plan]", '[plan]\nmethod = "exact"'))
    result = run("plan", str(folder / "job.toml"), "--out", str(folder / "out"), "--json")
    assert result.returncode == 0, result.stderr
    return folder


def refused(*words):
    """The one line that a command is refused with."""
    result = run(*words)
    assert_refused(result)
    return result.stderr


def audited(folder, text, name="edited.mod"):
    """The exit code and JSON of the audit of a text."""
    (folder / name).write_text(text)
    result = run("audit", str(folder / name), "--job", str(folder / "job.toml"), "--json")
    assert result.returncode in (0, 1), result.stderr
    return result.returncode, json.loads(result.stdout)


def failures(found):
    return {
        (name, check["code"]): check
        for name, checks in found["contours"].items()
        for check in checks
        if not check["ok"]
    }


@pytest.fixture(scope="module")
def written(folder):
    return (folder / "out" / "job.mod").read_text()


def test_the_program_that_was_written_passes(folder, written):
    code, found = audited(folder, written)
    assert (code, found["passed"], found["missing"]) == (0, True, [])
    cuts = {name for name in found["contours"] if "(" in name}
    assert cuts == {"led_in (led in)", "joined (joined)", "cornered (cornered)"}
    codes = {check["code"] for check in found["contours"]["led_in (led in)"]}
    assert {"tip-between-nodes", "velocity", "acceleration", "laser", "speed", "posture"} <= codes


@pytest.mark.parametrize(
    ("language", "main"),
    [
        ("krl", "job.src"),
        ("val3", "job/job.pjx"),
        ("ros", "job.yaml"),
        ("csv", "job.csv"),
        ("linuxcnc", "job.ngc"),
    ],
)
def test_every_language_that_can_say_the_plan_passes_its_audit(folder, language, main):
    """Arms of other makers are a warning; UR's, Yaskawa's and FANUC's cannot say this one's."""
    out = folder / language
    out.mkdir()
    job = str(folder / "job.toml")
    plan = str(folder / "out" / "plan.json")
    done = run("post", plan, "--job", job, "--language", language, "-o", str(out))
    assert done.returncode == 0, done.stderr
    result = run("audit", str(out / main), "--job", job, "--json")
    found = json.loads(result.stdout)
    assert (result.returncode, found["missing"], failures(found)) == (0, [], {})


def test_the_tables_are_for_people(folder, written):
    (folder / "edited.mod").write_text(written)
    result = run("audit", str(folder / "edited.mod"), "--job", str(folder / "job.toml"))
    assert re.search(r"led_in \(led in\): \d+ checks passed", result.stdout)
    assert "audit passed" in result.stdout


def nth(text, pattern, number):
    """The line number and text of one of the lines that match."""
    lines = text.splitlines()
    found = [k for k, line in enumerate(lines) if re.search(pattern, line)]
    return found[number], lines


def test_a_target_moved_by_hand_is_found_with_its_line(folder, written):
    k, lines = nth(written, r"^    MoveL \[\[", 20)
    x = re.search(r"MoveL \[\[(-?[\d.]+),", lines[k])
    lines[k] = lines[k].replace(f"[[{x[1]},", f"[[{float(x[1]) + 0.4:.4f},", 1)
    code, found = audited(folder, "\n".join(lines))
    assert code == 1
    wrong = failures(found)
    # The zones of the nodes beside it are not what the job makes of the way there, either.
    (check,) = (row for (_, code), row in wrong.items() if code == "tip-between-nodes")
    # The move may run partly along the contour: what leaves it is the part across.
    assert 1e-4 < check["value"] <= 4.1e-4
    line = int(re.search(r"line (\d+)", check["place"])[1])
    assert abs(line - (k + 1)) <= 1


@pytest.mark.slow
def test_what_else_people_change_is_found(folder, written):
    k, lines = nth(written, r"CONST speeddata vCut", 0)
    doubled = written.replace(
        lines[k], re.sub(r"\[([\d.]+),", lambda m: f"[{2 * float(m[1]):.2f},", lines[k])
    )
    edits = {
        "speed": doubled,
        # The last of the program: whichever contour is first, it may have micro joints.
        "laser-off": ",trOn,".join(written.rsplit(",trOff,", 1)),
        "laser": re.sub(r"TriggL (.*),trOff,", r"MoveL \1,", written),
        "pierce": written.replace("WaitTime 0.250;", "WaitTime 0.100;", 1),
        "lead-time": written.replace(r"TriggIO trOn,0.0100", r"TriggIO trOn,0.0500"),
        "posture": re.sub(r"(MoveL \[\[[^]]*\],\[[^]]*\],\[)(-?\d)", r"\g<1>9", written, count=1),
        "frames": re.sub(r'(wobjdata wPart:=\[FALSE,TRUE,"",\[\[)[\d.]+', r"\g<1>1201.0", written),
    }
    for code, text in edits.items():
        assert text != written, code
        status, found = audited(folder, text)
        assert status == 1
        assert code in {which for _, which in failures(found)}, code


def without(text, call):
    """The text of a main routine without a call, the others numbered again."""
    numbers = count(1)
    kept = text.replace(call, "")
    return re.sub(r"(?<=IF nFirst<=)\d+", lambda _: str(next(numbers)), kept)


def test_a_contour_that_would_be_begun_fast_is_found(folder, written):
    (slow,) = re.findall(r"speeddata (vAir\d+):=\[100\.00,", written)
    fast = next(name for name in re.findall(r"speeddata (vAir\d+)", written) if name != slow)
    assert written.count(f"],{slow},fine") == 3, "one for each contour"
    before, _, after = written.rpartition(f"],{slow},fine")
    code, found = audited(folder, f"{before}],{fast},fine{after}")
    assert code == 1
    assert {which for _, which in failures(found)} == {"asked-speeds"}


def test_a_byte_order_mark_is_noted(folder, written):
    code, found = audited(folder, f"\ufeff{written}")
    assert code == 0
    assert "edited.mod: a byte order mark is at the beginning" in found["notes"][0]
    assert "byte order mark" not in audited(folder, written)[1]["notes"][0]


def test_a_cut_that_is_left_out_or_made_twice_is_found(folder, written):
    name = re.search(r"    IF nFirst<=\d joined;\n", written)[0]
    body = re.search(r"\n  PROC joined\(\)\n.*?ENDPROC\n", written, re.DOTALL)[0]
    code, found = audited(folder, without(written, name).replace(body, ""))
    assert (code, found["missing"]) == (1, ["joined"])
    twice = without(written, name).replace(
        "    nFirst:=1;", "    IF nFirst<=3 joined;\n    IF nFirst<=4 joined_2;\n    nFirst:=1;"
    )
    twice = twice.replace(body, body + body.replace("PROC joined", "PROC joined_2"))
    code, found = audited(folder, twice)
    assert code == 1
    assert ("joined_2 (joined)", "once") in failures(found)


def test_a_path_backwards_or_elsewhere_is_no_contour_of_the_job(folder, written):
    away = re.sub(
        r"(\n  PROC joined\(\)\n.*?ENDPROC\n)",
        lambda m: re.sub(
            r"(MoveL|TriggL) \[\[(-?[\d.]+),",
            lambda move: f"{move[1]} [[{float(move[2]) + 30:.4f},",
            m[0],
        ),
        written,
        flags=re.DOTALL,
    )
    code, found = audited(folder, away)
    assert (code, found["missing"]) == (1, ["joined"])
    assert ("joined", "contour") in failures(found)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: t[: len(t) // 2],
            "line .*(not expected here|ENDMODULE is missing)",
        ),
        (
            lambda t: t.replace("MoveL", "MoveX", 1),
            r"line \d+: not expected here: 'MoveX",
        ),
        (lambda t: "", "ENDMODULE is missing"),
        (lambda t: re.sub(r"    MoveAbsJ.*\n", "", t), "expected a joint move before the path"),
    ],
)
def test_a_text_that_is_not_of_our_making_is_refused_in_one_line(folder, written, change, message):
    (folder / "edited.mod").write_text(change(written))
    said = refused("audit", str(folder / "edited.mod"), "--job", str(folder / "job.toml"))
    assert re.search(message, said)


def test_a_dry_run_is_written_beside_the_program(folder):
    out = folder / "out"
    result = run("post", out / "plan.json", "--dry-run", "0.2", "-o", out)
    assert result.returncode == 0, result.stderr
    text = (out / "dry_job.mod").read_text()
    assert "! DRY RUN at 20 % of the speed" in text
    assert "Trigg" not in text
    named = run("post", out / "plan.json", "--dry-run", "0.2", "-o", folder / "dry_mine.mod")
    assert named.returncode == 0, named.stderr
    assert "MODULE dry_mine" in (folder / "dry_mine.mod").read_text()
    said = refused("post", out / "plan.json", "--dry-run", "20")
    assert "dry run: expected a share of the speed of at most 1, got 20" in said


def compared(folder, text, name="edited.mod"):
    (folder / name).write_text(text)
    result = run("compare", folder / "out/job.mod", folder / name, "--job", folder / "job.toml",
                 "--json")  # fmt: skip
    found = json.loads(result.stdout)
    assert result.returncode == (0 if found["same"] else 1)
    return {each["code"]: each for each in found["differences"]}


def test_an_edited_program_is_compared_in_words(folder, written):
    assert compared(folder, written) == {}
    k, lines = nth(written, r"^    MoveL \[\[", 20)
    x = re.search(r"MoveL \[\[(-?[\d.]+),", lines[k])
    lines[k] = lines[k].replace(f"[[{x[1]},", f"[[{float(x[1]) + 0.4:.4f},", 1)
    lines = [line.replace("WaitTime 0.250;", "WaitTime 0.100;") for line in lines]
    found = compared(folder, "\n".join(lines))
    assert set(found) == {"targets", "waits"}
    assert found["targets"]["message"].startswith("1 moved, by up to 0.4000 mm")
    assert found["targets"]["places"][1].endswith(f"line {k + 1}")
    assert found["waits"]["count"] == 3
    result = run("compare", folder / "out/job.mod", folder / "edited.mod", "--job",
                 folder / "job.toml")  # fmt: skip
    assert "targets: 1 moved, by up to 0.4000 mm" in result.stdout
    assert result.stdout.endswith("not the same\n")


def test_a_program_in_another_language_is_the_same(folder):
    other = folder / "other"
    assert run("post", folder / "out/plan.json", "--language", "csv", "-o", other).returncode == 0
    (folder / "other.csv").write_bytes(other.read_bytes())
    result = run("compare", folder / "out/job.mod", folder / "other.csv", "--job",
                 folder / "job.toml")  # fmt: skip
    assert result.returncode == 0, result.stdout
    assert "note: not compared: times, the tool, the part frame, postures" in result.stdout
    assert "the same in what was compared" in result.stdout
    assert "no such file" in refused("compare", folder / "out/job.mod", folder / "none.mod",
                                     "--job", folder / "job.toml")  # fmt: skip


def with_points(folder, noise=0.0, shift=12.0):
    """A table of points on the part, which stands `shift` mm and half a degree off."""
    T = read_job(folder / "job.toml").placement.copy()
    T[:3, :3] = Rotation.from_euler("xyz", [0.1, -0.2, 90.5], degrees=True).as_matrix()
    T[0, 3] += shift / 1e3
    nominal = np.array([[0, 0, 0], [600, 0, 0], [600, 150, 40], [0, 200, 10]])
    measured = nominal @ T[:3, :3].T + T[:3, 3] * 1e3
    measured[2] += [0, 0, noise]
    sides = [f"{side}_{axis}_mm" for side in ("nominal", "measured") for axis in "xyz"]
    rows = [",".join(str(v) for v in row) for row in np.hstack([nominal, measured])]
    path = folder / "points.csv"
    path.write_text("\n".join([",".join(sides), *rows]))
    return path, T


def test_the_program_of_a_measured_part_passes_the_audit_of_a_job_that_places_it_there(folder):
    path, T = with_points(folder, noise=0.05)
    moved = folder / "moved"
    moved.mkdir()
    command = ("post", folder / "out/plan.json", "--measured", path, "-o", moved)
    result = run(*command, "--json")
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    frame = found["measured"]
    assert 0.005e-3 < max(frame["residuals_m"]) < 0.05e-3
    np.testing.assert_allclose(frame["T_base_part"], T, atol=2e-4)  # 0.05 mm over 250 mm
    assert "collisions are not checked there" in found["notes"][0]
    assert "no longer proved free of collisions" in found["notes"][1]
    assert "have not been checked for collisions" in " ".join(found["notes"])
    job = folder / "moved.toml"
    job.write_text(
        re.sub("rpy_deg = .*", f"rpy_deg = {frame['rpy_deg']}",
               JOB.replace("[1200, -600, 500]", str(frame["xyz_mm"])), count=1)
    )  # fmt: skip
    result = run("audit", moved / "job.mod", "--job", job)
    assert result.returncode == 0, result.stdout
    said = run(*command).stdout
    assert "residuals of 4 points: " in said
    assert re.search(r"the part is 1[12]\.\d{3} mm and 0\.5\d+ deg from", said)
    assert f"xyz_mm = {frame['xyz_mm']}, rpy_deg = {frame['rpy_deg']}" in said


@pytest.mark.slow
def test_a_measured_part_that_is_none_or_out_of_reach_gives_no_program(folder):
    out = folder / "none.mod"
    path, _ = with_points(folder, noise=3.0)
    command = ("post", folder / "out/plan.json", "-o", out, "--measured", path)
    assert "allowed are 0.5 mm" in refused(*command)
    assert run(*command, "--residual-mm", "4").returncode == 0
    out.unlink()
    with_points(folder, shift=1200)
    result = run(*command)
    assert result.returncode == 1
    assert "moved to the measured placement it fails" in result.stderr
    assert "out of the robot's reach at this placement" in result.stderr
    assert "and planned again there: " in result.stderr
    # Where the part stands is told all the same, so that a job can be planned there.
    assert re.search(r"keys for a job: xyz_mm = \[.*\], rpy_deg = \[.*\]", result.stdout)
    assert "xyz_mm = [" in run(*command, "--json").stderr
    assert not out.exists()
    with_points(folder, shift=300)
    result = run(*command)
    assert result.returncode == 0
    said = (
        "was planned again there; without planning, it fails: error: excess over the joint limits"
    )
    assert said in result.stdout


@pytest.mark.slow
def test_a_plan_on_its_limits_is_planned_again_around_a_part_that_was_measured(folder):
    """Refined, a plan uses all of eta: a part a little off asks for a little more."""
    (folder / "edge.toml").write_text(SMALL.replace("[plan]", '[plan]\nmethod = "exact"'))
    assert run("plan", folder / "edge.toml", "--out", folder / "edge").returncode == 0
    plans = read_plan_file(folder / "edge" / "plan.json").plans
    assert [np.abs(p.acceleration_share).max() > 0.899 for p in plans] == [True, True]
    over = 0
    for shift in (2.6, -2.6):
        path, T = with_points(folder, shift=shift)
        led = [placed(p, T) for p in plans]
        beyond = [p.name for p in led if np.abs(p.acceleration_share).max() > 0.9 + 1e-6]
        moved = folder / "edge_moved.mod"
        result = run("post", folder / "edge/plan.json", "--measured", path, "-o", moved)
        assert result.returncode == 0, result.stdout + result.stderr
        for name in beyond:
            assert (
                f"Contour '{name}' was planned again there; without planning, it" in result.stdout
            )
        over += len(beyond)
    assert over


@pytest.mark.parametrize("feed", ["constant", "dip"])
def test_planning_again_keeps_speed_postures_and_limits(folder, circle, arm, tool, placement, feed):
    speed = 0.3 if feed == "constant" else 0.8
    made = plan(
        circle, arm, tool=tool, placement=placement, speed=speed, gamma_step=np.radians(4),
        feed=feed, refine=feed == "constant", postures=[0], method="exact",
    )  # fmt: skip
    assert (made.feed is None) == (feed == "constant")
    T = placement.copy()
    T[:3, 3] += [0.02, -0.03, 0.01]
    again = planned_again(made, T)
    assert audit(again) == []
    np.testing.assert_array_equal(again.T_base_part, T)
    assert set(again.posture) == set(made.posture)
    fastest = np.diff(again.contour.s) / np.diff(again.time)
    assert fastest.max() == pytest.approx(speed, rel=1e-6)


def test_bad_arguments_are_refused(folder, written):
    (folder / "x.mod").write_bytes(b"MODULE\x00")
    assert "must not contain the character U+0000" in refused(
        "audit", str(folder / "x.mod"), "--job", str(folder / "job.toml")
    )
    assert "a program is compared with its job" in refused("audit", str(folder / "out/job.mod"))
    assert "no such file" in refused(
        "audit", str(folder / "nowhere.mod"), "--job", str(folder / "job.toml")
    )
    (folder / "x.foo").write_text("")
    said = refused("audit", str(folder / "x.foo"), "--job", str(folder / "job.toml"))
    assert "expected a program (" in said


ZIGZAG = """
[robot]
model = "abb_irb4600_60_205"
acceleration_ratio = "cybertech_8_to_20kg"
[tool]
head = "laser-head-45"
[part]
file = "line.csv"
placed_by = "centre"
xyz_mm = [1300, 0, 700]
rpy_deg = [0, 0, 0]
unit = "mm"
axis = [0, 0, -1]
[program]
language = "rapid"
[plan]
certify = false
[[contour]]
pick = "contour"
speed_m_min = 1
spacing_mm = 2
"""


@pytest.mark.slow
@pytest.mark.parametrize("turn", [120.0, 150.0, 170.0])
def test_a_line_of_few_points_with_sharp_corners_is_no_way_back(tmp_path, turn):
    """Near a corner both legs are close to a target: it stands on the one that it came by."""
    way = np.radians([0.0, 180.0 - turn, 0.0, 180.0 - turn])
    legs = 90.0 * np.c_[np.cos(way) * [1, -1, 1, -1], np.sin(way), 0 * way]
    points = np.vstack([np.zeros(3), np.cumsum(legs, axis=0)])
    rows = "\n".join(",".join(f"{x:.6f}" for x in point) for point in points)
    (tmp_path / "line.csv").write_text(rows)
    (tmp_path / "job.toml").write_text(ZIGZAG)
    result = run("plan", tmp_path / "job.toml", "--out", tmp_path / "out")
    assert result.returncode == 0, result.stderr
    assert run("audit", tmp_path / "out/job.mod", "--job", tmp_path / "job.toml").returncode == 0
