"""Layouts and lists of robots with external axes: what moves with what, and what placements are."""

import numpy as np
import pytest
import tomlkit

from commands import run
from conftest import pose
from jobs import ROBOT_AND_HEAD
from kerfpath import InputError, plan
from kerfpath.cad import read as read_drawing
from kerfpath.job import pose as pose_of
from kerfpath.job import prepare, read_job
from kerfpath.robots import robot
from kerfpath.study import (
    batch,
    contour_speeds,
    layout,
    pareto_of_job,
    plan_picked,
    read_pick,
    with_robot,
    write_layout,
    write_pareto,
)
from kerfpath.study.placing import placement_of
from kerfpath.study.placing.evaluators import is_estimated
from kerfpath.study.placing.place import middle_of, move_job, numbers_of, placed_text
from layouts import job_file, worth

RAIL = """
[[robot.external]]
name = "rail"
kind = "linear"
carries = "robot"
axis = [0, 1, 0]
lower_mm = {low}
upper_mm = {high}
velocity_mm_s = 1000
acceleration_mm_s2 = 2000
step_mm = 150
"""
TABLES = """
[[robot.external]]
name = "tilt"
kind = "rotary"
carries = "part"
axis = [0, 1, 0]
point_mm = [1300, 0, 400]
lower_deg = -20
upper_deg = 20
velocity_deg_s = 60
acceleration_deg_s2 = 100
[[robot.external]]
name = "table"
kind = "rotary"
carries = "part"
axis = [0, 0, 1]
point_mm = [1300, 0, 500]
endless = true
velocity_deg_s = 120
acceleration_deg_s2 = 200
"""
CELL = """
[cell]
near_miss_mm = 1
part = false
"""
FIXTURE = """
[[cell.fixture]]
name = "{name}"
size_mm = [20, 20, 20]
xyz_mm = [1300, 400, 100]
{on}
"""
JOB = """
[part]
file = "line.csv"
xyz_mm = [1300, 0, 500]
rpy_deg = [0, 0, 0]
[[contour]]
pick = "line"
speed_m_min = 12
count = {count}
[plan]
method = "{method}"
gamma_step_deg = 15
posture = "front/up"
refine = false
[program]
language = "none"
"""
BOTH = {"x_mm": 30.0, "y_mm": -70.0, "z_mm": 40.0, "yaw_deg": 20.0, "tilt_x_deg": 8.0}
BASE = {"base_x_mm": 60.0, "base_y_mm": -20.0, "base_yaw_deg": 8.0}


def line_job(folder, axes, *, half=150, count=9, method="continuous", more=""):
    """A job of one straight cut along y in the air, for a robot with external axes."""
    job_file(folder, f"contour,x_mm,y_mm,z_mm,nx,ny,nz\nline,0,{-half},0,0,0,1\n"
             f"line,0,0,0,0,0,1\nline,0,{half},0,0,0,1\n", "line.csv")  # fmt: skip
    text = ROBOT_AND_HEAD.replace("[tool]", f"{axes}\n[tool]", 1)
    return job_file(folder, text + JOB.format(count=count, method=method) + more)


def moved(path, offsets):
    job = read_job(path)
    middle = middle_of(job, [c.candidates[0].nodes for c in prepare(job).contours])
    numbers = numbers_of(job, offsets, middle)
    return job, move_job(job, numbers), numbers, middle


def seen_from_part(job, q):
    return np.linalg.inv(job.placement) @ job.robot.forward(q)


def some_joints(job, count=20):
    """Joint vectors with the rail within 1 m and tilt and table anywhere."""
    return np.random.default_rng(5).uniform(-1, 1, (count, job.robot.joints))


def fixtures(*names_and_axes):
    rows = (
        FIXTURE.format(name=name, on=f'on = "{on}"' if on else "") for name, on in names_and_axes
    )
    return CELL + "".join(rows)


ALL = fixtures(("post", ""), ("jaw", "table"), ("bracket", "tilt"), ("magazine", "rail"))


def test_a_base_that_moves_takes_its_rail_along_and_leaves_all_else(tmp_path):
    path = line_job(tmp_path, RAIL.format(low=-500, high=500) + TABLES, more=ALL)
    job, there, _, _ = moved(path, BASE)
    q = some_joints(job)
    # Seen from the part, the flange is where the robot has been shifted to: with the part at x
    # at C(x) P, that is inv(C P) B F, whatever carries the part.
    from kerfpath.robots.external_axes import carried

    turn = np.radians(8.0)
    B = pose([0.06, -0.02, 0], [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0],
                                [0, 0, 1]])  # fmt: skip
    axes, x = job.robot.externals, q[:, 6:]
    of_part, of_robot = carried(axes, x, "part"), carried(axes, x, "robot")
    arm = job.robot.alone().forward(q[:, :6])
    expected = np.linalg.inv(of_part @ job.placement) @ B @ of_robot @ arm
    # Numbers are rounded to 1e-4 mm and 1e-6 deg, a few metres from the base.
    np.testing.assert_allclose(seen_from_part(there, q), expected, atol=1e-6)
    by_name = {f.name: (f, g) for f, g in zip(job.cell.fixture, there.cell.fixture, strict=True)}
    before, after = by_name["magazine"]
    assert before == after
    for name in ("post", "jaw", "bracket"):
        before, after = (pose_of(f.xyz_mm, f.rpy_deg) for f in by_name[name])
        np.testing.assert_allclose(B @ after, before, atol=1e-6)


