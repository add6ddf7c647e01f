"""Touch-up: paths eased through taught poses, and jobs planned again around them."""

import json
import re
import shutil
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from commands import assert_refused, run
from jobs import DEMO, WHOLE
from kerfpath import Contour, InputError
from kerfpath.contour import angle_between
from kerfpath.job import read_plan_file
from kerfpath.operations import micro_joints, touched_up
from programs import read_text

EASE = 0.01
ROUNDING = 1e-12
"""m; of arc lengths summed over a thousand points."""


def line(count=41, length=0.08):
    points = np.c_[np.linspace(0, length, count), np.zeros(count), np.zeros(count)]
    return Contour(points, np.tile([0.0, 0, -1], (count, 1)), name="line")


def ring(count=61, radius=0.02):
    t = np.linspace(0, 2 * np.pi, 721)
    points = radius * np.c_[np.cos(t), np.sin(t), 0 * t]
    path = Contour(points, np.tile([0.0, 0, -1], (len(t), 1)), closed=True, name="ring")
    return path, path.resample(count=count)


def tilted(rad):
    return np.array([np.sin(rad), 0, -np.cos(rad)])


def test_one_pose_is_eased_by_the_flat_polynomial_of_degree_five():
    straight = line()
    h, turn = 0.0005, 0.1
    pose = straight.points[[20]] + [0, h, 0]
    path, (k,) = touched_up(straight, straight, [20], pose, tilted(turn)[None], ease=EASE)
    # Along a line that is hardly lengthened the share left at a distance d is known.
    d = np.abs(path.points[:, 0] - pose[0, 0]) / EASE
    left = np.where(d < 1, 1 - d**3 * (10 - 15 * d + 6 * d**2), 0)
    np.testing.assert_allclose(path.points[:, 1], h * left, atol=1e-15)
    np.testing.assert_allclose(
        angle_between(np.tile([0.0, 0, -1], (len(left), 1)), path.axes), turn * left, atol=1e-12
    )
    assert (path.points[:, 2] == 0).all()
    np.testing.assert_allclose(path.points[k], pose[0], atol=ROUNDING)
    np.testing.assert_allclose(path.axes[k], tilted(turn), atol=ROUNDING)


@pytest.mark.parametrize("other", [21, 24, 25, 30, 33])
def test_poses_near_each_other_are_all_kept_without_overshoot(other):
    straight = line()
    taught = straight.points[[20, other]] + [[0, 0.0004, 0], [0, 0.0007, 0]]
    axes = straight.axes[[20, other]]
    path, keep = touched_up(straight, straight, [20, other], taught, axes, ease=EASE)
    np.testing.assert_allclose(path.points[keep], taught, atol=ROUNDING)
    nodes = path.resample(spacing=0.002, keep=keep)
    for pose in taught:
        assert np.linalg.norm(nodes.points - pose, axis=1).min() < ROUNDING
    y = path.points[:, 1]
    assert y.min() >= -ROUNDING
    assert y.max() == pytest.approx(0.0007)
    apart = taught[1, 0] - taught[0, 0]
    if apart < 2 * EASE - ROUNDING:
        assert y[keep[0] : keep[1]].min() >= 0.0004 - ROUNDING
    curvature = np.abs(np.diff(np.gradient(y, path.points[:, 0]))) / np.diff(path.points[:, 0])
    # 10 / sqrt(3) is the largest second derivative of the polynomial; steps of 0.125 mm blur it.
    assert curvature.max() < 1.1 * 10 / np.sqrt(3) * 0.0007 / min(EASE, apart) ** 2


