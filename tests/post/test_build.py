"""From plans to the neutral program: what belongs together, how a contour is cut."""

from dataclasses import replace

import numpy as np
import pytest
from tests.post.cases import CASES, kinds_of

from kerfpath import InputError
from kerfpath.post import (
    LinearMove,
    ProgramKeywords,
    ProgramOptions,
    ReadWait,
    build_program,
    post,
)
from kerfpath.setting import settings
from programs import arc, codes, hand_plan, read_text, text_of

CASE = CASES["rapid"]


def moves_of(section, kind):
    return [step for step in section.steps if isinstance(step, kind)]


def test_zones_are_halved_until_they_do_not_overlap(small):
    program = build_program([small], zone=0.1)
    gaps = np.linalg.norm(np.diff(small.contour.points, axis=0), axis=1)
    zones = [move.zone for move in program.sections[0].moves[2:-1]]
    assert zones[-1] == 0
    for k, zone in enumerate(zones[:-1]):
        room = min(gaps[k], gaps[k + 1]) / 2
        assert room / 2 < zone <= room
        assert np.log2(0.1 / zone) == round(np.log2(0.1 / zone))
    assert codes(program) == ["air-moves"]


def test_plans_that_do_not_belong_together_are_refused(cell, small):
    arm, tool, placement = cell
    moved = placement.copy()
    moved[0, 3] += 0.01
    other = hand_plan(arc("hole"), arm, tool, moved)
    with pytest.raises(InputError, match=r"'skin/outer' and 'hole' differ in placement"):
        build_program([small, other])
    with pytest.raises(InputError, match="differ in robot"):
        build_program([small, replace(small, robot=replace(arm, id="another"))])
    with pytest.raises(InputError, match="at least one plan"):
        build_program([])


def test_joints_that_miss_the_contour_are_refused(small):
    with pytest.raises(InputError, match=r"node 3: the planned joints put the tool tip \d"):
        build_program([replace(small, q=small.q + np.where(np.arange(8) == 3, 1e-3, 0)[:, None])])


def test_a_retract_out_of_reach_says_to_lower_it(small):
    with pytest.raises(InputError, match=r"back off by 5000 mm .* lower the retract"):
        build_program([small], retract=5.0)
    with pytest.raises(InputError, match="retract: expected a number above 0 m"):
        build_program([small], retract=0.0)


def test_keywords_replace_the_options_of_a_program(small):
    options = ProgramOptions(name="one", pierce_time=0.4)
    program = build_program([small], options, name="two")
    assert program.name == "two"
    assert post(program) == post(build_program([small], name="two", pierce_time=0.4))
    known = settings(ProgramOptions)
    assert set(ProgramKeywords.__annotations__) == set(known) - {"language", "settings"}


@pytest.mark.parametrize("name", ["retract", "zone", "zone_error", "lead_time", "gas_lead"])
def test_process_values_below_their_bounds_are_refused(name):
    with pytest.raises(InputError, match=f"^{name}: .* got -1"):
        ProgramOptions(**{name: -1.0})


def test_the_laser_is_off_along_micro_joints_and_waits_at_the_pierce(cell):
    contour = replace(arc(), kind=kinds_of("picmmcoo"))
    made = hand_plan(contour, *cell, speed=0.12)
    program = build_program([made], pierce_time=0.4, lead_time=0.005)
    assert codes(program, "error") == []
    steps = read_text(text_of(post(program)), program.robot).sections[0].steps
    moves, on, waits, switched = 0, False, [], []
    for step in steps:
        if isinstance(step, ReadWait):
            waits.append((moves, on, step.time))
            continue
        switched.append(on)
        moves += 1
        for switch in step.switches:
            on = switch.on
    # Approach twice, then seven stretches of which two are micro joints, then the retract.
    assert switched == [False, False, True, True, True, False, False, True, True, False]
    assert waits == [(2, True, 0.4)]


def test_a_contour_with_times_of_its_own_is_cut_in_them(cell):
    contour = replace(arc(count=40), speed_share=np.linspace(1, 0.5, 40))
    timed = contour.resample(dt=0.02, speed=0.12)
    made = hand_plan(timed, *cell, speed=0.12)
    made = replace(made, time=timed.time)
    whole = build_program([made], thin_tolerance=0)
    moves = moves_of(whole.sections[0], LinearMove)[1:-1]
    np.testing.assert_allclose([m.speed for m in moves], np.diff(timed.s) / np.diff(timed.time))
    assert moves[-1].speed < 0.6 * moves[0].speed
