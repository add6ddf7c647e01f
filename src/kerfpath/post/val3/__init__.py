"""VAL 3, the language of Staubli controllers, as projects of XML files."""

from kerfpath.post.languages import Language
from kerfpath.post.program import stop_to_switch
from kerfpath.post.val3.controller import Val3Settings as Val3Settings
from kerfpath.post.val3.controller import axes_from_joints as axes_from_joints
from kerfpath.post.val3.controller import check, inherited, is_reserved, rules
from kerfpath.post.val3.controller import configurations as configurations
from kerfpath.post.val3.controller import joints_from_axes as joints_from_axes
from kerfpath.post.val3.controller import posture as posture
from kerfpath.post.val3.reader import read
from kerfpath.post.val3.writer import Val3 as Val3

VAL3 = Language(
    name="val3",
    title="Staubli VAL 3",
    manufacturers=("Staubli",),
    families=("opw",),
    axis_3=("", "serial"),
    suffix=".pjx",
    settings=Val3Settings,
    rules=rules,
    formatter=Val3,
    is_reserved=is_reserved,
    posture=posture,
    check=check,
    sayable=stop_to_switch,
    ahead=False,
    byte_order_mark=True,
    assumed={"laser_output": r"BasicIO-1\%Q0"},
    inherited=inherited,
    no_power="VAL 3 switches outputs only where the robot stands, so no power follows the speed",
    read=read,
)
"""The language as registered."""
