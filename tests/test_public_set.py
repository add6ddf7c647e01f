"""The public benchmark set: its files, its checker, and what is known of every instance."""

import ast
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from benchmarks import _public_instances, _public_planners, public_set
from benchmarks.public import check as checker
from benchmarks.public.outside import _chain

NAMES = checker.names()
FEW = ["random-ur_ur10e-00", "part-kuka_kr16_r1610_2-trim", "rail-03", "rail-and-table-01"]


def known(name):
    return json.loads((checker.KNOWN / f"{name}.json").read_text())


def a_motion(name):
    return checker.instance(name), np.array(known(name)["q"])


def test_there_are_as_many_instances_as_the_families_say():
    tasks = [checker.instance(name) for name in NAMES]
    robots = len(_public_instances.ROBOTS)
    counted = {family: robots * n for family, n in _public_instances.FAMILIES.items()}
    counted |= _public_instances.EXTERNAL
    assert len(NAMES) == sum(counted.values()) >= 200
    assert {f: sum(t.family == f for t in tasks) for f in counted} == counted
    assert sorted(file.stem for file in checker.KNOWN.glob("*.json")) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_what_is_known_of_an_instance_holds(name):
    task, best = checker.instance(name), known(name)
    assert task.name == best["instance"] == name
    assert (task.velocity > 0).all()
    assert (task.acceleration > 0).all()
    if best["cost"] is None:
        assert best["bound"] is None
        return
    assert "infeasible" not in best
    verdict = checker.check(task, best["q"])
    assert verdict.faults == []
    # A sum of some thousand numbers below one, added in the same order.
    assert verdict.cost == pytest.approx(best["cost"], rel=1e-12)
    assert best["bound"] is None or best["bound"] <= best["cost"]


def test_all_but_a_few_are_settled():
    best = [known(name) for name in NAMES]
    settled = sum(b["cost"] is not None or "infeasible" in b for b in best)
    assert settled >= 0.95 * len(NAMES)
    assert any(b["bound"] is not None for b in best)
    assert all("infeasible" in known(name) for name in NAMES if name.startswith("out-of-reach"))


@pytest.mark.parametrize("name", FEW)
def test_the_checker_and_the_library_have_the_same_kinematics(name):
    task = checker.instance(name)
    made = _public_planners.task_of(task)
    rng = np.random.default_rng(3)
    q = rng.uniform(-1, 1, (20, len(task.velocity)))
    reached = made.robot.forward(q) @ task.tool
    # Products of a dozen rotations, lengths of some metres.
    np.testing.assert_allclose(checker.forward(task, q), reached, atol=1e-12)


@pytest.mark.parametrize("name", FEW)
def test_the_chain_for_other_planners_has_the_same_kinematics(name):
    task = checker.instance(name)
    model = pinocchio.buildModelFromXML(_chain.urdf(task))
    data, tip = model.createData(), model.getFrameId("tip")
    rng = np.random.default_rng(4)
    columns = [joint.column for joint in _chain.joints(task)]
    for q in rng.uniform(-1, 1, (10, len(task.velocity))):
        pinocchio.framesForwardKinematics(model, data, q[columns])
        expected = checker.forward(task, q[None])[0]
        np.testing.assert_allclose(data.oMf[tip].homogeneous, expected, atol=1e-9)


@pytest.mark.parametrize("name", FEW)
def test_starts_of_other_planners_lie_at_the_first_node_and_follow_the_contour(name):
    task = checker.instance(name)
    found = _chain.starts(task, 6, np.random.default_rng(5))
    assert len(found) == 6
    motions = _chain.followed(task, found)
    assert len(motions) > 0
    for motion in motions:
        verdict = checker.check(task, motion)
        assert verdict.tip < 1e-8
        assert verdict.axis < 1e-8
        assert verdict.range == 0


def slowed(task, **limits):
    """The same instance with other limits."""
    return checker.Instance(**(vars(task) | limits))


@pytest.mark.parametrize("name", FEW)
def test_the_checker_sees_each_rule_broken_and_no_other(name):
    task, q = a_motion(name)
    verdict = checker.check(task, q)
    assert verdict.faults == []
    velocity, acceleration = verdict.velocity, verdict.acceleration
    for share, wrong in ((1 + 1e-5, False), (1 - 1e-5, True)):
        slower = slowed(task, velocity=task.velocity * velocity * share)
        assert [f.split()[0] for f in checker.check(slower, q).faults] == ["velocity"] * wrong
        slower = slowed(task, acceleration=task.acceleration * acceleration * share)
        assert [f.split()[0] for f in checker.check(slower, q).faults] == ["acceleration"] * wrong
    for off, wrong in ((5e-7, False), (2e-6, True)):
        moved = slowed(task, points=task.points + np.array([0, 0, off]))
        assert [f.split()[0] for f in checker.check(moved, q).faults] == ["tip"] * wrong
    x = np.cross(task.axes[4], [0.3, 0.4, 0.5])
    x /= np.linalg.norm(x)
    for off, wrong in ((5e-7, False), (2e-6, True)):
        axes = task.axes.copy()
        axes[4] = np.cos(off) * axes[4] + np.sin(off) * x
        faults = checker.check(slowed(task, axes=axes), q).faults
        assert [f.split()[0] for f in faults] == ["beam"] * wrong
    lower = np.where(task.endless, -np.inf, q.min(axis=0))
    assert checker.check(slowed(task, lower=lower), q).faults == []
    narrow = checker.check(slowed(task, lower=lower + 1e-6), q)
    assert [f.split()[0] for f in narrow.faults] == ["range"]


