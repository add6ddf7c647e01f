"""Motions along very many nodes are refined in sections: as good as whole, and every limit kept."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from kerfpath import audit, plan, refine
from kerfpath.refiner import descent, sections

NEAR = 1e-4
"""Relative: sections may end this much above programs of all nodes."""
COARSE, PARTS = 49, 5
NODES, OVERLAP = 80, 16
LARGEST = NODES * 3 // 2
KNOWN = 1e-6
"""A lower bound, however low, on the cost of the motion."""
TURN_LITTLE = [np.inf, np.inf, np.inf, 2.5, np.inf, 2.5]


@pytest.fixture
def sized(monkeypatch):
    """Make sections of few nodes, and return the nodes of every program."""
    sizes, solve = [], descent.solve

    def watched(model, *others):
        sizes.append(len(model.q))
        return solve(model, *others)

    monkeypatch.setattr(descent, "solve", watched)
    for name, value in {"MANY": 100, "NODES": NODES, "OVERLAP": OVERLAP}.items():
        monkeypatch.setattr(sections, name, value)
    return sizes


@pytest.fixture(scope="module")
def coarse(circle, arm, tool, placement):
    def call(robot=arm, **options):
        options = {"gamma_step": np.radians(4), "postures": (0, 1), "certify": None} | options
        nodes = circle.resample(count=COARSE)
        where = {"tool": tool, "placement": placement, "speed": 0.15}
        return plan(nodes, robot, **where, **options)

    return call


@pytest.fixture
def fine(circle):
    return circle.resample(count=(COARSE - 1) * PARTS + 1)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"metric": "euclid"},
        {"weights": [1, 2, 3, 1, 1, 0]},
        {"eta_a": 0.25},
    ],
    ids=lambda options: " ".join(options) or "plain",
)
def test_sections_are_as_good_as_the_whole(coarse, fine, sized, options):
    begun = coarse(**options)
    sized.clear()
    whole = refine(begun, nodes=fine)
    assert set(sized) == {len(fine)}
    sized.clear()
    found = refine(begun, nodes=fine, least=KNOWN)
    assert sized[0] <= LARGEST
    assert whole.done
    assert found.done
    assert found.cost_after <= whole.cost_after * (1 + NEAR)
    assert audit(found.plan) == []


def test_a_limit_on_jerk_holds_across_the_ends_of_sections(coarse, fine, sized, arm):
    begun = coarse()
    free = refine(begun, nodes=fine).plan
    jerk = np.abs(np.diff(free.increments, n=2, axis=0)).max(axis=0) / free.time[1] ** 3
    limited = replace(begun, robot=arm.with_limits(jerk=0.9 * jerk))
    whole = refine(limited, nodes=fine)
    sized.clear()
    found = refine(limited, nodes=fine, least=KNOWN)
    assert sized[0] <= LARGEST
    assert found.done
    assert found.cost_after <= whole.cost_after * (1 + NEAR)
    assert audit(found.plan) == []


@pytest.mark.parametrize(
    "options",
    [
        {"objective": "max"},
        {"metric": "chebychev"},
        {"closure": "periodic"},
        {"rotation": TURN_LITTLE},
    ],
    ids=lambda options: next(iter(options)),
)
def test_what_joins_all_nodes_is_refined_whole(coarse, fine, sized, options):
    begun = coarse(**options)
    sized.clear()
    assert refine(begun, nodes=fine, least=KNOWN).done
    assert set(sized) == {len(fine)}


def test_every_node_is_free_in_some_section_and_no_section_is_short():
    for nodes in (800, 1001, 2400, 10_000):
        for size in (400, 800):
            made = list(sections._sections(nodes, size))
            assert made[0][0] == 0
            assert made[-1][1] == nodes - 1
            for (_, last), (first, _) in pairwise(made):
                assert last - first == sections.OVERLAP
            sizes = [last - first + 1 for first, last in made]
            assert max(sizes) <= size * 3 // 2 + 1
            assert min(sizes) > min(nodes, size // 2 + sections.OVERLAP) - 1
