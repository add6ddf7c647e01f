"""Pictures and videos of the scene: files that the page itself makes."""

import struct
from pathlib import Path

import pytest

from studio.browser.test_page import ready, until

pytestmark = pytest.mark.slow


def test_a_picture_is_as_large_as_the_view_and_shows_it(page, studio, first):
    studio.open(*first)
    ready(page)
    page.locator("#export").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="picture of the view").click()
    assert download.value.suggested_filename == "b_pillar.png"
    data = Path(download.value.path()).read_bytes()
    assert data.startswith(b"\x89PNG")
    size = page.evaluate("() => [studio.view.canvas.width, studio.view.canvas.height]")
    assert list(struct.unpack(">2I", data[16:24])) == size
    assert len(data) > 10_000  # a sky alone takes far less


def test_a_video_is_recorded_to_the_end_or_until_it_is_stopped(page, studio, first):
    studio.open(*first)
    ready(page)
    page.locator("#rate").select_option("20")
    page.locator("#export").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="video of the motion").click()
        page.locator("#recording").wait_for()
    assert download.value.suggested_filename == "b_pillar.webm"
    data = Path(download.value.path()).read_bytes()
    assert data.startswith(b"\x1a\x45\xdf\xa3")  # what every WebM begins with
    assert len(data) > 5_000
    assert page.evaluate("() => studio.player.t === studio.player.timeline.total")
    assert page.locator("#recording").is_hidden()
    # One that is cancelled is no file, and leaves the player where it is.
    page.locator("#rate").select_option("1")
    wrong = []
    page.on("download", lambda file: wrong.append(file))
    page.locator("#export").click()
    page.get_by_role("button", name="video of the motion").click()
    until(page, lambda: page.evaluate("() => studio.player.t > 0.1"))
    page.locator("#recording").get_by_role("button", name="Cancel").click()
    assert page.locator("#recording").is_hidden()
    assert not page.evaluate("() => studio.player.playing")
    page.wait_for_timeout(300)
    assert wrong == []
