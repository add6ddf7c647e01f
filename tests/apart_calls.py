"""Functions that tests call in other processes."""

import ctypes
import os
import signal
import sys
import time

from kerfpath.effort import current_effort
from kerfpath.errors import InputError


def doubled(number):
    return 2 * number


def whose():
    return os.getpid()


def knows(module):
    return module in sys.modules


def crash():
    ctypes.string_at(0)


def abort():
    os.abort()


def leave():
    os._exit(3)


def hang():
    while True:
        pass


def swell():
    return len(b"x" * (64 * 1024**3))


def refuse():
    raise InputError("the file is damaged; export it again")


def err():
    return {}["key"]


def unpicklable():
    return lambda: None


def interrupted():
    os.kill(os.getppid(), signal.SIGINT)
    time.sleep(20)


def square_slowly(number):
    """Return the square, and the process that has computed it."""
    time.sleep(0.05)
    return number * number, os.getpid()


def binding_nodes(number):
    time.sleep(0.02)
    return current_effort().binding_nodes, number


def inverse(number):
    return 1 / number


def square_here(process, number):
    """Return the square in one process; end any other one."""
    if os.getpid() != process:
        os._exit(3)
    time.sleep(0.05)
    return number * number
