"""What a map is shaded by, and the course of other techniques: what the library itself says."""

import base64
import re

import numpy as np
import pytest

from kerfpath import plan
from kerfpath.comfort import MEASURES, measure
from kerfpath.job import prepare, read_job
from studio.talk import QUICK, serving, talking, write_job
from studio.test_clearance import CELL

NONE, CLOSED, MOST = 255, 254, 253
WINDING = QUICK.replace("endless = [4, 6]", "endless = []")


def opened(text, folder):
    path = write_job(folder, text)
    prepared = prepare(read_job(path))
    nodes = next(c for c in prepared.contours if c.task.name == "slot").candidates[0].nodes
    return path, prepared, nodes, prepared.job.graph(nodes)


@pytest.fixture(scope="module")
def celled(tmp_path_factory):
    path, prepared, nodes, graph = opened(QUICK + CELL, tmp_path_factory.mktemp("shade"))
    with serving(path) as client, talking(client) as page:
        page.done(1)
        yield page, prepared, nodes, graph


@pytest.fixture(scope="module")
def winding(tmp_path_factory):
    path, prepared, nodes, graph = opened(WINDING, tmp_path_factory.mktemp("turns"))
    with serving(path) as client, talking(client) as page:
        page.done(1)
        yield page, prepared, nodes, graph


def shaded(page, by):
    page.say("shade", contour="slot", by=by)
    return page.until("shade", by=by)


def decoded(found, graph, key="values"):
    """The codes (K, m) of each posture."""
    shape = len(graph.start) - 1, len(graph.gamma)
    return {
        layer["posture"]: np.frombuffer(base64.b64decode(layer[key]), np.uint8).reshape(shape)
        for layer in found["layers"]
    }


def codes_of_vertices(found, graph, key="values"):
    codes = decoded(found, graph, key)
    layer = np.repeat(np.arange(len(graph.start) - 1), np.diff(graph.start))
    places = zip(layer, graph.sample, graph.posture, strict=True)
    return np.array([codes[int(mu)][k, i] for k, i, mu in places])


@pytest.mark.slow
def test_a_map_says_what_it_can_be_shaded_by(celled, winding):
    for (page, *_), more in ((celled, {"clearance"}), (winding, {"turns"})):
        page.say("map", contour="slot")
        shades = page.until("map")["shades"]
        assert {each["by"] for each in shades} == {*MEASURES, *more}


@pytest.mark.slow
def test_clearance_is_that_of_the_cell(celled):
    page, prepared, _, graph = celled
    found, cell = shaded(page, "clearance"), prepared.cell
    codes, pairs = (codes_of_vertices(found, graph, key) for key in ("values", "nearest"))
    assert NONE not in codes
    some = np.linspace(0, len(codes) - 1, 200).astype(int)
    over = cell.distances(graph.q[some]) - cell.required
    clear = (over > 0).all(axis=1)
    assert (codes[some] == CLOSED).tolist() == (~clear).tolist()
    assert clear.any()
    assert not clear.all()
    least = np.where(cell.own, np.inf, over).min(axis=1)[clear]
    told = found["high"] * codes[some][clear] / MOST
    # It is told at least, 5 mm too little at most, and rounded to half a step of the code.
    half = found["high"] / MOST / 2
    assert (told <= np.minimum(least, found["high"]) + half + 1e-9).all()
    assert (told >= np.minimum(least, found["high"]) - 5e-3 - half - 1e-9).all()
    for k in np.flatnonzero(codes[some] == CLOSED)[:20]:
        names = tuple(found["pairs"][pairs[some][k]])
        assert over[k, cell.pair_names.index(names)] <= 0


def test_singularities_and_limits_are_the_measures_of_comfort(celled):
    page, prepared, _, graph = celled
    for by, each in MEASURES.items():
        found = shaded(page, by)
        assert (found["words"], found["unit"]) == (each.words, each.unit)
        value = measure(by, prepared.job.robot, graph.q, tool=prepared.job.tool)
        assert found["high"] == pytest.approx(value.max())
        told = found["high"] * codes_of_vertices(found, graph) / MOST
        # Half a step of the code.
        assert told == pytest.approx(value, abs=found["high"] / MOST / 2 * (1 + 1e-9))


