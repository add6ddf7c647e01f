"""The page of a Pareto set: what it says, what it refuses, and that its views are linked."""

import json
import re
from html import escape, unescape

import pytest

from browser import dom_of, figures, needs_chromium, without_scripts
from kerfpath.errors import InputError
from kerfpath.report import FrontAxis, FrontPlan, render_front
from kerfpath.report.style import DARK_SCALE, INK, SCALE

AXES = (
    FrontAxis(name="displacement", words="total displacement", unit="s", sense=1),
    FrontAxis(name="range_6", words="range of joint 6", unit="rad", sense=1),
    FrontAxis(name="speed", words="cutting speed", unit="m/s", sense=-1),
)
VALUES = ((1.0, 3.0, 0.05), (1.5, 2.0, 0.10), (2.0, 1.0, 0.20), (2.5, 0.5, 0.15))
NUMBERS = (4, 7, 1, 9)


def plan(number, values, asked=(("objective", "sum"),)):
    return FrontPlan(number=number, values=values, asked=asked)


def given(**changes):
    return {
        "axes": AXES,
        "plans": [plan(n, v) for n, v in zip(NUMBERS, VALUES, strict=True)],
        "dominated": [(2.5, 3.0, 0.05)],
        "marks": {"least displacement": 4, "balanced": 1},
        "facts": [("Robot", "ABB")],
        "notes": ["a note"],
        "command": "kerfpath pareto door.toml --pick {number}",
        "job_text": "[robot]",
    } | changes


def front(title="door", **changes):
    return render_front(title, **given(**changes))


def data(page):
    return json.loads(re.search(r'id="front">(.*?)</script>', page)[1])


def test_a_page_stands_alone_and_is_the_same_again():
    page = front()
    assert page == front()
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", without_scripts(page))
    text = without_scripts(page)
    for part in ("<h1>door</h1>", "<b>Note</b> a note", "<dd>ABB</dd>", "[robot]"):
        assert part in text


def test_values_are_shown_in_the_units_of_the_other_pages():
    page = front()
    row = re.search(r'<tr data-plan="4".*?</tr>', page)[0]
    # 3 rad are 171.9 degrees, 0.05 m/s are 3 m/min; the decimals tell a thousandth of the spread.
    assert re.findall(r'<td class="n">(.*?)</td>', row) == ["<b>1.00</b>", "172", "3.00"]
    assert [a["title"] for a in data(page)["axes"]] == [
        "total displacement (s)",
        "range of joint 6 (°)",
        "cutting speed (m/min)",
    ]


def test_equal_values_do_not_show_their_rounding():
    page = front(
        axes=AXES[:1], plans=[plan(1, (0.1 + 0.2,)), plan(2, (0.3,))], marks={}, dominated=[]
    )
    assert re.findall(r'<td class="n"><b>(.*?)</b>', page)[-1] == "0.300"


def test_better_is_at_the_bottom_of_every_parallel_axis():
    _, parallel = figures(front())
    dimensions = parallel["data"][0]["dimensions"]
    assert [d["range"] for d in dimensions][::2] == [[1.0, 2.5], [12.0, 3.0]]
    assert [d["label"][-1] for d in dimensions] == ["↓", "↓", "↑"]


def test_texts_from_outside_are_escaped():
    evil = "</script><b onclick='x'>&"
    axes = [FrontAxis(name=evil, words=evil, unit=evil, sense=1)]
    page = front(
        evil,
        axes=axes,
        plans=[plan(1, (1.0,), asked=((evil, evil),))],
        dominated=[],
        marks={evil: 1},
        facts=[(evil, evil)],
        notes=[evil],
        command=evil + "{number}",
        job_text=evil,
    )
    harmless = front(
        axes=[FrontAxis(name="x", words="x", unit="x", sense=1)],
        plans=[plan(1, (1.0,))],
        dominated=[],
        marks={"x": 1},
    )
    assert page.count("</script>") == harmless.count("</script>")
    assert "<b onclick" not in page
    # What plotly draws reads HTML, what the script sets as text does not.
    assert data(page)["axes"][0]["title"] == escape(f"{evil} ({evil})")
    assert data(page)["plans"][0]["asked"] == [[evil, evil]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"axes": []}, "axes: expected at least one"),
        ({"axes": [AXES[0], AXES[0], AXES[1]]}, "none twice, got .*displacement"),
        ({"plans": []}, "plans: expected at least one"),
        ({"plans": [plan(1, VALUES[0]), plan(1, VALUES[1])]}, r"none twice, got \[1, 1\]"),
        ({"plans": [plan(1, (1.0, 2.0))]}, "values of plan 1: expected shape"),
        ({"plans": [plan(1, (1.0, 2.0, float("nan")))]}, "values of plan 1.*finite"),
        ({"dominated": [(1.0, 2.0)]}, "dominated: expected shape"),
        ({"marks": {"best": 5}}, "mark 'best': expected the number of a plan, got 5"),
        ({"command": "kerfpath pareto"}, "command: expected {number}"),
    ],
)
def test_what_does_not_fit_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        front(**changes)


