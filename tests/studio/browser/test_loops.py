"""Loops of the part, pointed at and picked: by the pointer in the scene, by keys in their sheet."""

import pytest

from studio.browser.test_page import ready, sent, serious, until

pytestmark = pytest.mark.slow

PLACE = """(name) => {
    const { store, view: { stage, canvas } } = studio;
    const { points } = store.part.loops.find((loop) => loop.name === name);
    const at = stage.camera.position.clone().fromArray(points);
    const [{ x, y }, box] = [stage.project(at), canvas.getBoundingClientRect()];
    return [x + box.x, y + box.y];
}"""

DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


@pytest.fixture
def opened(page, studio, first):
    studio.open(*first)
    ready(page)
    page.locator("[data-view=part]").click()
    page.evaluate(DRAWN)
    return page


def test_a_loop_is_named_under_the_pointer_and_cut_at_a_click(opened, studio):
    x, y = opened.evaluate(PLACE, "skin/hole6")
    opened.mouse.move(x, y)
    label = opened.locator("#scene-label")
    until(opened, label.is_visible)
    assert label.inner_text() == "skin/hole6 opening, 334.4 mm long, not cut"
    assert opened.evaluate("() => studio.view.picking.loops.lit.visible")
    opened.mouse.click(x, y)
    opened.get_by_role("button", name="Cut this loop").click()
    assert sent(studio, "cut") == [{"type": "cut", "loops": ["skin/hole6"]}]
    assert opened.locator("#scene-menu").is_hidden()
    opened.mouse.click(x, y)
    # What lies on the inner side of the sheet, or is cut already, is not among them.
    opened.get_by_role("button", name="Cut all 3 loops of skin").click()
    assert len(sent(studio, "cut")[-1]["loops"]) == 3
    opened.mouse.click(x, y)
    opened.keyboard.press("Escape")
    assert opened.locator("#scene-menu").is_hidden()


def test_a_contour_is_taken_out_by_the_other_button(opened, studio):
    x, y = opened.evaluate(PLACE, "skin/hole11")
    opened.mouse.click(x, y, button="right")
    opened.get_by_role("button", name="Take out of the job").click()
    assert sent(studio, "leave") == [{"type": "leave", "index": 2}]


def test_the_sheet_of_loops_does_the_same_by_keys(opened, studio):
    opened.locator("#open-loops").focus()
    opened.keyboard.press("Enter")
    rows = opened.locator("dialog .row")
    assert rows.count() == 5
    assert serious(opened) == []
    opened.keyboard.type("hole6")
    assert rows.count() == 1
    button = opened.get_by_role("button", name="Cut skin/hole6")
    button.focus()
    assert opened.evaluate("() => studio.view.picking.loops.lit.visible")
    opened.keyboard.press("Enter")
    assert sent(studio, "cut") == [{"type": "cut", "loops": ["skin/hole6"]}]
    opened.keyboard.press("Escape")
    assert opened.locator("dialog").is_hidden()
    lit = "() => studio.view.picking.loops.lit.visible"
    until(opened, lambda: not opened.evaluate(lit))