def test_an_axis_that_moves_takes_the_part_and_what_it_carries_along(tmp_path):
    more = ALL + '\n[layout]\nmove = "{}"\n'
    by_move = {}
    for name in ("part", "tilt", "table"):
        path = line_job(tmp_path, RAIL.format(low=-500, high=500) + TABLES, more=more.format(name))
        by_move[name] = moved(path, BOTH)
    job, there, numbers, _ = by_move["tilt"]
    M = there.placement @ np.linalg.inv(job.placement)
    q = some_joints(job)
    # With tilt and table moved by M, all that carries the part is conjugated by it: M C(x) P.
    from kerfpath.robots.external_axes import carried

    axes, x = job.robot.externals, q[:, 6:]
    flange = carried(axes, x, "robot") @ job.robot.alone().forward(q[:, :6])
    expected = np.linalg.inv(M @ carried(axes, x, "part") @ job.placement) @ flange
    np.testing.assert_allclose(seen_from_part(there, q), expected, atol=1e-6)
    assert ("robot", "external", 0, "axis") not in numbers, "the rail stays"
    # The part alone, or its table alone, moves on what stays below it.
    for name, stays in (("part", (0, 1, 2)), ("table", (0, 1)), ("tilt", (0,))):
        before, after, found, _ = by_move[name]
        assert {key[2] for key in found if key[1] == "external"} == {0, 1, 2} - {*stays}
        for i in stays:
            assert after.robot.externals[i] is not None
            np.testing.assert_array_equal(
                after.robot.externals[i].point, before.robot.externals[i].point
            )
    # Jaws go with the part that they hold, what is on other axes does not.
    going = {
        name: {f.name for f, g in zip(b.cell.fixture, a.cell.fixture, strict=True) if f != g}
        for name, (b, a, _, _) in by_move.items()
    }
    assert going == {"part": {"jaw", "bracket"}, "table": {"post", "jaw"},
                     "tilt": {"post", "jaw", "bracket"}}  # fmt: skip


def test_a_placed_job_is_the_one_that_was_evaluated(tmp_path):
    more = ALL + '\n[layout]\nmove = "table"\nstanding = ["post"]\n'
    path = line_job(tmp_path, RAIL.format(low=-500, high=500) + TABLES, more=more)
    job, there, numbers, _ = moved(path, BOTH | BASE)
    out = tmp_path / "out"
    out.mkdir()
    (out / "placed.toml").write_text(placed_text(job, numbers, out, "moved"))
    again = read_job(out / "placed.toml")
    for one, other in zip(again.robot.externals, there.robot.externals, strict=True):
        # A direction of length 1 to 1e-9 is normalised once more.
        np.testing.assert_allclose(one.axis, other.axis, rtol=0, atol=1e-15)
        np.testing.assert_array_equal(one.point, other.point)
    np.testing.assert_array_equal(again.placement, there.placement)
    assert again.cell.fixture == there.cell.fixture
    file = tomlkit.parse((out / "placed.toml").read_text())
    assert file["robot"]["external"][0]["axis"] == [0, 1, 0]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("rail", "layout.move: expected one of 'part', 'tilt', 'table', got \"rail\"; vary base"),
        ("chuck", "layout.move: expected one of 'part', 'tilt', 'table', got \"chuck\"; name one"),
    ],
)
def test_what_cannot_be_moved_is_refused_in_one_line(tmp_path, name, said):
    axes = RAIL.format(low=-500, high=500) + TABLES
    path = line_job(tmp_path, axes, more=f'\n[layout]\nmove = "{name}"\n')
    with pytest.raises(InputError) as refused:
        read_job(path)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_an_axis_without_travel_leaves_a_placement_its_worth(tmp_path):
    (tmp_path / "a").mkdir()
    alone = line_job(tmp_path / "a", "")
    still = line_job(tmp_path, RAIL.format(low=0, high=0))
    offsets = {"x_mm": 40.0, "yaw_deg": 15.0}
    for goal in ("motion", "speed"):
        one = worth(alone, offsets, goal=goal, exact=True, whole=True)
        two = worth(still, offsets, goal=goal, exact=True, whole=True)
        # The same search, with a joint more that stands still; both are refined to 1e-4.
        assert two.value == pytest.approx(one.value, rel=2e-4)


