"""An order of very many cuts is there however little time its search has, and keeps the rules."""

from __future__ import annotations

import numpy as np
import pytest

from kerfpath.errors import NoFeasiblePath
from kerfpath.sequence.order import best_order, shortened


def nest(parts: int, seed: int) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """Return times between the loops of plates, two holes and an outline each, and the rules."""
    rng = np.random.default_rng(seed)
    at = (
        np.repeat(rng.uniform(0, 5, (parts, 2)), 3, axis=0) + rng.normal(size=(3 * parts, 2)) * 0.05
    )
    apart = np.linalg.norm(at[:, None] - at[None], axis=2) + 0.1
    np.fill_diagonal(apart, np.inf)
    return apart, [(3 * k + i, 3 * k + 2) for k in range(parts) for i in (0, 1)]


@pytest.mark.parametrize("seed", range(3))
def test_a_nest_has_an_order_within_the_rules_at_once(seed: int) -> None:
    apart, rules = nest(25, seed)
    count = len(apart)
    order = best_order(range(count), np.ones(count), apart, before=rules, seconds=0.01)
    place = np.argsort(order.candidates)
    assert sorted(order.candidates.tolist()) == list(range(count))
    assert all(place[a] < place[b] for a, b in rules)
    taken = order.candidates
    assert order.duration == pytest.approx(count + apart[taken[:-1], taken[1:]].sum())
    assert count < order.at_least <= order.duration


def test_more_time_is_never_worse() -> None:
    apart, rules = nest(4, 0)
    short, long = (
        best_order(range(12), np.ones(12), apart, before=rules, seconds=s) for s in (0.001, 5)
    )
    assert long.duration <= short.duration
    assert short.at_least <= long.duration + 1e-9  # a bound of any search holds for all orders


def test_very_many_cuts_have_an_order_near_its_bound() -> None:
    """160 plates, of which each loop can be cut in two ways: 900 000 moves between them."""
    apart, rules = nest(160, 0)
    group = np.repeat(np.arange(len(apart)), 2)
    between = np.repeat(np.repeat(apart, 2, axis=0), 2, axis=1)
    turned = np.add.outer(np.arange(len(group)), np.arange(len(group))) % 2
    between = between + 0.3 * turned
    order = best_order(group, np.ones(len(group)), between, before=rules, seconds=0.1)
    place = np.argsort(group[order.candidates])
    assert sorted(group[order.candidates].tolist()) == list(range(len(apart)))
    assert all(place[a] < place[b] for a, b in rules)
    assert 0.9 * order.duration < order.at_least <= order.duration


@pytest.mark.parametrize("seed", range(4))
def test_the_bound_of_an_order_without_a_search_holds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = 6
    group = np.concatenate([np.arange(count), rng.integers(0, count, 3)])
    between = rng.random((9, 9))
    between[rng.random((9, 9)) < 0.1] = np.inf
    found = [best_order(group, np.ones(9), between, seconds=s) for s in (1e-6, 10)]
    assert found[1].optimal
    assert found[0].at_least <= found[1].duration + 1e-9


def test_rules_that_contradict_each_other_are_told_from_too_little_time() -> None:
    apart, _ = nest(1, 0)
    with pytest.raises(NoFeasiblePath, match="contradict") as refused:
        best_order(range(3), np.ones(3), apart, before=[(0, 1), (1, 2), (2, 0)], seconds=5)
    assert refused.value.proved


@pytest.mark.parametrize("seed", range(6))
def test_an_order_is_shortened_within_its_rules(seed: int) -> None:
    """Nests of plates with a hole each, in rows; some groups may not follow each other."""
    rng = np.random.default_rng(seed)
    plates, each = 12, 3
    group = np.repeat(np.arange(2 * plates), each)
    place = np.stack([group // 2 % 4 * 45.0, group // 2 // 4 * 45.0], axis=1)
    start, end = (place + rng.uniform(0, 40, place.shape) for _ in range(2))
    time = np.full((len(group) + 1,) * 2, np.inf)
    time[0], time[:, 0] = 0.0, 0.0
    time[1:, 1:] = np.linalg.norm(end[:, None] - start, axis=2) ** 0.5
    barred = rng.random((2 * plates,) * 2) < 0.05
    time[1:, 1:][(group[:, None] == group) | barred[np.ix_(group, group)]] = np.inf
    earlier = np.zeros((2 * plates,) * 2, bool)
    earlier[np.arange(0, 2 * plates, 2), np.arange(1, 2 * plates, 2)] = True

    def length(order: np.ndarray) -> float:
        around = np.concatenate([[0], order + 1, [0]])
        return float(time[around[:-1], around[1:]].sum())

    while True:  # any order within the rules
        holes, outlines = rng.permutation(plates) * 2, rng.permutation(plates) * 2 + 1
        first = np.concatenate([holes, outlines]) * each
        if np.isfinite(length(first)):
            break
    found = shortened(first, group, time, earlier, np.zeros(len(group)), 0.0 * earlier)
    assert sorted(group[found].tolist()) == list(range(2 * plates))
    at = np.argsort(group[found])
    assert (at[::2] < at[1::2]).all()
    assert length(found) < 0.8 * length(first)
    # No group is better elsewhere, in any of its candidates.
    for k, one in enumerate(found):
        rest = np.delete(found, k)
        for p in range(len(found)):
            for other in np.flatnonzero(group == group[one]):
                tried = np.insert(rest, p, other)
                at = np.argsort(group[tried])
                if (at[::2] < at[1::2]).all():
                    assert length(tried) >= length(found) - 1.01e-4
