"""The bound of a plan: who asks the certifier for it, for which plans, and how it is shown."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import Certify, Contour, fastest_speed, pareto, plan, plan_in_pieces, refine, refiner
from kerfpath.certifier import Certified, SharedWork, certify
from kerfpath.certifier.bound import most_pairs
from kerfpath.effort import changed_effort
from kerfpath.placement import placed
from kerfpath.planner import planning, with_bound
from kerfpath.plans import Proof
from kerfpath.sequence import plan_part

pytestmark = pytest.mark.usefixtures("certified_by_default")
STEP = np.radians(10)


@pytest.fixture
def asked(monkeypatch):
    """Stand in for the certifier, which proves 0.9 of every cost: what it is asked for."""
    calls = []

    def certify(made, *, gap, seconds, checkable, most, progress, refined):
        calls.append((made, gap, seconds))
        progress("cells", 1, 2)
        proof = replace(made.proof, bound=0.9 * made.cost, gap=0.1)
        bounded = replace(made, proof=proof)
        return Certified(plan=bounded, done=False, statement="a bound is proved")

    monkeypatch.setattr(planning, "certify", certify)
    return calls


@pytest.fixture
def task(circle, arm, tool, placement):
    return {"tool": tool, "placement": placement, "gamma_step": STEP, "speed": 0.05}


@pytest.mark.parametrize("keywords", [{}, {"method": "exact", "refine": True}, {"method": "paper"}])
def test_every_plan_is_certified_as_it_is_asked_for(asked, task, circle, arm, keywords):
    phases = []
    made = plan(circle, arm, phase=phases.append, **task, **keywords)
    ((given, gap, seconds),) = asked
    assert (gap, seconds) == (0.005, None)
    assert "certificate" in phases
    assert phases.count("certificate") == 1
    np.testing.assert_array_equal(given.q, made.q)
    assert (made.proof.bound, made.proof.gap) == (0.9 * made.cost, 0.1)
    assert made.proof.statement == f"{given.proof.statement}; a bound is proved"
    assert made.proof.optimal == given.proof.optimal
    assert made.proof.grid_cost == given.proof.grid_cost
    own = plan(circle, arm, **task, **keywords, certify=Certify(gap=0.02, seconds=3))
    assert asked[-1][1:] == (0.02, 3.0)
    assert own.settings.certify == Certify(gap=0.02, seconds=3)


def test_without_the_option_nothing_is_certified(asked, task, circle, arm):
    phases = []
    made = plan(circle, arm, phase=phases.append, certify=None, **task)
    assert not asked
    assert "certificate" not in phases
    assert made.settings.certify is None
    assert (made.proof.bound, made.proof.gap, made.proof.certificate) == (None, None, None)


def test_a_bound_can_be_had_afterwards(asked, task, circle, arm):
    made, seen = plan(circle, arm, certify=None, **task), []
    bounded = with_bound(
        made, Certify(gap=0.3), progress=lambda what, done, total: seen.append((what, done, total))
    )
    assert seen == [("cells", 1, 2)]
    assert bounded.proof.gap == 0.1
    assert bounded.settings == replace(made.settings, certify=Certify(gap=0.3))
    assert with_bound(bounded, None).settings.certify is None


@pytest.fixture(scope="module")
def bounded(circle, arm, tool, placement):
    """A plan on a grid that says of itself that at most a fifth could be saved."""
    made = plan(
        circle, arm, tool=tool, placement=placement, gamma_step=STEP, speed=0.05, method="exact",
        certify=None,
    )  # fmt: skip
    proof = replace(made.proof, bound=0.8 * made.cost, gap=0.2)
    claim = f"{made.proof.statement}; {proof.bound_claim}"
    return made.proof.statement, replace(made, proof=replace(proof, statement=claim))


def nudged(made):
    T = made.T_base_part.copy()
    T[:3, 3] += [0.01, -0.02, 0.005]
    return T


@pytest.mark.parametrize(
    "changed",
    [
        lambda made: placed(made, nudged(made)),
        lambda made: refine(made).plan,
        lambda made: refine(made, eta_v=0.9).plan,
        lambda made: refiner.quicken(made)[0],
        lambda made: refiner.reduce_excess(made),
    ],
    ids=["moved", "refined", "within other limits", "quickened", "with less excess"],
)
def test_another_motion_does_not_quote_the_bound(bounded, changed):
    found, made = bounded
    proof = changed(made).proof
    assert (proof.bound, proof.gap, proof.certificate) == (None, None, None)
    assert proof.statement.startswith(found)
    assert "no motion" not in proof.statement


def test_a_bound_that_is_proved_again_is_said_once(bounded, asked):
    found, made = bounded
    again = with_bound(made, Certify())
    assert again.proof.statement == f"{found}; a bound is proved"
    assert made.proof.without_bound().statement == found
    assert made.proof.without_bound().without_bound() == made.proof.without_bound()


@pytest.mark.slow
def test_what_is_not_refined_keeps_its_bound(bounded):
    _, made = bounded
    left = refine(replace(made, settings=replace(made.settings, eta_a=1e-6)))
    assert not left.done
    assert left.plan.proof == made.proof


def test_where_nothing_can_be_proved_the_statement_says_why(monkeypatch, task, circle, arm):
    def nothing(made, **_):
        return Certified(plan=made, done=False, statement="no bound: unknown arm")

    monkeypatch.setattr(planning, "certify", nothing)
    made = plan(circle, arm, **task)
    assert made.proof.bound is None
    assert made.proof.statement.endswith("; no bound: unknown arm")


def test_every_piece_is_certified_on_its_own(asked, task, circle, arm):
    limits = {"rotation": None, "postures": (0,)}
    pieces = plan_in_pieces(circle, arm, **task, **limits)
    assert [given.name for given, _, _ in asked] == [piece.name for piece in pieces]
    assert all(piece.proof.gap == 0.1 for piece in pieces)


def test_of_a_part_only_what_is_chosen_is_certified(asked, task, circle, arm):
    other = Contour(circle.points[::-1], circle.axes[::-1], closed=True, name="back")
    made = plan_part([[circle, other.resample(count=61)]], arm, **task)
    assert len(asked) == len(made.plans) == 1
    assert made.plans[0].proof.gap == 0.1
    assert made.plans[0].settings.certify == Certify()


def test_the_bounds_of_a_part_share_the_work_of_one():
    with changed_effort(certificate_pairs=1000, certificate_pairs_per_node=10):
        work, alone = SharedWork([11, 101, 51]), most_pairs(101)
    assert alone == 2000
    taken = []
    for wanted in (0.1 * alone, np.inf, np.inf):
        taken.append(min(wanted, work.share))
        work.take(taken[-1])
    # The first one leaves some of its third, and the others take half and all of what is left.
    assert taken == pytest.approx([0.1 * alone, 0.45 * alone, 0.45 * alone])
    assert work.share == 0


def test_a_bound_takes_no_more_work_than_it_may(circle, arm, task):
    made = plan(circle, arm, certify=None, **task)
    free = certify(made, gap=1e-6, checkable=False, most=3e6)
    few = certify(made, gap=1e-6, checkable=False, most=free.pairs / 10)
    assert few.stages < free.stages  # the stage that goes beyond is the last one
    assert few.pairs < free.pairs
    assert 0 < few.plan.proof.bound <= free.plan.proof.bound


def test_plans_that_nobody_sees_are_not_certified(asked, task, circle, arm):
    front = pareto(circle, arm, runs=3, criteria=("displacement", "velocity"), **task)
    assert all(made.proof.bound is None for made in front.plans)
    del task["speed"]
    fastest_speed(circle, arm, refine=True, **task)
    assert not asked


def test_a_plan_and_its_proof_show_the_bound(asked, task, circle, arm):
    made = plan(circle, arm, **task)
    assert ", gap 10.00 %, " in repr(made)
    assert "gap" not in repr(with_bound(plan(circle, arm, certify=None, **task), None))
    assert "bound=" in repr(made.proof)


@pytest.mark.parametrize(
    ("bound", "gap", "shown"),
    [
        (21.637, 0.00123, ("21.63", "0.13")),
        (21.0, 0.0, ("21.00", "0.00")),
        (-0.001, 1.0, ("-0.01", "100.00")),
        (5.0, -1e-12, ("5.00", "0.00")),
        (None, None, ("-", "-")),
    ],
)
def test_figures_claim_no_more_than_is_proved(bound, gap, shown):
    proof = Proof(optimal=False, statement="", bound=bound, gap=gap)
    assert (proof.bound_shown, proof.gap_shown) == shown
