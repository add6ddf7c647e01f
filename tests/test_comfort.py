"""Comfort: its measures by other means, plans against brute force, margins held and audited."""

import json
import re
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import naive
from conftest import ROOT, pose, rebuilt
from kerfpath import (
    Band,
    Comfort,
    InputError,
    NoFeasiblePath,
    audit,
    fastest_speed,
    plan,
    plan_in_pieces,
    robot,
    shortest_path,
)
from kerfpath.auditor import chain_of, checks
from kerfpath.auditor.margins import margins
from kerfpath.cell import CollisionChecker, box_between, cell_of
from kerfpath.comfort import MEASURES, jacobian, measure, measures
from kerfpath.job import read_plan_file
from kerfpath.job.plan_file import plan_document, plan_entry, plan_text
from kerfpath.planner import layered_graph
from kerfpath.robots import Arm, Robot, RobotLimits
from kerfpath.tilt import Tilt

STEP = np.radians(30)
on_grid = partial(plan, method="exact")
FIVE = Robot(
    id="five",
    arm=Arm(
        kinematics="five",
        geometry={"a1": 0.3, "a2": -0.1, "b": 0.05, "c1": 0.7, "c2": 0.9, "c3": 0.8, "c4": 0.12},
    ),
    limits=RobotLimits(
        lower=np.radians([-170, -90, -60, -180, -180]),
        upper=np.radians([170, 120, 170, 180, 180]),
    ),
)


def placed(arm):
    """The arm with signs, offsets, foot and flange of its own, and an offset b."""
    rng, n = np.random.default_rng(5), arm.joints
    foot, end = pose([0.1, 0.2, 0.3]), pose([0.02, 0.0, 0.05])
    foot[:3, :3], end[:3, :3] = Rotation.random(2, rng=rng).as_matrix()
    geometry = arm.geometry | ({"b": 0.04} if "b" in arm.geometry else {})
    sign, offset = rng.choice([-1.0, 1.0], n), rng.uniform(-3, 3, n)
    changes = {"geometry": geometry, "sign": sign, "offset": offset}
    return rebuilt(arm, T_base_foot=foot, T_end_flange=end, **changes)


ARMS = {
    "opw": robot("abb_irb4600_60_205"),
    "opw, placed": placed(robot("kuka_kr16_2")),
    "opw, coupled": robot("abb_irb2400_155"),
    "ur": robot("ur_ur10e"),
    "ur, placed": placed(robot("ur_ur5")),
    "five": FIVE,
    "five, placed": placed(FIVE),
}
TOOL = pose([0.1, 0.05, 0.15], Rotation.from_rotvec([0.3, 0.7, 0]).as_matrix())


def some(arm, count=200):
    return np.random.default_rng(1).uniform(-3, 3, (count, arm.joints))


@pytest.mark.parametrize("name", ARMS)
def test_the_jacobian_is_that_of_the_joint_chain(name):
    arm, q = ARMS[name], some(ARMS[name])
    tool = replace(chain_of(arm), tip=chain_of(arm).tip @ TOOL)
    # Both are exact: rounding of metres only.
    np.testing.assert_allclose(jacobian(arm, q, tool=TOOL), tool.jacobian(q)[1], atol=1e-13)


@pytest.mark.parametrize("name", [name for name in ARMS if "five" not in name])
def test_the_determinant_is_the_product_of_the_singularities(name):
    arm = ARMS[name]
    found, g = measures(arm, some(arm)), arm.geometry
    links = g["a2"] * g["a3"] if "ur" in name else g["c2"] * np.hypot(g["a2"], g["c3"])
    want = links * np.sin(found["elbow"]) * found["shoulder"] * np.sin(found["wrist"])
    np.testing.assert_allclose(found["manipulability"], want, atol=1e-13)


def test_elbow_and_shoulder_are_what_the_wrist_centre_shows():
    arm = rebuilt(ARMS["opw"], geometry=ARMS["opw"].geometry | {"b": 0.07})
    g, q = arm.geometry, some(arm)
    T, found = arm.forward(q), measures(arm, q)
    centre = T[:, :3, 3] - g["c4"] * T[:, :3, 2]
    r = np.hypot(centre[:, 0], centre[:, 1])
    # A root near zero loses half of the digits.
    np.testing.assert_allclose(found["shoulder"], np.sqrt(r**2 - g["b"] ** 2), atol=1e-7)
    q1 = q[:, 0]
    joint = [g["a1"] * np.cos(q1) - g["b"] * np.sin(q1), g["a1"] * np.sin(q1) + g["b"] * np.cos(q1)]
    reach = np.linalg.norm(centre - np.stack([*joint, np.full(len(q), g["c1"])], axis=1), axis=1)
    k = np.hypot(g["a2"], g["c3"])
    cosine = np.abs(reach**2 - g["c2"] ** 2 - k**2) / (2 * g["c2"] * k)
    np.testing.assert_allclose(np.cos(found["elbow"]), cosine, atol=1e-12)


