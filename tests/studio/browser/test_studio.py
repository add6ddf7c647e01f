"""The studio as a whole: a browser on one side, the server with its planner on the other."""

import math
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from jobs import DEMO, SMALL
from studio.browser.test_loops import DRAWN, PLACE
from studio.browser.test_page import serious, until

# One small contour of the shipped example, of which nothing is proved: that takes a second.
_BEFORE, CONTOUR, _OTHER, _AFTER = re.split(r"(?=\[\[contour\]\]|\[plan\])", SMALL)
JOB = _BEFORE + CONTOUR + _AFTER.replace("[plan]", "[plan]\ncertify = false")


class Server:
    """`kerfpath studio` in a process of its own, as a user starts it."""

    def __init__(self, job, port=0):
        command = [sys.executable, "-m", "kerfpath", "studio", str(job), "--no-browser"]
        self.process = subprocess.Popen(
            [*command, "--port", str(port)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        line = self.process.stdout.readline()
        found = re.search(r"(http://127\.0\.0\.1:(\d+)/)\?token=\S+", line)
        assert found, line
        self.url, self.origin, self.port = found[0], found[1], int(found[2])

    def stop(self):
        self.process.terminate()
        self.process.wait(timeout=30)
        self.process.stdout.close()


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    folder = tmp_path_factory.mktemp("job")
    shutil.copy(DEMO / "b_pillar.step", folder)
    path = folder / "holes.toml"
    path.write_text(JOB)
    return path


@pytest.fixture(scope="module")
def servers(job):
    """The server of this module, in a list, so that a test may put another one in its place."""
    running = [Server(job)]
    yield running
    running[0].stop()


@pytest.fixture
def server(servers):
    return servers[0]


@pytest.fixture
def opened(page, server):
    """A page on the studio with everything planned; nothing may go wrong in it."""
    wrong, elsewhere = [], []
    page.on("console", lambda m: m.type in ("error", "warning") and wrong.append(m.text))
    page.on("pageerror", lambda fault: wrong.append(str(fault)))
    page.on("request", lambda r: r.url.startswith(server.origin) or elsewhere.append(r.url))
    page.goto(server.url)
    settled(page)
    before = page.evaluate(REVISION)
    if page.evaluate("() => studio.store.job.text") != JOB:  # what another test has left
        page.evaluate("(text) => studio.connection.send({ type: 'text', text })", JOB)
        settled(page, before)
    yield page
    assert wrong == []
    assert elsewhere == []


NEWEST = """() => {
    if (!window.studio) return false;
    const { job, plans, nopaths, progress } = studio.store;
    if (!job || progress.busy || !studio.view.ready) return false;
    const found = [...plans.values()].flat().concat([...nopaths.values()]);
    // A draft is not audited.
    const done = (each) => each.revision >= job.revision && each.passed !== null;
    return found.length > 0 && found.every(done);
}"""
TWO_FRAMES = "() => new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)))"
"""What has come is drawn with the next frame."""
POSE = """async (by) => {
    const { turnedAbout } = await import("/client/inverse.js");
    const { store, map, connection } = studio;
    const [plan, { gamma }] = [store.plans.get(store.selected)[0], map.grid.message];
    const sample = map.grid.sampleAt(plan.gamma[5] + by);
    const answer = new Promise((resolve) => store.on(["pose"], resolve));
    const [contour, posture] = [plan.contour, plan.posture[5]];
    connection.send({ type: "reason", contour, posture, node: 5, gamma: gamma[sample] });
    const { q } = await answer;
    const joints = plan.q.slice(30, 36);
    const turned = turnedAbout(store.scene.robot, joints, gamma[sample] - plan.gamma[5]);
    const near = (angle, j) => angle - 2 * Math.PI * Math.round((angle - q[j]) / 2 / Math.PI);
    return { q, turned: turned.map(near) };
}"""
REVISION = "() => window.studio?.store.job?.revision ?? 0"
COURSE = "() => studio.store.plans.get(studio.store.selected)?.[0].gamma ?? null"


def settled(page, after=-1):
    """Wait until all of the newest job is planned and drawn, and it is newer than a revision."""
    until(page, lambda: page.evaluate(REVISION) > after and page.evaluate(NEWEST), seconds=240)
    page.evaluate(TWO_FRAMES)


PLACES = """() => {
    const { chart } = studio.map;
    const { x, y } = chart.canvas.getBoundingClientRect();
    const [{ left, top, width, height }, { gamma, s }] = [
        chart.frame, studio.store.plans.get(studio.store.selected)[0],
    ];
    return { x: x + left, y: y + top, width, height, gamma, s };
}"""
WINDOWS = "() => studio.store.job.values.contour[0].gamma_windows"


def cost(page):
    return float(page.locator("#cost").text_content())


def drag(page, slider, share):
    """Move a slider to a share of its way, as a hand does; return the revision before."""
    before = page.evaluate(REVISION)
    box = page.locator(slider).bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] / 2, y)
    page.mouse.down()
    page.mouse.move(box["x"] + share * box["width"], y, steps=4)
    page.mouse.up()
    return before


