"""What the tests of the certifier share: a short contour."""

import numpy as np
import pytest

from kerfpath import plan
from kerfpath.contour import Contour


@pytest.fixture(scope="module")
def arc():
    """A third of a circle on a dome, 31 nodes."""
    t = np.linspace(0, 2.1, 2001)
    points = np.c_[0.15 * np.cos(t), 0.15 * np.sin(t), 0.02 * np.cos(2 * t)]
    axes = np.c_[-0.2 * np.cos(t), -0.2 * np.sin(t), -np.ones_like(t)]
    return Contour(points, axes, closed=False, name="arc").resample(count=31)


@pytest.fixture(scope="module")
def plans(arc, arm, tool, placement):
    """Give the plan of the arc with some options; each is made once."""
    kept = {}

    def of(**options):
        key = tuple(options.items())
        if key not in kept:
            kept[key] = plan(
                arc, arm, tool=tool, placement=placement, speed=0.3, certify=None, **options
            )
        return kept[key]

    return of