def test_no_test_before_the_plan_refuses_what_the_rail_reaches(tmp_path):
    """A cut 4.4 m long beside a rail: the arm alone reaches half of it, wherever it stands."""
    path = line_job(tmp_path, RAIL.format(low=-1500, high=1500), half=2200, count=21)
    (tmp_path / "a").mkdir()
    alone = worth(line_job(tmp_path / "a", "", half=2200, count=21), goal="motion")
    assert alone.status == "unreachable"
    known = worth(path, goal="motion")
    planned = worth(path, goal="motion", exact=True)
    assert known.feasible
    assert planned.value is not None
    # Along the first course, without accelerations: near to what the plan comes to.
    assert known.estimate == pytest.approx(planned.value, rel=0.25)
    # Farther away than the arm reaches, no rail helps, and a placement is refused for sure.
    away = worth(path, {"x_mm": 3000.0}, goal="motion")
    assert away.status == "unreachable"
    assert not is_estimated(away)
    ends = placement_of(prepare(read_job(path)))
    assert [out.size for out in ends.out_of_reach({})] == [0]
    assert [out.size for out in ends.out_of_reach({"x_mm": 3000.0})] == [21]


@pytest.fixture(scope="module")
def placed(tmp_path_factory):
    """The best of a few placements, and its files."""
    folder = tmp_path_factory.mktemp("layout")
    path = line_job(folder, RAIL.format(low=-150, high=150))
    found = layout(
        path, store=folder / "s.sqlite", goal="motion", ranges={"x_mm": (-250.0, 150.0)},
        evaluations=8, map_points=0, seed=1, processes=1,
    )  # fmt: skip
    write_layout(found, folder / "out")
    return found, folder


def test_the_best_placement_is_no_worse_than_the_given_one_and_is_planned(placed):
    found, folder = placed
    assert found.off_grid
    assert found.best.result.value <= found.before.value
    planned = [t.result.value for t in found.tried if t.result.value is not None]
    assert min(planned) == found.best.result.value
    job = read_job(folder / "out" / "placed.toml")
    (request,) = prepare(job).contours
    made = plan(
        request.candidates[0].nodes, job.robot, tool=job.tool, placement=job.placement,
        speed=request.candidates[0].speed, options=request.options.without_penalties,
    )  # fmt: skip
    # The same search of the same job.
    assert made.cost == pytest.approx(found.best.result.value, rel=1e-9)


@pytest.mark.slow
def test_the_placed_job_passes_its_audit(placed):
    _, folder = placed
    done = run("plan", str(folder / "out" / "placed.toml"), "--out", str(folder / "plan"))
    assert done.returncode == 0, done.stderr


def test_on_a_grid_of_the_axes_bounds_hold(tmp_path):
    path = line_job(tmp_path, RAIL.format(low=-150, high=150), method="exact")
    whole = [(0, 0, 8)]
    for offsets in ({}, {"x_mm": 60.0, "yaw_deg": 10.0}):
        solved = worth(path, offsets, goal="motion", exact=True, whole=True)
        bound = worth(path, offsets, goal="motion", stretches=whole).bound
        assert solved.stage == "exact"
        assert bound <= solved.value * (1 + 1e-9)


def test_other_robots_stand_on_the_axes_of_the_job(tmp_path):
    path = line_job(tmp_path, RAIL.format(low=-150, high=150))
    job = read_job(path)
    part = read_drawing(job.part_file)
    own = robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
    same = with_robot(job, own)
    for name in ("lower", "upper", "velocity", "acceleration", "endless"):
        np.testing.assert_array_equal(getattr(same.robot, name)[6:], getattr(job.robot, name)[6:])
    assert same.robot.externals == job.robot.externals
    (found,) = contour_speeds(job, part)
    assert found.reached == 1.0
    assert found.fastest > 0
    with pytest.raises(InputError, match=r"its accelerations are not known, .* no course of rail"):
        with_robot(job, robot("abb_irb4600_60_205"))
    small = robot("staubli_tx60", acceleration_ratio="iontec_20_to_70kg")
    (out,) = contour_speeds(with_robot(job, small), part)
    assert out.reason == "no pose at 9 of 9 nodes, at any sampled value of rail"


@pytest.mark.slow
def test_a_plan_picked_from_a_front_is_the_one_that_was_found(tmp_path):
    path = line_job(tmp_path, RAIL.format(low=-150, high=150))
    front = pareto_of_job(
        path, store=tmp_path / "s.sqlite", criteria=("displacement", "range_1"), runs=6, processes=1
    )
    write_pareto(front, tmp_path)
    for number, values in zip(front.front.numbers, front.front.values, strict=True):
        pick = read_pick(tmp_path, path, str(number))
        _, outcome = plan_picked(path, pick, refine=False)
        (cut,) = outcome.cuts
        assert cut.passed
        criteria = cut.plan.criteria
        assert criteria.range[0] == pytest.approx(values[1], rel=1e-9)


@pytest.mark.slow
def test_a_batch_plans_robots_with_external_axes(tmp_path):
    path = line_job(tmp_path, RAIL.format(low=-150, high=150))
    (done,) = batch([path], tmp_path / "out", processes=1)
    assert done.passed, done.reason
    assert (done.folder / "plan.json").exists()
