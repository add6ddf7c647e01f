"""External axes in the page: what they carry moves with them, and they are told in their units."""

import copy

import numpy as np
import pytest

from kerfpath.robots import ExternalAxis, base_in_part, chain_of, robot
from kerfpath.studio.options import options_message
from studio.browser.test_page import FRAMES, MODULE, ready, sent, serious, until

pytestmark = pytest.mark.slow

RAIL = {"lower": -0.5, "upper": 0.5, "velocity": 1.0, "acceleration": 1.5}
TABLE = {"lower": -np.pi, "upper": np.pi, "velocity": 1.5, "acceleration": 3.0, "endless": True}
CARRIED = (
    robot("abb_irb4600_60_205")
    .with_limits(acceleration=np.full(6, 10.0))
    .with_external(
        ExternalAxis(name="rail", kind="linear", carries="robot", axis=[0, 1, 0]), **RAIL
    )
    .with_external(
        ExternalAxis(
            name="table", kind="rotary", carries="part", axis=[0.6, 0, 0.8], point=[1.2, 0, 0.5]
        ),
        **TABLE,
    )
)
"""The robot of the sample on a rail, its part on a table whose axis leans."""
N, ARM = 8, 6
TABLES = [
    {
        **{"name": "rail", "kind": "linear", "carries": "robot", "axis": [0, 1, 0]},
        **{"lower_mm": -500, "upper_mm": 500, "velocity_mm_s": 1000, "acceleration_mm_s2": 1500},
        **{"endless": False},
    },
    {
        **{"name": "table", "kind": "rotary", "carries": "part", "axis": [0.6, 0, 0.8]},
        **{"point_mm": [1200, 0, 500], "velocity_deg_s": 86, "acceleration_deg_s2": 172},
        **{"endless": True},
    },
]


def axis_entry(i):
    """An external axis as the server says it, see README.md of the studio."""
    axis, limits = CARRIED.externals[i], (RAIL, TABLE)[i]
    T = np.eye(4)
    T[:3, 3] = axis.point
    endless = limits.get("endless", False)
    return {
        **{"name": axis.name, "unit": axis.unit, "carries": axis.carries, "endless": endless},
        **{"T": T.ravel().tolist(), "axis": axis.axis.tolist()},
        **{key: None if endless else limits[key] for key in ("lower", "upper")},
        **{key: limits[key] for key in ("velocity", "acceleration")},
    }


def wider(values, count, fill):
    """Rows of six joints, flat, with those of two external axes at their ends."""
    rows = np.array(values).reshape(count, ARM)
    return np.column_stack([rows, np.broadcast_to(fill, (count, 2))]).ravel().tolist()


def moved(plan):
    """A plan of the sample as an arm does it whose external axes move: the tip where it was."""
    plan, K = copy.deepcopy(plan), len(plan["time"])
    x = np.linspace([0.0, 0.0], [0.06, 0.15], K)
    arm = np.array(plan["q"]).reshape(K, ARM)
    seen = np.linalg.inv(base_in_part(CARRIED.externals, x)) @ CARRIED.alone().forward(arm)
    q = CARRIED.alone().arm.nearest(seen, arm)
    assert np.isfinite(q).all()
    plan["q"] = np.column_stack([q, x]).ravel().tolist()
    for key, rows in (("velocity_share", K - 1), ("acceleration_share", K - 2)):
        plan[key] = wider(plan[key], rows, [0.25, 0.5])
    for key in ("displacement", "largest_increment", "range", "peak_velocity", "peak_acceleration"):
        plan["criteria"][key] += [0.06, 0.15]
    plan["weights"] += [1.0, 1.0]
    return plan


