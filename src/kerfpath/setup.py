"""The setup of a contour: the robot, its tool, where the part is, and what is around them."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from kerfpath.arrays import Array, as_pose, short_repr
from kerfpath.cell import Cell
from kerfpath.robots import Robot

__all__ = ["Setup"]


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

    @classmethod
    def of(
        cls, robot: Robot, tool: ArrayLike, placement: ArrayLike, cell: Cell | None = None
    ) -> Setup:
        """Return the setup with tool and placement checked.

        Raises
        ------
        InputError
            A tool or a placement that is no pose.
        """
        T_flange_tip, T_base_part = as_pose(tool, "tool"), as_pose(placement, "placement")
        return cls(robot=robot, tool=T_flange_tip, placement=T_base_part, cell=cell)
