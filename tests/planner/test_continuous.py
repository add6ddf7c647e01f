"""plan() over continuous gamma: never worse than the refined grid, and every limit kept."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks._random_contours import ROBOTS, contour, cut, head
from benchmarks._random_contours import arm as arm_of

from kerfpath import (
    Band,
    Comfort,
    GammaWindow,
    NoFeasiblePath,
    Tilt,
    audit,
    fastest_speed,
    plan,
    plan_in_pieces,
    refine,
)
from kerfpath.cell import box_between, cell_of
from kerfpath.contour import Contour
from kerfpath.effort import changed_effort
from kerfpath.options import PlanOptions
from kerfpath.planner import layered_graph, subsampled
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.starts import Starts
from kerfpath.planner.task import planning_task
from kerfpath.plans import Proof
from kerfpath.refiner import Refinement
from kerfpath.setup import Setup

STEP = np.radians(4)
SAME = 1e-3
"""Relative: refinements stop where the model promises less than 1e-4 a step, from either side."""
TURN_LITTLE = [np.inf, np.inf, np.inf, 2.5, np.inf, 2.5]
TASKS = {
    "plain": {},
    "euclid": {"metric": "euclid"},
    "chebychev": {"metric": "chebychev"},
    "max": {"objective": "max"},
    "euclid max": {"metric": "euclid", "objective": "max"},
    "weights": {"weights": [1, 2, 3, 1, 1, 0]},
    "periodic": {"closure": "periodic"},
    "rotation": {"rotation": TURN_LITTLE},
    "both": {"closure": "periodic", "rotation": TURN_LITTLE},
    "tangent": {"frames": "tangent"},
    "wrist": {"comfort": Comfort(wrist=Band(margin=0.2, width=0.5, cost=0.2))},
    "limits": {"comfort": Comfort(limits=Band(margin=0.1, width=0.6, cost=0.1))},
    "tilt": {"tilt": Tilt(cone=0.1, steps=1, cost=0.1)},
}


@pytest.fixture(scope="module")
def nodes(circle):
    return circle.resample(count=61)


@pytest.fixture(scope="module")
def task(nodes, arm, tool, placement):
    where = {"tool": tool, "placement": placement, "gamma_step": STEP, "postures": (0, 1)}
    return (nodes, arm), where | {"speed": 0.1}


@pytest.mark.parametrize("name", TASKS)
def test_it_is_no_worse_than_the_refined_grid(task, name):
    options = task[1] | TASKS[name]
    grid = plan(*task[0], method="exact", refine=True, **options)
    made = plan(*task[0], **options)
    assert made.cost <= grid.cost * (1 + SAME)
    assert not made.proof.optimal
    assert made.proof.statement.startswith("the best motion found over continuous rotation: cost ")
    assert audit(made) == []
    if name == "rotation":
        turned = np.abs(np.cumsum(made.increments, axis=0)).max(axis=0)
        assert (turned <= np.array(TURN_LITTLE) + 1e-9).all()
    if made.settings.closure == "periodic":
        gap = (made.q[-1] - made.q[0]) / (2 * np.pi)
        np.testing.assert_allclose(gap, np.round(gap) * made.robot.endless, atol=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_no_path_on_the_grid_costs_less(seed, change_effort):
    """Whatever the task, and whether valleys are explored."""
    rng = np.random.default_rng(seed)
    robot = arm_of(str(rng.choice([*ROBOTS])))
    nodes = contour(rng, robot.reach).resample(count=int(rng.integers(9, 16)))
    options = {
        "gamma_step": np.radians(rng.choice([3.0, 6.0, 10.0])),
        "objective": str(rng.choice(["sum", "max"])),
        "metric": str(rng.choice(["manhattan", "euclid", "chebychev"])),
        "closure": "periodic" if nodes.closed and rng.random() < 0.5 else "free",
    }
    task = {"tool": head(), "placement": np.eye(4)}
    fastest = fastest_speed(nodes, robot, gamma_step=options["gamma_step"], **task).speed
    change_effort(explored=bool(rng.random() < 0.5))
    options |= task | {"speed": fastest * rng.uniform(0.5, 1.0)}
    try:
        grid = plan(nodes, robot, method="exact", **options)
    except NoFeasiblePath:
        assert options["closure"] == "periodic"  # the fastest speed need not close
        return
    assert plan(nodes, robot, **options).cost <= grid.cost * (1 + 1e-12)


@pytest.mark.parametrize("closure", ["free", "periodic"])
def test_a_motion_dearer_than_the_grid_gives_way_to_it(nodes, arm, tool, placement, closure):
    """Of a grid the best path that begins at another gamma costs more."""
    options = PlanOptions(gamma_step=STEP, closure=closure, certify=None)
    task = planning_task(nodes, Setup.of(arm, tool, placement), options, speed=0.1).whole()
    where = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    where |= {"method": "exact", "closure": closure}
    grid = plan(nodes, arm, **where)
    low, high = grid.gamma[0] + 1.5, grid.gamma[0] + 2.0
    window = GammaWindow(start=nodes.s[0], end=nodes.s[0], low=low, high=high)
    poor = plan(nodes, arm, gamma_windows=[window], **where)
    assert poor.cost > grid.cost
    starts = Starts(task, CollisionFreeSearch(task))
    starts.best = Refinement(
        plan=replace(poor, settings=task.settings),
        done=True,
        cost_before=poor.cost,
        cost_after=poor.cost,
        programs=0,
        statement="",
    )
    starts.hold_against_grid()
    assert starts.best.cost_after <= grid.cost
    assert not [issue for issue in audit(starts.best.plan) if issue.level == "error"]
    best = starts.best
    starts.hold_against_grid()  # nothing on the grid costs less now
    assert starts.best is best


def test_the_step_of_gamma_hardly_matters(task):
    costs = [
        plan(*task[0], **task[1] | {"gamma_step": np.radians(step)}).cost for step in (2, 5, 10)
    ]
    assert max(costs) <= min(costs) * (1 + 2e-3)


@pytest.mark.parametrize("name", ["plain", "max", "periodic", "rotation", "tangent", "wrist"])
def test_very_many_nodes_are_planned_from_every_few_of_them(
    circle, arm, tool, placement, name, monkeypatch, change_effort
):
    """As 121 nodes are here, and 25 of them; the cost may differ by what refinements leave."""
    options = {"tool": tool, "placement": placement, "gamma_step": STEP, "postures": (0, 1)}
    options = options | {"speed": 0.1} | TASKS[name]
    plain = plan(circle, arm, **options)
    lifted, lift = [], subsampled.SubsampledTask.at_all_nodes
    monkeypatch.setattr(
        subsampled.SubsampledTask,
        "at_all_nodes",
        lambda *of: lifted.append(lift(*of)) or lifted[-1],
    )
    change_effort(subsampled_from=100)
    made = plan(circle, arm, **options)
    assert len(lifted) == 1
    assert made.cost <= plain.cost * (1 + SAME)
    assert audit(made) == []


def test_every_few_nodes_are_those_of_the_whole(circle, arm, tool, placement, change_effort):
    change_effort(subsampled_from=100)
    asked = PlanOptions(gamma_step=STEP, frames="rotation-minimising")
    whole = planning_task(circle, Setup.of(arm, tool, placement), asked, speed=0.1)
    thin = subsampled.subsampled(whole)
    graph, nodes = thin.task.graph, [*range(0, 120, 5), 120]
    assert thin.nodes.tolist() == nodes
    assert thin.task.dt == 5 * whole.dt
    for k, node in enumerate(nodes):
        own, there = (g.part(i, i).q for g, i in ((graph, k), (whole.graph, node)))
        np.testing.assert_array_equal(own, there)
    index = np.zeros(len(nodes), dtype=int)
    some = thin.task.plan(index, 0.0, Proof(optimal=False, statement=""))
    # Gamma counts from the same directions.
    at = some.frames[:, :3, :3], (placement @ circle.frames(asked.frames))[nodes, :3, :3]
    np.testing.assert_allclose(*at, atol=1e-12)
    assert thin.at_all_nodes(replace(some, posture=np.arange(25) % 2)) is None


def solved(circle, arm, tool, placement, **options):
    """Return the plan, or what there is none for, and of how many nodes poses were solved."""
    nodes = []
    options = {"gamma_step": STEP, "postures": (0, 1), "speed": 0.1, "certify": None} | options
    try:
        made = plan(circle, arm, tool=tool, placement=placement, progress=nodes.append, **options)
    except NoFeasiblePath as broken:
        made = broken
    return made, sum(nodes)


def test_poses_of_very_many_nodes_are_solved_only_where_those_of_a_few_do_not_do(
    circle, arm, tool, placement, monkeypatch, change_effort
):
    space = circle, arm, tool, placement
    whole, nodes = solved(*space)
    assert nodes == len(circle) == 121
    change_effort(subsampled_from=100)
    made, nodes = solved(*space)
    assert nodes == 25
    assert sum(made.counts.values()) * 121 == sum(whole.counts.values()) * 25
    monkeypatch.setattr(subsampled.SubsampledTask, "at_all_nodes", lambda *of: None)
    again, nodes = solved(*space)
    assert nodes == 25 + 121
    np.testing.assert_array_equal(again.q, whole.q)
    assert again.counts == whole.counts


def test_a_node_without_a_pose_is_named_among_very_many(circle, arm, tool, placement):
    """Node 60 is one of the few that are looked at first, node 62 is not."""
    space, broken = (arm, tool, placement), []
    for node in (60, 62):
        points = circle.points.copy()
        points[node] += (0, 0, 30)
        far = replace(circle, points=points)
        broken.append(solved(far, *space)[0])
        with changed_effort(subsampled_from=100):
            broken.append(solved(far, *space)[0])
    for plain, sampled in (broken[:2], broken[2:]):
        assert isinstance(plain, NoFeasiblePath)
        assert str(sampled) == str(plain)
        assert sampled.node == plain.node


@pytest.mark.parametrize(("intervals", "every"), [(104, 4), (105, 5), (111, 3), (103, 5)])
def test_a_motion_along_some_nodes_is_one_along_all(
    circle, arm, tool, placement, change_effort, intervals, every
):
    change_effort(subsampled_from=100)
    asked, nodes = PlanOptions(gamma_step=STEP), circle.resample(count=intervals + 1)
    whole = planning_task(nodes, Setup.of(arm, tool, placement), asked, speed=0.1)
    thin = subsampled.subsampled(whole)
    assert (np.diff(thin.nodes) == every).all()
    assert intervals - every < thin.nodes[-1] <= intervals
    some = thin.task.plan(np.zeros(len(thin.nodes), int), 0.0, Proof(optimal=False, statement=""))
    along = 0.3 * thin.nodes / intervals  # gamma turns evenly, and so it does along all
    made = thin.at_all_nodes(replace(some, gamma=along, posture=np.zeros(len(along), int)))
    np.testing.assert_allclose(made.gamma, 0.3 * np.arange(intervals + 1) / intervals, atol=1e-12)
    assert made.time[-1] == whole.times[-1]
    periodic = replace(whole, settings=replace(whole.settings, closure="periodic"))
    assert (subsampled.subsampled(periodic) is None) == (intervals == 103)


def test_with_fewer_nodes_a_tilt_or_another_axis_no_node_is_left_out(
    circle, arm, tool, placement, change_effort
):
    def thin(robot=arm, **options):
        asked = PlanOptions(gamma_step=np.radians(30), **options)
        return subsampled.subsampled(
            planning_task(circle, Setup.of(robot, tool, placement), asked, speed=0.1)
        )

    assert thin() is None
    change_effort(subsampled_from=100)
    assert thin() is not None
    assert thin(tilt=Tilt(cone=0.1, steps=1)) is None
    rail = {"lower": 0.0, "upper": 0.1, "velocity": 1.0, "acceleration": 1.0, "step": 0.1}
    assert thin(arm.on_rail([0, 1, 0], **rail)) is None


def test_the_cost_is_that_of_the_motion(task):
    made = plan(*task[0], **task[1])
    assert made.cost == pytest.approx(np.abs(made.increments * made.settings.weights).sum())
    again = plan(*task[0], **task[1])
    np.testing.assert_array_equal(again.q, made.q)


def test_where_the_grid_is_proved_to_have_no_path_there_may_be_one(task):
    """At 1.2 times the fastest speed of the grid gamma may not step, but glide."""
    where = {name: task[1][name] for name in ("tool", "placement", "postures")}
    where["gamma_step"] = np.radians(10)
    fast = 1.05 * fastest_speed(*task[0], **where).speed
    with pytest.raises(NoFeasiblePath) as no:
        plan(*task[0], speed=fast, method="exact", **where)
    assert no.value.proved
    made = plan(*task[0], speed=fast, **where)
    assert audit(made) == []


def test_where_nothing_is_found_the_grid_says_why(task):
    with pytest.raises(NoFeasiblePath, match="on this grid of the rotation no admissible") as no:
        plan(*task[0], **task[1] | {"speed": 20.0})
    assert any(reason.startswith("velocity, joint") for reason in no.value.counts)


def posts(arm, tool, placement, count):
    turn = 2 * np.pi * np.arange(count) / count + 0.2
    places = np.c_[1.2 + 0.27 * np.cos(turn), 0.27 * np.sin(turn)]
    fixtures = {
        f"post {i}": box_between([x, y, 0.45], [x + 0.01, y + 0.01, 0.9])
        for i, (x, y) in enumerate(places)
    }
    return cell_of(arm, tool=tool, placement=placement, fixtures=fixtures, near_miss=2e-3)


@pytest.mark.slow
def test_a_motion_that_is_just_missed_is_looked_for_on_half_the_step():
    """With 2 deg the quickest motion that is found lacks 1.3 % of the speed; with 1 deg nothing."""
    drawn = cut("staubli_tx2_90xl", 55)
    made = plan(
        drawn.contour, drawn.robot, tool=drawn.tool, placement=np.eye(4), speed=drawn.speed,
        certify=None,
    )  # fmt: skip
    assert made.settings.gamma_step == PlanOptions().gamma_step
    assert not audit(made)


@pytest.mark.slow
@pytest.mark.parametrize(("closure", "many"), [("periodic", 800), ("free", 50)])
def test_it_goes_around_what_is_in_the_way(
    task, arm, tool, placement, closure, many, change_effort
):
    change_effort(subsampled_from=many)  # intervals: there are 60
    there = posts(arm, tool, placement, 6)
    options = task[1] | {"closure": closure}
    blind = plan(*task[0], **options)
    assert not there.clear(blind.q).all()
    made = plan(*task[0], cell=there, **options)
    assert there.clear(made.q).all()
    assert there.clear_motion(made.q[:-1], made.q[1:]).all()
    assert audit(made, cell=there) == []
    assert made.cost > blind.cost
    assert "clear in the cell" in made.proof.statement
    grid = plan(*task[0], cell=there, method="exact", refine=True, **options)
    # The motion is kept between clear samples about its path, the grid's is not.
    assert made.cost <= grid.cost * (1 + 5 * SAME)


@pytest.mark.slow
def test_what_clearance_costs_is_planned_on_the_grid_and_said(task, arm, tool, placement):
    there = posts(arm, tool, placement, 6)
    comfort = Comfort(clearance=Band(width=0.1, cost=1))
    made = plan(*task[0], cell=there, comfort=comfort, **task[1])
    assert made.proof.statement.startswith("planned on the grid: the cost of clearance is known")
    exact = plan(*task[0], cell=there, comfort=comfort, method="exact", **task[1])
    assert made.cost <= exact.cost


def test_a_graph_without_neighbours_is_planned_on_the_grid(task):
    """With one sample of gamma there is nothing between the samples; the answer stands."""
    options = task[1] | {"gamma_step": 2 * np.pi, "speed": 0.02}
    exact = plan(*task[0], method="exact", refine=True, **options)
    made = plan(*task[0], **options)
    assert made.cost <= exact.cost * (1 + SAME)


@pytest.mark.slow
def test_feed_and_pieces_go_on_from_it(task, arm, tool, placement):
    along = np.linspace(0, 0.16, 81)
    points = np.stack([np.minimum(along, 0.08), np.maximum(along - 0.08, 0), 0 * along], axis=1)
    lean = 0.3 / (1 + np.exp((0.08 - along) / 0.004))
    corner = Contour(points, np.c_[lean, 0 * along, -np.ones(81)], name="corner")
    options = {"tool": tool, "placement": placement, "gamma_step": np.radians(5)}
    dipped = plan(corner, arm, feed="dip", speed=0.4, **options)
    grid = plan(corner, arm, feed="dip", speed=0.4, method="exact", refine=True, **options)
    assert dipped.feed is not None
    assert dipped.time[-1] <= grid.time[-1] * (1 + SAME)
    assert audit(dipped) == []
    pieces = plan_in_pieces(corner, arm, speed=0.1, **options)
    refined = plan_in_pieces(corner, arm, speed=0.1, method="exact", refine=True, **options)
    assert all(a.cost <= b.cost for a, b in zip(pieces, refined, strict=True))
    assert any("continuous rotation" in piece.proof.statement for piece in pieces)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.2, 0.4])
def test_a_feed_reduction_between_the_samples_is_no_slower_than_from_the_grid(
    arm, tool, placement, speed
):
    along = np.linspace(0, 0.16, 81)
    points = np.stack([np.minimum(along, 0.08), np.maximum(along - 0.08, 0), 0 * along], axis=1)
    lean = 0.3 / (1 + np.exp((0.08 - along) / 0.004))
    corner = Contour(points, np.c_[lean, 0 * along, -np.ones(81)], name="corner")
    options = {"tool": tool, "placement": placement, "gamma_step": np.radians(5), "feed": "dip"}
    made = plan(corner, arm, speed=speed, **options)
    grid = plan(corner, arm, speed=speed, method="exact", refine=True, **options)
    # Both are local optima, whose times differ by 0.2 % at 0.2 m/s.
    assert made.time[-1] <= grid.time[-1] * 1.003
    if speed == 0.4:
        # Measured: 0.529 s instead of 0.537, of which 0.4 s are those of the speed asked for.
        assert made.time[-1] < 0.99 * grid.time[-1]
        assert "slowed down from paths over continuous rotation" in made.proof.statement


def test_a_refinement_stays_within_what_it_is_given(task):
    made = plan(*task[0], method="exact", **task[1])
    free = refine(made)
    low, high = made.gamma - 0.02, made.gamma + 0.02
    held = refine(made, within=(low[:, None], high[:, None]), first=0.005)
    assert held.done
    away = np.angle(np.exp(1j * (held.plan.gamma - made.gamma)))
    assert np.abs(away).max() <= 0.02 + 1e-9
    assert free.cost_after <= held.cost_after < made.cost


def test_a_kept_graph_gives_the_same_plan(task):
    space = {name: task[1][name] for name in ("tool", "placement", "gamma_step", "postures")}
    graph = layered_graph(*task[0], **space)
    np.testing.assert_array_equal(
        plan(*task[0], graph=graph, **task[1]).q, plan(*task[0], **task[1]).q
    )
