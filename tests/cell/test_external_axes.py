"""Cells with external axes: what a rail, a table, or tilt and turn move, and what stands still."""

import numpy as np
import pytest

from kerfpath import InputError
from kerfpath.auditor import chain_of as audit_chain
from kerfpath.auditor.collision import Moves, collision_along
from kerfpath.cell import CollisionChecker, Mesh, box, box_between, cell_of, clearances
from kerfpath.robots import carried, chain_of, lowest_joint

SLOW = {"velocity": 1.0, "acceleration": 2.0}
POINT = np.array([1.3, 0.1, 0.4])
EXACT = 3e-6
"""m: coal refines distances to 1e-6, each of two."""
KINDS = ("rail", "table", "tilt and turn", "lift under rail and table")


def on_axes(arm, kind):
    """The arm with the axes of a kind; each in the way that its case needs it."""
    rail = {"lower": -0.6, "upper": 0.9, **SLOW}
    turn = {"lower": -np.pi, "upper": np.pi, "endless": True, **SLOW}
    if kind == "rail":
        return arm.on_rail([0.2, 1, 0], **rail)
    if kind == "table":
        return arm.with_positioner([0, 0, 1], POINT, **turn)
    tilt = {"lower": -1.5, "upper": 1.5, **SLOW}
    if kind == "tilt and turn":
        tilted = arm.with_positioner([1, 0, 0.1], POINT, name="tilt", **tilt)
        return tilted.with_positioner([0.1, 0, 1], POINT, name="turn", **turn)
    lifted = arm.on_rail([0, 1, 0], **rail).on_rail([0, 0, 1], name="lift", **rail | {"lower": 0.0})
    return lifted.with_positioner([0, 1, 0], POINT, **turn)


def at(xyz):
    T = np.eye(4)
    T[:3, 3] = xyz
    return T


PART = box_between([-0.3, -0.2, -0.02], [0.3, 0.25, 0.02])
FIXTURES = {
    "clamp": box([0.1, 0.1, 0.2], at([1.5, 0.1, 0.55])),
    "post": box([0.2, 0.2, 1.2], at([0.9, -0.9, 0.6])),
}


def solid():
    return Mesh(vertices=PART.points, triangles=PART.triangles, name="plate")


def cell_on(robot, tool, **options):
    """A part, a clamp that stands on the last axis that carries it, and a post on the ground."""
    carrying = [axis.name for axis in robot.externals if axis.carries == "part"]
    on = {"clamp": carrying[-1]} if carrying else {}
    return cell_of(
        robot, tool=tool, part=solid(), placement=at(POINT), fixtures=FIXTURES, on=on,
        near_miss=5e-3, **options,
    )  # fmt: skip


def built_by_hand(arm, robot, x, tool):
    """The cell of the arm alone, everything where axes at x have taken it; seen from the base."""
    base = np.linalg.inv(carried(robot.externals, x, "robot"))
    turned = base @ carried(robot.externals, x, "part")
    carries = any(axis.carries == "part" for axis in robot.externals)
    fixtures = {
        "clamp": FIXTURES["clamp"].moved(turned if carries else base),
        "post": FIXTURES["post"].moved(base),
    }
    return cell_of(
        arm, tool=tool, part=solid(), placement=turned @ at(POINT), fixtures=fixtures,
        near_miss=5e-3, may_touch=[("base", "post"), ("base", "part"), ("base", "clamp")],
    )  # fmt: skip


def some(robot, count, seed, spread=0.7):
    """Joints about where the tool is over the part, external axes all over their travel."""
    rng, limits = np.random.default_rng(seed), robot.joint_limits()
    q = np.array([0, 0.5, 0.3, 0, 0.8, 0]) + rng.uniform(-spread, spread, (count, 6))
    x = rng.uniform(limits.lower[6:], limits.upper[6:], (count, robot.joints - 6))
    return np.hstack([q, x])


@pytest.mark.parametrize("kind", KINDS)
def test_distances_are_those_of_a_cell_moved_by_hand(kind, arm, tool):
    robot = on_axes(arm, kind)
    cell, q = cell_on(robot, tool), some(robot, 12, 1)
    found = cell.distances(q)
    judged = {frozenset(pair): p for p, pair in enumerate(cell.pair_names)}
    for row, joints in enumerate(q):
        there = built_by_hand(arm, robot, joints[6:], tool)
        own = there.distances(joints[None, :6])[0]
        for pair, apart, needed in zip(there.pair_names, own, there.required, strict=True):
            p = judged.pop(frozenset(pair)) if row == 0 else _place(cell, pair)
            if apart > EXACT:  # of a mesh that overlaps the depth is no measure
                assert found[row, p] == pytest.approx(apart, abs=EXACT)
            else:
                assert found[row, p] <= 2 * EXACT
            assert cell.required[p] == needed
    # What is judged beside is what did not move against each other by hand, and does here.
    for pair in judged:
        kinds = {body.kind for body in cell.bodies if body.name in pair}
        assert kinds <= {"part", "fixture"} or "base" in pair
    clear = (found > cell.required).all(axis=1)
    np.testing.assert_array_equal(cell.clear(q), clear)