def test_an_axis_has_a_sense():
    with pytest.raises(InputError, match=r"axis speed: expected sense 1 .* got 0"):
        FrontAxis(name="speed", words="speed", unit="m/s", sense=0)


ACTS = """
const wait = (ms) => new Promise((go) => setTimeout(go, ms));
const out = () => [...document.querySelectorAll(".plans tr.out")].map((row) => +row.dataset.plan);
const panel = () => ({
  command: PANEL.querySelector("pre").textContent,
  shown: [...PANEL.querySelectorAll(".values .n")].map((cell) => cell.textContent),
  asked: PANEL.querySelector(".asked dl").textContent,
  row: [...document.querySelectorAll("[aria-current]")].map((row) => +row.dataset.plan),
  ring: [...SCATTER.data[2].x],
  lines: PARALLEL?.data[0].dimensions[0].values.length,
});
const mouse = (target, kind, x, y) => target.dispatchEvent(new MouseEvent(kind,
  { clientX: x, clientY: y, bubbles: true, view: window, cancelable: true }));
async function drag(target, x, y0, y1) {
  target.scrollIntoView();
  const top = target.getBoundingClientRect().top;
  mouse(target, "mousemove", x, top + y0);
  mouse(target, "mousedown", x, top + y0);
  for (const share of [0.3, 0.6, 1]) mouse(window, "mousemove", x, top + y0 + share * (y1 - y0));
  mouse(window, "mouseup", x, top + y1);
  await wait(300);
}
async function clickPoint(i) {
  SCATTER.scrollIntoView();
  const layer = SCATTER.querySelector(".nsewdrag"), box = layer.getBoundingClientRect();
  const { xaxis, yaxis } = SCATTER._fullLayout, { x, y } = SCATTER.data[1];
  const at = [box.left + xaxis.d2p(x[i]), box.top + yaxis.d2p(y[i])];
  for (const kind of ["mousemove", "mousedown", "mouseup"]) {
    mouse(layer, kind, ...at);
    await wait(150);
  }
}
setTimeout(async () => {
  const seen = {};
  try { await act(seen); } catch (error) { seen.error = String(error); }
  document.body.append(element("output", JSON.stringify(seen)));
}, 3000);
"""


def seen(page, folder, acts):
    """Return what a script notes while it acts on a page."""
    script = f"<script>{ACTS}async function act(seen) {{{acts}}}</script>"
    path = folder / "front.html"
    path.write_text(page.replace("</body>", f"{script}</body>"), encoding="utf-8")
    dom = dom_of(path)
    assert 'data-state="failed"' not in dom
    assert "WebGL is not supported" not in dom
    found = json.loads(unescape(re.search(r"<output>(.*?)</output>", dom)[1]))
    assert "error" not in found, found
    return found


def _lightness(colour):
    return sum(bytes.fromhex(colour[1:]))


