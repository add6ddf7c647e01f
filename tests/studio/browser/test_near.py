"""What the scene draws on request: the nearest pair of bodies, ghosts, and executed paths."""

import pytest

from studio.browser.test_page import ready, serious, until

pytestmark = pytest.mark.slow


def test_the_nearest_pair_is_said_and_lit_where_the_robot_is(page, studio, first):
    studio.open(*first)
    ready(page)
    by = page.locator("#colour-by")
    by.select_option("clearance")
    assert "no [cell]" in page.locator("#scale").inner_text()
    plan = next(m for m in first if m["type"] == "plan" and m["contour"] == "slot")
    count = len(plan["time"])
    pairs = [["link 3", "part"], ["head", "part"]]
    half = [int(k > count / 2) for k in range(count)]
    studio.say(
        {
            "type": "clearance",
            "revision": 1,
            "contour": "slot",
            "name": plan["name"],
            "distance": [(0.0123, 0.004)[k] for k in half],
            "over": [(0.0073, -0.001)[k] for k in half],
            "pair": half,
            "pairs": pairs,
        }
    )
    until(page, lambda: "200 mm and more" in page.locator("#scale").inner_text())
    go = """(share) => {
        const span = studio.player.timeline.spans.find((s) => s.plan?.contour === "slot");
        studio.player.seek(span.begin + share * (span.end - span.begin));
    }"""
    page.evaluate(go, 0.2)
    label = page.locator("#near")
    assert label.inner_text() == "12.3 mm: link 3 \u2013 part"
    until(page, lambda: page.evaluate("() => studio.view.near.lit.length") == 2)
    page.evaluate(go, 0.9)
    assert label.inner_text() == "4.0 mm: head \u2013 part closer than allowed"
    assert serious(page) == []
    by.select_option("kind")
    assert label.is_hidden()
    until(page, lambda: page.evaluate("() => studio.view.near.lit.length") == 0)


def test_ghosts_stay_where_the_robot_was_until_they_are_cleared(page, studio, first):
    studio.open(*first)
    ready(page)
    poses = """() => studio.view.ghosts.group.children.map(
        (ghost) => ghost.children.map(({ matrix }) => [...matrix.elements])
    )"""
    robot = "() => studio.view.machine.frames.map(({ matrix }) => [...matrix.elements])"
    stood = []
    for share in (0.2, 0.6):
        page.evaluate("(s) => studio.player.seek(s * studio.player.timeline.total)", share)
        stood.append(page.evaluate(robot))
        page.keyboard.press("g")
    assert page.evaluate(poses) == stood
    page.locator("#ghost-keep").click()
    assert page.evaluate("() => studio.view.ghosts.group.children.length") == 3
    clear = page.get_by_role("button", name="Clear 3 ghosts")
    clear.click()
    assert page.evaluate(poses) == []
    assert clear.is_hidden()
    for _ in range(8):
        page.locator("#ghost-keep").click()
    assert page.evaluate("() => studio.view.ghosts.group.children.length") == 6


DRAWN = """() => {
    const { visible, geometry } = studio.view.paths.executed;
    if (!visible) return null;
    return ["instanceStart", "instanceEnd"].flatMap((name) => {
        const of = geometry.getAttribute(name);
        return [of.getX(0), of.getY(0), of.getZ(0)];
    });
}"""


def test_the_executed_path_is_drawn_with_its_errors_enlarged(page, studio, first):
    studio.open(*first)
    ready(page)
    assert page.evaluate(DRAWN) is None
    plan = next(m for m in first if m["type"] == "plan")
    drawn, tip = (plan["executed"][key][:6] for key in ("drawn", "tip"))
    for word, factor in (("1", 1), ("50", 50)):
        page.locator("#executed").select_option(word)
        asked = [a + factor * (b - a) for a, b in zip(drawn, tip, strict=True)]
        assert page.evaluate(DRAWN) == pytest.approx(asked, abs=1e-6)  # in single precision
    until(page, lambda: "at most 0.17 mm off" in page.locator("#scale").inner_text())
    assert "assumed, sigma 25 ms" in page.locator("#scale").inner_text()
    assert serious(page) == []
    page.locator("#executed").select_option("0")
    assert page.evaluate(DRAWN) is None
    until(page, lambda: "executed" not in page.locator("#scale").inner_text())
