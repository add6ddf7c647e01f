"""Taylor models and regions: enclosures that hold every solution, at any tilt and external axes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kerfpath import robot
from kerfpath.robots import ExternalAxis
from kerfpath.robots.external_axes import base_in_part
from kerfpath.robots.regions import enclose_regions
from kerfpath.robots.taylor import Region, angle_of

COUNT, M = 60, 3
TOOL = np.eye(4)
TOOL[:3, :3] = Rotation.from_euler("y", 40, degrees=True).as_matrix()
TOOL[:3, 3] = 0.1, 0.0, 0.3
RAIL = ExternalAxis(name="rail", kind="linear", carries="robot", axis=[0, 1, 0])
CHUCK = ExternalAxis(
    name="chuck", kind="rotary", carries="part", axis=[0.2, 1, 0], point=[1.3, 0, 0.6]
)
TABLE = ExternalAxis(
    name="table", kind="rotary", carries="part", axis=[0, 0.3, 1], point=[1, 0.2, 0.6]
)
CASES = {
    "gamma": ((), False),
    "tilt": ((), True),
    "rail": ((RAIL,), False),
    "table": ((TABLE,), False),
    "rail, two that carry the part": ((RAIL, CHUCK, TABLE), False),
    "tilt and rail": ((RAIL,), True),
}


@pytest.fixture
def drawn():
    """Give three random models, and their parameters at random places of the region."""
    rng = np.random.default_rng(5)
    half = rng.uniform(0.01, 0.3, (M, COUNT))
    region = Region.of(half)
    middle = rng.uniform(-2, 2, (M, COUNT))
    return region, region.parameters(middle), middle, rng


FUNCTIONS = {
    "product": (lambda x, y, z: x * y - z * z, lambda x, y, z: x * y - z * z),
    "root": (
        lambda x, y, z: (x * x + y * y).plus(0.1).sqrt(),
        lambda x, y, z: np.sqrt(x * x + y * y + 0.1),
    ),
    "cosine": (lambda x, y, z: (x * y).cos_sin()[0] * z, lambda x, y, z: np.cos(x * y) * z),
    "sine": (lambda x, y, z: (x + z).cos_sin()[1].scaled(3.0), lambda x, y, z: 3 * np.sin(x + z)),
    "arccos": (
        lambda x, y, z: (x * y).scaled(0.3).arccos(),
        lambda x, y, z: np.arccos(np.clip(0.3 * x * y, -1, 1)),
    ),
    "angle": (lambda x, y, z: angle_of(y, x) + z, lambda x, y, z: np.arctan2(y, x) + z),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_model_encloses_its_function(drawn, name):
    region, models, middle, rng = drawn
    model, value = FUNCTIONS[name]
    with np.errstate(all="ignore"):
        found = model(*models)
    for trial in range(50):
        share = rng.uniform(-1, 1, (M, COUNT))
        if trial < 8:
            share = np.sign(share)
        s = share * region.half
        polynomial = found.line[0] + (found.line[1:] * s).sum(axis=0)
        polynomial = polynomial + (found.quad * s[region.first] * s[region.second]).sum(axis=0)
        off = value(*(middle + s)) - polynomial
        if name == "angle":
            off -= 2 * np.pi * np.round(off / (2 * np.pi))
        assert (np.abs(off) <= found.rest).all()


def test_what_is_left_over_falls_with_the_third_power(drawn):
    """Half the region leaves an eighth of the rest, for a chain of all functions."""
    _, _, middle, _ = drawn
    middle = middle / 2  # below 1, where all functions are smooth
    rests = []
    for half in (0.01, 0.005):
        x, y, z = Region.of(np.full((M, COUNT), half)).parameters(middle)
        c, s = (x * y).cos_sin()
        chain = angle_of(s + z, c.plus(3.0)) * (x * x).plus(1.0).sqrt() + (y.scaled(0.4)).arccos()
        rests.append(chain.rest)
    assert np.median(rests[0] / rests[1]) == pytest.approx(8, rel=0.1)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", ["abb_irb4600_60_205", "ur_ur10e"])
def test_a_region_encloses_every_solution(name, case):
    """Solutions of the closed form at random places, corners among them, are in the bounds."""
    axes, tilted = CASES[case]
    one, rng = robot(name), np.random.default_rng(7)
    arm, n = one.arm, one.arm.joints
    joints = rng.uniform(-2.5, 2.5, (COUNT, n))
    frames = arm.forward(joints) @ TOOL
    wide = rng.choice([1e-7, 0.01, 0.05], COUNT)
    gamma, half = rng.uniform(-3, 3, COUNT), wide
    more = 2 * tilted + len(axes)
    at = rng.uniform(-0.3, 0.3, (COUNT, more))
    reach = np.repeat(wide[:, None], more, axis=1)
    node = np.arange(COUNT)
    found = enclose_regions(arm, axes, frames, TOOL, node, gamma, half, at, reach)
    reached = 0
    for trial in range(12):
        share = rng.uniform(-1, 1, (COUNT, 1 + more))
        if trial < 6:
            share = np.sign(share)
        t, s = share[:, 0] * half, share[:, 1:] * reach
        tilt, x = np.zeros((COUNT, 3)), (at + s)[:, 2 * tilted :]
        if tilted:
            tilt[:, :2] = (at + s)[:, :2]
        T = frames.copy()
        turn = Rotation.from_rotvec((gamma + t)[:, None] * [0.0, 0.0, 1.0])
        T[:, :3, :3] = T[:, :3, :3] @ (Rotation.from_rotvec(tilt) * turn).as_matrix()
        if axes:
            T = np.linalg.inv(base_in_part(axes, x)) @ T
        q, reach_it = arm.inverse_all(T @ np.linalg.inv(TOOL))
        t = t[:, None, None]
        there = found.center + found.slope * t + found.bend * t**2 / 2
        there += np.einsum("cpmn,cm->cpn", found.tied, s)
        off = q - there[:, :, :n]
        off -= 2 * np.pi * np.round(off / (2 * np.pi))
        inside = (np.abs(off) <= found.radius[:, :, :n] + 1e-13).all(axis=2) & (found.status > 0)
        assert (inside | ~reach_it).all()
        assert np.abs(there[:, :, n:] - x[:, None]).max(initial=0) < 1e-12
        reached += reach_it.sum()
    assert reached > 300
    # Where the region is small the bounds are close.
    assert np.median(found.radius[wide < 1e-6][found.status[wide < 1e-6] > 0]) < 1e-11
