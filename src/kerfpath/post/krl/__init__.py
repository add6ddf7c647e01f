"""KRL, the language of KUKA controllers (KSS 8)."""

from kerfpath.post.krl.controller import KrlSettings as KrlSettings
from kerfpath.post.krl.controller import axes_from_joints as axes_from_joints
from kerfpath.post.krl.controller import (
    bounds,
    check,
    inherited,
    is_reserved,
    missing,
    posture,
    rules,
)
from kerfpath.post.krl.controller import joints_from_axes as joints_from_axes
from kerfpath.post.krl.controller import status_and_turn as status_and_turn
from kerfpath.post.krl.reader import read
from kerfpath.post.krl.writer import Krl as Krl
from kerfpath.post.languages import Language

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
    bounds=bounds,
    assumed={"laser_output": 1},
    externals=missing,
    encodings=("utf-8-sig", "cp1252"),
    longest_line=250,
    inherited=inherited,
    follows_speed=True,
    read=read,
)
"""The language as registered."""
