"""The zones of a path: they never overlap, and the automatic ones are as wide as they may be."""

import numpy as np
import pytest

from kerfpath import InputError, robot
from kerfpath.post import build_program
from kerfpath.post.arcs import zones_at
from programs import arc, frames, hand_plan


@pytest.mark.parametrize("seed", range(20))
def test_automatic_zones_use_the_room_and_keep_the_error(seed):
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(size=(30, 3)) * rng.uniform(5e-4, 1e-2, (30, 1)), axis=0)
    error = 10 ** rng.uniform(-4.5, -3)
    *zones, last = zones_at(points, "auto", error)
    steps = np.diff(points, axis=0)
    gaps = np.linalg.norm(steps, axis=1)
    room = 0.49 * np.minimum(gaps[:-1], gaps[1:])
    passed = np.array(zones) / 4 * np.linalg.norm(np.diff(steps / gaps[:, None], axis=0), axis=1)
    assert last == 0
    assert len(zones) == 28
    assert (np.array(zones) <= room).all()
    assert passed.max() <= error * (1 + 1e-12)
    # One of both binds, but for the steps that zones are rounded down to: 1.1 %, and 1 um.
    lost = 1 - 2 ** (-1 / 64) + 1e-6 / np.array(zones)
    assert (np.maximum(np.array(zones) / room, passed / error) >= 1 - lost).all()


def test_on_a_straight_line_zones_end_just_short_of_half_way():
    points = np.c_[np.arange(5) * 0.002, np.zeros(5), np.zeros(5)]
    assert zones_at(points, "auto", 1e-4) == pytest.approx([0.00098] * 3 + [0.0], abs=1e-6)


def test_zones_of_a_length_are_halved_until_they_fit():
    points = np.c_[[0, 1, 1.5, 3.5, 5.5], np.zeros((5, 2))]
    assert zones_at(points, 0.6, 1e-4) == [0.15, 0.15, 0.6, 0.0]
    assert zones_at(points, 0, 1e-4) == [0.0] * 4


@pytest.mark.parametrize("wrong", [{"zone": -1.0}, {"zone": "wide"}, {"zone_error": 0.0}])
def test_other_zones_are_refused(wrong):
    made = hand_plan(arc(), robot("abb_irb4600_60_205"), *frames())
    with pytest.raises(InputError, match=next(iter(wrong))):
        build_program([made], **wrong)