@pytest.fixture
def carried(messages):
    """What greets a page of the job of the sample with external axes, once it is planned."""
    (job,), (scene,) = messages["job"], copy.deepcopy(messages["scene"])
    names = [contour["name"] for contour in scene["contours"]]
    scene["robot"]["joints"] += [axis_entry(0), axis_entry(1)]
    scene["sample"]["q"] += [0.3, 0.3]
    for body in scene["bodies"]:
        if body["kind"] == "part":
            body["frame"] = 0
        elif body["kind"] in ("robot", "head"):
            body["frame"] += 2
        else:
            body["frame"] = 1
    job = copy.deepcopy(job) | {"weights": [*job["weights"], 1.0, 1.0]}
    job["contours"] = [each for each in job["contours"] if each["name"] in names]
    job["values"]["robot"]["external"] = TABLES
    job["given"] += [f"robot.external.{i}.{key}" for i in (0, 1) for key in TABLES[i]]
    plans = [moved(plan) for plan in messages["plan"]]
    options = options_message(CARRIED, ["rail", "table"]).model_dump(mode="json")
    return [
        job,
        scene,
        options,
        *messages["part"],
        *plans,
        *messages["outcome"],
        *messages["progress"],
    ]


def test_the_frames_are_those_of_the_cell(modules, carried):
    scene = carried[1]
    for q in np.random.default_rng(3).uniform(-1, 1, (4, N)):
        found = modules.evaluate(FRAMES, [scene["robot"], q.tolist()])
        expected = chain_of(CARRIED).frames(q[None])[0]
        # The scene says the joints to 15 digits; the rest is rounding.
        assert np.array(found[:-1]).reshape(-1, 4, 4) == pytest.approx(expected, abs=1e-12)


def test_a_pose_is_turned_about_its_beam_while_the_axes_stand(modules, carried):
    scene, plan = carried[1], next(m for m in carried if m["type"] == "plan")
    q = plan["q"][-N:]
    found = modules.evaluate(MODULE, ["inverse", "turnedAbout", scene["robot"], q, 0.2])
    assert found[ARM:] == q[ARM:]
    before, after = (
        np.array(modules.evaluate(FRAMES, [scene["robot"], each])[-1]) for each in (q, found)
    )
    turn = before.reshape(4, 4)[:3, :3].T @ after.reshape(4, 4)[:3, :3]
    # Newton's method ends below 1e-7.
    assert after[[3, 7, 11]] == pytest.approx(before[[3, 7, 11]], abs=1e-6)
    assert np.arctan2(turn[1, 0], turn[0, 0]) == pytest.approx(0.2, abs=1e-6)


MATRICES = """(groups) => groups.map(({ matrix }) => matrix.clone().transpose().toArray())"""
SEEN = f"""() => {{
    const {{ machine, paths, placing }} = studio.view;
    const all = {MATRICES};
    return {{ q: studio.player.moment.q, node: studio.player.moment.node,
        frames: all(machine.frames), ghost: all(machine.ghostFrames),
        lines: all([paths.group])[0], handle: placing.handle.position.toArray(),
        beam: [...paths.beam.geometry.attributes.instanceStart.array.slice(0, 3)],
        middle: placing.middle.toArray() }};
}}"""


def at(page, contour, share):
    """Go to a node of a contour, and return what is where."""
    page.evaluate(
        """([contour, share]) => {
            const plan = studio.store.plans.get(contour)[0];
            const node = Math.round(share * (plan.time.length - 1));
            studio.player.seek(studio.player.timeline.when(plan, node));
        }""",
        [contour, share],
    )
    return page.evaluate(SEEN)


def square(flat):
    return np.array(flat).reshape(-1, 4, 4)


def test_all_that_is_carried_moves_and_the_floor_stands(page, studio, carried):
    studio.open(*carried)
    ready(page)
    plan = next(m for m in carried if m["type"] == "plan" and m["contour"] == "slot")
    points = np.array(plan["points"]).reshape(-1, 3)
    for share in (0.0, 0.5, 0.9):
        seen = at(page, "slot", share)
        expected = chain_of(CARRIED).frames(np.array([seen["q"]]))[0]
        # The page keeps matrices in double precision.
        assert square(seen["frames"]) == pytest.approx(expected, abs=1e-9)
        assert expected[1] == pytest.approx(np.eye(4), abs=1e-12)
        (lines,) = square(seen["lines"])
        assert lines == pytest.approx(expected[0], abs=1e-9)
        tip = lines @ [*points[seen["node"]], 1]
        own = page.evaluate(FRAMES, [carried[1]["robot"], seen["q"]])[-1]
        assert tip[:3] == pytest.approx([own[3], own[7], own[11]], abs=1e-6)
        beam = np.array(seen["beam"]) - tip[:3]
        # The beam begins 20 mm behind the tip, along its axis; in single precision.
        assert beam == pytest.approx(-0.02 * np.array([own[2], own[6], own[10]]), abs=1e-5)


