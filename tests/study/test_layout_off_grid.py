"""Placements over continuous gamma: values are those of plans, and proofs hold."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from commands import run
from kerfpath.job import fastest_along, read_job
from kerfpath.planner import plan
from kerfpath.study import job_key, layout
from kerfpath.study.placing.evaluators import is_estimated, leaves_grid
from kerfpath.study.placing.place import middle_of, move_job, numbers_of
from kerfpath.study.placing.study import contours_of, nodes_of
from layouts import CELL, HEAD, contours, job_file, rings, worth

RANGES = {"x_mm": (-150.0, 150.0), "yaw_deg": (-30.0, 30.0)}
SOME = [
    {"x_mm": 120.0, "y_mm": -80.0, "yaw_deg": 25.0, "tilt_x_deg": 12.0},
    {"x_mm": -150.0, "z_mm": 90.0, "yaw_deg": -28.0, "tilt_y_deg": -9.0},
]


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Two openings at 2 m/min."""
    text = HEAD + contours(speed=2, step=5, method="continuous")
    return job_file(tmp_path_factory.mktemp("a"), text)


@pytest.fixture(scope="module")
def on_grid(tmp_path_factory):
    """The same on the grid."""
    return job_file(tmp_path_factory.mktemp("b"), HEAD + contours(speed=2, step=5))


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    """Rings of few nodes, so that each is soon planned."""
    return rings(tmp_path_factory.mktemp("c"), 1200, "continuous", small=21, large=31)


def moved(path, offsets, goal="speed"):
    """Return the job with a placement, and its contours."""
    job, nodes = read_job(path), contours_of(**job_key(path))
    return move_job(job, numbers_of(job, offsets, middle_of(job, nodes_of(nodes)))), nodes


def whole(path, goal="speed"):
    """Return the stretches that are all of each contour."""
    sampled = contours_of(**job_key(path))
    return [(c, 0, len(contour.nodes) - 1) for c, contour in enumerate(sampled)]


@pytest.mark.parametrize("offsets", SOME)
def test_a_speed_is_the_one_that_is_found_off_the_grid_and_a_displacement_that_of_plans(
    plain, offsets
):
    found = worth(plain, offsets, exact=True, whole=True)
    job, sampled = moved(plain, offsets)
    speeds = [fastest_along(job, c.nodes, None, refine=True).speed * 60 for c in sampled]
    # The same search twice.
    assert found.value == pytest.approx(min(speeds), rel=1e-12)
    assert [c.value for c in found.contours] == pytest.approx(speeds, rel=1e-12)
    job, sampled = moved(plain, offsets, "motion")
    costs = [
        plan(
            c.nodes, job.robot, tool=job.tool, placement=job.placement, speed=c.speed,
            options=replace(job.options, certify=None),
        ).cost
        for c in sampled
    ]  # fmt: skip
    assert worth(plain, offsets, goal="motion", exact=True).value == pytest.approx(
        sum(costs), rel=1e-12
    )


@pytest.mark.parametrize("goal", ["speed", "motion"])
@pytest.mark.parametrize("offsets", SOME)
def test_off_the_grid_no_placement_is_worth_less_than_on_it(plain, on_grid, offsets, goal):
    grid = worth(on_grid, offsets, goal=goal, exact=True, whole=True)
    off = worth(plain, offsets, goal=goal, exact=True, whole=True)
    assert grid.stage == "exact"
    assert off.stage == "planned"
    for one, other in zip(grid.contours, off.contours, strict=True):
        better = one.value - other.value if goal == "motion" else other.value - one.value
        # The fastest path of the grid is the first of those that are looked at, but for 1e-6 of the
        # interval that is left free; a plan of the same samples is refined to 1e-4 of its cost.
        assert better >= -1e-4 * one.value


@pytest.mark.parametrize(("goal", "offsets"), [("speed", SOME[0]), ("margin", SOME[1])])
def test_no_placement_is_proved_to_be_slower_than_it_is(plain, goal, offsets):
    found = worth(plain, offsets, goal=goal, exact=True)
    slowest = min((c for c in found.contours if c.value is not None), key=lambda c: c.value)
    first = min(max(0, slowest.node - 12), slowest.nodes - 25)
    about = [(slowest.index, first, first + 24)]
    below = (1 - 1e-6) * found.value
    known = worth(plain, offsets, goal=goal, stretches=about, prove=True, floor=below)
    assert known.bound is None
    assert known.stage == "estimate"
    # Ceilings of the fastest speed are within a factor of two as a rule.
    above = 3 * found.value
    known = worth(plain, offsets, goal=goal, stretches=about, prove=True, floor=above)
    assert known.bound == above
    assert known.stage == "proved"
    # Nor is it planned then.
    left = worth(plain, offsets, goal=goal, stretches=about, exact=True, floor=above)
    assert left == known


def test_where_nothing_is_enclosed_nothing_is_proved(plain, tmp_path):
    text = plain.read_text().replace("[plan]", "[plan]\ntilt_deg = 2")
    tilted = job_file(tmp_path, text)
    assert leaves_grid(read_job(tilted))
    assert worth(tilted, stretches=whole(tilted), prove=True, floor=1e3).bound is None


@pytest.mark.parametrize("offsets", SOME)
def test_the_estimate_by_stretches_that_are_whole_contours_is_near_the_value(
    plain, offsets, quickest_at_work
):
    value = worth(plain, offsets, exact=True).value
    known = worth(plain, offsets, stretches=whole(plain))
    assert known.stage == "estimate"
    assert known.value is None
    assert known.bound is None
    # Beams alone, from samples 5 deg apart: 0 to 6 % slower than plans where it was measured.
    assert known.estimate == pytest.approx(value, rel=0.1)


