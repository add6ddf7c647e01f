"""A real browser, and pages in it, served by the pretended server.

It closes with each module: a page that waits turns its spinner, which takes most of a core without
a graphics card.
"""

import contextlib
import functools
import json
import struct

import pytest

from browser import CHROMIUM
from studio.browser.pretend import SAMPLE, Pretend

SWITCHES = [
    *("--no-sandbox", "--no-first-run", "--disable-background-networking", "--disable-sync"),
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    "--ignore-gpu-blocklist",
]
# A tetrahedron of 0.2 m stands in for every mesh.
CORNERS = [(0, 0, 0), (0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2)]
FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]
# What a person does; each is answered by the page in its next frames.
GESTURES = {
    "Page": ("evaluate",),
    "Locator": ("check", "click", "dblclick", "fill", "focus", "press", "select_option", "uncheck"),
    "Keyboard": ("down", "press", "type", "up"),
    "Mouse": ("click", "dblclick", "down", "move", "up", "wheel"),
}
# Two frames: a panel renders in the first one and its effects follow; the second begins after them.
FRAMES = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
MESH = (
    struct.pack("<2I", len(CORNERS), len(FACES))
    + b"".join(struct.pack("<3f", *corner) for corner in CORNERS)
    + b"".join(struct.pack("<3I", *face) for face in FACES)
)


@pytest.fixture(scope="module")
def chromium():
    if not CHROMIUM.exists():
        pytest.skip("needs the Chromium browser at /usr/bin/chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SWITCHES)
        yield browser
        browser.close()


def settle_after_gestures(page, monkeypatch):
    """Let every gesture return only when the page has drawn the frames that answer it.

    Playwright returns as soon as the page has the event; on a busy machine the page draws later.
    """
    from playwright import sync_api

    evaluate = sync_api.Page.evaluate

    def settling(act):
        @functools.wraps(act)
        def settled(actor, *args, **kwargs):
            result = act(actor, *args, **kwargs)
            # A gesture may leave the page, which ends the wait.
            with contextlib.suppress(sync_api.Error):
                evaluate(actor.page if isinstance(actor, sync_api.Locator) else page, FRAMES)
            return result

        return settled

    for actor, names in GESTURES.items():
        kind = getattr(sync_api, actor)
        for name in names:
            monkeypatch.setattr(kind, name, settling(getattr(kind, name)))


@pytest.fixture
def page(chromium, request, monkeypatch):
    """A page of its own; a test asks for another size or theme by indirect parameters."""
    theme, width, height = getattr(request, "param", ("light", 1280, 720))
    context = chromium.new_context(
        viewport={"width": width, "height": height}, color_scheme=theme, accept_downloads=True
    )
    context.set_default_timeout(30_000)
    page = context.new_page()
    settle_after_gestures(page, monkeypatch)
    yield page
    context.close()


@pytest.fixture(scope="module")
def modules(chromium):
    """A page without a job, whose modules can be called."""
    context = chromium.new_context()
    page = context.new_page()
    Pretend(page).open()
    yield page
    context.close()


@pytest.fixture(scope="session")
def messages():
    """What the server says of two contours of the demo, by type."""
    found = {}
    for message in json.loads(SAMPLE.read_text()):
        found.setdefault(message["type"], []).append(message)
    return found


@pytest.fixture
def first(messages):
    """The messages that greet a page once everything is planned."""
    names = [contour["name"] for contour in messages["scene"][0]["contours"]]
    job = messages["job"][0]
    job = job | {"contours": [each for each in job["contours"] if each["name"] in names]}
    kinds = ("options", "scene", "part", "plan", "program", "outcome", "progress")
    return [job, *(message for kind in kinds for message in messages[kind])]


@pytest.fixture
def studio(page, messages):
    """The pretended server of a page; after the test nothing may have gone wrong in the page."""
    meshes = {f"mesh/{body['mesh']}": MESH for body in messages["scene"][0]["bodies"]}
    server = Pretend(page, files=meshes)
    (known,) = messages["map"]

    def react(message):
        if message["type"] == "map" and message["contour"] == known["contour"]:
            server.say(known)

    server.react = react
    yield server
    assert server.errors == []
    assert server.elsewhere == []
