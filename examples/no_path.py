"""A corner too sharp for the speed: no path, proved; then slowed down there, or interrupted.

Run it with `python examples/no_path.py`.
"""

from __future__ import annotations

import numpy as np

import kerfpath


def corner() -> kerfpath.Contour:
    """Two straight lines that meet at a right angle, the tool axis leaning over as it turns."""
    along = np.linspace(0, 0.16, 81)
    points = np.stack([np.minimum(along, 0.08), np.maximum(along - 0.08, 0), 0 * along], axis=1)
    lean = 0.3 / (1 + np.exp((0.08 - along) / 0.004))
    return kerfpath.Contour(points, np.c_[lean, 0 * along, -np.ones(81)], name="corner")


def main() -> None:
    """Plan the corner at 0.15 m/s in every available way."""
    robot = kerfpath.robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
    robot = robot.with_limits(endless=np.isin(np.arange(1, 7), (4, 6)))
    tool, placement = np.eye(4), np.eye(4)
    tool[:3, :3] = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    tool[:3, 3], placement[:3, 3] = [0.15, 0, 0.30], [1.2, 0, 0.4]
    contour, step = corner(), np.radians(5)

    fastest = kerfpath.fastest_speed(
        contour, robot, tool=tool, placement=placement, gamma_step=step, refine=True
    )
    assert fastest.on_grid is not None
    print(f"fastest constant speed: {fastest.on_grid:.3f} m/s on the grid, {fastest.speed:.3f} off")
    print(f"  there the {fastest.limit} of joint {fastest.joint + 1} binds at node {fastest.node}")
    try:
        kerfpath.plan(
            contour, robot, tool=tool, placement=placement, gamma_step=step, speed=0.15,
            method="exact",
        )  # fmt: skip
    except kerfpath.NoFeasiblePath as broken:
        print(f"constant, on the grid: none, proved: {broken.proved}; {broken}")
    for refine in (False, True):
        dipped = kerfpath.plan(
            contour,
            robot,
            tool=tool,
            placement=placement,
            gamma_step=step,
            speed=0.15,
            feed="dip",
            method="exact",
            refine=refine,
        )
        where = "off the grid" if refine else "on the grid"
        print(f"dipped {where}: {dipped.time[-1]:.3f} s, {dipped.feed}")
        for issue in kerfpath.audit(dipped):
            assert issue.level == "warning", issue
            print(f"  {issue}")
    # Around the corner only pieces of a millimetre are fast enough; the default is 10 mm or more.
    pieces = kerfpath.plan_in_pieces(
        contour, robot, tool=tool, placement=placement, gamma_step=step, speed=0.15,
        method="exact", least_piece=1e-4,
    )  # fmt: skip
    print(f"interrupted: {len(pieces)} pieces of {[len(p.q) for p in pieces]} nodes")


if __name__ == "__main__":
    main()
