"""What is known of a controller's corners: by the program, by settings, or assumed and said so."""

import pytest

from kerfpath.post import PLAIN, Controller, language
from kerfpath.post.fanuc import FanucSettings
from kerfpath.post.inform import InformSettings

FANUC, INFORM = language("fanuc"), language("inform")


def test_a_program_says_how_far_from_a_corner_unless_the_controller_has_its_own_measure():
    assert PLAIN.zone(0.003, 0.2) == 0.003
    assert not PLAIN.rounds_by_itself
    assert Controller(corner=0.01).zone(0.003, 0.2) == 0.01
    assert Controller(corner_time=0.05).zone(0.003, 0.2) == pytest.approx(0.01)
    assert Controller(corner_time=0.05).rounds_by_itself


@pytest.mark.parametrize("controller", [Controller(corner=0.01), Controller(corner_time=0.05)])
def test_where_a_program_stops_it_stops(controller):
    assert controller.zone(0.0, 0.2) == 0.0


@pytest.mark.parametrize(("percent", "stated", "time"), [
    (100, None, 0.12), (50, None, 0.06), (100, 40.0, 0.04), (25, 40.0, 0.01),
])  # fmt: skip
def test_cnt_rounds_by_time_in_proportion(percent, stated, time):
    settings = FanucSettings(cnt_percent=percent, corner_ms=stated)
    controller = FANUC.controller(settings)
    assert controller.corner_time == pytest.approx(time)
    assert ("corner_ms" in controller.assumed) == (stated is None)


def test_cnt0_is_nearly_a_corner_and_no_stop():
    controller = FANUC.controller(FanucSettings(cnt_percent=0, corner_ms=100))
    assert 0 < controller.zone(1.0, 0.1) <= 1e-4


def test_corner_regions_are_the_programs_own():
    controller = FANUC.controller(FanucSettings(corner="CR"))
    assert not controller.rounds_by_itself
    assert controller.assumed == ""


def test_a_position_level_is_a_length_of_the_controller():
    taken = INFORM.controller(InformSettings(position_level=3))
    assert taken.corner == 0.0125
    assert "PL=3" in taken.assumed
    assert "S1CxG035" in taken.assumed
    stated = INFORM.controller(InformSettings(position_level=3, position_level_mm=50))
    assert (stated.corner, stated.assumed) == (0.05, "")