def test_contours_are_pointed_at_where_they_are_seen(page, studio, carried):
    studio.open(*carried)
    ready(page)
    at(page, "slot", 1.0)
    found = page.evaluate(
        """() => {
            const { view } = studio;
            const track = view.paths.tracks.find(({ contour }) => contour === "slot");
            const point = view.stage.camera.position.clone().fromArray(track.points, 30);
            const seen = view.stage.project(point.applyMatrix4(view.paths.group.matrix));
            return view.pointed(seen.x, seen.y);
        }"""
    )
    assert found["contour"] == "slot"
    assert found["away"] < 3  # px: another node may be as near


def test_a_ghost_has_the_part_where_it_was(page, studio, carried):
    studio.open(*carried)
    ready(page)
    stood = at(page, "slot", 0.1)["frames"]
    page.keyboard.press("g")
    now = at(page, "slot", 0.9)["frames"]
    kept = page.evaluate(f"() => ({MATRICES})(studio.view.ghosts.group.children[0].children)")
    assert kept == stood
    assert kept != now
    counts = page.evaluate(
        "() => studio.view.ghosts.group.children[0].children.map((each) => each.children.length)"
    )
    assert counts[0] > 0  # the part
    assert counts[1] == 0  # what stands has no ghost


def test_the_handle_is_where_the_part_is_and_moves_it_on_its_table(page, studio, carried):
    studio.open(*carried)
    ready(page)
    page.locator("#open-layout").click()
    seen = at(page, "slot", 1.0)
    frame = square(seen["frames"])[0]
    assert seen["handle"] == pytest.approx((frame @ [*seen["middle"], 1])[:3], abs=1e-9)
    # Taken along the turned x of the table by 10 mm, the part moves along x at zero.
    page.evaluate(
        """([x, y, z]) => {
            const { handle, gizmo } = studio.view.placing;
            handle.position.x += x; handle.position.y += y; handle.position.z += z;
            gizmo.dispatchEvent({ type: "objectChange" });
        }""",
        (0.01 * frame[:3, 0]).tolist(),
    )
    until(page, lambda: sent(studio, "reach"))
    assert page.evaluate("() => studio.view.placing.offsets()") == {"x_mm": 10}
    assert serious(page) == []


WORLD = """() => {
    const { machine, stage } = studio.view;
    stage.scene.updateMatrixWorld(true);
    const of = (each) => each.matrixWorld.clone().transpose().toArray();
    return { part: of(machine.carried[0]), base: of(machine.frames[machine.base]) };
}"""


def test_where_the_base_is_moved_part_and_table_stand(page, studio, carried):
    studio.open(*carried)
    ready(page)
    page.locator("#open-layout").click()
    at(page, "slot", 0.9)
    before = page.evaluate(WORLD)
    page.evaluate("() => studio.view.placing.moveRobot([100, 0, 0], 30, 0)")
    after = page.evaluate(WORLD)
    # The page keeps matrices in double precision.
    assert after["part"] == pytest.approx(before["part"], abs=1e-9)
    moved = np.eye(4)
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    moved[:2, :2], moved[0, 3] = [[c, -s], [s, c]], 0.1
    assert square(after["base"])[0] == pytest.approx(moved @ square(before["base"])[0], abs=1e-9)