def test_an_endless_joint_is_judged_by_the_shorter_way():
    task, q = a_motion("random-kuka_kr16_r1610_2-00")
    assert task.endless[5]
    there, turned = checker.check(task, q), q.copy()
    turned[::2, 5] += 2 * np.pi
    around = checker.check(task, turned)
    assert around.faults == []
    assert around.cost == pytest.approx(there.cost, rel=1e-9)


@pytest.mark.parametrize("bad", [np.zeros((3, 6)), np.full((70, 6), np.nan), [[1.0], [2.0]]])
def test_what_is_no_motion_of_the_instance_is_refused(bad):
    task = checker.instance(FEW[0])
    with pytest.raises(ValueError, match=r"random-ur_ur10e-00: expected \(\d+, 6\) finite joint"):
        checker.check(task, bad)


def test_the_checker_runs_alone(tmp_path):
    (tmp_path / "check.py").write_text(Path(checker.__file__).read_text())
    for folder in ("instances", "known"):
        (tmp_path / folder).symlink_to(Path(checker.__file__).parent / folder)
    name = FEW[1]
    answers = {
        "right": known(name)["q"],
        "wrong": (np.array(known(name)["q"]) + 1e-3).tolist(),
        "none": None,
    }
    for file, q in answers.items():
        said = {"instance": name, "planner": "test", "q": q}
        (tmp_path / f"{file}.json").write_text(json.dumps(said))
    (tmp_path / "broken.json").write_text('{"instance": "random"}')

    def run(*files):
        command = [sys.executable, "-I", "check.py", *files]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    fine = run("right.json", "none.json")
    assert fine.returncode == 0
    assert "right: valid, cost" in fine.stdout
    assert "+0.00 % against the best known" in fine.stdout
    assert "none: no motion" in fine.stdout
    bad = run("right.json", "wrong.json", "broken.json", "absent.json")
    assert bad.returncode == 1
    assert "wrong: not valid: tip" in bad.stdout
    assert "broken: not valid" in bad.stdout
    assert "absent: not valid: FileNotFoundError" in bad.stdout


def test_the_checker_imports_numpy_alone():
    tree = ast.parse(Path(checker.__file__).read_text())
    imported = {
        name.split(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in (
            [node.module] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names]
        )
    }
    assert imported - set(sys.stdlib_module_names) == {"numpy"}
    assert len(Path(checker.__file__).read_text().splitlines()) < 400


def test_an_instance_is_drawn_again_as_it_is(tmp_path, monkeypatch):
    name = "random-kuka_kr16_r1610_2-00"
    before = checker.instance(name)
    monkeypatch.setattr(_public_instances, "INSTANCES", tmp_path)
    assert list(_public_instances.draw(name)) == [name]
    again = checker.instance(name, tmp_path)
    for key in ("origins", "turns", "lower", "upper", "velocity", "acceleration", "points", "axes"):
        np.testing.assert_allclose(getattr(again, key), getattr(before, key), rtol=1e-9, atol=1e-9)
    # The speed comes from a search whose sums may be rounded otherwise on another machine.
    assert again.interval == pytest.approx(before.interval, rel=1e-6)


def test_the_best_of_the_answers_is_kept_and_no_worse_one(tmp_path, monkeypatch):
    name = FEW[1]
    best = known(name)
    monkeypatch.setattr(public_set, "ANSWERS", tmp_path)
    (tmp_path / "other").mkdir()

    def after(**said):
        answer = {"instance": name, "planner": "other", "q": best["q"]} | said
        (tmp_path / "other" / f"{name}.json").write_text(json.dumps(answer))
        return public_set._best(name, dict(best))

    assert after() == best
    assert after(q=None) == best
    assert after(q=(np.array(best["q"]) + 1e-3).tolist()) == best
    kept = public_set._best(name, {})
    assert kept["cost"] is None  # the motion on file now is not valid
    found = public_set._best(name, best | {"cost": best["cost"] + 1})
    assert found["cost"] == best["cost"] + 1
    after()
    better = public_set._best(name, best | {"cost": best["cost"] + 1})
    assert better["cost"] == pytest.approx(best["cost"])
    assert better["by"] == "other"
    with pytest.raises(SystemExit, match="proved infeasible"):
        after(scope="every gamma", where={"node": 1}, says="")


@pytest.mark.parametrize("name", ["table-03", "table-04", "rail-05", "rail-10"])
def test_plans_with_external_axes_come_near_the_best_known(name, monkeypatch):
    words, options = _public_planners.PLANNERS["kerfpath"]
    without_bound = {"kerfpath": (words, replace(options, certify=None))}
    monkeypatch.setattr(_public_planners, "PLANNERS", without_bound)
    # One course after the other was taken here once, and cost 4 to 12 % more.
    answer = _public_planners.answer("kerfpath", name)
    verdict = checker.check(checker.instance(name), answer["q"])
    assert verdict.faults == []
    assert verdict.cost < 1.01 * known(name)["cost"]
