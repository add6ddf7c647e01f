"""The map: shades with their scale, zoom and pan by wheel and keys, another technique's course."""

import base64
import math

import pytest

from studio.browser.test_page import MODULE, ready, serious, until

pytestmark = pytest.mark.slow

SEEN = "() => ({ ...studio.map.chart.window })"
WHOLE = {"from": 0, "to": 1, "top": 0, "bottom": 1}
DRAWN = """() => new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)))"""
PIXEL = """([node, sample]) => {
    const { chart, grid } = studio.map;
    const frame = chart.frame;
    const { s, gamma } = grid.message;
    const [x, y] = [chart.x(s[node], frame), chart.y(gamma[sample], frame)];
    const { width, height } = chart.back;
    const across = ((x - frame.left) / frame.width) * width;
    const down = ((y - frame.top) / frame.height) * height;
    const one = document.createElement("canvas");
    Object.assign(one, { width: 1, height: 1 });
    const context = one.getContext("2d");
    context.drawImage(chart.back, -Math.floor(across), -Math.floor(down));
    return [...context.getImageData(0, 0, 1, 1).data].slice(0, 3);
}"""
SCALE = """async (share) => {
    const { alongScale } = await import("/client/scene/scale.js");
    return alongScale(share).getHexString().match(/../g).map((each) => parseInt(each, 16));
}"""
DOTS = """() => {
    const found = [];
    const { chart } = studio.map;
    const context = chart.canvas.getContext("2d");
    const dash = context.setLineDash.bind(context);
    context.setLineDash = (list) => { found.push(list.length); dash(list); };
    studio.map.draw();
    delete context.setLineDash;
    return found;
}"""


@pytest.fixture
def mapped(page, studio, first, messages):
    """A page with the map of the sample, whose server answers what is asked of it."""
    by_type = {kind: messages[kind][0] for kind in ("map", "shade", "technique")}
    contour = by_type["map"]["contour"]

    def react(message):
        kind = message["type"]
        key = {"shade": "by", "technique": "method"}.get(kind)
        known = by_type.get(kind)
        if known and message["contour"] == contour and (not key or message[key] == known[key]):
            studio.say(known)

    studio.react = react
    studio.open(*first)
    ready(page)
    page.locator("#contours button", has_text=contour).click()
    until(page, lambda: page.evaluate("() => studio.map.grid !== null"))
    page.evaluate(DRAWN)
    return page


def middle(page):
    box = page.locator("#map-canvas").bounding_box()
    frame = page.evaluate("() => studio.map.chart.frame")
    return (
        box["x"] + frame["left"] + frame["width"] / 2,
        box["y"] + frame["top"] + frame["height"] / 2,
    )


@pytest.mark.parametrize("page", [("light", 1280, 720), ("dark", 1280, 720)], indirect=True)
def test_the_admitted_are_shaded_with_a_scale_and_their_values_are_said(mapped, studio, messages):
    page, (shade,) = mapped, messages["shade"]
    assert "wrist singularity" in page.locator("#map-shade").inner_text()
    page.locator("#map-shade").select_option("wrist")
    until(page, lambda: page.evaluate("() => studio.map.chart.shade !== null"))
    page.evaluate(DRAWN)
    assert shades_asked(studio) == ["wrist"]
    legend = page.locator("#legend .shades").inner_text()
    assert "wrist singularity" in legend
    assert "90 deg" in legend
    for place in ([5, 20], [16, 200], [30, 300]):
        code = page.evaluate(
            """([node, sample]) => {
                const { grid, layer, chart } = studio.map;
                const { posture } = grid.layers[layer];
                return chart.shade.of(posture)[node * grid.samples + sample];
            }""",
            place,
        )
        assert code < 254  # admitted everywhere on this map
        # A pixel may be of the next sample, whose value is another by a step or two of the scale.
        expected = page.evaluate(SCALE, code / 253)
        assert page.evaluate(PIXEL, place) == pytest.approx(expected, abs=8)
        page.evaluate("([node, sample]) => studio.map.hover.enter({ node, sample })", place)
        value = math.degrees(shade["low"] + (shade["high"] - shade["low"]) * code / 253)
        said = page.locator("#map-tip").inner_text()
        found = float(said.split("wrist singularity: ")[1].split(" deg")[0])
        assert found == pytest.approx(value, abs=0.51)
    assert serious(page) == []
    page.locator("#map-shade").select_option("")
    until(page, lambda: page.evaluate("() => studio.map.chart.shade === null"))
    assert page.locator("#legend .shades").count() == 0
    until(page, lambda: shades_asked(studio) == ["wrist", None])


def shades_asked(studio):
    return [m["by"] for m in studio.sent if m["type"] == "shade"]


