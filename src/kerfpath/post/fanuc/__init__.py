"""TP, the language of FANUC controllers, as the listings (.ls) that they load."""

from kerfpath.post._languages import Language, no_settings_needed
from kerfpath.post.fanuc._axes import axes_from_joints as axes_from_joints
from kerfpath.post.fanuc._axes import joints_from_axes as joints_from_axes
from kerfpath.post.fanuc._axes import posture as posture
from kerfpath.post.fanuc._check import check
from kerfpath.post.fanuc._read import read
from kerfpath.post.fanuc._settings import FanucSettings as FanucSettings
from kerfpath.post.fanuc._settings import is_reserved, rules
from kerfpath.post.fanuc._switching import sayable
from kerfpath.post.fanuc._write import Fanuc as Fanuc

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
    sayable=sayable,
    assumed={"laser_output": 1},
    externals=no_settings_needed,
    read=read,
)
"""The language as registered."""
