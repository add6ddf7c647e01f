"""Fixtures shared by the tests: a robot with all limits, tool, placement, contour; a cluster."""

import importlib.util
import json
import os
import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from kerfpath import compiling, isolated
from kerfpath.contour import Contour
from kerfpath.effort import Effort, changed_effort, set_effort
from kerfpath.robots import robot

# The same examples in every run, without a deadline that a busy machine could miss.
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")


ROOT = Path(__file__).parents[1]


def pose(xyz, rotation=None):
    T = np.eye(4)
    T[:3, 3] = xyz
    if rotation is not None:
        T[:3, :3] = rotation
    return T


# A plan states a bound by default, which takes seconds. Tests ask for it where they are about it,
# and jobs get a little of it; the commands that tests start state it as a user sees it. The search
# for the quickest motion and its ceiling take seconds a contour, too.
USUAL = Effort()
set_effort(
    Effort(
        certified=False,
        explored=False,
        certificate_pairs=1_500_000,
        certificate_pairs_per_node=0,
        minimax_pairs=300_000,
        infeasibility_steps=200_000,
        infeasibility_tubes=20,
        binding_nodes=2,
        speed_factors=(),
    )
)


def pytest_sessionstart(session):
    """Compile the kernels of the main job once, before several workers each do so."""
    if getattr(session.config.option, "numprocesses", None):  # of workers it is not set
        for kinematics in compiling.EXAMPLES:
            compiling.warm_up(kinematics)


WITHOUT_KERNELS = {"cad", "sweep", "urdf", "test_apart.py"}


def pytest_collection_modifyitems(items):
    """Order modules for two workers that start with a half each, and with few kernels compiled.

    Those with long tests come first, so that none is left to wait for at the end. The second half
    begins with what needs no kernels: while one worker compiles them, the other need not.
    """
    long = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in long)
    light = [i for i in items if i.path.relative_to(ROOT / "tests").parts[0] in WITHOUT_KERNELS]
    kept = set(light)
    others = [item for item in items if item not in kept]
    half = min(len(items) // 2, len(others))
    while 0 < half < len(others) and others[half].path == others[half - 1].path:
        half -= 1
    items[:] = [*others[:half], *light, *others[half:]]


def rebuilt(robot, **changes):
    """The robot with another geometry, convention or frames of its arm."""
    return replace(robot, arm=replace(robot.arm, **changes))


@pytest.fixture
def change_effort():
    """Give the function that changes limits of the effort until the test ends."""
    with ExitStack() as changes:
        yield lambda **limits: changes.enter_context(changed_effort(**limits))


@pytest.fixture
def quickest_at_work():
    """Look for the quickest motion as far as outside the tests."""
    with changed_effort(speed_factors=USUAL.speed_factors):
        yield


@pytest.fixture
def ceiling_at_work():
    """Let the search for what is impossible work as much as outside the tests."""
    with changed_effort(infeasibility_steps=USUAL.infeasibility_steps):
        yield


@pytest.fixture
def certified_by_default():
    """Let plans be certified unless they are not to be, as outside the tests."""
    with changed_effort(certified=True):
        yield


@pytest.fixture
def explored():
    """Let plans explore all valleys, as outside the tests."""
    with changed_effort(explored=True):
        yield


@pytest.fixture
def certifier_at_work():
    """Let the certifier work as much as outside the tests."""
    with changed_effort(
        certificate_pairs=USUAL.certificate_pairs,
        certificate_pairs_per_node=USUAL.certificate_pairs_per_node,
    ):
        yield


@pytest.fixture(scope="session", autouse=True)
def reader():
    """Keep the process that reads files: between tests it would leave, and start again for 2 s."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(isolated, "IDLE", 600.0)
        yield


@pytest.fixture(scope="session")
def arm():
    """An IRB 4600 with stated accelerations, axes 4 and 6 endless."""
    return robot("abb_irb4600_60_205").with_limits(
        acceleration=np.radians([320, 270, 420, 1300, 1400, 2000]), endless=[0, 0, 0, 1, 0, 1]
    )


@pytest.fixture(scope="session")
def tool():
    """A head whose beam leaves the flange axis by 45 degrees, so that gamma moves every joint."""
    c = np.sqrt(0.5)
    return pose([0.15, 0, 0.30], [[c, 0, c], [0, 1, 0], [-c, 0, c]])


@pytest.fixture(scope="session")
def placement():
    return pose([1.2, 0.0, 0.4])


@pytest.fixture(scope="session")
def circle():
    """A closed circle of radius 0.15 m on a gentle dome, tool pointing down into it, 121 nodes."""
    t = np.linspace(0, 2 * np.pi, 4001)
    points = np.c_[0.15 * np.cos(t), 0.15 * np.sin(t), 0.02 * np.cos(2 * t)]
    axes = np.c_[-0.2 * np.cos(t), -0.2 * np.sin(t), -np.ones_like(t)]
    return Contour(points, axes, closed=True, name="circle").resample(count=121)


@pytest.fixture(scope="session")
def examples():
    """The script that models the example drawings."""
    path = Path(__file__).parents[1] / "examples" / "model_drawings.py"
    spec = importlib.util.spec_from_file_location("model_drawings", path)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


@pytest.fixture(scope="module")
def dask():
    """Start parts of a cluster; all are stopped at the end."""
    pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
    started = []

    def start(*arguments, path=""):
        known = os.pathsep.join([path, *sys.path, str(Path(__file__).parent)])
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments, "--host", "127.0.0.1", "--no-dashboard"],
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": known},
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()


@pytest.fixture
def scheduler(dask, tmp_path):
    """Start a scheduler and give its address."""
    file = tmp_path / "scheduler.json"
    dask("scheduler", "--port", "0", "--scheduler-file", str(file))
    while not file.exists() or not file.read_text().endswith("}"):
        time.sleep(0.02)
    return json.loads(file.read_text())["address"]


@pytest.fixture
def workers(dask, scheduler, tmp_path):
    """Give the function that starts a number of workers, and returns their processes."""
    import distributed

    def start(count, **given):
        options = ("--nthreads", "1", "--no-nanny", "--local-directory", str(tmp_path))
        started = [dask("worker", scheduler, *options, **given) for _ in range(count)]
        with distributed.Client(scheduler) as client:
            client.wait_for_workers(count, timeout=30)
        return started

    return start