def test_singular_poses_by_hand():
    arm = ARMS["opw"]
    stretched = arm.offset[2] - np.arctan2(arm.geometry["a2"], arm.geometry["c3"])
    q = np.array([[0.3, 0.2, stretched, 1.0, np.pi, 2.0], [0, 0.4, stretched + 0.1, 0, -0.2, 0]])
    found = measures(arm, q)
    np.testing.assert_allclose(found["wrist"], [0, 0.2], atol=1e-15)
    np.testing.assert_allclose(found["elbow"], [0, 0.1], atol=1e-15)
    assert found["manipulability"][0] < 1e-15


def test_the_nearest_limit_is_that_of_any_joint_or_coupling():
    arm = ARMS["opw, coupled"].with_limits(endless=[0, 0, 0, 1, 0, 1])
    q = np.random.default_rng(2).uniform(arm.lower, arm.upper, (50, 6))
    want = []
    for row in q:
        room = [min(row[i] - arm.lower[i], arm.upper[i] - row[i]) for i in (0, 1, 2, 4)]
        (c,) = arm.couplings
        want.append(min(*room, c.row @ row - c.lower, c.upper - c.row @ row))
    found = measure("limits", arm, q)
    np.testing.assert_allclose(found, want, atol=1e-15)
    assert (found < 0).any()
    endless = arm.with_limits(endless=np.ones(6, bool), couplings=())
    assert np.isinf(measure("limits", endless, q)).all()


@pytest.mark.parametrize("name", ARMS)
def test_the_audit_measures_the_same(name):
    arm, q = ARMS[name], some(ARMS[name], 40)
    found = measures(arm, q, tool=TOOL)
    for k, row in enumerate(q):
        asked = Comfort(**{name: Band(margin=1e-3) for name in found})
        settings = SimpleNamespace(comfort=asked, floor=None)
        one = SimpleNamespace(robot=arm, q=row[None], T_flange_tip=TOOL, settings=settings)
        told = {c.code: 1e-3 - c.value for c in margins(one, chain_of(arm))}
        for measured, value in found.items():
            # Intersections of axes and singular values: a few digits less than double precision.
            assert told[f"{measured}-margin"] == pytest.approx(value[k], abs=1e-10)


def test_what_an_arm_does_not_have_is_refused():
    assert list(measures(FIVE, some(FIVE))) == ["elbow", "shoulder", "limits", "manipulability"]
    with pytest.raises(InputError, match=r"wrist: no wrist singularity is defined .*five-axis"):
        measure("wrist", FIVE, some(FIVE))
    with pytest.raises(InputError, match=r"expected one of wrist, elbow, .* got 'knee'"):
        measure("knee", FIVE, some(FIVE))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Band(margin=-1), "margin: must not be negative"),
        (lambda: Band(width=np.nan), "width: expected a finite number"),
        (lambda: Band(cost=2), "cost: needs a width"),
        (lambda: Comfort(wrist=5), "wrist: expected a Band, got 5"),
        (lambda: Comfort(elbow=Band(margin=5)), r"elbow: the margin must be below 1\.571 rad"),
        (lambda: Comfort(clearance=Band(margin=0.1)), "near-miss distance of the cell"),
    ],
)
def test_bad_comfort_is_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.fixture(scope="module")
def small(circle, arm, tool, placement):
    """A circle of 13 nodes and its coarse graph, small enough for brute force."""
    nodes = circle.resample(count=13)
    where = {"tool": tool, "placement": placement, "gamma_step": STEP}
    graph = layered_graph(nodes, arm, postures=(0, 1), **where)
    return nodes, arm, where | {"graph": graph, "speed": 0.05, "method": "exact"}


EVERY = Comfort(
    wrist=Band(margin=0.05, width=0.5, cost=3),
    elbow=Band(width=1.2, cost=1),
    shoulder=Band(width=1.5, cost=2),
    limits=Band(margin=0.02, width=0.6, cost=1.5),
    manipulability=Band(width=1.0, cost=0.5),
)


