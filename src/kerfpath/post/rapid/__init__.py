"""RAPID, the language of ABB controllers."""

from kerfpath.post._languages import Language
from kerfpath.post.rapid._axes import axes_from_joints as axes_from_joints
from kerfpath.post.rapid._axes import confdata as confdata
from kerfpath.post.rapid._axes import joints_from_axes as joints_from_axes
from kerfpath.post.rapid._axes import posture
from kerfpath.post.rapid._external import missing
from kerfpath.post.rapid._read import read
from kerfpath.post.rapid._settings import RapidSettings as RapidSettings
from kerfpath.post.rapid._settings import is_reserved, rules
from kerfpath.post.rapid._write import Rapid as Rapid

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
    read=read,
)
"""The language as registered."""
