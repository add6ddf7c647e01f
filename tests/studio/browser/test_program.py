"""The text of the program beside the scene: lines and places lead to each other."""

import pytest

from studio.browser.test_page import ready, sent, serious, until

pytestmark = pytest.mark.slow


@pytest.fixture
def text(first):
    """A program of a line for each quarter of its time, the third of them in a second file."""
    total = next(message for message in first if message["type"] == "program")["segments"][-1][
        "end"
    ]
    ends = [total * share for share in (0.25, 0.5, 0.75, 1.0)]
    begins = [0.0, *ends[:3]]
    several = {"a.src": [0, 1, 3], "b.src": [2]}
    files = [
        {
            "name": name,
            "text": "; a comment\n\n" + "".join(f"LIN P{k}\n" for k in rows),
            "lines": [3 + i for i in range(len(rows))],
            "begin": [begins[k] for k in rows],
            "end": [ends[k] for k in rows],
        }
        for name, rows in several.items()
    ]
    where = {"level": "warning", "message": "slow down", "place": "cut, move 2"}
    findings = [
        where | {"file": "b.src", "line": 3},
        {"level": "warning", "message": "look", "place": "program", "file": None, "line": None},
    ]
    return {
        "type": "program_text",
        "revision": 1,
        "language": "krl",
        "files": files,
        "findings": findings,
        "notes": ["a note"],
        "faults": [],
    }


def marked(page):
    """The text of the marked line, and its file."""
    return page.evaluate("""() => {
        const [bar, code] = [".here", ".listing .code"].map((s) => document.querySelector(s));
        const [{ top, height }, all] = [bar, code].map((e) => e.getBoundingClientRect());
        return code.textContent.split("\\n")[Math.round((top - all.top) / height)];
    }""")


def share(page):
    return page.evaluate("() => studio.player.t / studio.player.timeline.total")


def test_a_line_leads_to_its_place_and_a_place_to_its_line(page, studio, first, text):
    studio.open(*first)
    ready(page)
    react = studio.react
    studio.react = lambda m: studio.say(text) if m["type"] == "program" else react(m)
    page.locator("#open-program").click()
    listing = page.locator(".listing")
    listing.wait_for()
    assert sent(studio, "program")
    assert serious(page) == []
    page.evaluate("() => studio.player.seek(0.4 * studio.player.timeline.total)")
    assert marked(page) == "LIN P1"
    # A line without a place leads to the next one that has one.
    box = page.locator(".listing .code").bounding_box()
    page.mouse.click(box["x"] + 20, box["y"] + 4)
    assert share(page) == pytest.approx(0.25)
    assert marked(page) == "LIN P0"
    listing.focus()
    page.keyboard.press("ArrowDown")
    assert share(page) == pytest.approx(0.5)
    assert marked(page) == "LIN P1"
    # A finding leads to its line in another file.
    page.get_by_role("button", name="b.src, line 3").click()
    assert share(page) == pytest.approx(0.75)
    assert marked(page) == "LIN P2"
    page.evaluate("() => studio.player.seek(studio.player.timeline.total)")
    assert marked(page) == "LIN P3"
    # Another revision is asked for by itself.
    before = len(sent(studio, "program"))
    outcome = next(message for message in first if message["type"] == "outcome")
    studio.say(outcome | {"revision": 2})
    until(page, lambda: len(sent(studio, "program")) == before + 1)
    page.keyboard.press("Escape")
    assert page.locator("dialog").is_hidden()
