"""Random gestures for half a minute: no exception, the server goes on, memory is flat."""

import pytest
from benchmarks.studio_endurance import Gestures, Served, many_pages, two_holes

from studio.browser.test_page import until
from studio.browser.test_studio import NEWEST

SECONDS = 30
pytestmark = pytest.mark.slow


@pytest.fixture
def served(tmp_path):
    server = Served(two_holes(tmp_path))
    yield server
    server.stop()


def test_random_gestures_break_nothing(page, served, tmp_path):
    text = (tmp_path / "job.toml").read_text()
    page.goto(f"http://{served.address}")
    until(page, lambda: page.evaluate(NEWEST), seconds=60)
    gestures = Gestures(page, seed=1)
    gestures.go_on(SECONDS, served, text, samples=3)
    assert gestures.wrong == []
    assert gestures.count > SECONDS  # one a second on a machine that others keep busy
    # Whatever was done, the job is planned again.
    until(page, lambda: page.evaluate(NEWEST), seconds=60)
    assert [line for line in served.said if "Traceback" in line] == []
    # A page keeps a few plans and maps of some 100 kB; what leaks in every gesture is more.
    assert gestures.heap[-1] < gestures.heap[0] + 30


def test_many_pages_change_one_job(served):
    assert many_pages(served, pages=20, seconds=8, seed=0) == []
    assert [line for line in served.said if "Traceback" in line] == []
