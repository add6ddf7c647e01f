"""The options of a plan: ranges, what goes with what, and back from data."""

import json
import re
from dataclasses import fields
from itertools import product
from typing import get_type_hints

import numpy as np
import pytest

import kerfpath
from conftest import ROOT
from kerfpath import (
    Band,
    Certify,
    Comfort,
    GammaWindow,
    InputError,
    OptionConflict,
    PlanOptions,
    Tilt,
)
from kerfpath.job.format.tables.job import PlanTable
from kerfpath.operations.kerf import Lead, LeadKeywords
from kerfpath.options import PlanKeywords
from kerfpath.post.options import ProgramKeywords, ProgramOptions
from kerfpath.sequence.part import OrderKeywords, OrderOptions
from reference import plan_options

EVERY = PlanOptions(
    gamma_step=0.02,
    frames="tangent",
    tilt=Tilt(cone=0.1, steps=2, cost=0.3),
    postures=(1, 4),
    objective="max",
    metric="euclid",
    weights=np.arange(1.0, 7.0),
    eta_v=0.9,
    eta_a=0.8,
    closure="periodic",
    rotation=[np.inf, np.inf, np.inf, 7.0, np.inf, 6.5],
    refine=True,
    comfort=Comfort(wrist=Band(margin=0.1, width=0.2, cost=3.0), limits=Band(margin=0.05)),
    certify=Certify(gap=0.02, seconds=3.0, keep=True),
)


PINNED = PlanOptions(gamma_windows=[GammaWindow(start=0.1, end=0.2, low=3.0, high=-3.0)])
PIECES = PlanOptions(interruptions="fewest", least_piece=0.02, retract=0.05, floor=-0.6)


def test_options_come_back_from_their_data():
    for options in (PlanOptions(), EVERY, PlanOptions(certify=None), PIECES, PINNED):
        data = json.loads(json.dumps(options.to_data()))
        assert PlanOptions.from_data(data) == options
    assert PlanOptions() != EVERY


def test_every_option_is_in_the_data_and_in_the_keywords():
    names = {field.name for field in fields(PlanOptions)}
    assert len(PlanOptions().to_data()) == len(names)
    only_whole = {"refine_parts", "between_nodes", "interruptions", "least_piece"}
    only_whole |= {"retract", "floor"}
    assert set(PlanKeywords.__annotations__) == names - only_whole


def test_keywords_of_functions_are_fields_of_their_options_with_the_same_types():
    for keywords, options, others in (
        (LeadKeywords, Lead, {"length"}),
        (OrderKeywords, OrderOptions, set()),
        (ProgramKeywords, ProgramOptions, {"language", "settings"}),
    ):
        known = get_type_hints(options)
        assert get_type_hints(keywords) == {k: known[k] for k in known.keys() - others}


CONFLICTS = {
    "method": {"method": "paper", "feed": "dip"},
    "closure": {"closure": "periodic", "feed": "dip"},
    "rotation": {"rotation": np.full(6, 1.0), "feed": "dip"},
    "objective": {"objective": "max", "feed": "dip"},
    "interruptions": {"interruptions": "fewest", "feed": "dip"},
    "refine_parts": {"refine_parts": 2, "tilt": Tilt(cone=0.1)},
    "tilt": {"tilt": Tilt(cone=0.1), "interruptions": "fewest"},
    "feed": {"feed": "dip", "comfort": Comfort(clearance=Band(width=0.01, cost=1))},
    "refine": {
        "feed": "dip",
        "refine": True,
        "comfort": Comfort(wrist=Band(width=0.1, cost=1)),
    },
}


@pytest.mark.parametrize("option", CONFLICTS)
def test_what_does_not_go_together_names_the_option(option):
    with pytest.raises(
        OptionConflict, match=f"^{option}: expected .* with .*, got .*; change one$"
    ):
        PlanOptions(**CONFLICTS[option])


