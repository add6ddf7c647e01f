"""The power by the speed in programs: how near it is to its curve, and what languages refuse."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.post.cases import CASES

from kerfpath import InputError
from kerfpath.execution import power_along, with_power
from kerfpath.post import (
    Await,
    JointMove,
    PowerBySpeed,
    ProgramOptions,
    ReadMove,
    ReadPower,
    ReadWait,
    Request,
    SetPower,
    build_program,
    dry_run,
    power_curve,
    preflight,
    unsafe_paths,
)
from programs import arc, hand_plan, with_steps

CURVE = ((0.0, 0.3), (0.5, 0.6), (1.0, 1.0))
POWER = {
    "rapid": {"power_output": "aoPower", "power_full": 10.0},
    "krl": {"power_output": 1, "power_full": 1.0},
    # Moves that take whole cycles are never as fast as programmed.
    "fanuc": {"power_output": 1, "power_full": 1000.0, "interpolation_ms": 0.0},
    "linuxcnc": {"power_output": 2, "power_full": 100.0},
    "urscript": {"power_output": 0, "power_full": 1.0},
    "csv": {},
}
BY_CONTROLLER = {
    "rapid": (
        {"power_output": "aoPower", "power_full": 10.0},
        r"TriggSpeed trFollow,0\\Start,0.0200,",
    ),
    "krl": ({"power_output": 1, "power_full": 1.0}, r"ANOUT ON power_out=16\.6\d+\*\$VEL_ACT"),
    "inform": ({"power_output": 1, "power_full": 10.0}, r"ARATION AO#\(1\) BV=10.00 V=60.0 OFV"),
}
"""Settings of the languages whose controller sets a power by the speed, and its statement."""
WITHOUT = sorted(CASES.keys() - POWER.keys())
in_each = pytest.mark.parametrize("name", POWER)


def dipping(case, share=0.8):
    """A plan whose speed dips to a share of it on the middle third."""
    plan = hand_plan(arc(count=40, radius=0.12), *case.cell, speed=0.06)
    took = np.diff(plan.time)
    took[13:26] /= share
    arm = plan.robot.with_limits(acceleration=np.radians([2000] * 6))
    return replace(plan, robot=arm, time=np.append(0.0, np.cumsum(took)))


def options_of(name, **more):
    case = CASES[name]
    settings = case.language.settings(**case.options, **POWER.get(name, {}))
    keys = {"power_by_speed": CURVE, "pierce_time": 0.3, "pierce_power": 0.55, **more}
    return ProgramOptions(language=name, settings=settings, **keys)


def powered(name, share=0.8, **more):
    options = options_of(name, **more)
    program = build_program([dipping(CASES[name], share)], options)
    return with_power(program, options), options


@in_each
@pytest.mark.parametrize("step", [0.05, 0.1])
def test_a_dip_of_the_speed_lowers_the_power_within_its_steps(name, step):
    program, options = powered(name, power_step=step)
    along = power_along(program, program.sections[0], options)
    assert along.difference <= 0.75 * step + 1e-12
    at = (along.s[1:] + along.s[:-1]) / (2 * along.s[-1])
    middle = along.set[(at > 0.4) & (at < 0.6)]
    full = along.set[(at > 0.15) & (at < 0.28)]
    assert (full == 1.0).all()
    assert np.ptp(middle) == 0, "an even speed switches nothing"
    assert middle[0] == pytest.approx(np.interp(0.8, *np.array(CURVE).T), abs=0.75 * step)
    assert 2 <= along.switches <= 2 + 2 * round(0.7 / step)
    assert (np.diff(along.fine_s) >= 0).all()
    assert along.fine_s[[0, -1]] == pytest.approx(along.s[[0, -1]], abs=1e-12)
    inner = (along.fine_s > 0.4 * along.s[-1]) & (along.fine_s < 0.6 * along.s[-1])
    assert along.fine_speed[inner] == pytest.approx(0.8, abs=0.05 if name == "linuxcnc" else 1e-3)
    assert along.mean_difference <= along.difference + 0.02
    case = CASES[name]
    _, read = case.reads_back(program, options.settings)
    assert unsafe_paths(read) == []
    assert not [i for i in preflight(program, name, options.settings) if i.level == "error"]


@in_each
def test_the_power_is_that_of_the_pierce_then_of_the_cut_and_zero_in_the_air(name):
    program, options = powered(name)
    steps = [s for s in program.steps if isinstance(s, SetPower | JointMove)]
    shares = [s.share for s in steps if isinstance(s, SetPower)]
    assert isinstance(steps[0], JointMove)
    assert shares[0] == 0.55
    assert shares[-1] == 0.0
    _, read = CASES[name].reads_back(program, options.settings)
    read_shares = [s.share for s in read.steps if isinstance(s, ReadPower)]
    assert read_shares == pytest.approx(shares, abs=1e-3)
    before = next(k for k, s in enumerate(read.steps) if isinstance(s, ReadPower))
    assert isinstance(read.steps[before + 1], ReadMove), "the approach follows"


STAGES = ((0.4, 0.2), (0.8, 0.1), (0.6, 0.3))


@pytest.mark.parametrize("name", [*POWER, "inform"])
def test_the_stages_of_a_pierce_follow_each_other_at_the_start(name):
    by = {} if name in POWER else BY_CONTROLLER[name][0]
    case = CASES[name]
    options = ProgramOptions(
        language=name, settings=case.language.settings(**case.options, **(by or POWER[name])),
        power_by_speed=((0.0, 0.0), (1.0, 1.0)), pierce_stages=STAGES, lead_time=0.0,
        power_follows="controller" if by else "steps",
    )  # fmt: skip
    assert options.pierce_time == pytest.approx(0.6)
    program = with_power(build_program([dipping(case)], options), options)
    _, read = case.reads_back(program, options.settings)
    now, found = 0.0, []
    for step in read.steps:
        now = step.share if isinstance(step, ReadPower) else now
        if isinstance(step, ReadWait):
            found.append((now, step.time))
    assert found == [pytest.approx(stage, abs=1e-3) for stage in STAGES]
    assert unsafe_paths(read) == []


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"pierce_stages": ((1.2, 0.2),)}, "powers above 0, at most 1, got 1.2"),
        ({"pierce_stages": ((0.4, 0.0),)}, "above 0 and at most 60 s, got 0 s"),
        ({"pierce_stages": ()}, "1 to 20 of them, got 0"),
        ({"pierce_stages": ((0.4,),)}, "expected pairs"),
        ({"pierce_stages": STAGES, "pierce_time": 0.3}, "no other time or power"),
        ({"pierce_stages": STAGES, "pierce_power": 0.3}, "no other time or power"),
        ({"pierce_stages": STAGES, "power_by_speed": None}, "expected power_by_speed"),
    ],
)
def test_stages_that_are_none_are_refused(more, words):
    with pytest.raises(InputError, match=words):
        ProgramOptions(**{"power_by_speed": CURVE, **more})


PARTNERS = {
    "rapid": {"ready_input": "diReady", "shutter_output": "doShutter"},
    **{name: {"ready_input": 6, "shutter_output": 7} for name in ("krl", "fanuc", "urscript")},
    "linuxcnc": {"ready_input": 6, "shutter_output": 7},
    "inform": {"ready_input": 6, "shutter_output": 7},
}


@pytest.mark.parametrize("name", PARTNERS)
def test_no_path_without_an_answer_has_power(name):
    """Two contours that ask partners: with no answer everything is off, the power, too."""
    case, by = CASES[name], name == "inform"
    power = BY_CONTROLLER[name][0] if by else POWER[name]
    options = ProgramOptions(
        language=name,
        settings=case.language.settings(**{**case.options, **power, **PARTNERS[name]}),
        power_by_speed=((0.0, 0.0), (1.0, 1.0)), pierce_stages=STAGES, lead_time=0.0,
        power_follows="controller" if by else "steps",
        handshakes=(Request(partner="shutter", on=True), Await(partner="ready", timeout=5.0)),
    )  # fmt: skip
    plan = dipping(case)
    other = replace(plan, contour=replace(plan.contour, name="skin/other"))
    program = with_power(build_program([plan, other], options), options)
    _, read = case.reads_back(program, options.settings)
    assert unsafe_paths(read) == []
    on = replace(
        read,
        sections=tuple(
            replace(s, flow=tuple(step for step in s.flow or s.steps if not is_off(step)), steps=())
            for s in read.sections
        ),
    )
    assert any("the power" in str(issue) for issue in unsafe_paths(on)), "it stays on in the air"


def is_off(step):
    return isinstance(step, ReadPower) and max(step.share, step.per_speed) == 0


@pytest.mark.parametrize("name", [name for name in POWER if name != "linuxcnc"])
def test_the_power_follows_along_arcs(name):
    options = options_of(name, arc_tolerance=2e-5)
    case = CASES[name]
    plan = dipping(case)
    program = with_power(build_program([plan], options), options)
    along = power_along(program, program.sections[0], options)
    assert along.difference <= options.power.tolerance + 1e-12
    assert along.s[-1] == pytest.approx(plan.contour.length, rel=1e-6)
    case.reads_back(program, options.settings)


@pytest.mark.parametrize("name", WITHOUT)
def test_a_language_that_sets_no_output_on_the_path_refuses_in_one_line(name):
    with pytest.raises(InputError, match=r"power_by_speed: .*, or use another language") as caught:
        powered(name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", BY_CONTROLLER)
def test_a_controller_sets_the_power_in_proportion_to_the_speed(name):
    case, (power, statement) = CASES[name], BY_CONTROLLER[name]
    options = ProgramOptions(
        language=name, settings=case.language.settings(**case.options, **power),
        power_by_speed=((0.0, 0.0), (1.0, 1.0)), power_follows="controller", pierce_time=0.3,
        lead_time=0.02 if case.language.ahead else 0.0, pierce_power=0.55,
    )  # fmt: skip
    program = with_power(build_program([dipping(case)], options), options)
    along = power_along(program, program.sections[0], options)
    assert along.switches == 0
    assert along.difference < 1e-12
    files, read = case.reads_back(program, options.settings)
    assert re.search(statement, "\n".join(files.values()))
    powers = [(s.share, s.per_speed) for s in read.steps if isinstance(s, ReadPower)]
    assert powers == [
        pytest.approx(each, rel=2e-3, abs=1e-3) for each in ((0.55, 0), (0, 1 / 0.06), (0, 0))
    ]
    assert unsafe_paths(read) == []


def test_a_curve_that_no_controller_follows_is_refused():
    with pytest.raises(InputError, match=r"30.0% of the full power off the curve, allowed 7.5%"):
        powered("rapid", power_follows="controller")


def test_a_language_without_such_a_statement_is_refused():
    with pytest.raises(InputError, match=r'no statement .*write power_follows = "steps"'):
        powered("urscript", power_follows="controller")


@in_each
def test_a_program_with_the_power_on_in_the_air_is_refused(name):
    program, options = powered(name)
    steps = [s for s in program.sections[0].steps if not (isinstance(s, SetPower) and s.share == 0)]
    last = program.moves[-1]
    steps.append(JointMove(q=last.q, speed=0.5))
    codes = [i.code for i in preflight(with_steps(program, steps), name, options.settings)]
    assert codes.count("power") == 2


@in_each
def test_a_dry_run_has_no_power(name):
    program, options = powered(name)
    slow = dry_run(program, 0.5)
    assert slow.signals == ()
    if name != "csv":
        assert "power" in [i.code for i in preflight(slow, name, options.settings)]


def test_an_output_without_its_value_at_full_power_is_refused():
    program, options = powered("rapid")
    settings = options.settings.model_copy(update={"power_full": None})
    issues = preflight(program, "rapid", settings)
    assert any("power_full in [program.rapid]" in issue.message for issue in issues)


@given(
    st.lists(st.floats(0, 1), min_size=1, max_size=60),
    st.floats(0.02, 0.5),
    st.lists(st.floats(0, 1), min_size=2, max_size=5),
)
def test_steps_stay_within_their_tolerance_of_any_curve(speed, step, powers):
    powers[-1] = max(powers[-1], 0.1)
    curve = power_curve([*zip(np.linspace(0, 1, len(powers)).tolist(), powers, strict=True)])
    law = PowerBySpeed(curve, step)
    found = law.steps(np.array(speed))
    assert (np.abs(found - law.at(np.array(speed))) <= law.tolerance + 1e-9).all()
    np.testing.assert_allclose(law.nearest(found), found, atol=1e-9)
    assert ((found >= 0) & (found <= 1)).all()


def test_a_speed_between_two_steps_does_not_switch_to_and_fro():
    law = PowerBySpeed(((0.0, 0.0), (1.0, 1.0)), 0.1)
    assert len(set(law.steps(0.85 + 0.02 * np.sin(np.arange(100))).tolist())) == 1


@pytest.mark.parametrize(
    ("pairs", "words"),
    [
        ([[0.0, 0.3]], "from speed 0 to speed 1"),
        ([[0.1, 0.3], [1.0, 1.0]], "from speed 0"),
        ([[0.0, 0.3], [0.5, 0.2], [0.5, 0.4], [1.0, 1.0]], "rising speeds"),
        ([[0.0, 0.3], [1.0, 1.2]], "from 0 to 1, got 1.2"),
        ([[0.0, 0.3], [1.0, 0.0]], "above 0 at speed 1"),
        ([[0.0, 0.3, 1.0], [1.0, 0.0]], "expected pairs"),
    ],
)
def test_a_curve_that_is_none_is_refused(pairs, words):
    with pytest.raises(InputError, match=words):
        power_curve(pairs)