def by_hand(arm, q, comfort):
    """What vertices cost, infinite where they are too near, straight from the definitions."""
    total = np.zeros(len(q))
    for name, band in comfort.bands.items():
        x = measure(name, arm, q)
        price = [band.cost * (1 - (v - band.margin) / band.width) if band.width else 0 for v in x]
        total += np.where(x < band.margin, np.inf, np.maximum(price, 0))
    return total


def brute(small, comfort, objective, closure, more=0.0):
    nodes, arm, options = small
    graph, dt = options["graph"], nodes.length / 12 / options["speed"]
    price = by_hand(arm, graph.q, comfort) + more
    open_ = np.isfinite(price)
    layer = np.repeat(np.arange(13), np.diff(graph.start))[open_]
    start = np.concatenate([[0], np.cumsum(np.bincount(layer, minlength=13))])
    limits = {"velocity": arm.velocity, "acceleration": arm.acceleration, "eta_v": 1, "eta_a": 1}
    weights = 1 / (arm.velocity * dt)
    found = naive.second_order(
        graph.q[open_], start, closure, endless=arm.endless, vertex_cost=price[open_], dt=dt,
        weights=weights, metric="manhattan", objective=objective, **limits,
    )  # fmt: skip
    return found[0]


@pytest.mark.parametrize("closure", ["free", "periodic"])
@pytest.mark.parametrize("objective", ["sum", "max"])
def test_a_plan_with_comfort_is_the_brute_optimum(small, objective, closure):
    nodes, arm, options = small
    made = plan(nodes, arm, comfort=EVERY, objective=objective, closure=closure, **options)
    want = brute(small, EVERY, objective, closure)
    assert made.proof.optimal
    assert made.cost == pytest.approx(want, rel=1e-12)
    nodes_cost = by_hand(arm, made.q, EVERY)
    path = np.abs(made.increments * made.settings.weights).sum(axis=1)
    both = path.sum() + nodes_cost.sum() if objective == "sum" else max(*path, *nodes_cost)
    assert made.cost == pytest.approx(both, rel=1e-12)
    assert nodes_cost.max() > 0  # it did have something to weigh


def test_what_tilt_costs_and_comfort_add_up(small):
    nodes, arm, options = small
    where = {key: options[key] for key in ("tool", "placement", "gamma_step")}
    tilt = Tilt(cone=0.3, steps=1, cost=0.7)
    graph = layered_graph(nodes, arm, tilt=tilt, postures=(0,), **where)
    tilted = options | {"graph": graph}
    made = plan(nodes, arm, tilt=tilt, comfort=EVERY, **tilted)
    lean = tilt.cost * np.hypot(*graph.tilt[graph.variant].T)
    assert made.cost == pytest.approx(brute((nodes, arm, tilted), EVERY, "sum", "free", lean))
    better = plan(nodes, arm, tilt=tilt, comfort=EVERY, refine=True, **tilted)
    path = np.abs(better.increments * better.settings.weights).sum()
    price = by_hand(arm, better.q, EVERY).sum() + tilt.cost * np.hypot(*better.tilt.T).sum()
    assert better.cost == pytest.approx(path + price, rel=1e-9)


def test_no_margin_and_no_cost_change_nothing(small):
    nodes, arm, options = small
    plain = plan(nodes, arm, **options)
    none = Comfort(wrist=Band(), elbow=Band(width=1), limits=Band(), manipulability=Band())
    made = plan(nodes, arm, comfort=none, **options)
    np.testing.assert_array_equal(made.q, plain.q)
    assert made.cost == plain.cost
    assert made.counts == plain.counts


@pytest.mark.parametrize("name", list(MEASURES))
def test_a_tighter_margin_never_costs_less_until_there_is_no_way(small, name):
    nodes, arm, options = small
    nearest = plan(nodes, arm, **options).criteria.nearest[name][0]
    every = measure(name, arm, options["graph"].q)
    last = 0.0
    for margin in [0.5 * nearest, nearest, *np.linspace(nearest, 1.01 * every.max(), 5)[1:]]:
        comfort = Comfort(**{name: Band(margin=min(margin, MEASURES[name].most * 0.9999))})
        try:
            made = plan(nodes, arm, comfort=comfort, **options)
        except NoFeasiblePath:
            last = np.inf
            continue
        assert made.cost >= last * (1 - 1e-12)
        assert made.criteria.nearest[name][0] >= margin
        assert audit(made, path_tolerance=1, axis_tolerance=9) == []
        last = made.cost