def test_a_length_of_pieces_needs_pieces():
    with pytest.raises(OptionConflict) as caught:
        PlanOptions(least_piece=0.02)
    assert (caught.value.option, caught.value.expected) == ("interruptions", "fewest")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("gamma_step", 0.0),
        ("gamma_step", "fine"),
        ("eta_v", -1.0),
        ("eta_a", np.nan),
        ("frames", "frenet"),
        ("method", "fast"),
        ("objective", "mean"),
        ("metric", "taxi"),
        ("closure", "open"),
        ("feed", "slow"),
        ("interruptions", "some"),
        ("least_piece", 0.0),
        ("retract", 0.0),
        ("floor", np.nan),
        ("refine_parts", 0),
        ("weights", [[1.0]]),
        ("rotation", [np.nan]),
        ("gamma_windows", [(0.0, 1.0, 0.0, 0.1)]),
        ("certify", True),
        ("certify", 0.005),
    ],
)
def test_a_value_out_of_range_is_refused_by_its_name(name, value):
    with pytest.raises(InputError, match=f"^{name}: "):
        PlanOptions(**{name: value})


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("gap", -0.1, "must not be negative, got -0.1"),
        ("gap", np.nan, "expected a finite number, got nan"),
        ("gap", 1.5, "expected a share of the cost up to 1, got 1.5"),
        ("gap", "small", "expected a number, got 'small'"),
        ("seconds", 0, "expected a number above 0 s, got 0 s"),
        ("seconds", np.inf, "expected a number above 0 s, got inf s"),
        ("keep", "yes", "expected True or False, got 'yes'"),
    ],
)
def test_what_is_certified_is_refused_by_its_name(name, value, said):
    with pytest.raises(InputError, match=f"^certify {name}: {said}$"):
        Certify(**{name: value})


@pytest.mark.usefixtures("certified_by_default")
def test_plans_are_certified_unless_they_are_not_to_be():
    assert PlanOptions().certify == Certify(gap=0.005, seconds=None, keep=False)
    assert PlanOptions() != PlanOptions(certify=None)
    assert PlanOptions(certify=Certify(gap=1)).to_data()["certify"]["gap"] == 1.0


def test_two_plain_options_never_conflict():
    plain = PlanOptions()
    for one, two in product(fields(PlanOptions), repeat=2):
        PlanOptions(**{f.name: getattr(plain, f.name) for f in (one, two)})


def test_keywords_go_before_the_options(arm, tool, placement, circle):
    options = PlanOptions(gamma_step=0.5, metric="euclid")
    made = kerfpath.plan(
        circle, arm, tool=tool, placement=placement, speed=0.02, options=options, metric="chebychev"
    )
    assert made.settings.metric == "chebychev"
    assert made.settings.gamma_step == 0.5
    velocity, _ = arm.speed_limits()
    np.testing.assert_allclose(made.settings.weights, 1 / (velocity * made.dt))


def test_a_keyword_that_is_none_is_refused(arm, tool, placement, circle):
    with pytest.raises(TypeError, match="metrik"):
        kerfpath.plan(circle, arm, tool=tool, placement=placement, speed=0.02, metrik="euclid")


def test_the_old_name_of_the_settings_warns():
    from kerfpath import plans

    with pytest.warns(DeprecationWarning, match="PlanOptions"):
        assert plans.Settings is PlanOptions


def test_the_page_lists_every_option_its_key_and_its_name_in_the_data():
    rows = [line.split("|") for line in plan_options.page().splitlines()[2:]]
    words = [set(re.findall(r"`(\w+)`", " ".join(column))) for column in zip(*rows, strict=True)]
    parts = {field.name for kind in (Tilt, Certify) for field in fields(kind)}
    assert words[1] == {field.name for field in fields(PlanOptions)} | parts
    # What the executed path must keep is no option of a plan.
    assert words[2] == set(PlanTable.model_fields) - {"path_tolerance_mm"}
    assert words[5] == set(PlanOptions().to_data())


def test_the_example_of_the_page_runs(capsys):
    page = (ROOT / "docs" / "options.md").read_text()
    for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        exec(compile(code, "options.md", "exec"), {})
    assert capsys.readouterr().out.endswith("True\n")
