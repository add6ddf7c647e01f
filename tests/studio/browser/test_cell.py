"""A cell from the page: from a drawing to a planned job without a line of TOML."""

import re
import tomllib

import pytest

from cell.test_cell import stl_bytes
from commands import run
from jobs import DEMO
from kerfpath.cell import box
from studio.browser.test_page import serious, until
from studio.browser.test_studio import JOB, REVISION, TWO_FRAMES, Server, settled
from studio.test_cell import plate

pytestmark = pytest.mark.slow

DROP = """([name, bytes, where]) => {
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([new Uint8Array(bytes)], name));
    const event = new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true });
    document.querySelector(where).dispatchEvent(event);
}"""
OUTSIDE = """() => {
    const all = [...document.querySelectorAll("#top > *, #sheet *, .notice > *")];
    const cut = ({ left, right, width }) => width > 2 && (left < -1 || right > innerWidth + 1);
    return all.filter((each) => cut(each.getBoundingClientRect())).map((each) => each.className);
}"""
"""What the window cuts off of the header, the sheet and the notices."""
VALID = "() => studio.store.job.values !== null"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("cell")
    (made / "b_pillar.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
    (made / "job.toml").write_text(JOB)
    return made


@pytest.fixture(scope="module")
def server(folder):
    running = Server(folder / "job.toml")
    yield running
    running.stop()


@pytest.fixture
def opened(page, server):
    """A page with the sheet of the cell; the refusal of a file is the only fault in its console."""
    wrong = []
    page.on("console", lambda m: m.type == "error" and "409" not in m.text and wrong.append(m.text))
    page.on("pageerror", lambda fault: wrong.append(str(fault)))
    page.goto(server.url)
    until(page, lambda: page.locator("#open-cell").is_enabled(), seconds=120)
    page.locator("#open-cell").click()
    yield page
    assert wrong == []


def drop(page, name, data, where="#scene"):
    page.evaluate(DROP, [name, list(data), where])


def edit(page, act):
    """Do something to the job, and wait until the server has read it."""
    before = page.evaluate(REVISION)
    act()
    until(page, lambda: page.evaluate(REVISION) > before and page.evaluate(VALID), seconds=120)


@pytest.mark.parametrize("page", [("light", 1400, 900)], indirect=True)
def test_a_job_is_made_on_the_page_and_planned(opened, folder, tmp_path):
    page, cell = opened, opened.locator("#sheet")
    drop(page, "pillar.step", (folder / "b_pillar.step").read_bytes())
    until(page, cell.get_by_text("pillar.step", exact=True).is_visible, seconds=120)
    plate(tmp_path)
    drawing = tmp_path / "drawn.dxf"
    edit(page, lambda: cell.get_by_label("Open a drawing").set_input_files(drawing))
    until(page, lambda: page.locator("#contours button").count() == 2, seconds=60)

    edit(page, lambda: cell.get_by_label("Robot", exact=True).select_option("kuka_kr60_ha"))
    assert (
        cell.get_by_alt_text("KUKA KR 60 HA (also KR 60-3)").evaluate("each => each.naturalWidth")
        > 0
    )
    facts = cell.locator(".facts").inner_text()
    assert re.search(r"Reach\s+2.033 m\s+Payload\s+60 kg", facts)
    edit(page, lambda: cell.get_by_label("Head", exact=True).select_option("laser-head-90"))
    language = cell.get_by_label("Language of the controller")
    assert language.input_value() == "krl"  # that of the robot's maker
    settled(page)
    edit(page, lambda: cell.get_by_role("button", name="Take the shown pose").click())
    edit(page, lambda: cell.get_by_role("button", name="Add a box").click())
    width = cell.get_by_label("box 1, size x, mm")
    edit(page, lambda: (width.fill("450"), width.press("Enter")))
    edit(page, lambda: cell.get_by_role("button", name="Add a cylinder").click())
    across = cell.get_by_label("cylinder 1, size diameter, mm")
    edit(page, lambda: (across.fill("50"), across.press("Enter")))
    edit(page, lambda: drop(page, "clamp.stl", stl_bytes(box([80, 120, 60])), ".fixtures"))
    settled(page)
    assert serious(page) == []
    for width, height in ((1400, 900), (1000, 700)):
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate(TWO_FRAMES)
        assert page.evaluate(OUTSIDE) == []
    assert all(
        page.evaluate("() => [...studio.store.plans.values()].flat().map((each) => each.passed)")
    )
    page.locator("#save").click()
    until(page, lambda: page.locator("#saved").inner_text() == "saved")
    job = tomllib.loads((folder / "job.toml").read_text())
    assert job["robot"]["model"] == "kuka_kr60_ha"
    assert job["tool"] == {"head": "laser-head-90"}
    assert len(job["sequence"]["home_deg"]) == 6
    first, second, third = fixtures = job["cell"]["fixture"]
    assert first["size_mm"] == [450, 300, 50]
    assert second["cylinder_mm"] == [50, 200]
    assert (third["name"], third["file"], third["unit"]) == ("clamp", "clamp.stl", "mm")
    # Its top is as far below the contours as those of the others.
    tops = [each["xyz_mm"][2] + h for each, h in zip(fixtures, (25, 100, 30), strict=True)]
    assert len(set(tops)) == 1
    done = run("plan", folder / "job.toml", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", [("light", 1000, 700)], indirect=True)
def test_bad_input_is_said_in_one_line_and_leaves_the_job(opened, tmp_path):
    page, cell = opened, opened.locator("#sheet")
    before = page.evaluate("() => studio.store.job.text")
    said = cell.get_by_role("alert")
    drop(page, "photo.png", b"\x89PNG")
    until(page, said.is_visible)
    assert said.inner_text().startswith("expected a drawing, such as .step")
    drop(page, "bad.step", b"hello")
    until(page, lambda: said.inner_text().startswith("bad.step: not a STEP file"), seconds=60)
    assert page.evaluate("() => studio.store.job.text") == before
    # A plate of 300 m is not believed; its unit is all that is asked for.
    drop(page, "large.dxf", plate(tmp_path, units=6))
    until(page, lambda: said.inner_text().startswith("unit? the part is 300 m long"), seconds=60)
    edit(page, lambda: cell.get_by_label("Unit of the drawing").select_option("mm"))
    assert not said.is_visible()

    drop(page, "open.stl", stl_bytes(box([80, 120, 60]))[:-50], ".fixtures")
    until(page, lambda: said.count() == 1 and said.inner_text().startswith("open.stl: "))
    edit(page, lambda: cell.get_by_role("button", name="Add a box").click())
    height = cell.get_by_label("box 1, size z, mm")
    height.fill("0")
    height.press("Enter")
    notice = page.locator(".notice.bad")
    until(page, lambda: notice.count() == 1)
    assert "cell.fixture.size_mm: expected 3 numbers above 0" in notice.inner_text()
    # What was there is still shown, and nothing of the notice is behind the sheet.
    assert cell.get_by_text("large.dxf", exact=True).is_visible()
    assert height.input_value() == "50"
    edit(page, lambda: notice.get_by_role("button", name="Undo").click())
    assert notice.count() == 0
