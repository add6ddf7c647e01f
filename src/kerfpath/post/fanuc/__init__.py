"""TP, the language of FANUC controllers, as the listings (.ls) that they load."""

from kerfpath.post.fanuc.controller import FanucSettings as FanucSettings
from kerfpath.post.fanuc.controller import axes_from_joints as axes_from_joints
from kerfpath.post.fanuc.controller import (
    bounds,
    endless_bounds,
    inherited,
    is_reserved,
    rules,
    sayable,
)
from kerfpath.post.fanuc.controller import joints_from_axes as joints_from_axes
from kerfpath.post.fanuc.controller import posture as posture
from kerfpath.post.fanuc.reader import read
from kerfpath.post.fanuc.writer import Fanuc as Fanuc
from kerfpath.post.fanuc.writer import check
from kerfpath.post.languages import Language, no_settings_needed

FANUC = Language(
    name="fanuc",
    title="FANUC TP",
    manufacturers=("FANUC",),
    families=("opw",),
    axis_3=("horizontal",),
    suffix=".ls",
    settings=FanucSettings,
    rules=rules,
    formatter=Fanuc,
    is_reserved=is_reserved,
    posture=posture,
    check=check,
    bounds=bounds,
    endless_bounds=endless_bounds,
    sayable=sayable,
    assumed={"laser_output": 1},
    externals=no_settings_needed,
    encodings=("utf-8-sig", "cp1252"),
    longest_line=250,
    inherited=inherited,
    read=read,
)
"""The language as registered."""
