"""The part taken elsewhere by numbers and by hand, and the best place found and taken."""

import re
import shutil
import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jobs import DEMO
from studio.browser.test_page import ready, serious, until
from studio.browser.test_studio import JOB, REVISION, Server, settled

pytestmark = pytest.mark.slow

GRID = JOB.replace("[plan]", '[plan]\nmethod = "exact"')
TEXT = "() => studio.store.job.text"
REACH = "() => studio.view.placing.reach?.contours[0].out.length ?? null"
HANDLE = """() => {
    const { stage, placing, canvas } = studio.view;
    const [{ x, y }, at] = [stage.project(placing.handle.position), canvas.getBoundingClientRect()];
    return [at.left + x, at.top + y];
}"""
SEEN = "placing.middle"
SETTLED = """() => {
    const [{ moved, numbers }, { part }] = [studio.view.placing, studio.store.job.values];
    return !moved && String(numbers.xyz) === String(part.xyz_mm);
}"""
PART = """() => {
    const { machine } = studio.view;
    machine.group.updateMatrixWorld(true);
    return [...machine.carried[0].children[0].matrixWorld.elements];
}"""


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    folder = tmp_path_factory.mktemp("layout")
    shutil.copy(DEMO / "b_pillar.step", folder)
    path = folder / "part.toml"
    path.write_text(GRID)
    running = Server(path)
    yield running
    running.stop()


@pytest.fixture
def opened(page, server):
    """A page with the sheet open on the job as it was written; nothing may go wrong in it."""
    wrong = []
    page.on("console", lambda m: m.type in ("error", "warning") and wrong.append(m.text))
    page.on("pageerror", lambda fault: wrong.append(str(fault)))
    page.goto(server.url)
    settled(page)
    before = page.evaluate(REVISION)
    if page.evaluate(TEXT) != GRID:
        page.evaluate("(text) => studio.connection.send({ type: 'text', text })", GRID)
        settled(page, before)
    page.get_by_role("button", name="Layout").click()
    until(page, lambda: page.evaluate(REACH) is not None)
    yield page
    assert wrong == []


def part_of(page):
    return tomllib.loads(page.evaluate(TEXT))["part"]


def is_grasped(page):
    """Whether the pointer, put on the handle, is on it: as far as that is drawn there."""
    x, y = page.evaluate(HANDLE)
    page.mouse.move(x + 1, y)
    page.mouse.move(x, y)
    return page.evaluate("() => studio.view.placing.gizmo.axis") == "XYZ"


def test_the_part_is_moved_by_numbers_and_what_is_out_of_reach_is_said(opened):
    page, reach = opened, opened.locator(".reach")
    was = part_of(page)
    until(page, lambda: "within reach" in reach.inner_text())
    assert serious(page) == []
    x = page.get_by_label("Part x, mm")
    assert x.input_value() == str(was["xyz_mm"][0])
    x.fill(str(was["xyz_mm"][0] + 1500))  # shown at once, in the job once it is let go
    until(page, lambda: "Out of reach" in reach.inner_text())
    assert page.evaluate(PART)[12] == pytest.approx(1.5)
    assert page.evaluate("() => studio.view.placing.lost.visible")
    assert part_of(page) == was
    x.press("Enter")
    until(page, lambda: part_of(page)["xyz_mm"][0] == was["xyz_mm"][0] + 1500)
    until(page, lambda: not page.evaluate("() => studio.view.placing.moved"))
    until(page, lambda: "Out of reach" in reach.inner_text())
    assert x.input_value() == str(was["xyz_mm"][0] + 1500)
    page.locator("#undo").click()
    until(page, lambda: part_of(page) == was)
    until(page, lambda: "within reach" in reach.inner_text())
    assert x.input_value() == str(was["xyz_mm"][0])
    # A turn by the keys alone, about all three axes.
    for label, keys in [
        ("Part roll, deg", "12"),
        ("Part pitch, deg", "-7"),
        ("Part yaw, deg", "80"),
    ]:
        page.get_by_label(label).focus()
        page.keyboard.press("Control+a")
        page.keyboard.type(keys, delay=60)  # the page is drawn again between the keys
        before = part_of(page)
        page.keyboard.press("Enter")
        until(page, lambda now=before: part_of(page) != now)
        # The next move counts from the scene of this one.
        until(page, lambda: not page.evaluate("() => studio.view.placing.moved"))
    until(page, lambda: part_of(page)["rpy_deg"] == pytest.approx([12, -7, 80], abs=2e-4))
    assert part_of(page)["xyz_mm"] == pytest.approx(was["xyz_mm"], abs=2e-3)


