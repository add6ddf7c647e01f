"""Programs over cones: a worked example, and what happens where there is no memory."""

import subprocess
import sys

import numpy as np
import pytest
from scipy import sparse

from kerfpath.conic import NonnegativeConeT, SecondOrderConeT, minimise

ROUNDED = 1e-6
"""Ten times the solver's own tolerance on a program of order 1."""

LITTLE = """
import resource
import numpy as np
from scipy import sparse
from kerfpath.conic import NonnegativeConeT, minimise

pages = int(open("/proc/self/statm").read().split()[0])
limit = pages * resource.getpagesize() + (8 << 20)
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
try:
    minimise(np.ones(1000), -sparse.eye_array(1000), np.zeros(1000), [NonnegativeConeT(1000)])
except MemoryError as error:
    print(error)
"""


def test_the_nearest_point_of_a_disk_to_a_line():
    """Of the points (x, y) within 1 of the origin, (-0.6, -0.8) has the least 3 x + 4 y."""
    rows = sparse.csc_matrix([[0.0, 0.0], [-1.0, 0.0], [0.0, -1.0]])
    found = minimise(np.array([3.0, 4.0]), rows, np.array([1.0, 0, 0]), [SecondOrderConeT(3)])
    assert found.solved
    assert found.x == pytest.approx([-0.6, -0.8], abs=ROUNDED)
    assert found.dual == pytest.approx([5.0, 3.0, 4.0], abs=10 * ROUNDED)


def test_a_program_without_an_optimum_is_not_solved():
    rows = sparse.csc_matrix([[1.0], [-1.0]])
    found = minimise(np.zeros(1), rows, np.array([-1.0, -1.0]), [NonnegativeConeT(2)])
    assert not found.solved


def test_too_little_memory_is_an_error_and_not_the_end_of_the_process():
    done = subprocess.run(
        [sys.executable, "-c", LITTLE], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout) == (0, "68 MB are not free\n"), done.stderr
