"""Tubes without a motion: never said of a tube with one, and proved close to the fastest speed."""

import numpy as np
import pytest

from kerfpath import fastest_speed, plan
from kerfpath.certifier import MotionTest, empty_tubes, infeasibility
from kerfpath.certifier.cells import CellMaker
from kerfpath.certifier.empty_tubes import EmptyTubes, binding_window
from kerfpath.certifier.neighbours import within
from kerfpath.certifier.stages import Steps
from kerfpath.certifier.tube import Duals, enclosed, hull
from kerfpath.contour import Contour
from kerfpath.kernels.metric import MANHATTAN
from kerfpath.limits import Limits

NODES = 9
STEP = np.radians(5)


@pytest.fixture
def at_once(monkeypatch):
    """Divide motions into tubes without any halving of cells before."""
    monkeypatch.setattr(infeasibility, "MANY_STEPS", 0)


@pytest.fixture(scope="module")
def part(arc):
    """Return the first nodes of an arc, from some node on."""

    def of(first, nodes=NODES):
        which = slice(first, first + nodes)
        return Contour(arc.points[which], arc.axes[which], closed=False, name="part")

    return of


@pytest.fixture(scope="module")
def quickest(part, arm, tool, placement):
    """Return the plan at the fastest speed found along a part of the arc."""
    made = {}

    def of(first):
        if first not in made:
            options = {"tool": tool, "placement": placement, "gamma_step": STEP}
            told = fastest_speed(part(first), arm, refine=True, **options)
            made[first] = plan(part(first), arm, speed=told.speed, **options)
        return made[first]

    return of


def test_of(one):
    return MotionTest(one.robot, one.nominal_frames, one.T_flange_tip)


test_of.__test__ = False  # it makes a test of motions


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("first", [0, 10, 20])
def test_where_a_motion_is_known_it_is_never_said_to_be_impossible(first, quickest):
    """At the very interval that it needs, and at longer ones."""
    one = quickest(first)
    test, limits = test_of(one), one.settings.limits(one.robot)
    for slower in (1.0, 1.001, 1.01, 1.05):
        assert test.closed(limits, one.dt * slower, tubes=12) is None


@pytest.mark.parametrize("first", [0, 20])
def test_slightly_above_the_fastest_speed_it_is_proved(first, quickest):
    """Where elimination alone leaves it undecided, or takes longer."""
    one = quickest(first)
    closed = test_of(one).closed(one.settings.limits(one.robot), one.dt / 1.03, tubes=300)
    assert closed is not None
    assert 0 <= closed.node < NODES - 1


def steps_of(one, dt):
    limits = one.settings.limits(one.robot)
    return Steps(
        weight=np.zeros(6), velocity=limits.velocity.per_interval(dt),
        acceleration=limits.acceleration.most_per_interval(dt), metric=MANHATTAN,
        endless=one.robot.endless,
    )  # fmt: skip


def program_of(one, dt):
    nodes = np.arange(len(one.q))
    return EmptyTubes(maker_of(one), steps_of(one, dt), len(one.q) - 1, 1).program(nodes)


def maker_of(one):
    return CellMaker(one.robot, one.nominal_frames, one.T_flange_tip)


def tube_near(one, width, halved):
    """Return a tube about a motion, and its cells."""
    maker, nodes = maker_of(one), np.arange(len(one.q))
    cells = cells_near(maker, one, width, halved)
    tube = enclosed(maker, one.robot.endless, nodes, cells, hull(cells, nodes))
    assert tube is not None
    return tube, cells


def cells_near(maker, one, width, halved):
    cells = maker.coarsest(np.arange(len(one.q)))
    cells = cells.take(cells.posture == one.posture[cells.node])
    for _ in range(halved):
        cells = maker.halves(cells)
    middle = cells.half * (2 * cells.index + 1) - np.pi
    off = np.abs(np.angle(np.exp(1j * (middle - one.gamma[cells.node]))))
    return cells.take(off <= np.maximum(width, cells.half))