def test_what_comes_too_near_is_crossed_and_said(mapped, studio, messages):
    page, (known,) = mapped, messages["map"]
    studio.say(known | {"shades": [{"by": "clearance", "words": "clearance", "unit": "m"}]})
    until(page, lambda: page.locator("#map-shade option").count() == 2)
    page.locator("#map-shade").select_option("clearance")
    until(page, lambda: studio.sent[-1].get("by") == "clearance")
    assert "being computed" in page.locator("#legend .shades").inner_text()
    half = len(known["gamma"]) // 2
    rows = [bytes([254] * half + [253] * half)] * known["nodes"]
    values = base64.b64encode(b"".join(rows)).decode()
    nearest = base64.b64encode(bytes(2 * half * known["nodes"])).decode()
    studio.say(
        {
            **{"type": "shade", "revision": 1, "contour": known["contour"]},
            **{"graph": known["graph"], "by": "clearance", "words": "clearance", "unit": "m"},
            **{"low": 0.0, "high": 0.1, "beyond": True, "pairs": [["link 3", "post"]]},
            "layers": [
                {"posture": layer["posture"], "values": values, "nearest": nearest}
                for layer in known["layers"]
            ],
        }
    )
    until(page, lambda: "100 mm" in page.locator("#legend .shades").inner_text())
    assert "closer than allowed" in page.locator("#legend .shades").inner_text()
    page.evaluate("() => studio.map.hover.enter({ node: 3, sample: 10 })")
    said = page.locator("#map-tip").inner_text()
    assert said.startswith("Closer than allowed")
    assert "link 3 \u2013 post" in said
    page.evaluate("() => studio.map.hover.enter({ node: 3, sample: 300 })")
    assert "at least 100 mm" in page.locator("#map-tip").inner_text()


def test_the_wheel_zooms_where_the_pointer_is_and_all_is_shown_again(mapped, studio, first):
    page = mapped
    place = "([x, y]) => [studio.map.chart.sAt(x), studio.map.chart.gammaAt(y)]"
    x, y = middle(page)
    box = page.locator("#map-canvas").bounding_box()
    at = [x - box["x"] + 30, y - box["y"] - 20]
    page.mouse.move(x + 30, y - 20)
    before, frame = page.evaluate(place, at), page.evaluate("() => studio.map.chart.frame")
    length = page.evaluate("() => studio.map.grid.length")
    for _ in range(3):
        page.mouse.wheel(0, -100)
    until(page, lambda: page.evaluate(SEEN)["to"] - page.evaluate(SEEN)["from"] < 0.5)
    page.evaluate(DRAWN)
    # What is under the pointer stays there, to the pixel that a browser says it is at.
    after = page.evaluate(place, at)
    assert after[0] == pytest.approx(before[0], abs=length / frame["width"])
    assert after[1] == pytest.approx(before[1], abs=360 / frame["height"])
    seen = page.evaluate(SEEN)
    cell = page.evaluate("([x, y]) => studio.map.hover.at(x, y)", at)
    s = page.evaluate("() => studio.map.grid.message.s")
    assert abs(s[cell["node"]] - before[0]) == min(abs(each - before[0]) for each in s)
    # A drag with Shift moves it, and pins nothing.
    page.keyboard.down("Shift")
    page.mouse.down()
    page.mouse.move(x, y - 20)
    page.mouse.up()
    page.keyboard.up("Shift")
    moved = page.evaluate(SEEN)
    assert moved["from"] > seen["from"]
    assert not any(m["type"] == "edit" for m in studio.sent)
    # A new plan of the contour leaves it as it is, another contour has its own.
    plan = next(m for m in first if m["type"] == "plan" and m["contour"] == "hole 10")
    studio.say(plan | {"revision": 2})
    until(page, lambda: page.evaluate("() => studio.store.plans.get('hole 10')[0].revision") == 2)
    assert page.evaluate(SEEN) == moved
    page.locator("#contours button", has_text="slot").click()
    assert page.evaluate(SEEN) == WHOLE
    page.locator("#contours button", has_text="hole 10").click()
    until(page, lambda: page.evaluate(SEEN) == moved)
    assert serious(page) == []
    page.locator("#map-whole").click()
    assert page.evaluate(SEEN) == WHOLE
    assert page.locator("#map-whole").is_hidden()
    page.mouse.move(x, y)
    page.mouse.wheel(0, -100)
    until(page, lambda: page.evaluate(SEEN) != WHOLE)
    page.mouse.dblclick(x, y)
    assert page.evaluate(SEEN) == WHOLE