def test_poses_on_several_turns_are_counted_and_their_joints_said(winding):
    page, _, _, graph = winding
    found = shaded(page, "turns")
    step = (found["high"] - found["low"]) / MOST
    layer = np.repeat(np.arange(len(graph.start) - 1), np.diff(graph.start))
    counts = {mu: np.zeros(codes.shape) for mu, codes in decoded(found, graph).items()}
    for k, i, mu in zip(layer, graph.sample, graph.posture, strict=True):
        counts[int(mu)][k, i] += 1
    assert found["high"] == max(count.max() for count in counts.values()) > 1
    for mu, codes in decoded(found, graph).items():
        assert ((codes != NONE) == (counts[mu] > 0)).all()
        told = found["low"] + step * codes[codes != NONE]
        assert told == pytest.approx(counts[mu][counts[mu] > 0], abs=step / 2 + 1e-9)
    mu, count = next(iter(counts.items()))
    k, i = (int(at) for at in np.argwhere(count > 1)[0])
    page.say("reason", contour="slot", node=k, gamma=graph.gamma[i], posture=mu)
    said = page.until("pose")["reason"]
    here = (layer == k) & (graph.sample == i) & (graph.posture == mu)
    assert said.startswith(f"admitted: on {int(count[k, i])} turns, joint ")
    for joint, places in re.findall(r"joint (\d) at ([-\d or]+) deg", said):
        q = np.degrees(graph.q[here][:, int(joint) - 1])
        assert sorted(map(float, places.split(" or "))) == sorted({float(f"{x:.0f}") for x in q})


def test_what_is_no_quantity_of_the_map_is_refused(winding):
    page, *_ = winding
    page.say("shade", contour="slot", by="clearance")
    said = page.until("error", about="shade")["message"]
    assert "expected one of wrist" in said
    page.say("shade", contour="nothing", by="wrist")
    assert "not planned yet" in page.until("error", about="shade")["message"]


@pytest.mark.parametrize("method", ["paper", "known"])
def test_the_course_of_a_technique_is_what_plan_finds_by_it(winding, method):
    page, prepared, nodes, graph = winding
    page.say("technique", contour="slot", method=method)
    found = page.until("technique")
    job = prepared.job
    made = plan(
        nodes, job.robot, tool=job.tool, placement=job.placement, speed=0.05,
        options=job.options, method=method, certify=None, refine=False, graph=graph,
    )  # fmt: skip
    assert found["cost"] == pytest.approx(made.cost)
    assert found["gamma"] == pytest.approx(made.gamma, abs=1e-8)
    assert found["posture"] == made.posture.tolist()
    for key in ("peak_velocity", "peak_acceleration"):
        assert found[key] == pytest.approx(getattr(made.criteria, key), abs=1e-8)
    assert "no claim" in found["statement"]
    assert found["notes"] == []


def test_what_a_technique_knows_nothing_of_is_left_out(tmp_path):
    text = QUICK.replace("[plan]", '[plan]\nbetween_nodes = "guaranteed"')
    with serving(write_job(tmp_path, text)) as client, talking(client) as page:
        page.until("plan", contour="hole 10")
        page.say("technique", contour="hole 10", method="known")
        found = page.until("technique")
    assert found["cost"] > 0
    assert "limits between the nodes" in found["notes"][0]


def test_what_a_technique_does_not_look_at_is_said(celled):
    page, *_ = celled
    page.say("technique", contour="slot", method="known")
    assert "collisions in the cell" in page.until("technique")["notes"][0]


def test_a_newer_look_of_a_page_takes_the_place_of_one_before(celled):
    page, *_ = celled
    before = len(page.heard)
    for by in ("clearance", "clearance", "clearance", "limits"):
        page.say("shade", contour="slot", by=by)
    page.until("shade", by="limits")
    page.say("shade", contour="slot", by="clearance")
    page.say("shade", contour="slot", by=None)
    page.say("technique", contour="slot", method="paper")
    page.until("technique")
    told = [m["by"] for m in page.heard[before:] if m["type"] == "shade"]
    assert told[-1] == "limits"
    assert told.count("clearance") <= 1