@pytest.mark.parametrize(("width", "halved"), [(0.3, 2), (0.1, 3), (0.02, 5)])
def test_the_curves_of_a_tube_hold_the_joints_on_its_cells(width, halved, quickest):
    one, rng = quickest(0), np.random.default_rng(8)
    (tube, cells), maker = tube_near(one, width, halved), maker_of(one)
    for k in range(len(one.q)):
        mine = cells.take(cells.node == k)
        which = rng.integers(len(mine), size=40)
        gamma = mine.half[which] * (2 * mine.index[which] + 1 + rng.uniform(-1, 1, 40)) - np.pi
        q, _, reached = maker.joints(np.full(40, k), gamma, int(one.posture[k]))
        assert reached.all()
        t = np.angle(np.exp(1j * (gamma - tube.middle[k])))[:, None]
        off = q - (t ** np.arange(4)) @ tube.power[k]
        off -= 2 * np.pi * np.rint(off / (2 * np.pi))
        assert (np.abs(off) <= tube.spread[k] + 1e-12).all()


@pytest.mark.parametrize("strides", [(1, 1, 1, 1, 1, 1, 1, 1), (2, 1, 2, 2, 1)])
@pytest.mark.parametrize(("width", "halved"), [(0.3, 2), (0.02, 5)])
def test_what_is_tied_holds_for_every_motion_within_the_limits(width, halved, strides, quickest):
    """Motions wander within the tube; the limits are what each of them uses, to the last digit."""
    one, rng = quickest(0), np.random.default_rng(12)
    tube, cells = tube_near(one, width, halved)
    maker, nodes = maker_of(one), np.append(0, np.cumsum(strides))
    cells = cells.take(np.isin(cells.node, nodes))
    tube = enclosed(maker, one.robot.endless, nodes, cells, hull(cells, nodes))
    spans, narrower = np.array(strides), 0
    for size in (0.0, 0.01, 0.1, 1.0):
        for _ in range(5):
            level, slope = rng.uniform(-1, 1, 2)
            t = 0.5 * level + 0.4 * slope * np.linspace(-1, 1, len(nodes))
            t = np.clip(t + 0.1 * size * rng.normal(size=len(nodes)), -1, 1) * tube.half
            q, _, reached = maker.joints(nodes, tube.middle + t, int(one.posture[0]))
            assert reached.all()
            u = np.diff(q, axis=0)
            u = (u - 2 * np.pi * np.rint(u / (2 * np.pi))) / spans[:, None]
            bent = np.diff(u, axis=0) / ((spans[1:] + spans[:-1]) / 2)[:, None]
            steps = Steps(
                weight=np.zeros(6), velocity=np.abs(u).max(axis=0),
                acceleration=np.abs(bent).max(axis=0), metric=MANHATTAN, endless=one.robot.endless,
            )  # fmt: skip
            tied, _ = tube.with_ties(steps, spans)
            assert tied is not None
            least, most, bend_least, bend_most = tied.changes
            d = np.diff(t)
            e = d[1:] / spans[1:] - d[:-1] / spans[:-1]
            room = 1e-12
            assert (least - room <= d).all()
            assert (d <= most + room).all()
            assert (bend_least - room <= e).all()
            assert (e <= bend_most + room).all()
            low, high = within(tied.changes, tied.half)
            assert (low <= t).all()
            assert (t <= high).all()
            rows, bound = tied.tied
            powers = np.concatenate([t / tube.half, (t / tube.half) ** 2])
            assert (rows @ powers <= bound + room).all()
            narrower += (most - least < 0.7 * (tube.half[1:] + tube.half[:-1])).sum()
    assert narrower > 20  # else nothing is tied


