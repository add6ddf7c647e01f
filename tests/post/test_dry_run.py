"""Dry runs: the same motions, slower, with nothing switched, in every language."""

import numpy as np
import pytest

from kerfpath import InputError, robot
from kerfpath.post import (
    Comment,
    JointMove,
    LinearMove,
    build_program,
    dry_run,
    languages,
    post,
    read_program,
)
from kerfpath.post.rapid import RapidSettings
from programs import arc, frames, hand_plan, text_of

SHARE = 0.2


@pytest.fixture(scope="module")
def plans():
    cell = robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg"), *frames()
    return [hand_plan(arc(f"skin/hole{i}", radius=0.08 + 0.005 * i), *cell) for i in (1, 2)]


@pytest.fixture(scope="module")
def program(plans):
    return build_program(
        plans, pierce_time=0.3, gas_lead=0.2, arc_tolerance=2e-5, name="b_pillar", air_speed=0.04
    )


def test_the_same_targets_are_passed_slower_and_nothing_is_switched(program):
    dry = dry_run(program, SHARE)
    assert len(dry.moves) == len(program.moves)
    for before, after in zip(program.moves, dry.moves, strict=True):
        assert type(before) is type(after)
        assert np.array_equal(before.q, after.q)
        assert before.zone == after.zone
        if isinstance(after, JointMove):
            assert after.speed == 0.01  # 0.04 at a fifth is less than any language says
            continue
        assert np.array_equal(before.T_part_tip, after.T_part_tip)
        assert after.speed == pytest.approx(SHARE * before.speed, rel=1e-12)
        assert after.duration * SHARE == pytest.approx(before.duration, rel=1e-12)
    assert not any(move.switches for move in dry.moves if isinstance(move, LinearMove))
    assert all(isinstance(step, JointMove | LinearMove | Comment) for step in dry.steps)


@pytest.mark.parametrize("name", sorted(languages()))
def test_every_language_says_a_dry_run_and_that_it_is_one(plans, name):
    program = build_program(plans, pierce_time=0.3, name="b_pillar")
    if languages()[name].refusal(program.robot):
        pytest.skip("for other arms")
    dry = post(dry_run(program, SHARE), name)
    assert all("dry_" in file.lower() for file in dry)  # none overwrites one that cuts
    comments = "".join(dry.values()).count("DRY RUN at 20 %")
    assert comments == (0 if name == "csv" else 2)  # a table has none
    read = read_program(dry, name, program.robot)
    assert all(section.name.lower().startswith("dry_") for section in read.sections)
    assert not any(move.switches for move in read.moves)
    assert list(read.steps) == list(read.moves)


def test_rapid_only_ever_switches_off(program):
    text = text_of(post(dry_run(program, SHARE), "rapid", RapidSettings(gas_output="doGas")))
    assert "Trigg" not in text
    assert "WaitTime" not in text
    assert [line.strip() for line in text.splitlines() if "SetDO" in line] == [
        "SetDO doLaser,0;",
        "SetDO doGas,0;",
    ]


@pytest.mark.parametrize("share", [0, -0.1, 1.01, float("nan")])
def test_a_share_that_is_none_is_refused(program, share):
    with pytest.raises(InputError, match="dry run: expected"):
        dry_run(program, share)
