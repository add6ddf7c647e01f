"""The bodies of a cell: robot links as capsules, a parametric cutting head, fixed things."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import as_pose, scalar
from kerfpath.cell._chain import Chain
from kerfpath.cell._shapes import Capsule, Shape, frustum
from kerfpath.errors import InputError
from kerfpath.robots import Robot

__all__ = ["Body", "CuttingHead", "Kind", "link_capsules"]

Kind = Literal["robot", "head", "part", "fixture"]

FLANGE = 6
"""Frame of the last link."""

FRACTIONS = {"base": 0.10, "shoulder": 0.09, "upper arm": 0.07, "forearm": 0.055, "wrist": 0.04}
"""Radius of each link's capsule over the length c2 + c3 of the arm: typical of heavy arms, drawn
rather too thick than too thin."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Body:
    """A solid fixed in one of the robot's frames.

    Parameters
    ----------
    name : str
        Unique in the cell.
    shape : Shape
        In coordinates of the frame, m.
    frame : int
        0 the robot base, where all that stands still is; i the link that joint i moves.
    kind : {"robot", "head", "part", "fixture"}
    approximate : bool
        The shape stands in for one that is not known.
    """

    name: str
    shape: Shape
    frame: int
    kind: Kind
    approximate: bool = False


def link_capsules(robot: Robot) -> tuple[Body, ...]:
    """Return the links of an OPW robot as capsules along its lengths, marked approximate.

    Radii are `FRACTIONS` of the arm's length; for judging a cell in earnest, take the meshes of
    the robot's description.
    """
    g, arm = robot.geometry, robot.geometry["c2"] + robot.geometry["c3"]
    elbow = (g["a2"], 0.0, 0.0)
    lines = [
        ("base", "base", 0, (0.0, 0.0, 0.0), (0.0, 0.0, g["c1"] / 2)),
        ("link 1", "shoulder", 1, (0.0, 0.0, g["c1"]), (g["a1"], g["b"], g["c1"])),
        ("link 2", "upper arm", 2, (0.0, 0.0, 0.0), (0.0, 0.0, g["c2"])),
        ("link 3 elbow", "forearm", 3, (0.0, 0.0, 0.0), elbow),
        ("link 3", "forearm", 3, elbow, (g["a2"], 0.0, g["c3"])),
        ("link 5", "wrist", 5, (0.0, 0.0, 0.0), (0.0, 0.0, g["c4"] / 2)),
    ]
    return tuple(
        Body(
            name=name,
            shape=Capsule(start=np.array(start), end=np.array(end), radius=FRACTIONS[thick] * arm),
            frame=frame,
            kind="robot",
            approximate=True,
        )
        for name, thick, frame, start, end in lines
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CuttingHead:
    """A generic cutting head: a conical nozzle, a round body above it, an arm to the flange.

    Everything lies along the beam, the tip's z axis. The tip is where the beam meets the part; the
    nozzle ends at the stand-off above it, and must keep `share` of the stand-off to the part.

    Parameters
    ----------
    stand_off : float m
        From the nozzle's end to the part.
    share : float
        Of the stand-off, what the nozzle may come down to.
    nozzle_length : float m
    nozzle_radii : (2,) m
        At its end and where it meets the body.
    body_length, body_radius : float m
    arm_radius : float m
    """

    stand_off: float = 1e-3
    share: float = 0.5
    nozzle_length: float = 0.06
    nozzle_radii: tuple[float, float] = (2.5e-3, 16e-3)
    body_length: float = 0.14
    body_radius: float = 0.04
    arm_radius: float = 0.05

    def __post_init__(self) -> None:
        for name in ("stand_off", "nozzle_length", "body_length", "body_radius", "arm_radius"):
            scalar(getattr(self, name), f"head {name}", unit="m", above=0.0)
        if not 0 <= self.share < 1:
            raise InputError(f"head share: expected 0 to below 1, got {self.share:g}")

    @property
    def keeps(self) -> float:
        """Distance (m) that the nozzle must keep to the part."""
        return self.share * self.stand_off

    def bodies(self, chain: Chain, T_flange_tip: ArrayLike) -> tuple[Body, ...]:
        """Return nozzle, head and, from the flange to the head, the arm."""
        tip = as_pose(T_flange_tip, "T_flange_tip")
        beam, at = tip[:3, 2], tip[:3, 3]
        end = at - self.stand_off * beam
        neck = end - self.nozzle_length * beam
        top = neck - self.body_length * beam
        shapes: dict[str, Shape] = {
            "nozzle": frustum(end, neck, self.nozzle_radii),
            "head": frustum(neck, top, (self.body_radius, self.body_radius)),
            "arm": Capsule(start=np.zeros(3), end=top, radius=self.arm_radius),
        }
        return tuple(
            Body(name=name, shape=shape.moved(chain.flange), frame=FLANGE, kind="head")
            for name, shape in shapes.items()
        )