@pytest.mark.slow
def test_a_job_is_planned_and_shown(opened):
    page = opened
    assert page.locator("#file").inner_text() == "holes.toml"
    assert page.locator("#contours button").count() == 1
    assert cost(page) > 0
    until(page, lambda: page.locator("#legend li").count() > 0)
    scene = page.evaluate("() => studio.store.scene")
    assert {body["kind"] for body in scene["bodies"]} >= {"robot", "head", "part"}
    assert page.evaluate("() => studio.view.stage.renderer.info.render.calls") <= 60
    # The page turns the tool about its beam as the planner's own kinematics do.
    pose = page.evaluate(POSE, 0.7)
    assert pose["turned"] == pytest.approx(pose["q"], abs=1e-5)  # joints are sent to 1e-9
    assert serious(page) == []


@pytest.mark.slow
def test_a_slider_changes_cost_and_course_and_undo_brings_them_back(opened):
    page = opened
    first, course = cost(page), page.evaluate(COURSE)
    settled(page, drag(page, "#weight-6", 0.9))
    assert cost(page) != first
    assert page.evaluate(COURSE) != course
    assert page.locator("#saved").inner_text().startswith("not saved")
    before = page.evaluate(REVISION)
    page.locator("#undo").click()
    settled(page, before)
    # One drag is one step: the job is again as it was opened.
    assert page.locator("#saved").inner_text() == "saved"
    assert cost(page) == pytest.approx(first, rel=1e-3)  # four digits are shown
    assert page.evaluate(COURSE) == pytest.approx(course, abs=1e-6)  # sent to 1e-9
    before = page.evaluate(REVISION)
    page.keyboard.press("Control+Shift+Z")
    settled(page, before)
    assert cost(page) != first


@pytest.mark.slow
def test_playing_shows_the_program_and_a_click_on_the_map_goes_there(opened):
    page = opened
    until(page, lambda: page.evaluate("() => studio.player.timeline.whole"))
    pose = "() => studio.view.machine.frames.map((frame) => [...frame.matrix.elements])"
    before = page.evaluate(pose)
    page.locator("#toggle").click()
    until(page, lambda: page.evaluate(pose) != before)
    page.locator("#toggle").click()
    # On a busy machine the program may have ended before, and this has begun it again.
    page.evaluate("() => studio.player.pause()")
    box = page.locator("#map-canvas").bounding_box()
    page.mouse.click(box["x"] + 0.6 * box["width"], box["y"] + 0.4 * box["height"])
    span = page.evaluate("() => studio.player.moment.span.kind")
    assert span == "cut"


@pytest.mark.slow
def test_without_a_path_a_relaxation_makes_one(opened):
    page = opened
    field = page.locator("#speed-number")
    field.fill("90")
    field.press("Enter")
    page.get_by_text("No feasible path").wait_for(timeout=240_000)
    remedy = page.locator(".remedy").first
    remedy.wait_for(timeout=240_000)
    before = page.evaluate(REVISION)
    remedy.click()
    until(page, lambda: page.evaluate(REVISION) > before)
    page.locator("#cost").wait_for(state="attached", timeout=240_000)
    assert cost(page) > 0


@pytest.mark.slow
def test_a_hole_that_is_clicked_is_planned_and_undo_takes_it_back(opened):
    page = opened
    page.locator("[data-view=part]").click()
    page.evaluate(DRAWN)
    page.mouse.click(*page.evaluate(PLACE, "skin/hole2"))
    before = page.evaluate(REVISION)
    page.get_by_role("button", name="Cut this loop").click()
    settled(page, before)
    assert page.locator("#contours button").count() == 2
    assert page.evaluate("() => studio.store.selected") == "skin/hole2"
    assert page.evaluate("() => studio.store.plans.get('skin/hole2')[0].passed")
    until(page, lambda: page.evaluate("() => studio.player.timeline.whole"))
    before = page.evaluate(REVISION)
    page.locator("#undo").click()
    settled(page, before)
    assert page.locator("#contours button").count() == 1
    assert page.locator("#saved").inner_text() == "saved"


