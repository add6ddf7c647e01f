"""Tasks of sweeps for the tests, in a module that worker processes can import."""

import os
import signal
import sys
import time
from pathlib import Path

from kerfpath.effort import current_effort
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.sweep import UnfitWorker


class Stubborn(Exception):
    """An exception that does not survive the way back from a process."""

    def __init__(self, *, needed):
        super().__init__(f"needs {needed}")


def binding_nodes():
    return current_effort().binding_nodes


def square(x):
    return {"square": x * x}


def marked(x, folder, seconds=0.0):
    """Leave a mark per call, so that a test can count them."""
    time.sleep(seconds)
    with (Path(folder) / str(x)).open("a") as file:
        file.write("x")
    return [x, os.getpid()]


def troubled(what):
    match what:
        case "path":
            raise NoFeasiblePath("layer 3 is empty", proved=True, node=2)
        case "input":
            raise InputError("speed: expected more than 0")
        case "exit":
            sys.exit("enough")
        case "stubborn":
            raise Stubborn(needed="more")
        case "infinite":
            return float("inf")
        case "object":
            return object()
        case "surrogate":
            raise ValueError("\udcff")
        case "unfit":
            raise UnfitWorker("the drawing is not here")
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
    return what


def threads():
    return [os.environ["NUMBA_NUM_THREADS"], os.environ["OMP_NUM_THREADS"]]
