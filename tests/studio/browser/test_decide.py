"""What one decides with: plans side by side, a control for every option, Pareto sets."""

import json

import pytest

from studio.browser.test_page import ready, sent, serious, until

pytestmark = pytest.mark.slow


def slower(plan):
    """The plan of a job that was kept: twice as long, and half the gap away."""
    return plan | {"time": [2 * t for t in plan["time"]], "gap": 0.5, "revision": 1}


def entry(**more):
    known = {"id": 3, "name": "A", "revision": 1, "metric": "manhattan", "objective": "sum"}
    return known | {"contours": ["slot"], "cycle": None, "settled": True} | more


def test_a_plan_that_is_kept_is_compared_with_the_one_that_is_shown(page, studio, first, messages):
    plan = next(each for each in messages["plan"] if each["contour"] == "slot")
    studio.files["kept/3"] = json.dumps([slower(plan)]).encode()

    def react(message):
        if message["type"] == "keep":
            studio.say({"type": "kept", "plans": [entry()]})

    studio.react = react
    studio.open(*first)
    ready(page)
    page.locator("#contours button", has_text="slot").click()
    page.get_by_role("button", name="Keep to compare").click()
    table = page.locator("#compare table").first
    table.wait_for()
    seconds = plan["time"][-1]
    row = table.locator("tr", has_text="Time of the cut").locator("td").all_inner_texts()
    assert [float(each) for each in row[:2]] == [round(2 * seconds, 2), round(seconds, 2)]
    assert "better" in row[2]
    # Its course is there for the map, its curves for the plot, and its robot in the scene.
    (course,) = page.evaluate("() => studio.store.beside('slot')")
    assert (course["name"], course["gamma"]) == ("A", plan["gamma"])
    until(page, lambda: page.evaluate("() => studio.plots.beside.length") == 7)
    assert page.evaluate("() => studio.plots.plot.scales.x.max") >= 1.9 * seconds
    page.evaluate("() => studio.player.seek(studio.player.timeline.begin('slot') + 0.1)")
    until(page, lambda: page.evaluate("() => studio.view.machine.ghost.visible"))
    assert serious(page) == []
    page.get_by_role("button", name="Go back to A").click()
    until(page, lambda: sent(studio, "restore"))
    assert sent(studio, "restore") == [{"type": "restore", "id": 3}]
    page.get_by_label("Name of the kept plan").fill("slow")
    page.keyboard.press("Enter")
    until(page, lambda: sent(studio, "rename"))
    # A page that is told that it is gone compares with nothing.
    studio.say({"type": "kept", "plans": []})
    until(page, lambda: page.evaluate("() => studio.store.against === null"))
    assert not page.evaluate("() => studio.view.machine.ghost.visible")


def test_another_page_chooses_what_it_compares_with(page, studio, first):
    studio.open(*first, {"type": "kept", "plans": [entry(contours=[])]})
    studio.files["kept/3"] = b"[]"
    ready(page)
    assert page.locator("#compare table").count() == 0
    page.locator(".kept button", has_text="A").click()
    page.get_by_text("A has no plan for this contour.").wait_for()
    page.locator(".kept button", has_text="A").click()
    until(page, lambda: page.locator("#compare .actions").count() == 0)


def test_every_option_has_a_control_and_is_found_by_its_name(page, studio, first):
    studio.open(*first)
    ready(page)
    page.locator("#contours button", has_text="slot").click()
    page.get_by_label("Find an option").fill("lead-in")
    length = page.get_by_label("Lead-in, length", exact=True)
    assert page.get_by_label("Lead-in, shape", exact=True).is_disabled()  # there is no lead yet
    assert page.get_by_label("Step of gamma", exact=True).is_hidden()
    length.fill("4")
    length.press("Enter")
    until(page, lambda: sent(studio, "edits"))
    path = ["contour", 2, "lead_in", "length_mm"]
    assert sent(studio, "edits")[-1]["edits"] == [{"path": path, "value": 4}]
    page.get_by_label("Find an option").fill("wrist band")
    width = page.get_by_label("Wrist singularity, band width", exact=True)
    width.fill("20")
    width.press("Enter")
    until(page, lambda: len(sent(studio, "edits")) == 2)
    assert sent(studio, "edits")[-1]["edits"] == [
        {"path": ["comfort", "wrist_band_deg"], "value": 20},
        {"path": ["comfort", "wrist_cost"], "value": 1},  # which it may not be without
    ]
    page.get_by_label("Find an option").fill("nodes by")
    page.get_by_label("Nodes by", exact=True).first.select_option("count")
    until(page, lambda: len(sent(studio, "edits")) == 3)
    assert sent(studio, "edits")[-1]["edits"] == [
        {"path": ["contour", 2, "spacing_mm"], "value": None},
        {"path": ["contour", 2, "count"], "value": 200},
    ]
    page.get_by_label("Find an option").fill("gamma")
    page.get_by_label("Step of gamma: reset to default").click()
    until(page, lambda: len(sent(studio, "edits")) == 4)
    step = {"path": ["plan", "gamma_step_deg"], "value": None}
    assert sent(studio, "edits")[-1]["edits"] == [step]
    page.get_by_label("Find an option").fill("place x")
    place = page.get_by_label("x, y, z", exact=True)
    assert place.input_value() == "1200, -600, 500"
    place.fill("1250 -600, 500")
    place.press("Enter")
    until(page, lambda: len(sent(studio, "edits")) == 5)
    edit = {"path": ["part", "xyz_mm"], "value": [1250, -600, 500]}
    assert sent(studio, "edits")[-1]["edits"] == [edit]
    place.fill("here")
    place.press("Enter")
    assert place.get_attribute("aria-invalid") == "true"
    assert serious(page) == []
    page.get_by_label("Find an option").fill("nonsense")
    page.get_by_text("No option matches.").wait_for()


