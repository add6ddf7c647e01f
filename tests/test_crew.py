"""Calls for many items, shared with other processes."""

import os
from functools import partial
from time import monotonic

import pytest

import apart_calls
from kerfpath.crew import ALONE, Crew
from kerfpath.effort import changed_effort


@pytest.fixture(scope="module")
def crew():
    with Crew(1, "apart_calls") as found:
        begun = monotonic()
        while len({process for _, process in found.each(apart_calls.square_slowly, [1, 2])}) == 1:
            assert monotonic() < begun + 120, "the other process does nothing"
        yield found


def test_results_are_in_the_order_of_the_items_whoever_does_them(crew):
    found = crew.each(apart_calls.square_slowly, range(40))
    assert [square for square, _ in found] == [k * k for k in range(40)]
    assert {process for _, process in found} > {os.getpid()}  # both have done some


def test_alone_all_is_done_here_after_begin():
    begun = []
    found = ALONE.each(apart_calls.square_slowly, [3, 4], begun.append)
    assert found == [(9, os.getpid()), (16, os.getpid())]
    assert begun == [3, 4]


def test_others_have_the_effort_of_this_process(crew):
    with changed_effort(binding_nodes=7):
        assert {nodes for nodes, _ in crew.each(apart_calls.binding_nodes, range(40))} == {7}


def test_what_an_item_raises_is_raised(crew):
    with pytest.raises(ZeroDivisionError):
        crew.each(apart_calls.inverse, [1, 2, 0, 4])
    assert crew.each(apart_calls.inverse, [1, 2]) == [1.0, 0.5]


def test_what_a_dead_process_leaves_is_done_here():
    with Crew(1, "apart_calls") as crew:
        found = crew.each(partial(apart_calls.square_here, os.getpid()), range(20))
        assert found == [k * k for k in range(20)]
        assert crew.each(partial(apart_calls.square_here, os.getpid()), [5]) == [25]