def test_keys_zoom_move_and_show_all(mapped):
    page = mapped
    page.locator("#map-canvas").focus()
    for _ in range(4):
        page.keyboard.press("+")
    seen = page.evaluate(SEEN)
    assert seen["to"] - seen["from"] == pytest.approx(1.3**-4)
    page.keyboard.press("Control+ArrowRight")
    after = page.evaluate(SEEN)
    assert after["from"] - seen["from"] == pytest.approx(0.2 * 1.3**-4)
    page.keyboard.press("-")
    assert page.evaluate(SEEN)["to"] - page.evaluate(SEEN)["from"] == pytest.approx(1.3**-3)
    # The cursor takes what is seen along.
    for _ in range(4):
        page.keyboard.press("Shift+ArrowRight")
    (node, s) = page.evaluate("() => [studio.map.hover.cell.node, studio.map.grid.message.s]")
    assert node == len(s) - 1
    assert page.evaluate(SEEN)["to"] == pytest.approx(1)
    page.keyboard.press("Home")
    assert page.evaluate(SEEN) == WHOLE


def test_a_pin_is_drawn_where_the_pointer_is_on_a_zoomed_map(mapped, studio):
    page = mapped
    page.locator("#map-canvas").focus()
    for _ in range(5):
        page.keyboard.press("+")
    x, y = middle(page)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 10, y + 10)
    page.mouse.move(x + 40, y + 30)
    page.mouse.up()
    until(page, lambda: any(m["type"] == "edit" for m in studio.sent))
    (edit,) = (m for m in studio.sent if m["type"] == "edit")
    ((start, end, low, high),) = edit["value"]
    frame, s = page.evaluate("() => [studio.map.chart.frame, studio.map.grid.message.s]")
    share = 1.3**-5
    # The middle of this map is at 0 deg; written to a tenth.
    assert [low, high] == pytest.approx([-30 * 360 * share / frame["height"], 0], abs=0.06)
    step = (s[1] - s[0]) * 1e3
    length = s[-1] * 1e3
    ends = [length / 2, length / 2 + 40 * length * share / frame["width"]]
    assert [start, end] == pytest.approx(ends, abs=step / 2 + 0.1)


@pytest.mark.parametrize(
    ("seen", "x", "y", "factor"), [(WHOLE, 0.3, 0.9, 0.5), (WHOLE, 0, 1, 1e-9), (WHOLE, 1, 0, 7)]
)
def test_a_zoom_stays_inside_the_map_and_not_too_near(modules, seen, x, y, factor):
    least = {"across": 0.1, "down": 0.2}
    found = modules.evaluate(MODULE, ["map/window", "zoomed", seen, x, y, factor, least])
    assert 0 <= found["from"] < found["to"] <= 1
    assert 0 <= found["top"] < found["bottom"] <= 1
    wide, tall = found["to"] - found["from"], found["bottom"] - found["top"]
    assert wide == pytest.approx(min(1, max(0.1, factor)))
    assert tall == pytest.approx(min(1, max(0.2, factor)))
    assert found["from"] == pytest.approx(x * (1 - wide))
    assert found["top"] == pytest.approx(y * (1 - tall))


def test_the_course_of_another_technique_is_dotted_with_what_it_comes_to(mapped, studio, messages):
    page, (technique,) = mapped, messages["technique"]
    before = page.evaluate(DOTS)
    page.locator("#map-technique").select_option("known")
    until(page, lambda: page.evaluate("() => studio.map.choices.course !== null"))
    after = page.evaluate(DOTS)
    assert after.count(2) == before.count(2) + 1
    legend = page.locator("#legend .shades")
    said = legend.inner_text()
    assert "known technique" in said
    assert "cost 8.850" in said
    most = max(technique["peak_acceleration"])
    joint = technique["peak_acceleration"].index(most) + 1
    assert f"peak acceleration {most:.2f} \u00d7 limit, joint {joint}" in said
    assert "acceleration" in legend.locator(".over").first.inner_text() or most <= 1
    assert serious(page) == []
    # The paper's procedure is still looked for; nothing of it can be left out of the page's words.
    page.locator("#map-technique").select_option("paper")
    assert "Being computed" in legend.inner_text()
    studio.say(
        technique
        | {"method": "paper", "s": [], "gamma": [], "posture": [], "cost": None}
        | {"peak_velocity": [], "peak_acceleration": [], "statement": "no edge from node 3"}
        | {"notes": ["It ignores collisions in the cell."]}
    )
    until(page, lambda: "finds no path" in legend.inner_text())
    legend.locator("summary").click()
    assert "no edge from node 3" in legend.inner_text()
    assert "collisions in the cell" in legend.inner_text()
    page.locator("#map-technique").select_option("")
    until(page, lambda: page.evaluate("() => studio.map.choices.course === null"))
    wanted = ["known", "paper", None]
    until(page, lambda: [m["method"] for m in studio.sent if m["type"] == "technique"] == wanted)
