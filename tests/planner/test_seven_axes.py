"""Plans of a seven-axis arm: joint 3 is chosen with gamma, against grids of both and the audit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import naive
from kerfpath import Contour, InputError, NoFeasiblePath, audit, fastest_speed, plan, robot
from kerfpath.auditor import checks
from kerfpath.cell import cell_of
from kerfpath.certifier import certify
from kerfpath.comfort import Band, Comfort
from kerfpath.execution import run_along
from kerfpath.graph import external_grid, gamma_grid
from kerfpath.options import PlanOptions
from kerfpath.planner import layered_graph
from kerfpath.post import build_program, post_and_read
from kerfpath.refiner import refine

STEP = np.radians(10)
BACK_OFF = PlanOptions(gamma_step=STEP, retract=0.02)


@pytest.fixture(scope="module")
def lbr():
    """With accelerations of about three times the speeds, per second: KUKA publishes none."""
    known = robot("kuka_lbr_iiwa14_r820")
    return known.with_limits(acceleration=np.radians([300, 300, 300, 300, 500, 500, 700]))


def task(seed, count=7, half=0.06):
    """A short bent cut in reach, the tool axis turning along it, and where it stands."""
    rng = np.random.default_rng(seed)
    placement, tool = np.eye(4), np.eye(4)
    placement[:3, 3] = rng.uniform([0.35, -0.2, 0.1], [0.55, 0.2, 0.4])
    tool[2, 3] = 0.2
    y, (a, b, c) = np.linspace(-half, half, count), rng.uniform(-0.6, 0.6, 3)
    axes = np.c_[a * np.sin(8 * y), b + 2 * c * y, -np.ones(count)]
    cut = Contour(np.c_[0 * y, y, 0.5 * y**2], axes, name="cut")
    return cut, {"tool": tool, "placement": placement}


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("speed", [0.03, 0.25])
def test_a_plan_is_no_worse_than_the_best_of_a_grid_even_refined(seed, speed, lbr):
    cut, cell = task(seed)
    made = plan(cut, lbr, speed=speed, gamma_step=np.radians(5), **cell)
    for interpolation in ("joint", "linear"):
        # A warning is due where a straight move passes near a singularity.
        issues = audit(made, interpolation=interpolation, path_tolerance=5e-3)
        assert {issue.code for issue in issues} <= {"unbounded"}
    sampled = lbr.with_elbow_step(STEP)
    best = plan(cut, sampled, speed=speed, gamma_step=STEP, method="exact", **cell)
    assert best.proof.optimal
    assert audit(best, path_tolerance=5e-3) == []
    assert made.cost <= best.cost
    # A hundredth: what valleys that the courses do not lead to may be worth.
    assert made.cost <= 1.01 * refine(best).cost_after


def test_the_exact_search_is_the_best_of_all_elbows_gammas_and_postures(lbr):
    cut, cell = task(1, count=3)
    narrow = lbr.with_limits(
        lower=np.where(np.arange(7) == 2, -0.4, lbr.lower),
        upper=np.where(np.arange(7) == 2, 0.5, lbr.upper),
    ).with_elbow_step(0.3)
    step, dt = np.radians(60), 0.5
    places = external_grid(narrow)
    np.testing.assert_allclose(places[:, 0], [-0.4, -0.1, 0.2, 0.5])
    layers = []
    for H in cell["placement"] @ cut.frames("rotation-minimising"):
        rows = []
        for x in places[:, 0]:
            for g in gamma_grid(step):
                T = H.copy()
                T[:3, :3] = T[:3, :3] @ Rotation.from_rotvec([0, 0, g]).as_matrix()
                rows.append(narrow.inverse(T @ np.linalg.inv(cell["tool"]), given=x).q)
        layers.append(np.vstack(rows))
    graph = layered_graph(cut, narrow, gamma_step=step, **cell)
    np.testing.assert_allclose(graph.q, np.vstack(layers), atol=1e-9)
    velocity, acceleration = narrow.speed_limits()
    want, _ = naive.second_order(
        np.vstack(layers), graph.start, "free", dt=dt, velocity=velocity, acceleration=acceleration,
        eta_v=1.0, eta_a=1.0, endless=narrow.endless, weights=1 / (velocity * dt),
        metric="manhattan", objective="sum", vertex_cost=np.zeros(len(graph.q)),
    )  # fmt: skip
    speed = np.diff(cut.s).max() / dt
    made = plan(cut, narrow, speed=speed, gamma_step=step, method="exact", **cell)
    assert made.cost == pytest.approx(want, rel=1e-9)  # two ways to the same poses


def test_the_limits_of_joint_3_are_kept_and_judged(lbr):
    cut, cell = task(3, count=21)
    options = {"speed": 0.1, "gamma_step": np.radians(5), **cell}
    made = plan(cut, lbr, **options)
    assert not made.turn[:, 2].any()
    here = made.q[:, 2]
    lower, upper = lbr.lower.copy(), lbr.upper.copy()
    lower[2], upper[2] = here.min() - 1.0, here.min() - 0.01
    narrow = lbr.with_limits(lower=lower, upper=upper)
    inside = plan(cut, narrow, **options)
    assert ((inside.q[:, 2] >= lower[2]) & (inside.q[:, 2] <= upper[2])).all()
    assert audit(inside, path_tolerance=5e-3) == []
    assert {i.code for i in audit(replace(made, robot=narrow), path_tolerance=5e-3)} == {
        "joint-limits"
    }
    # Elsewhere joint 3 cannot be while the tool stays: the audit's own chain sees the tip move.
    q = made.q.copy()
    q[4, 2] += 1e-4
    assert "tip-at-nodes" in {i.code for i in audit(replace(made, q=q), path_tolerance=5e-3)}
    slow = lbr.velocity.copy()
    slow[2] = 1e-3
    held = plan(cut, lbr.with_limits(velocity=slow), **options)
    assert audit(held, path_tolerance=5e-3) == []
    with pytest.raises(NoFeasiblePath, match="joint 3"):
        plan(cut, lbr, speed=20.0, gamma_step=np.radians(5), **cell)


def test_a_course_of_joint_3_may_be_given_and_is_refined(lbr):
    cut, cell = task(4)
    options = {"speed": 0.05, "gamma_step": np.radians(5), **cell}
    made = plan(cut, lbr, **options)
    again = plan(cut, lbr, external=made.course, **options)
    assert again.cost <= made.cost * (1 + 1e-3)  # what a descent ends by
    assert made.course.shape == (7, 1)
    assert made.external is None
    with pytest.raises(InputError, match=r"external: joint 3 is at 4 rad at node 0, outside"):
        plan(cut, lbr, external=np.full((7, 1), 4.0), **options)
    with pytest.raises(
        InputError, match=r"joint 3: the exact search .* give robot\.with_elbow_step"
    ):
        plan(cut, lbr, method="exact", **options)


@pytest.mark.slow
@pytest.mark.parametrize("interpolation", ["linear", "joint"])
def test_it_rides_a_rail_and_in_a_cell(lbr, interpolation):
    rides = lbr.on_rail([0, 1, 0], lower=-1.0, upper=1.0, velocity=1.0, acceleration=2.0)
    y = np.linspace(-0.9, 0.9, 37)
    line = Contour(np.c_[0 * y, y, 0 * y], np.tile([0.2, 0, -1.0], (37, 1)), name="line")
    _, cell = task(0)
    cell["placement"] = np.eye(4)
    cell["placement"][:3, 3] = 0.5, 0.0, 0.2
    options = {"speed": 0.1, "gamma_step": np.radians(15), **cell}
    with pytest.raises(NoFeasiblePath):
        plan(line, lbr, **options)
    around = cell_of(rides, tool=cell["tool"], near_miss=0.005, floor=-0.05)
    made = plan(line, rides, cell=around, **options)
    assert made.q.shape == (37, 8)
    np.testing.assert_array_equal(made.external[:, 0], made.q[:, 7])
    np.testing.assert_array_equal(made.course, made.q[:, [2, 7]])
    table = checks(made, interpolation=interpolation, path_tolerance=0.02, cell=around)
    assert [check.code for check in table if not check.ok] == []


def test_comfort_keeps_its_margins_and_the_audit_measures_them_itself(lbr):
    cut, cell = task(2)
    comfort = Comfort(
        wrist=Band(margin=0.3), elbow=Band(margin=0.5), shoulder=Band(margin=0.05),
        manipulability=Band(margin=0.01), limits=Band(margin=0.1, width=0.2, cost=0.1),
    )  # fmt: skip
    made = plan(cut, lbr, comfort=comfort, speed=0.05, gamma_step=np.radians(5), **cell)
    table = {check.code: check for check in checks(made, path_tolerance=5e-3)}
    assert {f"{name}-margin" for name in comfort.bands} <= set(table)
    assert all(check.ok for check in table.values())
    nearest = made.criteria.nearest
    for name, band in comfort.bands.items():
        row = table[f"{name}-margin"]
        # Two kinematics in double precision.
        assert row.value == pytest.approx(band.margin - nearest[name][0], abs=1e-9)


def test_the_fastest_speed_can_be_planned(lbr):
    cut, cell = task(5)
    found = fastest_speed(cut, lbr, gamma_step=STEP, **cell)
    assert found.speed > 0.25
    made = plan(cut, lbr, speed=0.95 * found.speed, gamma_step=STEP, **cell)
    assert audit(made, path_tolerance=5e-3) == []
    shares = np.abs(made.velocity_share).max(), np.abs(made.acceleration_share).max()
    assert max(shares) > 0.5


def test_what_does_not_know_a_free_elbow_says_so(lbr):
    cut, cell = task(1)
    made = plan(cut, lbr, speed=0.05, options=BACK_OFF, **cell)
    with pytest.raises(InputError, match="controllers move joint 3 along an arc in different ways"):
        build_program([made], arc_tolerance=1e-4)
    program = build_program([made], retract=0.02)
    for language in ("rapid", "krl", "fanuc", "inform", "val3", "urscript"):
        with pytest.raises(
            InputError, match=f"'{language}' cannot yet express the axes of an arm like"
        ):
            post_and_read(program, language)
    with pytest.raises(InputError, match=r"motion between the nodes .* poses leave joint 3"):
        run_along(program.moves[1:5], lbr, T_base_part=cell["placement"], T_flange_tip=cell["tool"])
    assert "takes only lever arms into account" in certify(made).statement


@pytest.mark.parametrize("language", ["csv", "ros"])
def test_programs_say_the_joints_in_their_own_order(lbr, language):
    cut, cell = task(1, count=21)
    made = plan(cut, lbr, speed=0.05, options=BACK_OFF, **cell)
    written = post_and_read(build_program([made], retract=0.02), language)
    text = next(iter(written.files.values()))
    names = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,q7_deg"
    if language == "ros":
        names = '["joint_1", "joint_2", "joint_3", "joint_4", "joint_5", "joint_6", "joint_7"]'
    assert names in text
    said = [move.q for move in written.read.moves if move.q is not None]
    off = np.abs(np.array(said)[:, None] - made.q[None]).max(axis=2).min(axis=0)
    assert off.max() < 1e-9  # the digits of the texts
