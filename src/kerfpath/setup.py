"""The setup of a contour: the robot, its tool, where the part is, and what is around them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, as_pose, require_instance, require_metres, short_repr
from kerfpath.cell import Cell
from kerfpath.robots import Robot

__all__ = ["Setup"]

ROBOT = 'make one with kerfpath.robot("abb_irb4600_60_205") or kerfpath.Robot.from_urdf("arm.urdf")'
"""What to do where no robot was given."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Setup:
    """A robot with its tool and its part, in a cell if there is one.

    Parameters
    ----------
    robot : Robot
    tool : (4, 4) m
        T_flange_tip.
    placement : (4, 4) m
        T_base_part.
    cell : Cell, optional
        What the robot must not collide with.
    """

    robot: Robot
    tool: Array
    placement: Array
    cell: Cell | None = None

    __repr__ = short_repr

    def folded(self, joints: Bools) -> Setup:
        """Return the setup with some joints (n,) of its robot endless."""
        if not joints.any():
            return self
        robot = self.robot.folded(joints)
        cell = None if self.cell is None else self.cell.with_endless(robot.endless)
        return replace(self, robot=robot, cell=cell)

    @classmethod
    def of(
        cls, robot: Robot, tool: ArrayLike, placement: ArrayLike, cell: Cell | None = None
    ) -> Setup:
        """Return the setup with tool and placement checked.

        Raises
        ------
        InputError
            No robot, a tool or a placement that is no pose, or a cell of another type.
        """
        require_instance(robot, Robot, "robot", ROBOT)
        if cell is not None:
            require_instance(cell, Cell, "cell", "kerfpath.cell.build_cell makes one")
        T_flange_tip, T_base_part = as_pose(tool, "tool"), as_pose(placement, "placement")
        require_metres(float(np.abs(T_flange_tip[:3, 3]).max()), "tool")
        require_metres(float(np.abs(T_base_part[:3, 3]).max()), "placement")
        return cls(robot=robot, tool=T_flange_tip, placement=T_base_part, cell=cell)