def test_the_robot_is_moved_by_numbers_and_all_else_the_other_way(opened):
    page, was = opened, part_of(opened)
    page.get_by_text("Robot and head, moved by").click()
    for label, value in [("Robot base x, by, mm", "40"), ("Robot base turned by, deg", "10")]:
        page.get_by_label(label).fill(value)
        before = part_of(page)
        page.get_by_label(label).press("Enter")
        until(page, lambda now=before: part_of(page) != now)
        until(page, lambda: not page.evaluate("() => studio.view.placing.moved"))
    turn = Rotation.from_euler("z", -10, degrees=True)
    there = turn.apply(np.array(was["xyz_mm"]) - [40, 0, 0])
    assert part_of(page)["xyz_mm"] == pytest.approx(there, abs=1e-3)
    assert part_of(page)["rpy_deg"] == pytest.approx([0, 0, was["rpy_deg"][2] - 10], abs=1e-4)


def test_the_part_follows_a_hand_and_is_put_back_by_undo(opened):
    page, was = opened, part_of(opened)
    until(page, lambda: is_grasped(page))
    x, y = page.evaluate(HANDLE)
    camera = page.evaluate("() => studio.view.stage.camera.position.toArray()")
    page.mouse.down()
    page.mouse.move(x + 30, y - 20, steps=4)
    dragged = page.evaluate("() => studio.view.placing.offsets()")
    assert len(dragged) == 3
    assert page.evaluate(PART)[12] == pytest.approx(dragged["x_mm"] / 1e3, abs=1e-6)
    assert part_of(page) == was
    page.mouse.up()
    until(page, lambda: part_of(page) != was)
    moved = [dragged[f"{axis}_mm"] for axis in "xyz"]
    assert part_of(page)["xyz_mm"] == pytest.approx(np.add(was["xyz_mm"], moved), abs=1e-3)
    assert part_of(page)["rpy_deg"] == was["rpy_deg"]
    assert page.evaluate("() => studio.view.stage.camera.position.toArray()") == camera
    until(page, lambda: not page.evaluate("() => studio.view.placing.moved"))
    page.locator("#undo").click()
    until(page, lambda: part_of(page) == was)
    # The robot by its handle: the part stays where it is seen, and is elsewhere in the base.
    until(page, lambda: page.evaluate(SETTLED))
    page.get_by_role("button", name="Robot", exact=True).click()
    seen = page.evaluate(HANDLE.replace("placing.handle.position", SEEN))
    until(page, lambda: is_grasped(page))
    x, y = page.evaluate(HANDLE)
    page.mouse.down()
    page.mouse.move(x - 20, y + 10, steps=4)
    dragged = page.evaluate("() => studio.view.placing.offsets()")
    page.mouse.up()
    until(page, lambda: part_of(page) != was)
    moved = [dragged[f"base_{axis}_mm"] for axis in "xyz"]
    assert part_of(page)["xyz_mm"] == pytest.approx(np.subtract(was["xyz_mm"], moved), abs=1e-3)
    until(page, lambda: page.evaluate(SETTLED))
    again = page.evaluate(HANDLE.replace("placing.handle.position", SEEN))
    assert again == pytest.approx(seen, abs=0.1)
    page.keyboard.press("Escape")
    until(page, lambda: not page.evaluate("() => studio.view.placing.open"))
    assert page.evaluate("() => studio.view.placing.lost.visible") is False


