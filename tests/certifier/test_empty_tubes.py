"""Tubes without a motion: never said of a tube with one, and proved close to the fastest speed."""

import numpy as np
import pytest

from kerfpath import fastest_speed, plan
from kerfpath.certifier import MotionTest, empty_tubes, infeasibility
from kerfpath.certifier.cells import CellMaker
from kerfpath.certifier.empty_tubes import EmptyTubes
from kerfpath.certifier.stages import Steps
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


def tubes_of(one, dt):
    limits = one.settings.limits(one.robot)
    steps = Steps(
        weight=np.zeros(6), velocity=limits.velocity.per_interval(dt),
        acceleration=limits.acceleration.most_per_interval(dt), metric=MANHATTAN,
        endless=one.robot.endless,
    )  # fmt: skip
    maker = CellMaker(one.robot, one.nominal_frames, one.T_flange_tip)
    nodes = np.arange(len(one.q))
    return maker, steps, EmptyTubes(maker, steps, nodes, 1)


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
    one = quickest(0)
    maker, _, tubes = tubes_of(one, one.dt)
    cells = cells_near(maker, one, width, halved)
    tube, rng = tubes._tube(cells), np.random.default_rng(8)
    assert tube is not None
    for k in range(len(one.q)):
        mine = cells.take(cells.node == k)
        which = rng.integers(len(mine), size=40)
        gamma = mine.half[which] * (2 * mine.index[which] + 1 + rng.uniform(-1, 1, 40)) - np.pi
        q, _, reached = maker.joints(np.full(40, k), gamma, int(one.posture[k]))
        assert reached.all()
        t = np.angle(np.exp(1j * (gamma - tube.middle[k])))[:, None]
        off = q - (tube.center[k] + tube.slope[k] * t + tube.bend[k] * t**2 / 2)
        off -= 2 * np.pi * np.rint(off / (2 * np.pi))
        assert (np.abs(off) <= tube.spread[k] + 1e-12).all()


def test_no_duals_prove_a_tube_with_a_motion_empty(quickest):
    """Whatever the duals: those of its program at a higher speed, and changed at random."""
    one = quickest(0)
    maker, steps, tubes = tubes_of(one, one.dt * 1.0001)
    cells = cells_near(maker, one, 0.02, 5)
    tube, spans = tubes._tube(cells), np.ones(len(one.q) - 1, np.int64)
    rng = np.random.default_rng(9)
    for faster in (1.0, 1.02, 1.2):
        _, quick, other = tubes_of(one, one.dt / faster)
        y, nu, _ = other._program.solve(tube)
        assert tube.least(steps, spans, y, nu) <= 0
        if faster == 1.2:
            assert tube.least(quick, spans, y, nu) > 0  # at that speed it is empty
        for size in (0.01, 0.1, 1.0):
            y1 = y + size * np.abs(y).max() * rng.normal(size=y.shape)
            nu1 = nu + size * np.abs(nu).max() * rng.normal(size=nu.shape)
            nu1[[0, -1]] = 0.0
            assert tube.least(steps, spans, y1, nu1) <= 0


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
