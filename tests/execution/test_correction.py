"""Targets corrected by measured runs of a robot that is not as its model."""

import json
from dataclasses import replace

import numpy as np
import pytest

import kerfpath
from holes import round_hole
from kerfpath import InputError, Response, plan
from kerfpath.execution import (
    CommandedRun,
    Correction,
    Log,
    correct,
    correction_text,
    longest_run,
    moved,
    path_error,
    read_correction,
    timing_of,
)
from kerfpath.post import build_program

SPEED, RADIUS, WIDTH = 0.04, 0.008, 0.0125
NOISE = 4e-6


@pytest.fixture(scope="module")
def truth():
    return kerfpath.response("abb_irb6640_180_255", "real")


@pytest.fixture(scope="module")
def path():
    return round_hole(RADIUS)


@pytest.fixture(scope="module")
def made(path, arm, tool, placement):
    nodes = path.resample(spacing=0.001)
    return plan(nodes, arm, tool=tool, placement=placement, speed=SPEED, certify=None)


def executed(made, path, truth):
    run = longest_run(build_program([made]), bounded=False)
    return run, path_error(run, path, timing=timing_of(run), response=truth)


def logged(made, path, truth, seed, name="run.csv"):
    """A log every 4 ms of the tip in the robot base, with noise."""
    run, off = executed(made, path, truth)
    tip = (run.T_base_part @ off.T)[::2, :3, 3]
    noise = np.random.default_rng(seed).normal(0, NOISE, tip.shape)
    return CommandedRun.of(run), Log(name=name, tip=tip + noise)


def one_round(made, path, truth, known, seed, gain=0.8):
    """The correction after one more measured run, and the plan of the next program."""
    displacement = known.displacement_at(made.contour)
    now = moved(made, displacement)
    pairs = [logged(now, path, truth, seed + k, f"run{k}.csv") for k in range(3)]
    logs = [log for _, log in pairs]
    known = correct([(made, displacement)], [pairs[0][0]], logs, known, gain=gain, width=WIDTH)
    return known, moved(made, known.displacement_at(made.contour))


def test_three_rounds_leave_less_than_half_of_the_error(made, path, truth):
    known, rests = Correction(), [executed(made, path, truth)[1].largest]
    for k in range(3):
        known, now = one_round(made, path, truth, known, 10 * k)
        rests.append(executed(now, path, truth)[1].largest)
    assert rests[-1] < 0.4 * rests[0]
    hole = known.contours["hole"]
    assert len(hole.rounds) == 3
    # Three sigma of the mean of three logs, of which each has noise in three coordinates.
    assert 1e-6 < hole.rounds[0].noise < 3 * NOISE * 3**0.5 * 2
    falling = [each.largest for each in hole.rounds]
    assert falling[1] < 0.6 * falling[0]
    assert falling[2] < falling[1]


def test_a_round_that_is_no_better_is_taken_back(made, path, truth):
    known, _ = one_round(made, path, truth, Correction(), 1)
    first = known.contours["hole"]
    np.testing.assert_array_equal(first.best, 0)
    # The second run is that of a program which was not corrected at all.
    _, log = logged(made, path, truth, 4)
    run, _ = logged(made, path, truth, 4)
    displacement = first.displacement
    again = correct([(made, displacement)], [run], [log], known, gain=0.8, width=WIDTH)
    hole = again.contours["hole"]
    assert hole.settled
    assert hole.words == "no longer falls: the best run is kept"
    np.testing.assert_array_equal(hole.displacement, 0)


def test_what_is_noise_is_not_corrected(made, path):
    ideal = Response()
    rng = np.random.default_rng(3)
    run, log = logged(made, path, ideal, 5)
    rough = replace(log, tip=log.tip + rng.normal(0, 5e-5, log.tip.shape))
    zero = np.zeros((len(made.q), 3))
    found = correct([(made, zero)], [run], [rough], Correction(), gain=0.8, width=WIDTH)
    hole = found.contours["hole"]
    assert hole.settled
    assert hole.words == "what is left is noise: nothing to correct"
    assert hole.largest == 0


def test_a_correction_is_read_back_from_its_file(tmp_path, made, path, truth):
    known, _ = one_round(made, path, truth, Correction(), 1)
    file = tmp_path / "correction.json"
    file.write_text(correction_text(known))
    found = read_correction(file)
    assert found.name == "correction.json"
    one, two = known.contours["hole"], found.contours["hole"]
    for name in ("s", "points", "displacement", "best"):
        np.testing.assert_allclose(getattr(two, name), getattr(one, name), rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        [tuple(each)[1:] for each in two.rounds], [tuple(each)[1:] for each in one.rounds],
        rtol=0, atol=1e-9,
    )  # fmt: skip
    assert correction_text(found) == file.read_text()
    other = replace(made.contour, name="another")
    assert not found.displacement_at(other).any()
    away = replace(made.contour, points=made.contour.points + np.array([0.002, 0, 0]))
    with pytest.raises(InputError, match="2 mm away; measure the program of this job again"):
        found.displacement_at(away)


def test_logs_of_another_program_or_too_little_of_it_are_refused(made, path, truth):
    run, log = logged(made, path, truth, 1)
    zero = np.zeros((len(made.q), 3))

    def refused(tip):
        with pytest.raises(InputError) as caught:
            correct(
                [(made, zero)], [run], [Log(name="log.csv", tip=tip)], Correction(), gain=0.8,
                width=WIDTH,
            )  # fmt: skip
        assert "\n" not in str(caught.value)
        return str(caught.value)

    assert refused(log.tip + np.array([0.3, 0, 0])).startswith("expected a log of this program")
    way = np.append(0, np.cumsum(np.linalg.norm(np.diff(log.tip, axis=0), axis=1)))
    most = refused(log.tip[way < 0.9 * way[-1]])
    assert most.startswith("log.csv: expected a log of all of contour 'hole', got one that is")
    assert "log more often" in refused(log.tip[:: len(log.tip) // 12])


def test_what_is_no_correction_is_refused_in_one_line(tmp_path):
    good = {"correction": 1, "contours": []}
    contour = {
        "name": "a", "settled": False, "rounds": [], "s_mm": [0, 1],
        **{key: [[0, 0, 0], [1, 0, 0]] for key in ("points_mm", "displacement_mm", "best_mm")},
    }  # fmt: skip
    for text, said in (
        ("", "expected a correction"),
        ("[]", "schema"),
        (json.dumps(good | {"correction": 2}), "schema"),
        (json.dumps({"correction": 1}), "no key 'contours'"),
        (json.dumps(good | {"contours": [contour | {"s_mm": [1, 0]}]}), "increase"),
        (json.dumps(good | {"contours": [contour | {"points_mm": [[0, 0]]}]}), "points_mm"),
        (json.dumps(good | {"contours": [{"name": "a"}]}), "no key 's_mm'"),
    ):
        file = tmp_path / "bad.json"
        file.write_text(text)
        with pytest.raises(InputError, match=said) as caught:
            read_correction(file)
        assert str(caught.value).startswith(str(file))
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match=r"none\.json"):
        read_correction(tmp_path / "none.json")
