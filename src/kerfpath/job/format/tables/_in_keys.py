"""Messages that advise Python arguments, translated into the keys of a job."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["in_keys"]

IN_KEYS = {
    "lower= and upper=": "lower_deg and upper_deg",
    "velocity=": "velocity_deg_s",
    "(rad, rad/s)": "(deg, deg/s)",
    "snap=5e-06": "snap_deg = 0.0003",
    "snap=5e-05": "snap_deg = 0.003",
    "snap=0.0005": "snap_deg = 0.03",
    "snap=0.005": "snap_deg = 0.3",
    "snap=0": "snap_deg = 0",
    'packages={"NAME": "FOLDER"}, or read only the kinematics with meshes=False': (
        'packages = { NAME = "FOLDER" }'
    ),
    "choose base= or tip=": "choose base or tip",
    "axis_3_limits=": "axis_3_deg",
}
"""Python arguments in messages about descriptions, and the keys of a job in their place."""


def in_keys(said: str, words: Mapping[str, str] = IN_KEYS) -> str:
    """Return a message with keys of a job file in place of Python arguments."""
    for python, ours in words.items():
        said = said.replace(python, ours)
    return said