def pareto(plan, **more):
    """A set of three points, of which the last is beaten, and the second is no job's."""
    axes = [
        {"name": "displacement", "words": "total displacement", "unit": "s", "better": "less"},
        {"name": "velocity", "words": "peak velocity", "unit": "share", "better": "less"},
        {"name": "limits", "words": "limits", "unit": "rad", "better": "more"},
    ]
    edits = [{"path": ["plan", "weights"], "value": [1, 2, 3, 4, 5, 6]}]
    points = [
        {"number": 0, "values": [1.0, 0.9, 0.5], "best": True, "edits": edits},
        {"number": 4, "values": [2.0, 0.4, 0.6], "best": True, "edits": None},
        {"number": 7, "values": [2.5, 0.95, 0.4], "best": False, "edits": edits},
    ]
    known = {"type": "front", "revision": plan["revision"], "contour": plan["contour"]}
    known |= {"axes": axes, "points": points, "done": 10, "total": 10, "state": "done"}
    return known | more


def test_a_point_of_the_pareto_set_is_shown_and_taken(page, studio, first, messages):
    plan = next(each for each in messages["plan"] if each["contour"] == "slot")
    other = plan | {"gamma": [g + 0.5 for g in plan["gamma"]], "cost": 99.0, "passed": None}

    def react(message):
        if message["type"] == "front":
            studio.say(pareto(plan))
        elif message["type"] == "point":
            number = message["number"]
            studio.say({"type": "candidate", "contour": "slot", "number": number, "plan": other})

    studio.react = react
    studio.open(*first)
    ready(page)
    page.locator("#contours button", has_text="slot").click()
    page.get_by_text("Criteria and runs").click()
    page.get_by_label("limits", exact=True).check()
    page.locator("#front").get_by_role("button", name="Search", exact=True).click()
    page.get_by_text("2 non-dominated plans").wait_for()
    asked = sent(studio, "front")[0]
    assert asked["criteria"] == ["displacement", "velocity", "range", "limits"]
    page.get_by_label("Criterion by colour").select_option("limits")
    canvas = page.locator("canvas.scatter")
    canvas.focus()
    for _ in range(2):
        page.keyboard.press("ArrowRight")
    page.get_by_text("peak velocity 40.0 % limit").wait_for()
    page.keyboard.press("Enter")
    page.get_by_text("kerfpath pareto --pick").wait_for()  # it was held to what no job can say
    assert page.get_by_role("button", name="Take it").count() == 0
    page.locator("#cost", has_text="99.00").wait_for(state="attached")  # drawn with the next frame
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")
    take = page.get_by_role("button", name="Take it")
    take.wait_for()
    assert serious(page) == []
    take.click()
    until(page, lambda: sent(studio, "edits"))
    assert sent(studio, "edits")[0]["edits"] == pareto(plan)["points"][0]["edits"]
    page.get_by_role("button", name="Back to the job's plan").click()
    assert page.evaluate("() => studio.store.plans.get('slot')[0].gamma[0]") == plan["gamma"][0]
    # What the job is planned to be takes the place of a point that is shown.
    canvas.focus()
    page.keyboard.press("Enter")
    until(page, lambda: page.evaluate("() => studio.store.candidate !== null"))
    studio.say(plan | {"revision": plan["revision"] + 1})
    until(page, lambda: page.evaluate("() => studio.store.candidate === null"))
