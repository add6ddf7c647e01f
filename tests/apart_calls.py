"""Functions that the tests of `kerfpath.isolated` call in another process."""

import ctypes
import os
import signal
import sys
import time

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