def test_the_fastest_speed_follows_and_the_best_place_is_found_and_taken(opened):
    page, sheet = opened, opened.locator("#sheet")
    here = sheet.locator("dd").first
    until(page, lambda: "m/min" in here.inner_text(), seconds=120)
    # Without the gain that is shown where the page has seen another place before.
    before = re.match(r"[\d.]+ m/min", here.inner_text())[0]
    sheet.get_by_text("Variables and ranges").click()
    sheet.get_by_label("Placements to try").fill("8")
    sheet.get_by_label("Part about z", exact=True).uncheck()
    look = sheet.get_by_role("button", name="Search", exact=True)
    until(page, look.is_enabled, seconds=120)
    look.click()
    done = "() => studio.store.layout?.state === 'done'"
    until(page, lambda: page.evaluate(done), seconds=240)
    sheet.get_by_text("Variables and ranges").click()
    rows = sheet.locator(".tries button")
    assert rows.count() >= 5
    assert serious(page) == []
    best = page.evaluate("() => studio.store.layout.best.find((e) => e.offsets.x_mm !== 0)")
    row = sheet.locator(f".tries button[data-number='{best['number']}']")
    row.click()
    until(page, lambda: page.evaluate("() => studio.view.placing.moved"))
    assert page.evaluate("() => studio.view.placing.offsets().x_mm") == pytest.approx(
        best["offsets"]["x_mm"], abs=1e-3
    )
    was = part_of(page)
    sheet.get_by_role("button", name="Take it").click()
    until(page, lambda: part_of(page) != was)
    assert part_of(page)["xyz_mm"][0] == pytest.approx(
        was["xyz_mm"][0] + best["offsets"]["x_mm"], abs=1e-3
    )
    assert "Out of date: the job has changed" in sheet.inner_text()
    settled(page, page.evaluate(REVISION) - 1)
    until(page, lambda: before in sheet.locator("dd").nth(1).inner_text(), seconds=120)
    until(page, lambda: re.search(r"\d m/min", here.inner_text()), seconds=120)


def test_what_the_search_has_tried_is_said_in_words(page, studio, first, messages):
    (reach,), (layout,) = messages["reach"], messages["layout"]

    def react(message):
        if message["type"] == "reach":
            far = message["offsets"].get("x_mm", 0) > 500
            contours = [
                each | {"out": list(range(10)) if far else []} for each in reach["contours"]
            ]
            studio.say(reach | {"number": message["number"], "contours": contours})

    studio.react = react
    studio.open(*first, layout)
    ready(page)
    page.get_by_role("button", name="Layout").click()
    rows = page.locator(".tries button .name")
    said = ["5.14 m/min, +6.5 %", "4.83 m/min", "at most 5.14 m/min", "about 4.75 m/min"]
    until(page, lambda: rows.all_inner_texts() == [*said, "out of reach"])
    sheet = page.locator("#sheet")
    take = sheet.get_by_role("button", name="Take it")
    rows.last.click()
    until(page, lambda: "Out of reach: 20 of" in sheet.inner_text())
    assert take.is_disabled()
    assert "no pose at node 16" in sheet.inner_text()
    rows.first.click()
    until(page, lambda: "are within reach" in sheet.inner_text())
    assert page.get_by_label("Part x, mm").input_value() == "1260"
    assert serious(page) == []
    take.click()
    until(page, lambda: studio.sent[-1] == {"type": "take", "number": 3})
    sheet.get_by_role("button", name="Back to the job's place").click()
    until(page, lambda: page.get_by_label("Part x, mm").input_value() == "1200")
    sheet.get_by_role("button", name="Search again").click()
    until(page, lambda: studio.sent[-1]["type"] == "layout")
    asked = studio.sent[-1]
    spans = {"x_mm": [-200, 200], "y_mm": [-200, 200], "yaw_deg": [-30, 30]}
    assert asked == {
        "type": "layout", "goal": "speed", "ranges": spans, "evaluations": 64, "grid": True,
    }  # fmt: skip
    studio.say(layout | {"state": "running"})
    sheet.get_by_role("button", name="Stop").first.click()
    until(page, lambda: studio.sent[-1]["type"] == "cancel")
    job = next(m for m in first if m["type"] == "job")
    studio.say(job | {"revision": 2})
    until(page, lambda: "Out of date: the job has changed" in sheet.inner_text())
    assert page.locator(".tries button:disabled").count() == 5