def test_the_rest_of_a_ring_stays_and_its_seam_too():
    path, nodes = ring()
    taught = nodes.points[[3]] + [0, 0, 0.0003]
    new, keep = touched_up(path, nodes, [3], taught, nodes.axes[[3]], ease=EASE)
    assert new.closed
    np.testing.assert_allclose(new.points[keep], taught, atol=ROUNDING)
    # Node 3 is 6.3 mm from the start, where nothing moves.
    np.testing.assert_allclose(new.points[[0, -1]], nodes.points[[0, -1]], atol=ROUNDING)
    far = new.s > nodes.s[3] + 1.02 * EASE
    assert np.abs(new.points[far, 2]).max() == 0
    assert np.linalg.norm(new.points[far], axis=1) == pytest.approx(0.02, abs=1e-6)


def test_what_stretches_are_is_kept():
    jointed = micro_joints(ring()[0], 0.004, count=2)
    nodes = jointed.resample(spacing=0.002)
    taught = nodes.points[[5]] * 1.01
    new, keep = touched_up(jointed, nodes, [5], taught, nodes.axes[[5]], ease=EASE)
    again = new.resample(spacing=0.002, keep=keep)
    lengths = [
        sum(np.diff(c.s)[np.array(c.kinds[:-1]) == "micro joint"]) for c in (nodes, new, again)
    ]
    assert lengths == pytest.approx([0.008] * 3, rel=0.01)
    assert np.linalg.norm(again.points - taught[0], axis=1).min() < ROUNDING


@pytest.mark.parametrize("moved", [[], [0], [60], [5, 4], [5, 5], [61]])
def test_nodes_that_cannot_be_moved_are_refused(moved):
    path, nodes = ring()
    k = np.clip(moved, 0, 60).astype(int)
    with pytest.raises(InputError, match="expected increasing moved nodes from 1 to 59"):
        touched_up(path, nodes, moved, nodes.points[k], nodes.axes[k])


def test_the_end_of_an_open_path_may_be_moved():
    straight = line()
    taught = straight.points[[40]] + [0, 0, 0.0002]
    path, keep = touched_up(straight, straight, [40], taught, straight.axes[[40]], ease=EASE)
    assert keep.tolist() == [len(path) - 1]
    np.testing.assert_allclose(path.points[-1], taught[0], atol=ROUNDING)


def test_nodes_are_kept_by_a_sampling_in_length_or_time():
    straight = line()
    for asked in ({"spacing": 0.003}, {"dt": 0.03, "speed": 0.1}):
        nodes = straight.resample(**asked, keep=[7, 8, 33])
        for k in (7, 8, 33):
            assert np.abs(nodes.s - straight.s[k]).min() < ROUNDING
        steps = np.diff(nodes.s)
        assert steps.max() <= 0.003 + ROUNDING
        assert steps.min() >= 0.8 * steps.max() - ROUNDING
    for bad, message in (
        ({"count": 5}, "only with spacing= or dt="),
        ({"spacing": 0.003}, "0 to 40"),
    ):
        with pytest.raises(InputError, match=message):
            straight.resample(**bad, keep=[41])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("touch")
    shutil.copy(DEMO / "b_pillar.step", folder)
    (folder / "job.toml").write_text(WHOLE)
    assert run("plan", folder / "job.toml", "--out", folder / "out").returncode == 0
    return folder


TARGET = re.compile(r"\[\[([^\]]*)\],\[([^\]]*)\]")


def edited(text, routine, node, shift_mm=(0, 0, 0), turn_deg=0.0):
    """The program with a target of a routine moved in the part, and turned about its own x."""
    head, body = text.split(f"\n  PROC {routine}()\n")
    lines = body.split("\n")
    moves = [k for k, row in enumerate(lines) if re.match(r" +(MoveL|TriggL) ", row)]
    row = lines[moves[node]]
    xyz, wxyz = (
        np.array([float(v) for v in part.split(",")]) for part in TARGET.search(row).groups()
    )
    turned = Rotation.from_quat(wxyz, scalar_first=True) * Rotation.from_rotvec(
        [turn_deg, 0, 0], degrees=True
    )
    said = ",".join(f"{v:.4f}" for v in xyz + shift_mm)
    quaternion = ",".join(f"{v:.8f}" for v in turned.as_quat(scalar_first=True))
    lines[moves[node]] = TARGET.sub(f"[[{said}],[{quaternion}]", row, count=1)
    return head + f"\n  PROC {routine}()\n" + "\n".join(lines)


