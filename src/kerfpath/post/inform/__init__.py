"""INFORM, the language of Yaskawa controllers, as jobs (.JBI)."""

from kerfpath.post._languages import Language
from kerfpath.post._standing import stop_to_switch
from kerfpath.post.inform._axes import axes_from_joints as axes_from_joints
from kerfpath.post.inform._axes import joints_from_axes as joints_from_axes
from kerfpath.post.inform._axes import manipulator_type as manipulator_type
from kerfpath.post.inform._axes import posture
from kerfpath.post.inform._check import check
from kerfpath.post.inform._external import missing
from kerfpath.post.inform._read import read
from kerfpath.post.inform._settings import InformSettings as InformSettings
from kerfpath.post.inform._settings import is_reserved, rules
from kerfpath.post.inform._write import Inform as Inform

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
    sayable=stop_to_switch,
    ahead=False,
    assumed={"laser_output": 1},
    externals=missing,
    read=read,
)
"""The language as registered."""
