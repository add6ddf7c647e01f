"""RAPID, the language of ABB controllers."""

from kerfpath.post.languages import Language
from kerfpath.post.rapid.controller import RapidSettings as RapidSettings
from kerfpath.post.rapid.controller import axes_from_joints as axes_from_joints
from kerfpath.post.rapid.controller import confdata as confdata
from kerfpath.post.rapid.controller import inherited, is_reserved, missing, posture, rules
from kerfpath.post.rapid.controller import joints_from_axes as joints_from_axes
from kerfpath.post.rapid.reader import read
from kerfpath.post.rapid.writer import Rapid as Rapid

RAPID = Language(
    name="rapid",
    title="ABB RAPID",
    manufacturers=("ABB",),
    families=("opw",),
    axis_3=("serial", "horizontal"),
    suffix=".mod",
    settings=RapidSettings,
    rules=rules,
    formatter=Rapid,
    is_reserved=is_reserved,
    posture=posture,
    externals=missing,
    encodings=("utf-8-sig", "cp1252"),
    inherited=inherited,
    follows_speed=True,
    read=read,
)
"""The language as registered."""