def touch(folder, text, *more, plan="out", name="edited.mod"):
    (folder / name).write_text(text)
    return run("touch-up", folder / name, "--job", folder / "job.toml", "--plan",
               folder / plan / "plan.json", *more)  # fmt: skip


@pytest.mark.slow
def test_taught_targets_are_kept_and_so_is_every_contour_without_one(folder):
    text = (folder / "out/job.mod").read_text()
    hand = edited(text, "led_in", 21, (0.1, -0.2, 0.4))
    hand = edited(hand, "led_in", 24, (0, 0, 0.2), turn_deg=1.0).replace("0.250;", "0.300;", 1)
    result = touch(folder, hand, "--out", folder / "one", "--json")
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["passed"]
    assert [(t["contour"], t["node"]) for t in found["targets"]] == [("led in", 21), ("led in", 24)]
    assert found["targets"][0]["off"] == pytest.approx(
        np.linalg.norm([0.1, 0.2, 0.4]) / 1e3, rel=1e-3
    )
    assert np.degrees(found["targets"][1]["turned"]) == pytest.approx(1, abs=1e-4)
    assert [note[:15] for note in found["not_kept"]] == ["not kept: waits"]
    assert {path.rsplit("/")[-1] for path in found["files"]} == {
        "job.mod", "plan.json", "trajectory.csv", "report.html",
    }  # fmt: skip
    before, after = (
        {p.name: p for p in read_plan_file(folder / out / "plan.json").plans}
        for out in ("out", "one")
    )
    moves = {s.name: s.moves for s in read_text(hand, after["led in"].robot).sections}
    planned = after["led in"]
    for node in (21, 24):
        taught = [m for m in moves["led_in"] if m.kind != "joint"][node].T_part_tip
        T = planned.T_part_tip
        T = T[np.linalg.norm(T[:, :3, 3] - taught[:3, 3], axis=1).argmin()]
        np.testing.assert_allclose(T[:3, 3], taught[:3, 3], atol=1e-9)
        np.testing.assert_allclose(T[:3, 2], taught[:3, 2], atol=1e-7)  # eight digits
    old = before["led in"].contour
    far = old.s[(old.s < old.s[21] - 0.0101) | (old.s > old.s[24] + 0.0101)]
    points = np.vstack([planned.contour.at(far)[0], planned.contour.points[-1:]])
    off = np.linalg.norm(old.at(far)[0] - points[:-1], axis=1)
    assert off[far < old.s[21]].max() < 2e-5  # chords of nodes 1.3 mm apart
    assert list(after) == list(before)  # the order of cutting
    for name, was in before.items():
        assert set(after[name].posture) == set(was.posture)
    assert {c["name"]: c["kept"] for c in found["contours"]} == {
        "joined": True, "cornered": True, "led in": False,
    }  # fmt: skip
    for name in ("joined", "cornered"):
        np.testing.assert_array_equal(after[name].q, before[name].q)
        np.testing.assert_array_equal(after[name].time, before[name].time)
    moves = [read_plan_file(folder / out / "plan.json").moves for out in ("out", "one")]
    names = ["home", *before, "home"]
    for leg, one, two in zip(pairwise(names), *moves, strict=True):
        assert np.array_equal(one.q, two.q) == ("led in" not in leg)
    assert run("audit", folder / "one/plan.json").returncode == 0