def _place(cell, pair):
    return [frozenset(names) for names in cell.pair_names].index(frozenset(pair))


@pytest.mark.parametrize("kind", KINDS)
def test_both_kinematics_agree_where_bodies_are(kind, arm):
    robot = on_axes(arm, kind)
    q = some(robot, 20, 2)
    np.testing.assert_allclose(
        audit_chain(robot).links(q), chain_of(robot).frames(q), rtol=0, atol=1e-12
    )
    still = chain_of(robot).still
    assert (chain_of(robot).frames(q)[:, still] == np.eye(4)).all()
    part = carried(robot.externals, q[:, 6:], "part")
    np.testing.assert_allclose(chain_of(robot).frames(q)[:, 0], part, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_is_called_clear_only_where_all_samples_of_it_are(kind, arm, tool):
    robot = on_axes(arm, kind)
    cell = cell_on(robot, tool)
    q0 = some(robot, 60, 3)
    q1 = q0 + np.random.default_rng(4).uniform(-0.25, 0.25, q0.shape)
    limits = robot.joint_limits()
    q1[:, 6:] = np.clip(q1[:, 6:], limits.lower[6:], limits.upper[6:])
    passed = cell.clear_motion(q0, q1)
    share = np.linspace(0, 1, 41)[:, None]
    dq = cell.increments(q0, q1)
    dense = np.array([cell.clear(a + share * d).all() for a, d in zip(q0, dq, strict=True)])
    assert not (passed & ~dense).any()
    assert passed.sum() > 0.7 * dense.sum()  # what is refused beyond that is within a tolerance
    assert 0 < dense.sum() < len(q0)
    checker = CollisionChecker(cell, np.vstack([q0, q1]))
    first = np.arange(len(q0))
    np.testing.assert_array_equal(checker.passable(first, first + len(q0)), passed)


@pytest.mark.parametrize("kind", KINDS)
def test_bounds_on_motions_hold_for_every_corner(kind, arm, tool):
    """By samples: no second difference of a corner's way, seen from its pair, beats the bound."""
    robot = on_axes(arm, kind)
    cell = cell_on(robot, tool)
    q, dq = some(robot, 10, 5), np.random.default_rng(6).uniform(-0.2, 0.2, (10, robot.joints))
    limits = robot.joint_limits()
    dq[:, 6:] = np.clip(q[:, 6:] + dq[:, 6:], limits.lower[6:], limits.upper[6:]) - q[:, 6:]
    bend, h = cell.sweep.bend(dq), 1e-3
    chain = audit_chain(robot)
    rates = Moves(cell, chain, q, q + dq).rates
    at = [chain.links(q + (0.5 + s) * dq) for s in (-h, 0.0, h)]
    for p, (a, b) in enumerate(cell.pairs):
        one, two = cell.bodies[a], cell.bodies[b]
        before, here, after = (
            np.linalg.solve(F[:, one.frame], F[:, two.frame])[:, :3, :3] @ two.shape.corners.T
            + np.linalg.solve(F[:, one.frame], F[:, two.frame])[:, :3, 3:]
            for F in at
        )
        second = np.linalg.norm(after - 2 * here + before, axis=1).max(axis=1) / h**2
        first = np.linalg.norm(after - before, axis=1).max(axis=1) / (2 * h)
        assert (second <= bend[:, p] + 1e-6).all()  # rounding of 1 m over h^2 is 1e-10
        assert (first <= np.abs(dq) @ rates[p] + 1e-6).all()


@pytest.mark.parametrize("kind", ["rail", "tilt and turn"])
def test_clearances_of_many_are_those_of_each(kind, arm, tool):
    robot = on_axes(arm, kind)
    cell = cell_on(robot, tool)
    q = np.linspace(*some(robot, 2, 7), 300)
    found = clearances(cell, q, band=0.05, resolution=1e-3)
    np.testing.assert_array_equal(found.upper > 0, cell.clear(q))
    apart = (cell.distances(q) - cell.required)[:, ~cell.own].min(axis=1)
    inside = found.upper > 0
    assert (found.lower <= apart + EXACT)[inside].all()
    assert (found.upper >= np.minimum(apart, 0.05) - EXACT)[inside].all()


@pytest.mark.parametrize("seed", [8, 11])
@pytest.mark.parametrize("kind", KINDS)
def test_an_audit_looks_between_the_samples_and_misses_nothing(kind, seed, arm, tool):
    robot = on_axes(arm, kind)
    cell, chain = cell_on(robot, tool), audit_chain(robot)
    ends = some(robot, 2, seed, spread=0.3)
    q = np.linspace(*ends, 40)
    rows = collision_along(cell, q[:-1], q[1:], np.arange(39), chain)
    fine = np.linspace(*ends, 1200)
    over = cell.distances(fine) - cell.required
    told = {row.code: row for row in rows}
    for code, wanted in (("collision", ~cell.own), ("collision-own", cell.own)):
        least = over[:, wanted].min()
        assert abs(least) > 1.1e-4  # what may be hidden: no case is in doubt
        assert told[code].ok == (least > 0)
    assert told["collision-open"].ok


def test_the_floor_is_as_low_as_the_lift_is_high(arm, tool):
    lift = {"lower": 0.0, "upper": 1.0, **SLOW}
    robot = arm.on_rail([0, 0, 1], name="lift", **lift)
    q = some(robot, 30, 9)
    np.testing.assert_allclose(
        lowest_joint(robot, q), lowest_joint(arm, q[:, :6]) + q[:, 6], atol=1e-12
    )
    table = on_axes(arm, "tilt and turn")
    q = some(table, 30, 9)
    np.testing.assert_array_equal(lowest_joint(table, q), lowest_joint(arm, q[:, :6]))
    # The part that is tilted into the floor is seen, wherever on the table it is.
    cell = cell_of(table, tool=tool, part=solid(), placement=at(POINT), near_miss=0.01, floor=0.2)
    over = [np.array([[0, -0.5, 0, 0, 0.5, 0, tilt, 0]]) for tilt in (0.0, 1.4)]
    assert [bool(cell.clear(q)[0]) for q in over] == [True, False]
    assert cell.pair_names[cell.clearance(over[1])[1][0]] == ("part", "floor")


def test_what_rides_along_is_not_judged_against_what_carries_it(arm, tool):
    robot = on_axes(arm, "lift under rail and table")
    names = ("clamp", "post")
    stood = cell_of(
        robot, tool=tool, part=solid(), placement=at(POINT), fixtures=FIXTURES, near_miss=5e-3,
        on={"clamp": "lift", "post": "rail"},
    )  # fmt: skip
    frames = {body.name: body.frame for body in stood.bodies}
    chain = chain_of(robot)
    assert frames["part"] == 0
    assert frames["post"] == chain.still + 1
    assert frames["clamp"] == frames["base"] == chain.base == 3
    assert ("base", "clamp") in {tuple(sorted(pair)) for pair in stood.unjudged}
    assert not set(names) <= {name for pair in stood.unjudged for name in pair} - {"base", "clamp"}
    with pytest.raises(InputError, match=r"no external axis is called 'crane'; there are 'rail'"):
        cell_of(robot, tool=tool, fixtures=FIXTURES, on={"clamp": "crane"})
    with pytest.raises(InputError, match="no fixture is called 'vice'"):
        cell_of(robot, tool=tool, fixtures=FIXTURES, on={"vice": "rail"})
    with pytest.raises(InputError, match="there is no external axis"):
        cell_of(arm, tool=tool, fixtures=FIXTURES, on={"clamp": "rail"})


def test_what_stands_on_the_base_must_leave_room_for_it(arm, tool):
    robot = on_axes(arm, "rail")
    with pytest.raises(InputError, match="'cabinet' overlaps the robot's"):
        cell_of(robot, tool=tool, fixtures={"cabinet": box([0.3] * 3)}, on={"cabinet": "rail"})
    # On the ground it is met where the rail brings the base there.
    cell = cell_of(robot, tool=tool, fixtures={"block": box([0.3] * 3, at([0, 1.0, 0.15]))})
    q = np.zeros((2, 7))
    q[1, 6] = 0.9
    assert cell.clear(q).tolist() == [True, False]


def test_a_linear_axis_beyond_its_travel_is_never_proved_clear(arm, tool):
    robot = on_axes(arm, "rail")
    cell = cell_of(robot, tool=tool, near_miss=1e-3)
    q = np.array([[0, 0.3, 0.3, 0, 0.5, 0, x] for x in (0.0, 0.9, 1.5)])
    assert cell.clear(q).all()
    assert cell.clear_motion(q[:2], q[1:]).tolist() == [True, False]
    with pytest.raises(InputError, match="less travel"):
        CollisionChecker(cell, q)


def test_a_cell_of_other_axes_is_refused(arm, tool):
    from kerfpath.robots import require_axes

    rail, table = on_axes(arm, "rail"), on_axes(arm, "table")
    with pytest.raises(InputError, match=r"other external axes \(rail\) than the robot has \(posi"):
        require_axes(chain_of(rail), table)
    with pytest.raises(InputError, match=r"other external axes \(none\) than the robot has \(rail"):
        require_axes(chain_of(arm), rail)
    with pytest.raises(InputError, match=r"other external axes \(rail\) than the robot has \(none"):
        require_axes(chain_of(rail), arm)
    longer = rail.with_limits(upper=rail.upper + np.eye(7)[6])
    with pytest.raises(InputError, match="less travel"):
        require_axes(chain_of(rail), longer)
    require_axes(chain_of(longer), rail)
    require_axes(chain_of(table), table)
