"""INFORM, the language of Yaskawa controllers, as jobs (.JBI)."""

from kerfpath.post.inform.controller import InformSettings as InformSettings
from kerfpath.post.inform.controller import axes_from_joints as axes_from_joints
from kerfpath.post.inform.controller import (
    bounds,
    check,
    inherited,
    is_reserved,
    missing,
    posture,
    rules,
    sayable,
)
from kerfpath.post.inform.controller import joints_from_axes as joints_from_axes
from kerfpath.post.inform.controller import manipulator_type as manipulator_type
from kerfpath.post.inform.reader import read
from kerfpath.post.inform.writer import Inform as Inform
from kerfpath.post.languages import Language

INFORM = Language(
    name="inform",
    title="Yaskawa INFORM",
    manufacturers=("Yaskawa",),
    families=("opw",),
    axis_3=("serial",),
    suffix=".JBI",
    settings=InformSettings,
    rules=rules,
    formatter=Inform,
    is_reserved=is_reserved,
    posture=posture,
    check=check,
    bounds=bounds,
    sayable=sayable,
    ahead=False,
    assumed={"laser_output": 1},
    externals=missing,
    encodings=("utf-8-sig", "cp932", "cp1252"),
    longest_line=250,
    inherited=inherited,
    no_power="INFORM switches outputs only where the robot stands, so no power follows the speed",
    follows_speed=True,
    read=read,
)
"""The language as registered."""