def test_an_infeasible_answer_counts_what_the_margin_removed(small):
    nodes, arm, options = small
    with pytest.raises(NoFeasiblePath, match=r"wrist singularity margin: \d+") as broken:
        plan(nodes, arm, comfort=Comfort(wrist=Band(margin=1.57)), **options)
    assert sum(broken.value.counts.values()) == 12 * 8
    graph = options["graph"]
    thin = layered_graph(
        nodes, arm, postures=(0, 1), comfort=Comfort(limits=Band(margin=1.0)),
        **{k: options[k] for k in ("tool", "placement", "gamma_step")},
    )  # fmt: skip
    keep = measure("limits", arm, graph.q) >= 1.0
    np.testing.assert_array_equal(thin.q, graph.q[keep])
    layer = np.repeat(np.arange(13), np.diff(graph.start))
    np.testing.assert_array_equal(np.diff(thin.start), np.bincount(layer[keep], minlength=13))
    kept = {*zip(layer[keep], graph.sample[keep], graph.posture[keep], strict=True)}
    whole = {*zip(layer, graph.sample, graph.posture, strict=True)}
    assert thin.counts()["joint limit margin"] == len(whole) - len(kept)
    assert thin.counts()["admitted"] == len(kept)


@pytest.fixture(scope="module")
def posted(small, tool, placement):
    turn = np.arange(6) * np.pi / 3 + 0.2
    places = np.c_[1.2 + 0.33 * np.cos(turn), 0.33 * np.sin(turn)]
    posts = {
        f"post {i}": box_between([x, y, 0.45], [x + 0.01, y + 0.01, 0.9])
        for i, (x, y) in enumerate(places)
    }
    return cell_of(small[1], tool=tool, placement=placement, fixtures=posts, near_miss=2e-3)


@pytest.mark.parametrize("closure", ["free", "periodic"])
def test_a_near_miss_costs_and_the_plan_is_the_best_of_all(small, posted, closure):
    nodes, arm, options = small
    comfort = Comfort(clearance=Band(width=0.1, cost=5), wrist=EVERY.wrist)
    made = plan(nodes, arm, cell=posted, comfort=comfort, closure=closure, **options)
    graph = options["graph"]
    price = CollisionChecker(posted, graph.q, comfort=0.1, comfort_cost=5).price(
        np.arange(len(graph.q))
    )
    price += by_hand(arm, graph.q, comfort)
    open_ = np.isfinite(price)
    layer = np.repeat(np.arange(13), np.diff(graph.start))[open_]
    start = np.concatenate([[0], np.cumsum(np.bincount(layer, minlength=13))])
    best = shortest_path(
        graph.q[open_], start, dt=made.dt, velocity=arm.velocity, acceleration=arm.acceleration,
        endless=arm.endless, vertex_cost=price[open_], closure=closure,
    )  # fmt: skip
    q = graph.q[open_][start[:-1] + best.index]
    assert posted.clear_motion(q[:-1], q[1:]).all()  # so that nothing is better than it
    assert made.cost == pytest.approx(best.cost, rel=1e-9)  # distances are found to 1e-9 m
    blind = plan(nodes, arm, cell=posted, closure=closure, **options)
    assert made.cost > blind.cost
    with pytest.raises(InputError, match="clearance: is measured in a cell"):
        plan(nodes, arm, comfort=comfort, **options)
    # Off the grid it is not known what clearance costs, so no motion there is looked for.
    with pytest.raises(NoFeasiblePath, match="no admissible"):
        plan(nodes, arm, cell=posted, comfort=comfort, refine=True, **options | {"speed": 50.0})


@pytest.fixture(scope="module")
def fine(circle, arm, tool, placement):
    where = {"tool": tool, "placement": placement, "gamma_step": np.radians(5)}
    nodes = circle.resample(count=61)
    graph = layered_graph(nodes, arm, postures=(0, 1), **where)
    return nodes, arm, where | {"graph": graph}


# There is little room above the plain plan's shoulder: 43 um at the worst node.
@pytest.mark.parametrize(("name", "more"), [("wrist", 0.01), ("limits", 0.01), ("shoulder", 2e-5)])
def test_a_refined_plan_keeps_the_margins(fine, name, more):
    nodes, arm, options = fine
    plain = on_grid(nodes, arm, speed=0.1, **options)
    nearest = plain.criteria.nearest[name][0]
    comfort = Comfort(**{name: Band(margin=nearest + more)})
    made = on_grid(nodes, arm, speed=0.1, comfort=comfort, **options)
    better = on_grid(nodes, arm, speed=0.1, comfort=comfort, refine=True, **options)
    assert better.cost <= made.cost
    assert better.criteria.nearest[name][0] >= nearest + more
    assert audit(better) == []
    if name != "shoulder":  # no range of a joint keeps that
        assert "refined off the grid" in better.proof.statement
    near = next(c for c in checks(replace(plain, settings=made.settings)) if "margin" in c.code)
    assert not near.ok
    assert near.value == pytest.approx(more, abs=1e-10)