@pytest.mark.slow
@needs_chromium
def test_views_are_linked(tmp_path):
    found = seen(
        front(),
        tmp_path,
        """
        const bars = PARALLEL.querySelectorAll(".axis-brush .background");
        const box = bars[0].getBoundingClientRect();
        // The lower half of the first axis: displacements from 1.0 to 1.75.
        await drag(bars[0], box.left + box.width / 2, box.height / 2, box.height - 1);
        seen.brush = PARALLEL.data[0].dimensions[0].constraintrange;
        seen.out = out();
        seen.kept = KEPT.textContent;
        seen.bright = SCATTER.data[1].selectedpoints;
        KEPT.querySelector("button").click();
        await wait(300);
        seen.outAfter = out();
        seen.brightAfter = SCATTER.data[1].selectedpoints ?? null;
        await clickPoint(1);
        seen.point = panel();
        document.querySelector('tr[data-plan="9"]').click();
        await wait(300);
        seen.row = panel();
        const row = document.querySelector('tr[data-plan="9"]');
        row.focus();
        for (const key of ["ArrowUp", "Enter"]) {
          const press = new KeyboardEvent("keydown", { key, bubbles: true });
          document.activeElement.dispatchEvent(press);
        }
        await wait(300);
        seen.key = panel();
        const order = () => [...BODY.rows].map((row) => +row.dataset.plan);
        const head = document.querySelector('[data-sort="2"]');
        head.click();
        seen.fastest = order();
        head.click();
        seen.slowest = order();
        const box2 = document.querySelector('[data-choice="x"]');
        box2.value = "2";
        box2.dispatchEvent(new Event("change"));
        await wait(300);
        seen.x = SCATTER.data[1].x;
        seen.title = SCATTER.layout.xaxis.title.text;
        seen.labels = SCATTER.layout.annotations.map((label) => label.text);
        const look = () => ({
          best: SCATTER.data[1].marker.colorscale[0][1],
          page: SCATTER.layout.paper_bgcolor,
          ink: SCATTER.layout.annotations[0].font.color,
        });
        await wait(300);
        seen.light = look();
        // The page becomes dark, as far as its script knows; the colours of its style stay light.
        Object.defineProperty(DARK, "matches", { value: true });
        DARK.dispatchEvent(new Event("change"));
        await wait(300);
        seen.dark = look();
        seen.bar = SCATTER.data[1].marker.colorbar.title.text;
        """,
    )
    low, high = found["brush"]
    assert low <= 1.05
    assert 1.5 < high < 2.0
    assert found["out"] == [1, 9]
    assert found["bright"] == [0, 1]
    assert found["kept"].startswith("2 of 4 plans")
    assert (found["outAfter"], found["brightAfter"]) == ([], None)
    assert found["point"]["command"] == "kerfpath pareto door.toml --pick 7"
    assert found["point"]["shown"] == ["1.50 s", "115 °", "6.00 m/min"]
    assert found["point"]["asked"] == "objectivesum"
    assert found["point"]["row"] == [7]
    assert found["point"]["ring"] == [1.5]
    assert found["point"]["lines"] == len(VALUES) + 5, "the picked line is five lines wide"
    assert found["row"]["command"].endswith("--pick 9")
    assert found["row"]["ring"] == [2.5]
    assert found["key"]["row"] == [1], "the row above"
    assert found["fastest"] == [1, 9, 7, 4]
    assert found["slowest"] == [4, 7, 9, 1]
    assert found["x"] == [3, 6, 12, 9]
    assert found["title"] == "cutting speed (m/min), better →"
    assert found["labels"] == ["least displacement", "balanced"]
    # In both themes the best colour stands out most: the darkest on white, the lightest on black.
    assert found["light"] == {"best": SCALE[0], "page": "white", "ink": INK}
    assert found["dark"] == {"best": DARK_SCALE[0], "page": "#fff", "ink": INK}
    assert _lightness(SCALE[0]) < _lightness(SCALE[-1])
    assert _lightness(DARK_SCALE[0]) > _lightness(DARK_SCALE[-1])
    assert found["bar"] == "cutting speed (m/min), better ↑"


@pytest.mark.slow
@needs_chromium
def test_one_plan_of_one_criterion_is_picked_by_itself(tmp_path):
    page = front(axes=AXES[:1], plans=[plan(3, (1.0,))], dominated=[(2.0,)], marks={})
    assert len(figures(page)) == 1
    found = seen(page, tmp_path, "seen.panel = panel();")
    assert found["panel"]["command"].endswith("--pick 3")
    assert found["panel"]["ring"] == [1.0]
