"""Handshakes: partners that are asked and awaited before the beam, in every language."""

import pytest

from kerfpath.post import Await, Request, build_program, dry_run, preflight
from kerfpath.robots import robot
from programs import arc, codes, frames, hand_plan, with_steps

ASKED = (Request(partner="shutter", on=True), Await(partner="ready", timeout=4.0))


def program(arm="abb_irb4600_60_205", place=None, **options):
    tool, placement = frames()
    if place is not None:
        placement[:3, 3] = place
    return build_program([hand_plan(arc(), robot(arm), tool, placement)], **options)


def test_partners_are_asked_before_the_way_down_and_released_after_the_way_back():
    made = program(handshakes=ASKED)
    kinds = [type(step).__name__ for step in made.steps]
    first = kinds.index("LinearMove")
    assert made.steps[first - 2 : first] == ASKED
    assert made.steps[-1] == Request(partner="shutter", on=False)
    assert len(made.steps) == len(program().steps) + 3


@pytest.mark.parametrize("language", ["csv", "ros"])
def test_a_trajectory_cannot_wait(language):
    found = preflight(program(handshakes=ASKED), language)
    said = [issue.message for issue in found if issue.code == "handshake"]
    assert len(said) == 2
    assert all("leave it out" in text for text in said)


def test_handshakes_belong_where_the_robot_stands_with_the_laser_off():
    made = program(handshakes=ASKED)
    steps = list(made.steps)
    moving = [*steps[:6], ASKED[1], *steps[6:]]
    assert codes(with_steps(made, moving), "error", "csv").count("handshake") == 3


def test_a_dry_run_asks_nobody():
    slow = dry_run(program(handshakes=ASKED), 0.5)
    assert not any(isinstance(step, Request | Await) for step in slow.steps)
