"""Where the tool axis jumps, a motion that the planner passes is one that its audit passes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kerfpath import Contour, NoFeasiblePath, audit, plan, robot
from kerfpath.operations import slow_turns
from kerfpath.planner.straight_moves import follows, least_times

STRAIGHT = {"tip-at-nodes", "axis-at-nodes", "straight-move", "joint-step", "velocity-between"}
"""What a change of posture, or a singularity, between two nodes breaks."""


def _over_an_edge(seed: int) -> tuple[Contour, np.ndarray]:
    """A straight cut over a sharp edge of a sheet, and where it lies before an IRB 4600."""
    rng = np.random.default_rng(seed)
    half = np.linspace(0.0, 0.02, 11)
    turn, lean = rng.uniform(np.radians(30), np.radians(100)), rng.uniform(-1, 1)
    before, after = lean - turn / 2, lean + turn / 2
    down, along = rng.permutation(3)[:2]
    points, axes = np.zeros((21, 3)), np.zeros((21, 3))
    points[:, along] = np.concatenate([half[:-1] - half[-1], half])
    angle = np.where(np.arange(21) < 10, before, after)
    angle[10] = lean
    axes[:, down], axes[:, along] = -np.cos(angle), np.sin(angle)
    placement = np.eye(4)
    placement[:3, 3] = rng.uniform((0.9, -0.6, 0.1), (1.5, 0.6, 1.2))
    return Contour(points, axes, name="edge"), placement


@pytest.mark.parametrize(
    ("feed", "moves"), [("dip", "linear"), ("constant", "linear"), ("constant", "joint")]
)
def test_a_planned_cut_over_a_sharp_edge_passes_its_audit(feed, moves):
    arm = robot("abb_irb4600_60_205").with_limits(acceleration=[5.0, 5, 5, 20, 20, 20])
    tool = np.eye(4)
    tool[:3, 3] = 0.1, 0.0, 0.3
    planned = 0
    for seed in range(16):
        contour, placement = _over_an_edge(seed)
        where = {"tool": tool, "placement": placement, "gamma_step": np.radians(10)}
        where |= {"feed": feed, "interpolation": moves}
        try:
            made = plan(contour, arm, speed=0.002, certify=None, **where)
        except NoFeasiblePath:
            continue
        planned += 1
        found = audit(made, interpolation=moves, axis_tolerance=3.0)
        assert [issue for issue in found if issue.code in STRAIGHT] == []
        assert follows(made)
        assert (np.diff(made.time) >= least_times(made) * (1 - 1e-9)).all() or feed == "constant"
    assert planned >= 4


def test_a_cut_whose_nodes_follow_the_turn_passes_its_audit_between_them():
    """As jobs sample a wall edge: the beam turns within 1 mm, at a speed that gives it nodes."""
    arm = robot("abb_irb4600_60_205").with_limits(acceleration=[5.0, 5, 5, 20, 20, 20])
    tool = np.eye(4)
    tool[:3, :3] = Rotation.from_euler("y", 45, degrees=True).as_matrix()
    tool[:3, 3] = 0.2, 0.0, 0.3
    planned = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        half = np.radians(rng.uniform(15, 45))
        to = Rotation.from_euler("z", rng.uniform(-180, 180), degrees=True)
        x = np.array([-0.015, -1e-3, 0.0, 1e-3, 0.015])
        points = np.stack([x * np.cos(half), 0 * x, -np.abs(x) * np.sin(half)], axis=1)
        lean = np.array([-half, -half, 0, half, half])
        axes = np.stack([-np.sin(lean), 0 * x, -np.cos(lean)], axis=1)
        drawn = Contour(to.apply(points), to.apply(axes), name="edge")
        path = slow_turns(drawn, [[0, 0, 0]], distance=1e-3, step=2e-3)
        nodes = path.resample(dt=0.04, speed=0.05, bend_ends=True)
        placement = np.eye(4)
        placement[:3, 3] = rng.uniform((0.9, -0.6, 0.3), (1.4, 0.6, 1.0))
        where = {"tool": tool, "placement": placement, "gamma_step": np.radians(10)}
        try:
            made = plan(nodes, arm, feed="dip", certify=None, **where)
        except NoFeasiblePath:
            continue
        planned += 1
        issues = [issue for issue in audit(made, reference=path) if issue.level == "error"]
        between = STRAIGHT | {"tip-between-nodes", "axis-between-nodes"}
        assert [issue for issue in issues if issue.code in between] == [], seed
    assert planned >= 4