def test_an_estimate_knows_what_stands_around(plain, tmp_path):
    alone = worth(plain, stretches=whole(plain))
    # A block beside the openings leaves the head fewer rotations, if any.
    text = plain.read_text() + CELL
    beside = worth(job_file(tmp_path, text), stretches=whole(plain))
    assert beside.stage == "estimate"
    assert beside.estimate <= alone.estimate * 1.01  # how close an estimate is found


@pytest.mark.parametrize("offsets", SOME)
def test_the_value_function_is_near_the_displacement(plain, offsets):
    value = worth(plain, offsets, goal="motion", exact=True).value
    about = worth(plain, offsets, goal="motion").estimate
    # Interpolated between samples 5 deg apart: 2 to 5 % on the demo's contours.
    assert about == pytest.approx(value, rel=0.08)


def test_a_speed_that_no_way_keeps_is_said_to_be_too_high(tmp_path):
    quick = job_file(tmp_path, HEAD + contours(speed=60, step=5, method="continuous"))
    by_estimate = worth(quick, goal="motion")
    assert by_estimate.status == "speed"
    assert is_estimated(by_estimate)
    planned = worth(quick, goal="motion", exact=True)
    assert planned.status == "speed"
    assert not is_estimated(planned)


@pytest.mark.parametrize("goal", ["speed", "motion"])
def test_a_tolerance_never_makes_it_better(coarse, goal):
    star = [{"x_mm": 30.0}, {"x_mm": 25.0}, {"x_mm": 35.0}]
    values = [worth(coarse, at, goal=goal, exact=True).value for at in star]
    worst = max(values) if goal == "motion" else min(values)
    robust = worth(coarse, *star, goal=goal, exact=True)
    # The same searches; a contour as fast as the worst so far is left at that.
    assert robust.value == pytest.approx(worst, rel=1e-12)


def test_a_placement_that_is_worse_than_the_floor_is_left_at_that(plain):
    value = worth(plain, SOME[0], exact=True).value
    left = worth(plain, SOME[0], exact=True, floor=1.01 * value)
    assert left.stage == "planned"
    assert left.value is None
    assert value * (1 - 1e-12) <= left.bound <= 1.01 * value
    kept = worth(plain, SOME[0], exact=True, floor=0.99 * value)
    assert kept.value == pytest.approx(value, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("goal", ["speed", "motion"])
def test_no_placement_that_was_planned_or_proved_is_better(
    coarse, tmp_path, goal, quickest_at_work
):
    result = layout(
        coarse, store=tmp_path / "s.sqlite", ranges=RANGES, map_points=0, processes=1,
        evaluations=8, goal=goal,
    )  # fmt: skip
    assert result.off_grid
    assert result.best is not None
    best, sign = result.best.result.value, -1 if goal == "motion" else 1
    assert sign * best >= sign * result.before.value
    assert result.proved == (result.estimated == 0)
    assert sum(result.stages.values()) == len(result.tried)
    for trial in result.tried:
        value = worth(coarse, dict(trial.offsets), goal=goal, exact=True).value
        known = trial.result
        if known.value is not None:
            assert known.value == pytest.approx(value, rel=1e-12)  # the same search
        if known.stage in ("planned", "proved"):
            # What rounding makes of the same search again, at most.
            assert sign * value <= sign * best * (1 + sign * 1e-12)
        else:
            assert is_estimated(known)
            # It would have been planned, had its estimate been better than the best.
            assert sign * known.estimate < sign * best


@pytest.mark.slow
def test_the_command_says_what_was_planned_and_what_was_only_estimated(
    coarse, tmp_path, quickest_at_work
):
    options = ["--vary", "x_mm=-300:0", "--vary", "yaw_deg=-30:30", "--evaluations", "8",
               "--map-points", "2", "--processes", "1", "--out", tmp_path / "out"]  # fmt: skip
    said = run("layout", coarse, *options)
    assert said.returncode == 0, said.stderr
    data = json.loads((tmp_path / "out" / "layout.json").read_text())
    assert data["off_grid"]
    tried, planned = len(data["tried"]), data["exact_searches"]
    assert f"{tried} placements tried" in said.stdout
    assert f"{planned} planned over continuous rotation" in said.stdout
    proved, estimated = data["stages"]["proved"], data["estimated"]
    assert proved + estimated + planned == tried  # all of them are in reach
    assert (f"{estimated} judged by an estimate alone" in said.stdout) == (estimated > 0)
    assert (f"{proved} proved to be no faster at any rotation" in said.stdout) == (proved > 0)
    assert "solved exactly" not in said.stdout
    assert ("no other of them" in said.stdout) is False
    for each in data["tried"]:
        assert (each["bound"] is None) == (each["stage"] == "estimate")
    page = (tmp_path / "out" / "layout.html").read_text()
    assert "planned over continuous gamma" in page
    assert re.search(r"judged by an estimate alone", page) or not estimated
    placed = read_job(tmp_path / "out" / "placed.toml")
    part = placed.read_part()
    speeds = [
        fastest_along(placed, task.sample(task.candidates(part)[0]), None, refine=True).speed * 60
        for task in placed.tasks(part)
    ]
    # The same search twice.
    assert min(speeds) == pytest.approx(data["best"]["value"], rel=1e-12)
    assert np.isfinite(speeds).all()