@pytest.mark.slow
def test_a_second_touch_up_keeps_the_first(folder):
    text = (folder / "out/job.mod").read_text()
    first = edited(text, "led_in", 21, (0, 0, 0.4))
    assert touch(folder, first, "--out", folder / "two").returncode == 0
    second = edited((folder / "two/job.mod").read_text(), "joined", 10, (0, 0, 0.3))
    result = touch(folder, second, "--out", folder / "three", plan="two")
    assert result.returncode == 0, result.stderr
    assert "joined, node 10, moved by 0.300 mm, axis turned by 0.000 deg" in result.stdout
    two, three = (
        {p.name: p.contour for p in read_plan_file(folder / out / "plan.json").plans}
        for out in ("two", "three")
    )
    np.testing.assert_array_equal(three["led in"].points, two["led in"].points)
    assert np.abs(three["joined"].points - two["joined"].points).max() == pytest.approx(
        3e-4, rel=0.1
    )


@pytest.mark.slow
def test_contours_that_the_job_does_not_allow_any_more_are_planned_again(folder):
    text = edited((folder / "out/job.mod").read_text(), "led_in", 21, (0, 0, 0.4))
    (folder / "edited.mod").write_text(text)
    slower = folder / "slower.toml"
    changed = 'name = "cornered"\nspeed_m_min = 2.5\n'
    slower.write_text(WHOLE.replace('name = "cornered"\nspeed_m_min = 3\n', changed))
    result = run("touch-up", folder / "edited.mod", "--job", slower, "--plan",
                 folder / "out/plan.json", "--out", folder / "slow", "--json")  # fmt: skip
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    assert [c["name"] for c in found["contours"] if c["kept"]] == ["joined"]
    (said,) = found["renewed"]
    assert said.startswith("cornered was planned again, as the job has changed: ")
    before, after = (read_plan_file(folder / out / "plan.json").plans for out in ("out", "slow"))
    for one, two in zip(before, after, strict=True):
        if one.name == "cornered":
            assert two.time[-1] == pytest.approx(one.time[-1] * 3 / 2.5, rel=0.05)
            assert set(two.posture) == set(one.posture)
        elif one.name == "joined":
            np.testing.assert_array_equal(two.q, one.q)


def many(text):
    for node in range(5, 30):
        text = edited(text, "led_in", node, (0, 0, 0.4))
    return text


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t, "no target on a contour was moved"),
        (lambda t: edited(t, "joined", 0, (0, 0, 1)), "the start of contour 'joined' was moved"),
        (lambda t: edited(t, "joined", 41, (0, 0, 1)), "the end of contour 'joined' was moved"),
        (many, "targets were moved; for a part that is elsewhere"),
        (
            lambda t: re.sub(r'(wobjdata wPart:=\[FALSE,TRUE,"",\[\[)[\d.]+', r"\g<1>1201.0", t),
            "the part frame is 1.0000 mm and 0.0000 deg off; for a part that is elsewhere",
        ),
        (
            lambda t: re.sub(r"\n    MoveL [^\n]*vCut[^\n]*\n", "\n", t, count=1),
            "removed: 1 move left out in B, the first",
        ),
    ],
)
def test_what_is_no_touch_up_is_refused_in_one_line(folder, change, words):
    out = folder / "never"
    assert_refused(touch(folder, change((folder / "out/job.mod").read_text()), "--out", out), words)
    assert not out.exists()


def test_jobs_and_plans_that_do_not_fit_are_refused(folder):
    text = (folder / "out/job.mod").read_text()
    arcs = folder / "arcs.toml"
    arcs.write_text(WHOLE.replace("[program]", "[program]\narcs_mm = 0.02"))
    command = ("touch-up", folder / "edited.mod", "--plan", folder / "out/plan.json", "--job")
    (folder / "edited.mod").write_text(edited(text, "led_in", 21, (0, 0, 0.4)))
    assert_refused(run(*command, arcs), "jobs with arcs_mm cannot be touched up")
    other = folder / "elsewhere.toml"
    other.write_text(WHOLE.replace("[1200, -600, 500]", "[1201, -600, 500]"))
    assert_refused(run(*command, other), "its part is not at the place of that in")
