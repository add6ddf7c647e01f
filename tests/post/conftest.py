"""Fixtures of a language's tests: the robot, plan and program of the `CASE` that a module names."""

import pytest


@pytest.fixture(scope="module")
def cell(request):
    """Robot, tool and placement."""
    return request.module.CASE.cell


@pytest.fixture(scope="module")
def small(request):
    """The plan of the golden program."""
    return request.module.CASE.small


@pytest.fixture(scope="module")
def program(request):
    """The golden program."""
    return request.module.CASE.program
