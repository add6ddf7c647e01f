"""Plans of robots with external axes in a cell: clear as the audit sees it, and edits are found."""

from dataclasses import replace

import numpy as np
import pytest

from conftest import pose
from kerfpath import Contour, InputError, audit, plan
from kerfpath.cell import Mesh, box, box_between, cell_of

AXES = {"lower": -1.0, "upper": 1.0, "velocity": 1.0, "acceleration": 2.0}
CENTRE = [1.3, 0.0, 0.5]


def plate(half, top=0.0):
    hull = box_between([-half[0], -half[1], top - 0.02], [half[0], half[1], top])
    return Mesh(vertices=hull.points, triangles=hull.triangles, name="plate")


def line(half, count):
    y = np.linspace(-half, half, count)
    return Contour(np.c_[0 * y, y, 0 * y], np.tile([0, 0, -1.0], (count, 1)), name="line")


@pytest.fixture(scope="module")
def along_a_wall(arm, tool):
    """A cut 1.6 m long beside the rail, with a post at its end that the arm must keep away from."""
    robot = arm.on_rail([0, 1, 0], **AXES)
    cell = cell_of(
        robot, tool=tool, part=plate([0.1, 1.0]), placement=pose(CENTRE), near_miss=5e-3, floor=0.0,
        fixtures={"post": box([0.2, 0.2, 1.6], pose([0.62, 0.45, 0.8]))},
    )  # fmt: skip
    options = {"tool": tool, "placement": pose(CENTRE), "speed": 0.1, "gamma_step": np.radians(6)}
    return line(0.8, 41), robot, cell, options


@pytest.mark.slow
def test_a_plan_on_a_rail_keeps_clear_of_what_stands_beside_it(along_a_wall):
    contour, robot, cell, options = along_a_wall
    made = plan(contour, robot, cell=cell, **options)
    assert audit(made, cell=cell, path_tolerance=1e-3) == []
    assert "clear in the cell" in made.proof.statement
    steps = np.linspace(0, 1, 30)[:, None]
    dq = cell.increments(made.q[:-1], made.q[1:])
    assert all(cell.clear(q + steps * d).all() for q, d in zip(made.q, dq, strict=False))
    # Without the cell the same motion costs no more, and is not clear.
    free = plan(contour, robot, **options)
    assert free.cost <= made.cost * 1.01
    codes = {issue.code for issue in audit(free, cell=cell, path_tolerance=1e-3)}
    assert "collision" in codes


def test_courses_keep_clear_where_they_can(along_a_wall):
    """The gentlest course leads into the post; with the cell it leads past it."""
    from kerfpath.options import PlanOptions
    from kerfpath.planner.external_motion import GENTLE, courses
    from kerfpath.planner.task import planning_task
    from kerfpath.setup import Setup

    contour, robot, cell, options = along_a_wall
    setup = Setup.of(robot, options["tool"], options["placement"])
    asked = PlanOptions(gamma_step=np.radians(6))
    task = planning_task(contour, setup, asked, speed=options["speed"])
    (free,), (kept,) = (list(courses(task, (GENTLE,), clear=c)) for c in (_all, cell.clear))
    assert np.abs(free - kept).max() > 0.05


def _all(q):
    return np.ones(len(q), np.bool_)


@pytest.mark.slow
def test_an_edited_value_of_an_external_axis_that_collides_is_found(arm, tool):
    """A clamp on the table is turned into the head."""
    turns = AXES | {"lower": -np.pi, "upper": np.pi, "endless": True}
    robot = arm.with_positioner([0, 0, 1], CENTRE, name="table", **turns)
    clamp = {"clamp": box([0.06, 0.06, 0.4], pose([1.5, 0.0, 0.71]))}
    options = {"tool": tool, "placement": pose(CENTRE), "speed": 0.05, "gamma_step": np.radians(6)}
    made_of = {
        "tool": tool,
        "part": plate([0.4, 0.4]),
        "placement": pose(CENTRE),
        "near_miss": 5e-3,
    }
    cell = cell_of(robot, fixtures=clamp, on={"clamp": "table"}, **made_of)
    y = np.linspace(-0.1, 0.1, 21)
    contour = Contour(np.c_[0 * y - 0.2, y, 0 * y], np.tile([0, 0, -1.0], (21, 1)), name="line")
    made = plan(contour, robot, cell=cell, **options)
    assert audit(made, cell=cell, path_tolerance=1e-3) == []
    q = made.q.copy()
    q[10, 6] += np.pi  # half a turn, and the clamp is where the head cuts
    edited = replace(made, q=q)

    def codes(cell):
        found = audit(edited, cell=cell, interpolation="joint", path_tolerance=1e-3)
        return {issue.code for issue in found}

    assert "collision" in codes(cell)
    assert "collision" not in codes(cell_of(robot, **made_of))


def test_a_cell_of_another_rail_is_refused(along_a_wall, arm, tool):
    contour, _, cell, options = along_a_wall
    with pytest.raises(InputError, match=r"cell: it was built with other external axes \(rail\)"):
        plan(contour, arm.with_positioner([0, 0, 1], CENTRE, **AXES), cell=cell, **options)
    longer = arm.on_rail([0, 1, 0], **AXES | {"upper": 2.0})
    with pytest.raises(InputError, match="less travel"):
        plan(contour, longer, cell=cell, **options)
    with pytest.raises(InputError, match="other external axes"):
        plan(contour, arm, cell=cell, **options)


def test_ends_that_are_apart_begin_with_the_best_and_lie_far_from_each_other():
    from types import SimpleNamespace

    from kerfpath.planner.coarse import DEARER, ELSEWHERE, FARTHEST, Coarse, apart

    rng = np.random.default_rng(8)
    counts, samples = (6, 9), 18
    coarse = Coarse(
        nodes=np.arange(2),
        places=np.zeros((54, 2)),
        counts=counts,
        graph=None,
        closed=np.zeros(0, bool),
    )
    robot = SimpleNamespace(free=np.array([0, 1]), endless=np.array([False, True]))
    value = 100 + rng.uniform(0, 20, (54, samples, 4))
    value[rng.random(value.shape) < 0.3] = np.inf
    ends = apart(coarse, robot, value, 5)
    costs = [value[end] for end in ends]
    assert len(ends) == 5
    assert costs == sorted(costs)
    assert costs[0] == value.min()
    assert costs[-1] <= (1 + DEARER) * costs[0]
    for i, (x, g, p) in enumerate(ends):
        for x2, g2, p2 in ends[:i]:
            far = np.abs(np.array(divmod(x, 9)) - divmod(x2, 9))
            far[1] = min(far[1], 9 - far[1])
            turn = abs(g - g2)
            turn = min(turn, samples - turn) * 2 * np.pi / samples
            assert p != p2 or turn >= ELSEWHERE or (far > FARTHEST).any()
    assert apart(coarse, robot, value, 1) == ends[:1]
    assert apart(coarse, robot, np.full_like(value, np.inf), 3) == []