def test_a_refinement_is_taken_only_where_it_costs_no_more_in_all(fine):
    nodes, arm, options = fine
    for cost in (1e-4, 0.05):
        comfort = Comfort(wrist=Band(width=0.8, cost=cost))
        made = on_grid(nodes, arm, speed=0.1, comfort=comfort, **options)
        better = on_grid(nodes, arm, speed=0.1, comfort=comfort, refine=True, **options)
        path = np.abs(better.increments * better.settings.weights).sum()
        assert better.cost == pytest.approx(path + by_hand(arm, better.q, comfort).sum(), rel=1e-9)
        assert better.cost < made.cost if cost < 1e-3 else better.cost <= made.cost


def test_the_fastest_speed_keeps_margins_and_knows_no_costs(fine):
    nodes, arm, options = fine
    free = fastest_speed(nodes, arm, **options)
    held = fastest_speed(nodes, arm, comfort=Comfort(wrist=Band(margin=1.25)), **options)
    assert held.speed < free.speed
    away = {"comfort": Comfort(limits=Band(margin=0.3))} | options
    on, off = (fastest_speed(nodes, arm, refine=refine, **away) for refine in (False, True))
    assert off.speed >= on.speed
    with pytest.raises(InputError, match="takes no costs"):
        fastest_speed(nodes, arm, comfort=EVERY, **options)


@pytest.mark.slow
def test_pieces_and_dips_keep_comfort(fine):
    nodes, arm, options = fine
    fast = options | {"speed": 1.2 * fastest_speed(nodes, arm, **options).speed}
    comfort = Comfort(wrist=Band(margin=0.1, width=0.5, cost=0.2))
    dipped = on_grid(nodes, arm, feed="dip", comfort=comfort, **fast)
    assert dipped.feed is not None
    assert dipped.criteria.nearest["wrist"][0] >= 0.1
    hard = Comfort(wrist=Band(margin=0.1))
    assert audit(on_grid(nodes, arm, feed="dip", comfort=hard, refine=True, **fast)) == []
    with pytest.raises(InputError, match='expected False with feed "dip" and comfort costs'):
        on_grid(nodes, arm, feed="dip", comfort=comfort, refine=True, **fast)
    pieces = plan_in_pieces(nodes, arm, comfort=comfort, method="exact", **fast)
    assert len(pieces) > 1
    for piece in pieces:
        nodes_cost = by_hand(arm, piece.q, comfort)
        path = np.abs(piece.increments * piece.settings.weights).sum()
        assert piece.cost == pytest.approx(path + nodes_cost.sum(), rel=1e-12)
    with pytest.raises(InputError, match='interruptions: expected "none" with comfort clearance'):
        plan_in_pieces(nodes, arm, comfort=Comfort(clearance=Band()), **fast)


def test_a_plan_file_tells_the_comfort_asked_for(small, tmp_path):
    nodes, arm, options = small
    made = plan(nodes, arm, comfort=EVERY, **options)
    entry = plan_entry(made, "circle", checks(made))
    text = plan_text(plan_document(arm, made.T_flange_tip, made.T_base_part, [entry], {}))
    (tmp_path / "plan.json").write_text(text)
    (again,) = read_plan_file(tmp_path / "plan.json").plans
    assert again.settings.comfort == EVERY
    assert again.criteria.nearest == made.criteria.nearest
    told = json.loads(text)["contours"][0]
    assert told["comfort"]["wrist"] == {"margin": 0.05, "width": 0.5, "cost": 3.0}
    assert told["criteria"]["nearest"]["shoulder"]["unit"] == "m"


def test_the_page_s_examples_run_and_keep_what_it_says(capsys):
    page = (ROOT / "docs" / "comfort.md").read_text()
    margins, reversals = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    names: dict[str, object] = {}
    exec(compile(margins, "comfort.md", "exec"), names)
    wrist, _, limits = map(float, capsys.readouterr().out.split())
    assert wrist >= 5
    assert limits >= 3
    exec(compile(reversals, "comfort.md", "exec"), names)
    assert capsys.readouterr().out.split() == ["2", "0.64", "2", "1.14", "0", "0.88"]
