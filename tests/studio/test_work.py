"""Work beside the server: the newest wins, and what is not wanted any more stops."""

from threading import Event, current_thread

import numpy as np
import pytest

from kerfpath import plan, refine
from kerfpath.progress import may_stop, stopped_by
from kerfpath.studio.cache import Cache
from kerfpath.studio.work import Newest, Seldom, Stop, Superseded


@pytest.fixture
def newest():
    failed = []
    worker = Newest("test", failed.append)
    worker.failed = failed
    yield worker
    worker.close()


def test_the_newest_wins_and_what_is_on_is_stopped(newest):
    begun, done, seen = Event(), Event(), []

    def first(stop):
        begun.set()
        while True:
            stop.rest(10)  # until it is stopped

    newest.ask(first)
    assert begun.wait(10)
    for i in range(5):
        newest.ask(lambda stop, i=i: seen.append(i))
    newest.ask(lambda stop: done.set())
    assert done.wait(10)
    assert newest.failed == []


def test_what_is_cancelled_stops_and_says_nothing(newest):
    begun, ended = Event(), Event()

    def work(stop):
        begun.set()
        try:
            stop.rest(10)
        finally:
            ended.set()

    newest.ask(work)
    assert begun.wait(10)
    newest.cancel()
    assert ended.wait(10)
    assert newest.failed == []


def test_a_failure_is_handed_on_and_the_thread_goes_on(newest):
    done = Event()
    newest.ask(lambda stop: 1 / 0)
    newest.ask(lambda stop: done.set())
    assert done.wait(10)
    assert [type(error) for error in newest.failed] in ([ZeroDivisionError], [])
    newest.ask(lambda stop: np.zeros(-1))
    again = Event()
    while not newest.failed:
        again.wait(0.01)
    assert isinstance(newest.failed[-1], (ValueError, ZeroDivisionError))


def test_a_long_call_of_the_library_stops_where_it_may(circle, arm, tool, placement):
    made = plan(
        circle, arm, tool=tool, placement=placement, speed=0.1,
        method="exact", gamma_step=np.radians(10), postures=(0, 1),
    )  # fmt: skip
    stop, calls = Stop(), []

    def check():
        calls.append(current_thread())
        if len(calls) == 2:
            stop.set()
        stop.check()

    with pytest.raises(Superseded), stopped_by(check):
        refine(made)
    assert len(calls) == 2
    assert refine(made).done  # outside of it nothing stops
    assert len(calls) == 2


def test_what_is_not_asked_to_stop_does_not():
    may_stop()
    with stopped_by(lambda: None):
        may_stop()


def test_seldom_lets_through_now_and_then():
    seldom = Seldom(3600)
    assert [seldom.may() for _ in range(3)] == [True, False, False]


def test_what_the_last_two_rounds_used_is_kept_and_the_eldest_of_the_rest_goes():
    kept = Cache(len, 10)
    kept.begin()
    for name in "abcdef":
        kept.put(name, name * 3)
    assert len(kept) == 6  # more than there is room for, but of this round
    kept.begin()
    assert kept.get("a") == "aaa"
    kept.put("g", "g")
    assert len(kept) == 7
    kept.begin()
    assert kept.get("b") == "bbb"
    kept.put("h", "h")
    # c to f were asked for two rounds ago; a in the last one, b in this.
    assert [name for name in "abcdefgh" if kept.get(name)] == ["a", "b", "g", "h"]
