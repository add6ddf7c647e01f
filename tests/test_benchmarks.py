"""The yardsticks of the benchmarks measure against the right thing."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

import kerfpath

ROOT = Path(__file__).parent.parent


def benchmark_module(name):
    """Import benchmarks._dense and the like, which live beside the package, not in it."""
    if "benchmarks" not in sys.modules:
        folder = ROOT / "benchmarks"
        spec = importlib.util.spec_from_file_location(
            "benchmarks", folder / "__init__.py", submodule_search_locations=[str(folder)]
        )
        sys.modules["benchmarks"] = importlib.util.module_from_spec(spec)
    return importlib.import_module(f"benchmarks.{name}")


@pytest.mark.parametrize("metric", ["manhattan", "euclid"])
@pytest.mark.parametrize("velocity", [4.0, 1e6])
@pytest.mark.parametrize("seed", range(5))
def test_the_dense_recursion_finds_the_cost_of_the_shortest_path(metric, velocity, seed):
    rng = np.random.default_rng(seed)
    sizes = rng.integers(20, 40, 12)
    start = np.concatenate([[0], np.cumsum(sizes)])
    q = rng.uniform(-0.5, 0.5, (start[-1], 6)) + rng.integers(-1, 2, (start[-1], 1)) * np.pi
    task = {
        "dt": 0.2,
        "velocity": np.full(6, velocity),
        "endless": np.array([0, 1, 0, 1, 0, 1], bool),
        "weights": rng.uniform(0.5, 2, 6),
        "metric": metric,
    }
    path = kerfpath.shortest_path(q, start, acceleration=np.full(6, 1e9), method="paper", **task)
    dense = benchmark_module("_dense").dense_cost(q, start, **task)
    assert path.optimal
    # Two orders of summation of a dozen numbers near one.
    assert dense == pytest.approx(path.cost, rel=1e-12)


def test_the_dense_recursion_says_when_there_is_no_path():
    q, start = np.zeros((2, 6)), np.array([0, 1, 2])
    q[1] = 1.0
    dense = benchmark_module("_dense").dense_cost
    ones = np.ones(6)
    task = {"endless": np.zeros(6, bool), "weights": ones, "metric": "manhattan"}
    assert dense(q, start, dt=0.5, velocity=ones, **task) == np.inf
    assert dense(q, start, dt=1.0, velocity=ones, **task) == pytest.approx(6.0)


def test_the_serial_chain_given_to_the_peers_is_the_robot():
    arm = benchmark_module("_arm")
    robot = arm.arm()
    axes, origins = arm.chain(robot)
    q = np.array([0.3, -0.4, 0.5, -0.6, 0.7, -0.8])
    R, p = np.eye(3), np.zeros(3)
    for (x, y, z), origin, angle in zip(axes, origins[:6], q, strict=True):
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        p = p + R @ origin
        R = R @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
    T, zero = robot.forward(q), robot.forward(np.zeros(6))
    # Rounding of a dozen products of numbers near one.
    np.testing.assert_allclose(p + R @ origins[6], T[:3, 3], atol=1e-14)
    np.testing.assert_allclose(R @ zero[:3, :3], T[:3, :3], atol=1e-14)