def test_no_duals_prove_a_tube_with_a_motion_empty(quickest):
    """Whatever the duals: those of its program at a higher speed, and changed at random."""
    one, spans = quickest(0), np.ones(NODES - 1, np.int64)
    steps = steps_of(one, one.dt * 1.0001)
    tube, _ = tube_near(one, 0.02, 5)
    tube, _ = tube.with_ties(steps, spans)
    rng = np.random.default_rng(9)
    for faster in (1.0, 1.02, 1.2):
        duals, _ = program_of(one, one.dt / faster).solve(tube)
        assert tube.least(steps, spans, duals) <= 0
        if faster == 1.2:  # at that speed it is empty
            assert tube.least(steps_of(one, one.dt / faster), spans, duals) > 0
        for size in (0.01, 0.1, 1.0):
            y, nu, ties = (
                each + size * np.abs(each).max() * rng.normal(size=each.shape) for each in duals
            )
            nu[[0, -1]] = 0.0
            assert tube.least(steps, spans, Duals(y, nu, ties)) <= 0


@pytest.mark.parametrize("slower", [1 / 1.2, 1.05])
def test_a_part_that_motions_pass_grows_to_one_that_none_passes_or_to_a_motion(slower, quickest):
    """From four nodes, along which much is possible."""
    one = quickest(0)
    maker, steps = maker_of(one), steps_of(one, one.dt * slower)
    cells, nodes = cells_near(maker, one, 0.2, 2), np.arange(3, 7)
    tubes = EmptyTubes(maker, steps, NODES - 1, 100)
    closed = tubes.closed(cells.take(np.isin(cells.node, nodes)), nodes)
    if slower < 1:
        assert closed is not None
        assert tubes.motion is None
        return
    assert closed is None
    gamma, posture = tubes.motion
    q, _, reached = maker.joints(np.arange(NODES), gamma, posture)
    u = np.diff(q, axis=0)
    u -= 2 * np.pi * np.rint(u / (2 * np.pi))
    assert reached.all()
    assert (np.abs(u) <= steps.velocity).all()
    assert (np.abs(np.diff(u, axis=0)) <= steps.acceleration).all()


def test_limits_bind_where_a_motion_cannot_be_bettered(quickest):
    """The window holds the node that binds, and grows to no more than the contour."""
    one = quickest(0)
    used = np.abs(one.acceleration_share).max(axis=1)
    first, last = binding_window(
        maker_of(one), steps_of(one, one.dt / 1.02), one.gamma, one.posture.astype(np.int64)
    )
    assert 0 <= first < last < NODES
    assert (used[max(first - 1, 0) : last] > 0.999).any()


@pytest.mark.usefixtures("at_once")
def test_without_tubes_left_it_is_undecided(quickest, monkeypatch):
    one = quickest(0)
    monkeypatch.setattr(empty_tubes, "ROUNDS", 1)
    assert test_of(one).closed(one.settings.limits(one.robot), one.dt / 1.001, tubes=1) is None


@pytest.mark.usefixtures("at_once")
def test_limits_that_a_motion_just_keeps_leave_it(arm, tool, placement, part):
    """Gamma wanders, and the limits are what it uses: to the last digit."""
    done = 0
    for seed in range(8):
        rng = np.random.default_rng([11, seed])
        nodes = part(int(rng.integers(0, 20)), 7)
        frames = placement @ nodes.frames("rotation-minimising")
        gamma = rng.uniform(-3, 3) + np.cumsum(rng.normal(0, (0.0, 0.01, 0.1)[seed % 3], 7))
        maker = CellMaker(arm, frames, tool)
        q, _, reached = maker.joints(np.arange(7), gamma, int(rng.integers(8)))
        limits = arm.joint_limits()
        inside = ((q >= limits.lower) & (q <= limits.upper) | limits.endless).all()
        if not (reached.all() and inside):
            continue
        u = np.diff(q, axis=0)
        u = np.where(arm.endless, u - 2 * np.pi * np.rint(u / (2 * np.pi)), u)
        used = np.maximum(np.abs(u).max(axis=0), 1e-6)
        bent = np.maximum(np.abs(np.diff(u, axis=0)).max(axis=0), 1e-6)
        test = MotionTest(arm, frames, tool)
        assert test.closed(Limits.of(used, bent), 1.0, tubes=30) is None
        done += 1
    assert done >= 3