@pytest.mark.parametrize("move", ["part", "table"])
def test_the_part_is_moved_on_its_table_or_with_it(page, studio, carried, move):
    carried[0]["values"]["layout"]["move"] = move
    studio.open(*carried)
    ready(page)
    page.locator("#open-layout").click()
    seen = at(page, "slot", 0.9)
    before = square(page.evaluate(WORLD)["part"])[0]
    page.evaluate(
        """() => {
            const { placing } = studio.view;
            const { xyz: [x, y, z], rpy } = placing.place;
            placing.put([x + 10, y, z], rpy);
        }"""
    )
    step = np.eye(4)
    step[0, 3] = 0.01
    frame = square(seen["frames"])[0]
    expected = frame @ step if move == "part" else step @ frame
    assert before == pytest.approx(frame, abs=1e-9)
    # The job says micrometres.
    assert square(page.evaluate(WORLD)["part"])[0] == pytest.approx(expected, abs=2e-6)


def test_the_axes_are_told_in_their_units(page, studio, carried):
    studio.open(*carried)
    ready(page)
    page.evaluate("() => studio.store.select('slot')")
    legend = page.locator("#plot-legend button")
    until(page, lambda: legend.count() == N)
    assert legend.all_inner_texts() == ["J1", "J2", "J3", "J4", "J5", "J6", "rail", "table"]
    assert legend.nth(6).get_attribute("title") == (
        "Show or hide rail: \u2212500.0 to 500.0 mm, 1000 mm/s, 1500 mm/s\u00b2"
    )
    assert "endless" in legend.nth(7).get_attribute("title")
    page.locator("#plot-kind").get_by_role("button", name="Angle").click()
    drawn = """() => {
        const { series, data, axes } = studio.plots.plot;
        return { scales: series.slice(1).map(({ scale }) => scale),
            labels: axes.map(({ label }) => label),
            last: data.slice(1).map((column) => column.at(-1)) };
    }"""
    until(page, lambda: "mm" in page.evaluate(drawn)["scales"])
    found = page.evaluate(drawn)
    assert found["scales"] == ["deg"] * 6 + ["mm", "deg"]
    assert found["labels"][1:] == ["joint angle, deg", "linear axes, mm"]
    assert found["last"][6:] == pytest.approx([60.0, np.degrees(0.15)])
    rows = page.locator("#joints tbody tr")
    assert rows.locator("th").all_inner_texts()[6:] == ["rail", "table"]
    assert rows.nth(6).locator("td").nth(1).inner_text() == "60.0"
    assert rows.nth(6).locator(".weight").get_attribute("title") == "1.00 per m"
    assert serious(page) == []


def test_the_keys_of_an_axis_have_controls(page, studio, carried):
    studio.open(*carried)
    ready(page)
    page.get_by_label("Find an option").fill("rail speed")
    field = page.get_by_label("rail, speed", exact=True)
    assert field.input_value() == "1000"
    field.fill("750")
    field.press("Enter")
    until(page, lambda: sent(studio, "edits"))
    path = ["robot", "external", 0, "velocity_mm_s"]
    assert sent(studio, "edits")[-1]["edits"] == [{"path": path, "value": 750}]
    page.get_by_label("Find an option").fill("table")
    assert page.get_by_label("table, lower limit").count() == 0  # endless
    assert page.get_by_label("table, point on the axis", exact=True).input_value() == "1200, 0, 500"
    studio.say(options_message(CARRIED).model_dump(mode="json"))
    until(page, lambda: page.get_by_label("rail, speed", exact=True).count() == 0)


def test_plans_of_a_robot_without_the_axes_are_let_go_of(page, studio, carried, first):
    studio.open(*carried)
    ready(page)
    scene = next(m for m in first if m["type"] == "scene")
    studio.say(scene | {"revision": 2})
    until(page, lambda: page.evaluate("() => studio.store.plans.size") == 0)
    assert page.evaluate("() => studio.player.timeline.total") == 0
    plan = next(m for m in first if m["type"] == "plan")
    studio.say(plan | {"revision": 2})
    until(page, lambda: page.evaluate("() => studio.player.timeline.total") > 0)
