"""Room at both ends: plans begin and end where the tool can back off, off their grid, too."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import Band, Comfort, InputError, NoFeasiblePath, PlanOptions, audit
from kerfpath.auditor import checks
from kerfpath.contour import Contour
from kerfpath.planner import plan
from kerfpath.robots import can_back_off
from kerfpath.transfer import back_off

RETRACT = 0.05
SLIT = Contour(
    np.c_[np.linspace(0, 0.03, 11), np.zeros((11, 2))], np.tile([0.0, 0.0, -1.0], (11, 1))
)


def narrow(arm, draw):
    """Return the arm with ranges of axes 4 to 6 drawn so narrow that many plans end at a limit."""
    four, five, six = np.radians(draw.uniform([30, 40, 60], [90, 100, 150]))
    lower, upper = arm.lower.copy(), arm.upper.copy()
    lower[3:], upper[3:] = (-four, -five, -six), (four, five, six)
    return arm.with_limits(lower=lower, upper=upper, endless=np.zeros(6, bool))


def planned(arm, tool, placement, **options):
    return plan(
        SLIT, arm, tool=tool, placement=placement, speed=0.04,
        options=PlanOptions(gamma_step=np.radians(10), certify=None, **options),
    )  # fmt: skip


def cannot(made):
    try:
        back_off(made, "start", RETRACT)
        back_off(made, "end", RETRACT)
    except InputError:
        return True
    return False


def errors(made):
    return [issue for issue in audit(made) if issue.level == "error"]


@pytest.fixture(scope="module")
def drawn(arm, tool):
    """Give plans with and without the retract, of arms and places drawn at random."""
    draw, found = np.random.default_rng(17), []
    for _ in range(30):
        robot = narrow(arm, draw)
        place = np.eye(4)
        place[:3, 3] = draw.uniform([0.9, -0.7, 0.2], [1.6, 0.7, 1.2])
        try:
            free = planned(robot, tool, place)
        except NoFeasiblePath:
            continue
        try:
            found.append((free, planned(robot, tool, place, retract=RETRACT)))
        except NoFeasiblePath as none:
            found.append((free, none))
    return found


def test_a_plan_that_is_to_back_off_can_where_any_does_or_the_audit_says_so(drawn):
    for free, made in drawn:
        if not isinstance(made, NoFeasiblePath):
            row = next(row for row in checks(made) if row.code == "retract")
            assert row.ok != cannot(made)
            assert row.ok or cannot(free)


@pytest.mark.slow
def test_with_a_margin_the_motion_between_nodes_at_a_limit_keeps_it(arm, tool):
    # Nodes may lie on a limit, and what is straight between them then goes beyond it.
    draw, margin, beyond = np.random.default_rng(17), Comfort(limits=Band(margin=0.0017)), 0
    for _ in range(30):
        robot, place = narrow(arm, draw), np.eye(4)
        place[:3, 3] = draw.uniform([0.9, -0.7, 0.2], [1.6, 0.7, 1.2])
        try:
            beyond += bool(errors(planned(robot, tool, place)))
            made = planned(robot, tool, place, retract=RETRACT, comfort=margin)
        except NoFeasiblePath:
            continue
        assert not errors(made)
    assert beyond


def test_without_it_some_end_where_the_tool_cannot_back_off(drawn):
    # Else the law above would be about nothing.
    assert sum(cannot(free) for free, _ in drawn) >= 3


def test_what_can_back_off_by_itself_is_no_worse(drawn):
    for free, made in drawn:
        if not cannot(free):
            # Both searches are local: another optimum may be found, of nearly the same cost.
            assert made.cost <= free.cost * 1.02


def test_the_audit_finds_a_plan_that_cannot(drawn):
    for free, _ in drawn:
        asked = replace(free, settings=replace(free.settings, retract=RETRACT))
        row = next(row for row in checks(asked) if row.code == "retract")
        assert row.ok != cannot(free)


def test_no_end_at_all_is_said_by_the_audit(arm, tool, placement):
    made = planned(arm, tool, placement, retract=3.0)
    row = next(row for row in checks(made) if row.code == "retract")
    assert not row.ok
    assert "no way there" in row.title
    assert "lower retract_mm" in row.advice


@pytest.mark.usefixtures("explored")
def test_the_margin_of_the_limits_is_kept_where_it_has_backed_off_to(arm, tool, placement):
    margin = np.radians(2)
    draw = np.random.default_rng(3)
    tried = 0
    for _ in range(8):
        robot = narrow(arm, draw)
        asked = Comfort(limits=Band(margin=margin))
        try:
            made = planned(robot, tool, placement, retract=RETRACT, comfort=asked)
        except NoFeasiblePath:
            continue
        at = made.q[[0, -1]], made.posture[[0, -1]]
        if not can_back_off(robot, *at, tool, RETRACT, margin).all():
            continue  # no sample of an end leaves room for both
        tried += 1
        for end in ("start", "end"):
            back = back_off(made, end, RETRACT)
            assert (back - robot.lower >= margin - 1e-9).all()
            assert (robot.upper - back >= margin - 1e-9).all()
    assert tried


def test_backing_off_in_bulk_agrees_with_one_by_one(drawn):
    for free, _ in drawn:
        q, posture = free.q[[0, -1]], free.posture[[0, -1]]
        bulk = can_back_off(free.robot, q, posture, free.T_flange_tip, RETRACT)
        for end, can in zip(("start", "end"), bulk, strict=True):
            try:
                back_off(free, end, RETRACT)
            except InputError:
                assert not can
            else:
                assert can


def test_the_way_back_has_no_jump_where_the_wrist_would_flip(arm, tool):
    """Against 400 small steps: from poses near a wrist singularity many ways lead through it."""
    draw = np.random.default_rng(29)
    q = draw.uniform([-1, -0.3, -0.8, 0, -0.02, -1], [1, 0.6, 0.3, 0, 0.02, 1], (120, 6))
    q[::2, 5] = np.pi  # the way is in the plane of the arm, and leads exactly through it
    T = arm.forward(q)
    back = np.stack([arm.arm.follow(T, q, np.full(len(q), mu)) for mu in range(arm.postures)])
    posture = np.nanargmin(np.abs(back - q).max(axis=2), axis=0)
    np.testing.assert_allclose(back[posture, np.arange(len(q))], q, atol=1e-9)
    wide = arm.with_limits(lower=np.full(6, -7.0), upper=np.full(6, 7.0))
    can = can_back_off(wide, q, posture, tool, 0.2)
    T, at, smooth, slow = T @ tool, q, np.ones(len(q), bool), np.ones(len(q), bool)
    for _ in range(400):
        T[:, :3, 3] -= 0.2 / 400 * T[:, :3, 2]
        there = arm.arm.follow(T @ np.linalg.inv(tool), at, posture)
        smooth &= np.abs(there - at).max(axis=1) < 2.0  # a wrist that flips turns by pi
        slow &= np.abs(there - at).max(axis=1) < 1 / 40
        at = there
    assert 10 < slow.sum() <= smooth.sum() < len(q) - 5
    assert not (can & ~smooth).any()
    assert can[slow].all()  # else a joint may move by more than 1 rad in a tenth of the way
