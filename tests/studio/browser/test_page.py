"""The page by itself: what it makes of the messages of a server that only pretends."""

import math
import time

import pytest

from studio.browser.pretend import ROOT

AXE = ROOT / "tests" / "studio" / "browser" / "vendor" / "axe-core" / "axe.min.js"
THEMES = pytest.mark.parametrize(
    "page",
    [("light", 1280, 720), ("dark", 2560, 1440)],
    indirect=True,
    ids=lambda value: f"{value[0]}-{value[1]}",
)
FRAMES = """async ([robot, q]) => {
    const { frames } = await import('/client/kinematics.js');
    return frames(robot, q).map((each) => each.transpose().toArray());
}"""
"""The frames of a robot, each row by row."""
MODULE = "async ([name, call, ...given]) => (await import(`/client/${name}.js`))[call](...given)"


def sent(studio, kind):
    return [message for message in studio.sent if message["type"] == kind]


def until(page, condition, seconds=15):
    """Wait until something holds; under its policy the page itself may not poll an expression."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "the page did not do it in time"
        page.wait_for_timeout(50)


def ready(page):
    until(
        page, lambda: page.evaluate("() => studio.view.ready && studio.player.timeline.total > 0")
    )


def serious(page):
    """The faults of accessibility that axe-core calls serious or worse."""
    page.evaluate(AXE.read_text())
    found = page.evaluate("() => axe.run()")["violations"]
    return [
        (each["id"], [node["html"] for node in each["nodes"]][:3])
        for each in found
        if each["impact"] in ("serious", "critical")
    ]


def test_kinematics_are_those_of_the_robot(modules, messages):
    (scene,) = messages["scene"]
    frames = modules.evaluate(FRAMES, [scene["robot"], scene["sample"]["q"]])
    assert len(frames) == len(scene["robot"]["joints"]) + 2
    # Both are sums of a few products of numbers of about 1, so rounding is about 1e-15.
    assert frames[-1] == pytest.approx(scene["sample"]["T"], abs=1e-12)


def test_the_tip_follows_the_points_of_the_plan(modules, messages):
    (scene,), plan = messages["scene"], messages["plan"][0]
    joints = len(scene["robot"]["joints"])
    for k in (0, 17, len(plan["time"]) - 1):
        q = plan["q"][k * joints : (k + 1) * joints]
        tip = modules.evaluate(FRAMES, [scene["robot"], q])[-1]
        # Joints and points are sent to 1e-9, and the arm is about 2 m long.
        assert [tip[3], tip[7], tip[11]] == pytest.approx(
            plan["points"][3 * k : 3 * k + 3], abs=1e-7
        )


def test_joints_between_the_rows_are_straight(modules):

    def at(t):
        return modules.evaluate(
            MODULE, ["kinematics", "jointsAt", [0, 1, 3], [0, 5, 1, 6, 2, 10], 2, t]
        )

    assert at(0) == [0, 5]
    assert at(0.5) == [0.5, 5.5]
    assert at(2) == [1.5, 8]
    assert at(3) == [2, 10]
    assert at(99) == [2, 10]


def test_a_mesh_keeps_sharp_edges_and_is_smooth_elsewhere(modules):
    # A quarter of a prism with 12 sides, 30 deg apart: smooth at 0.6 rad, and with edges at 0.4.
    count = """async (crease) => {
        const { creased } = await import('/client/scene/meshes.js');
        const xyz = [], corners = [];
        for (let i = 0; i <= 3; i++)
            for (const z of [0, 1]) {
                const angle = i * Math.PI / 6;
                xyz.push(Math.cos(angle), Math.sin(angle), z);
            }
        for (let i = 0; i < 3; i++)
            corners.push(2*i, 2*i+2, 2*i+1, 2*i+1, 2*i+2, 2*i+3);
        const strip = { xyz: new Float32Array(xyz), corners: new Uint32Array(corners) };
        const made = creased(strip, crease);
        return made.edges.length / 6;
    }"""
    rim = 8  # the border of the strip: three below, three above, two at its ends
    assert modules.evaluate(count, 0.6) == rim
    assert modules.evaluate(count, 0.4) == rim + 2


def test_a_rotation_is_taken_into_one_turn(modules):
    for angle, expected in ((0.5, 0.5), (math.pi, math.pi), (-math.pi, math.pi), (7, 7 - math.tau)):
        found = modules.evaluate(MODULE, ["map/grid", "wrapped", angle])
        assert found == pytest.approx(expected, abs=1e-12)  # one turn taken off, rounded once


@pytest.mark.slow
@THEMES
def test_a_planned_job_is_shown_without_a_serious_fault(page, studio, first):
    studio.open(*first)
    ready(page)
    assert page.locator("#contours button").count() == 2
    assert page.locator("#cost").text_content() == "20.54"
    # What a shop asks for first is large; the cost is among the details.
    (plan,) = (
        m for m in first if m["type"] == "plan" and m["contour"] == first[0]["contours"][0]["name"]
    )
    peaks = plan["criteria"]["peak_velocity"] + plan["criteria"]["peak_acceleration"]
    assert page.locator("#margin").inner_text() == f"{100 * (1 - max(peaks)):.0f} %"
    assert not page.locator("#cost").is_visible()
    page.get_by_text("Details").click()
    assert page.locator("#cost").is_visible()
    page.locator("#contours button", has_text="hole 10").click()
    until(page, lambda: page.locator("#legend li").count() > 0)
    assert serious(page) == []


@pytest.mark.slow
def test_before_anything_is_there_the_page_says_what_it_waits_for(page, studio, messages):
    studio.open(messages["progress"][0] | {"busy": True, "label": "reading the drawing"})
    page.get_by_text("Reading the cell").wait_for()
    assert page.get_by_text("reading the drawing", exact=True).count() == 2
    assert page.locator("#toggle").is_disabled()
    assert page.locator("#save").is_disabled()
    assert serious(page) == []


def test_a_plot_without_curves_says_why(page, studio, first):
    studio.open(*first)
    ready(page)
    state = page.locator("#plot-state")
    assert state.inner_text() == ""
    joints = page.locator("#plot-legend .joint")
    for k in range(joints.count()):
        joints.nth(k).click()
    assert state.inner_text() == "All joints are hidden; show one above."
    joints.first.click()
    assert state.inner_text() == ""
    page.get_by_role("button", name="Accel.").click()
    # The first two nodes of the plan alone.
    page.evaluate("""() => {
        const { plans, selected } = studio.store;
        const [plan] = plans.get(selected);
        studio.store.plans.set(selected, [{ ...plan, time: plan.time.slice(0, 2) }]);
        studio.store.emit("plan");
    }""")
    said = "No acceleration to plot: it takes 3 nodes, and this cut has 2."
    until(page, lambda: state.inner_text() == said)


@pytest.mark.slow
def test_no_path_says_where_and_why_and_its_relaxations_are_buttons(page, studio, first, messages):
    (answer,) = messages["nopath"]
    studio.open(*(each for each in first if each.get("contour") != answer["contour"]), answer)
    ready(page)
    page.locator("#contours button", has_text=answer["contour"]).click()
    page.get_by_text("No feasible path").wait_for()
    assert page.get_by_text("velocity, joint 6").is_visible()
    assert page.get_by_text("after node 13").is_visible()
    assert serious(page) == []
    page.get_by_role("button", name="2.6 m/min instead of 3 m/min").click()
    until(page, lambda: sent(studio, "relax"))
    assert sent(studio, "relax") == [{"type": "relax", "contour": answer["contour"], "index": 0}]


@pytest.mark.slow
def test_contours_are_switched_off_and_a_program_is_asked_for_without_them(page, studio, first):
    """Also: the button that closes a sheet stays in it beside very many files of a program."""
    off = first[0]["values"]["part"] | {"switched_off": ["old hole"]}
    job = first[0] | {"values": first[0]["values"] | {"part": off}}
    edits = [{"path": ["program", "incomplete"], "value": "accept"}]
    (outcome,) = (each for each in first if each["type"] == "outcome")
    lost = {"ready": False, "why": "no path for b", "remedy": "Without b", "edits": edits}
    exports = [e | lost if e["name"] == "program" else e for e in outcome["exports"]]
    studio.open(job, *first[1:], outcome | {"exports": exports})
    ready(page)
    name = first[0]["contours"][0]["name"]
    page.get_by_role("checkbox", name=f"Cut {name}").click()
    page.get_by_role("checkbox", name="Cut old hole").click()
    until(page, lambda: len(sent(studio, "edits")) == 2)
    path = ["part", "switched_off"]
    asked = [message["edits"] for message in sent(studio, "edits")]
    assert asked[0] == [{"path": path, "value": ["old hole", name]}]
    assert asked[1] == [{"path": path, "value": None}]
    page.locator("#export").click()
    page.get_by_role("button", name="Without b").click()
    until(page, lambda: len(sent(studio, "edits")) == 3)
    assert sent(studio, "edits")[2]["edits"] == edits
    page.locator("#open-program").click()
    file = {"text": "", "lines": [], "begin": [], "end": []}
    files = [file | {"name": f"cut_of_hole_{i}.pgx"} for i in range(40)]
    text = {"type": "program_text", "language": "val3", "revision": 1, "files": files}
    studio.say(text | {"findings": [], "notes": [], "faults": []})
    page.get_by_text("cut_of_hole_39.pgx").wait_for(state="attached")
    close = page.get_by_role("button", name="Close").bounding_box()
    assert close["x"] + close["width"] <= page.viewport_size["width"]
    assert serious(page) == []


@pytest.mark.slow
def test_a_fault_of_the_job_and_an_error_are_said(page, studio, first):
    studio.open(*first)
    ready(page)
    message = "expected a number above 0, got -1"
    line = first[0]["text"].split("\n").index("[plan]") + 1
    fault = {"key": ["contour", 2, "speed_m_min"], "line": line, "message": message}
    studio.say(first[0] | {"revision": 2, "faults": [fault]})
    page.get_by_text(f"Line {line}, contour.2.speed_m_min: {message}").wait_for()
    assert page.locator(f"p:not(.unseen):has-text('{message}')").count() == 1, "it is said once"
    page.get_by_role("button", name=f"Line {line}").click()
    chosen = "(area) => area.value.slice(area.selectionStart, area.selectionEnd)"
    assert page.locator("dialog textarea").evaluate(chosen) == "[plan]"
    page.get_by_role("button", name="Close").click()
    assert page.locator("#speed-number").get_attribute("aria-invalid") == "true"
    studio.say(
        {"type": "error", "message": "the file has changed since it was read", "about": "save"}
    )
    page.get_by_text("the file has changed since it was read").wait_for()
    page.get_by_role("button", name="Save over it").click()
    until(page, lambda: sent(studio, "save"))
    assert sent(studio, "save") == [{"type": "save", "over": True}]
    page.get_by_text("the file has changed since it was read").wait_for(state="detached")
    assert serious(page) == []


@pytest.mark.slow
def test_without_its_server_the_page_says_so_and_comes_back_by_itself(page, studio, first):
    studio.open(*first)
    ready(page)
    studio.refusing = True
    studio.socket.close()
    page.get_by_text("has stopped or cannot be reached").wait_for()
    assert page.locator("#speed").is_disabled()
    assert serious(page) == []
    tries = studio.tries
    page.get_by_role("button", name="Try now").click()
    until(page, lambda: studio.tries > tries)
    studio.refusing = False
    page.get_by_text("connected", exact=True).wait_for()
    assert page.locator("#notices .notice").count() == 0
    assert page.locator("#speed").is_enabled()


@pytest.mark.slow
def test_space_plays_and_arrows_step(page, studio, first):
    studio.open(*first)
    ready(page)
    begin = page.evaluate("() => studio.player.t")
    page.keyboard.press("Space")
    until(page, lambda: page.evaluate("() => studio.player.t") > begin)
    page.keyboard.press("Space")
    assert not page.evaluate("() => studio.player.playing")
    page.locator("#contours button").first.focus()
    nodes = []
    for key in ("ArrowRight", "ArrowRight", "ArrowLeft"):
        page.keyboard.press(key)
        nodes.append(page.evaluate("() => studio.player.moment.node"))
    assert nodes[1] == nodes[0] + 1
    assert nodes[2] == nodes[0]


@pytest.mark.slow
def test_a_button_that_was_clicked_leaves_the_space_bar_to_the_player(page, studio, first):
    studio.open(*first)
    ready(page)
    page.locator("#contours button").first.click()
    page.keyboard.press("Space")
    assert page.evaluate("() => studio.player.playing")
    page.keyboard.press("Space")
    # Who goes by keys presses the button that has the focus.
    page.locator("#theme").focus()
    before = page.evaluate("() => document.documentElement.dataset.theme")
    page.keyboard.press("Space")
    assert page.evaluate("() => document.documentElement.dataset.theme") != before
    assert not page.evaluate("() => studio.player.playing")


@pytest.mark.slow
def test_playing_moves_the_robot_and_its_clock(page, studio, first):
    studio.open(*first)
    ready(page)
    pose = "() => studio.view.machine.frames.map((frame) => [...frame.matrix.elements])"
    before, clock = page.evaluate(pose), page.locator("#clock").inner_text()
    page.locator("#rate").select_option("20")
    page.locator("#toggle").click()
    until(
        page, lambda: page.locator("#clock").inner_text() != clock and page.evaluate(pose) != before
    )
    until(page, lambda: not page.evaluate("() => studio.player.playing"), seconds=60)
    total = page.evaluate("() => studio.player.timeline.total")
    assert page.evaluate("() => studio.player.t") == total


@pytest.mark.slow
def test_a_drag_of_a_slider_is_one_gesture_and_ends_with_its_last_value(page, studio, first):
    studio.open(*first)
    ready(page)
    box = page.locator("#weight-2").bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] / 2, y)
    page.mouse.down()
    for share in (0.6, 0.7, 0.8, 0.9):
        page.mouse.move(box["x"] + share * box["width"], y)
        page.wait_for_timeout(80)
    page.mouse.up()
    until(page, lambda: sent(studio, "edit"))
    page.wait_for_timeout(200)
    edits = sent(studio, "edit")
    assert {tuple(edit["path"]) for edit in edits} == {("plan", "weights")}
    assert len({edit["gesture"] for edit in edits}) == 1
    shown = page.locator("#weight-2").get_attribute("aria-valuetext")
    usual = first[0]["weights"]
    assert float(shown.split()[0]) == pytest.approx(edits[-1]["value"][1] / usual[1], rel=0.02)
    assert edits[-1]["value"][0] == pytest.approx(usual[0], rel=1e-3)  # sent to four digits


@pytest.mark.slow
def test_what_is_out_of_date_is_marked_until_its_plan_comes(page, studio, first, messages):
    studio.open(*first)
    ready(page)
    studio.say(first[0] | {"revision": 2})
    studio.say({"type": "progress", "busy": True, "label": "planning slot", "done": 0, "total": 2})
    page.locator(".result.stale").wait_for()
    page.locator(".badge", has_text="planning again").wait_for()
    page.get_by_role("button", name="Cancel").click()
    until(page, lambda: sent(studio, "cancel"))
    plan = messages["plan"][0]
    studio.say(plan | {"revision": 2, "cost": 2 * plan["cost"]})
    until(page, lambda: page.locator("#cost").text_content() == "41.07")
    assert page.locator(".delta").text_content() == "+100 %"
    assert page.locator(".result.stale").count() == 0


@pytest.mark.slow
def test_undo_redo_and_save_by_keys(page, studio, first):
    studio.open(*first)
    ready(page)
    for keys in ("Control+z", "Control+Shift+Z", "Control+y", "Control+s"):
        page.keyboard.press(keys)
    until(page, lambda: sent(studio, "save"))
    kinds = [message["type"] for message in studio.sent]
    assert [kind for kind in kinds if kind in ("undo", "redo", "save")] == [
        "undo",
        "redo",
        "redo",
        "save",
    ]


def test_names_are_text_and_never_markup(page, studio, first):
    name = "<img src=x onerror=alert(1)>"
    job, options, scene = first[:3]
    contours = [contour | {"name": name} for contour in scene["contours"][:1]]
    studio.open(job | {"name": name}, options, scene | {"contours": contours})
    page.locator("#contours button").wait_for()
    assert page.locator("#contours .name").inner_text() == name
    assert page.locator("#file").inner_text() == name
    assert page.locator("img[src=x]").count() == 0


def test_the_tool_turned_about_its_beam_stays_at_its_tip(modules, messages):
    (scene,), plan = messages["scene"], messages["plan"][0]
    q = plan["q"][: len(scene["robot"]["joints"])]

    def tip(joints):
        return modules.evaluate(FRAMES, [scene["robot"], joints])[-1]

    before = tip(q)
    for angle in (-2.5, 0.02, 1.0, 3.0):
        turned = modules.evaluate(MODULE, ["inverse", "turnedAbout", scene["robot"], q, angle])
        after = tip(turned)
        c, s = math.cos(angle), math.sin(angle)
        for row in (0, 4, 8):
            x, y, z, place = before[row : row + 4]
            expected = [c * x + s * y, c * y - s * x, z, place]
            # Newton ends below 1e-7; the arm is about 2 m long.
            assert after[row : row + 4] == pytest.approx(expected, abs=1e-6)
    assert modules.evaluate(MODULE, ["inverse", "turnedAbout", scene["robot"], q, 0]) == q


@pytest.mark.slow
def test_hovering_the_map_says_why_and_shows_a_ghost_without_the_server(
    page, studio, first, messages
):
    (known,) = messages["map"]
    studio.open(*first)
    ready(page)
    page.locator("#contours button", has_text=known["contour"]).click()
    until(page, lambda: page.evaluate("() => studio.map.grid !== null"))
    (plan,) = (each for each in messages["plan"] if each["contour"] == known["contour"])
    gamma, layer = plan["gamma"][len(plan["s"]) // 2], plan["posture"][0]
    assert page.evaluate("() => studio.map.grid.layers[studio.map.layer].posture") == layer
    box = page.locator("#map-canvas").bounding_box()
    frame = page.evaluate("() => studio.map.chart.frame")
    x = box["x"] + frame["left"] + 0.5 * frame["width"]
    y = box["y"] + frame["top"] + (0.45 - gamma / math.tau) * frame["height"]
    page.mouse.move(x, y)  # this server never answers what it is asked about a pose
    assert page.evaluate("() => studio.view.machine.ghost.visible")
    assert page.locator("#map-tip").inner_text().startswith("Free")
    assert "nearest limit" in page.locator("#map-tip").inner_text()
    page.mouse.move(box["x"] - 40, box["y"])
    assert not page.evaluate("() => studio.view.machine.ghost.visible")
    page.locator("#map-canvas").focus()
    page.keyboard.press("ArrowRight")
    assert page.locator("#map-tip").is_visible()


@pytest.mark.slow
def test_the_theme_is_the_systems_until_the_button_says_otherwise(page, studio, first):
    studio.open(*first)
    theme = "() => document.documentElement.dataset.theme"
    assert page.evaluate(theme) == "light"
    page.locator("#theme").click()
    assert page.evaluate(theme) == "dark"
    page.reload()
    ready(page)
    assert page.evaluate(theme) == "dark"


@pytest.mark.slow
def test_the_line_above_the_map_is_moved_by_keys(page, studio, first):
    studio.open(*first)
    ready(page)
    before = page.locator("#map").bounding_box()["height"]
    page.locator("#split").focus()
    for _ in range(3):
        page.keyboard.press("ArrowUp")
    assert page.locator("#map").bounding_box()["height"] > before


@pytest.mark.slow
def test_a_scene_is_drawn_in_few_calls_and_only_when_something_changes(page, studio, first):
    studio.open(*first)
    ready(page)
    page.wait_for_timeout(500)
    frames = page.evaluate("() => studio.view.stage.frames")
    page.wait_for_timeout(500)
    assert page.evaluate("() => studio.view.stage.frames") == frames
    assert page.evaluate("() => studio.view.stage.renderer.info.render.calls") <= 60
