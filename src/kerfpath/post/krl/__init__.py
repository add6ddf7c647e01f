"""KRL, the language of KUKA controllers (KSS 8)."""

from kerfpath.post._languages import Language
from kerfpath.post.krl._axes import axes_from_joints as axes_from_joints
from kerfpath.post.krl._axes import joints_from_axes as joints_from_axes
from kerfpath.post.krl._axes import posture
from kerfpath.post.krl._axes import status_and_turn as status_and_turn
from kerfpath.post.krl._check import check
from kerfpath.post.krl._external import missing
from kerfpath.post.krl._read import read
from kerfpath.post.krl._settings import KrlSettings as KrlSettings
from kerfpath.post.krl._settings import is_reserved, rules
from kerfpath.post.krl._write import Krl as Krl

KRL = Language(
    name="krl",
    title="KUKA KRL",
    manufacturers=("KUKA",),
    families=("opw",),
    axis_3=("", "serial"),
    suffix=".src",
    settings=KrlSettings,
    rules=rules,
    formatter=Krl,
    is_reserved=is_reserved,
    posture=posture,
    check=check,
    assumed={"laser_output": 1},
    externals=missing,
    read=read,
)
"""The language as registered."""