@pytest.mark.slow
def test_files_are_exported_with_their_comments(opened, tmp_path):
    page = opened
    before = page.evaluate(REVISION)
    field = page.locator("#speed-number")
    field.fill("2.5")
    field.press("Enter")
    settled(page, before)
    page.locator("#export").click()
    with page.expect_download() as download:
        page.locator("#export-menu a[href*='export/job']").click()
    text = Path(download.value.path()).read_text()
    assert "# assumed: the maker publishes none" in text
    assert tomllib.loads(text)["contour"][0]["speed_m_min"] == 2.5
    page.locator("#export").click()
    with page.expect_download() as download:
        page.locator("#export-menu a[href*='export/program']").click()
    assert "MODULE" in Path(download.value.path()).read_text(errors="replace")
    page.locator("#open-program").click()
    page.locator("dialog .code", has_text="MODULE").wait_for()


@pytest.mark.slow
def test_two_pages_see_the_same_and_a_new_server_finds_the_work(opened, servers, job, chromium):
    page = opened
    context = chromium.new_context(viewport={"width": 1280, "height": 720})
    other = context.new_page()
    other.goto(servers[0].url)
    settled(other)
    before = drag(page, "#weight-6", 0.85)
    settled(page, before)
    settled(other, before)
    assert cost(other) == cost(page)
    shown = cost(page)
    context.close()
    page.goto("about:blank")  # its messages about a server that is gone would be faults
    servers[0].stop()
    servers[0] = Server(job, servers[0].port)
    page.goto(servers[0].url)
    settled(page)
    assert cost(page) == pytest.approx(shown, rel=1e-3)  # four digits are shown
    assert page.locator("#saved").inner_text().startswith("not saved")


@pytest.mark.slow
def test_a_rectangle_on_the_map_pins_the_course_until_it_is_undone(opened):
    page = opened
    before, at = page.evaluate(COURSE), page.evaluate(PLACES)
    middle = len(before) // 2
    high = math.degrees(before[middle]) - 15

    def place(share, angle):
        return at["x"] + share * at["width"], at["y"] + (0.5 - angle / 360) * at["height"]

    revision = page.evaluate(REVISION)
    page.mouse.move(*place(0.4, high))
    page.mouse.down()
    page.mouse.move(*place(0.5, high - 10))
    page.mouse.move(*place(0.6, high - 30))
    page.mouse.up()
    settled(page, revision)
    ((start, end, low, up),) = page.evaluate(WINDOWS)
    # A pixel of the map is about 1 deg.
    assert [low, up] == pytest.approx([high - 30, high], abs=4)
    held = [
        math.degrees(gamma)
        for gamma, s in zip(page.evaluate(COURSE), at["s"], strict=True)
        if start <= s * 1e3 <= end
    ]
    assert len(held) >= 3
    # The page has gamma to 1e-9 rad.
    assert all(low - 1e-6 <= gamma <= up + 1e-6 for gamma in held)
    # It is chosen: a key widens it, another one removes it.
    page.locator("#map-canvas").focus()
    revision = page.evaluate(REVISION)
    page.keyboard.press("+")
    settled(page, revision)
    assert page.evaluate(WINDOWS)[0][2:] == pytest.approx([low - 1, up + 1], abs=1e-9)
    revision = page.evaluate(REVISION)
    page.keyboard.press("Delete")
    settled(page, revision)
    assert page.evaluate(WINDOWS) is None
    assert page.evaluate(COURSE) == pytest.approx(before, abs=1e-6)
    # With the keys alone: the cursor, a pin about the course there, and back.
    page.keyboard.press("ArrowRight")
    revision = page.evaluate(REVISION)
    page.keyboard.press("p")
    settled(page, revision)
    ((start, end, low, up),) = page.evaluate(WINDOWS)
    # Written to a tenth of a degree.
    assert [low, up] == pytest.approx([math.degrees(before[1]) + by for by in (-10, 10)], abs=0.06)
    assert page.locator(".pins li").count() == 1
    revision = page.evaluate(REVISION)
    page.keyboard.press("Control+z")
    settled(page, revision)
    assert page.evaluate(WINDOWS) is None
