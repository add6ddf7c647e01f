"""The report: one page that stands alone, says what it knows, and draws in a browser."""

import base64
import json
import re
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plotly.offline import get_plotlyjs

from browser import dom_of, needs_chromium
from kerfpath.auditor import Check
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.graph import LayeredGraph
from kerfpath.planner import layered_graph, plan
from kerfpath.plans import Feed
from kerfpath.report import ContourSection, feasibility_map, render
from kerfpath.report.maps import chosen_line, hidden_postures, shown_postures
from kerfpath.report.motion import cutting_speed, joint_positions, limit_shares, posture_runs
from kerfpath.report.scene import scene
from kerfpath.report.style import JOINT_COLOURS, reason_colours
from kerfpath.robots import posture_name, robot

NODES = 41

TOOL = np.eye(4)
TOOL[:3, :3] = [[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]
TOOL[:3, 3] = [0.12, 0, 0.35]
PLACEMENT = np.eye(4)
PLACEMENT[:3, 3] = [1.35, -0.35, 0.6]

CHECKS = [
    Check(code="a", title="tool tip", value=2e-5, limit=1e-4, unit="m", node=3),
    Check(code="b", title="joint velocity", value=0.145, limit=0.95, unit="share", node=7),
]


def _section(name: str = "outer trim") -> ContourSection:
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    points = np.stack([0.15 * np.cos(angle), 0.1 * np.sin(angle), 0 * angle], axis=1)
    axes = np.tile([0.0, 0.0, -1.0], (400, 1))
    contour = Contour(points, axes, closed=True, name=name).resample(count=NODES)
    arm = robot("abb_irb4600_60_205").with_limits(
        acceleration=np.radians([320, 270, 420, 1300, 1400, 2000])
    )
    where = {"tool": TOOL, "placement": PLACEMENT, "gamma_step": np.radians(15)}
    graph = layered_graph(contour, arm, **where)
    found = plan(contour, arm, **where, graph=graph, speed=0.05, eta_v=0.95, eta_a=0.9)
    return ContourSection(name=name, graph=graph, plan=found, checks=CHECKS, path=contour)


@pytest.fixture(scope="module")
def section() -> ContourSection:
    return _section()


@pytest.fixture(scope="module")
def infeasible(section: ContourSection) -> ContourSection:
    return replace(
        section, name="slot", plan=None, checks=(), failure="no edge <here>", broken_at=7
    )


def _own(html: str) -> str:
    """Return the page without plotly's own code."""
    assert html.count(get_plotlyjs()) == 1
    return html.replace(get_plotlyjs(), "")


def _table(html: str, heading: str) -> str:
    """Return the page from below a heading to the end of the next table."""
    return html.split(f">{heading}</h")[1].split("</table>")[0]


def _figures(html: str) -> list[dict]:
    packed = re.findall(r'<script type="application/octet-stream" id="[^"]+">([^<]+)<', html)
    return [json.loads(zlib.decompress(base64.b64decode(text))) for text in packed]


def _codes(trace: dict) -> np.ndarray:
    z = trace["z"]
    assert z["dtype"] == "u1", "codes must travel as bytes, not as numbers in words"
    shape = [int(n) for n in z["shape"].split(",")]
    return np.frombuffer(base64.b64decode(z["bdata"]), np.uint8).reshape(shape)


def test_page_asks_nothing_of_the_network(section: ContourSection) -> None:
    html = _own(render("Part", [section], job_text="x = 1"))
    for fetch in ("http://", "https://", "<link", "src=", "@import", "url(", "<iframe"):
        assert fetch not in html
    assert "fetch(" not in html
    assert "XMLHttpRequest" not in html


def test_the_same_input_gives_the_same_page(section: ContourSection) -> None:
    pages = [render("Part", [section], facts=[("Robot", "ABB")]) for _ in range(2)]
    assert pages[0] == pages[1]
    assert render("Part", [_section()], facts=[("Robot", "ABB")]) == pages[0]


def test_every_text_from_outside_is_escaped(section: ContourSection) -> None:
    bad = "<b>&\"'</b><script>alert(1)</script>"
    check = Check(code="c", title=bad, value=2, limit=1, unit="count", node=0, advice=bad)
    sections = [
        replace(section, name=bad, checks=[check]),
        replace(section, name=bad, plan=None, failure=bad, broken_at=2),
    ]
    html = render(bad, sections, facts=[(bad, bad)], notes=[bad], job_text=bad)
    own = _own(html)
    assert "<b>&\"'" not in own
    assert "<script>alert" not in own
    assert own.count("&lt;script&gt;alert(1)") >= 9
    assert bad not in json.dumps(_figures(html)[0])


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        ({}, "The contour is planned and the audit passed"),
        ({"checks": ()}, "The contour is planned; 1 not audited"),
        ({"plan": None}, "No feasible path for 1 of 1 contour"),
        (
            {"checks": [replace(CHECKS[0], value=1.0)]},
            "Planned, but the audit failed for 1 of 1 contour",
        ),
        (
            {"checks": [replace(CHECKS[0], value=np.nan)]},
            "Planned, but the audit failed for 1 of 1 contour",
        ),
        (
            {"checks": [replace(CHECKS[0], value=1.0, level="warning")]},
            "The contour is planned and the audit passed, with 1 to note",
        ),
    ],
)
def test_verdict_fails_closed(section: ContourSection, change: dict, verdict: str) -> None:
    assert f"</b> {verdict}</span>" in render("Part", [replace(section, **change)])


def test_no_contour_is_not_a_success() -> None:
    html = render("Part", [])
    assert "Nothing was planned" in html
    assert "✓" not in _own(html)


def test_infeasible_section_says_where_and_why(infeasible: ContourSection) -> None:
    html = render("Part", [infeasible])
    assert "no edge &lt;here&gt;" in html
    assert "The path breaks at node 7." in html
    assert "Joint positions" not in html
    figures = _figures(html)
    assert len(figures) == 2, "the scene and the map, no motion"
    marks = [shape for shape in figures[1]["layout"]["shapes"] if shape["x0"] == 7]
    assert {shape["xref"] for shape in marks} == {
        axis.replace("axis", "") for axis in figures[1]["layout"] if axis.startswith("xaxis")
    }


def test_map_shows_the_codes_of_the_graph_in_the_colours_of_its_reasons(
    section: ContourSection,
) -> None:
    graph = section.graph
    figure = json.loads(feasibility_map(graph, section.plan).to_json())
    maps = [trace for trace in figure["data"] if trace["type"] == "heatmap"]
    postures = shown_postures(graph)
    assert [trace["name"] for trace in maps] == [posture_name(mu) for mu in postures]
    colours = reason_colours(graph.reasons)
    for mu, trace in zip(postures, maps, strict=True):
        np.testing.assert_array_equal(_codes(trace), graph.reason[:, :, mu].T)
        scale = trace["colorscale"]
        for code, colour in enumerate(colours):
            share = (code - trace["zmin"]) / (trace["zmax"] - trace["zmin"])
            below = [c for edge, c in scale if edge <= share]
            above = [c for edge, c in scale if edge >= share]
            assert below[-1] == above[0] == colour


def test_legend_names_only_reasons_that_occur(section: ContourSection) -> None:
    graph = section.graph
    figure = feasibility_map(graph, section.plan)
    named = {
        t.name: t.marker.color for t in figure.data if t.type == "scatter" and t.showlegend is None
    }
    present = np.unique(graph.reason[:, :, shown_postures(graph)])
    colours = reason_colours(graph.reasons)
    expected = {graph.reasons[code]: colours[code] for code in present}
    assert {name: colour for name, colour in named.items() if name != "chosen gamma"} == expected


def test_postures_without_an_admitted_candidate_are_told_in_words(
    section: ContourSection,
) -> None:
    reason = np.ones_like(section.graph.reason)
    reason[:, :, 0] = 0
    reason[:2, :, 1] = 4
    graph = replace(section.graph, reason=reason)
    assert shown_postures(graph) == [0]
    told = hidden_postures(graph)
    assert len(told) == 7
    assert told[0] == ("front/up/minus: no admitted candidate (unreachable 95 %, joint 2 low 5 %)")
    assert told[1] == "front/down/plus: unreachable everywhere"


def test_graph_without_any_admitted_candidate_still_has_a_map(section: ContourSection) -> None:
    reason = np.ones_like(section.graph.reason)
    assert len(shown_postures(replace(section.graph, reason=reason))) == 8
    reason[:, :, 2] = 5
    reason[3:, :, 3] = 5
    assert shown_postures(replace(section.graph, reason=reason)) == [3]


def test_chosen_line_passes_the_edge_and_breaks_where_the_posture_changes(
    section: ContourSection,
) -> None:
    gamma = np.radians(np.linspace(100, 260, NODES))
    gamma = np.where(gamma > np.pi, gamma - 2 * np.pi, gamma)
    posture = np.full(NODES, 1)
    posture[30:33] = 0
    made_up = replace(section.plan, gamma=gamma, posture=posture)
    wrap = int(np.flatnonzero(np.diff(gamma) < 0)[0])
    pieces = chosen_line(made_up, 1)
    # On either side of the wrap the line goes on over the edge, to where the other side comes from.
    ends = [(p[0][0], p[0][-1]) for p in pieces]
    assert ends == [(0, wrap + 1), (wrap, 29), (33, NODES - 1)]
    assert pieces[0][1][-1] > 180
    assert pieces[1][1][0] <= -180
    assert [list(p[0]) for p in chosen_line(made_up, 0)] == [[30, 31, 32]]
    assert chosen_line(made_up, 7) == []
    assert all(np.abs(np.diff(g)).max() < 180 for _, g in pieces)
    figure = feasibility_map(section.graph, made_up)
    lines = [
        t for t in figure.data if t.type == "scatter" and t.mode == "lines" and t.x[0] is not None
    ]
    assert {int(np.isnan(t.y).sum()) for t in lines if len(t.x) > 10} == {2}


def test_colours_tell_the_reasons_apart() -> None:
    for name in ("abb_irb4600_60_205", "abb_irb2400_155"):  # the second has a coupling
        reasons = robot(name).reasons()
        colours = dict(zip(reasons, reason_colours(reasons), strict=True))
        assert len(set(colours.values())) == len(reasons)
        for joint in range(1, 7):
            low, high = colours[f"joint {joint} low"], colours[f"joint {joint} high"]
            assert _lightness(low) > _lightness(high)
    assert len(set(JOINT_COLOURS)) == 6


def test_every_joint_has_its_colour_everywhere(section: ContourSection) -> None:
    shares = limit_shares(section.plan)
    assert tuple(t.line.color for t in shares.data) == JOINT_COLOURS * 2
    assert tuple(t.line.color for t in joint_positions(section.plan).data) == JOINT_COLOURS
    table = _table(render("Part", [section]), "Criteria by joint")
    assert all(table.count(colour) == 1 for colour in JOINT_COLOURS)


def test_shares_show_the_limits_and_what_planning_may_use(section: ContourSection) -> None:
    figure = limit_shares(section.plan)
    levels = {shape.y0 for shape in figure.layout.shapes}
    assert levels == {100.0, -100.0, 95.0, -95.0, 90.0, -90.0}
    assert figure.layout.yaxis.range[1] > 100
    np.testing.assert_allclose(
        figure.data[2].y, section.plan.velocity_share[:, 2] * 100, rtol=1e-6, atol=1e-6
    )


def test_positions_are_to_the_scale_of_the_motion_and_endless_joints_unrolled(
    section: ContourSection,
) -> None:
    arm = section.plan.robot.with_limits(endless=[0, 0, 0, 0, 0, 1])
    q = section.plan.q.copy()
    q[:, 5] = np.angle(np.exp(1j * np.linspace(2, 8, NODES)))
    q[:, 4] = 0.3
    figure = joint_positions(replace(section.plan, robot=arm, q=q))
    assert len(figure.layout.shapes) == 10, "two limits for each of the five other joints"
    np.testing.assert_allclose(figure.data[5].y, np.degrees(np.linspace(2, 8, NODES)), rtol=1e-6)
    np.testing.assert_allclose(
        figure.data[0].y, np.degrees(section.plan.q[:, 0]), rtol=1e-6, atol=1e-5
    )
    low, high = figure.layout.yaxis.range
    moved = np.degrees(np.ptp(section.plan.q[:, 0]))
    assert low < min(figure.data[0].y) < max(figure.data[0].y) < high
    assert moved < high - low < 1.2 * moved
    low, high = figure.layout.yaxis5.range
    assert high - low > 1, "a joint at rest is not drawn as if it moved"
    # Rounded to two decimals, as the title says it.
    spare = np.degrees(min(arm.upper[0] - q[:, 0].max(), q[:, 0].min() - arm.lower[0]))
    assert f"{spare:.2f}".rstrip("0") + "° to spare" in figure.layout.annotations[0].text


def test_every_figure_says_where_its_nodes_lie(section: ContourSection) -> None:
    plan = section.plan
    for figure, x in (
        (joint_positions(plan), plan.time),
        (limit_shares(plan), plan.time),
        (cutting_speed(plan), (plan.contour.s - plan.contour.s[0]) * 1e3),
        (feasibility_map(section.graph, plan), np.arange(NODES)),
    ):
        # Four decimals of seconds, two of millimetres.
        np.testing.assert_allclose(figure.layout.meta["nodes"], x, atol=6e-3)


def test_changes_of_posture_are_shaded_and_told(section: ContourSection) -> None:
    posture = np.zeros(NODES, int)
    posture[10:20] = 1
    made_up = replace(section.plan, posture=posture)
    assert posture_runs(made_up) == [(0, 0, 9), (1, 10, 19), (0, 20, NODES - 1)]
    bands = [s for s in limit_shares(made_up).layout.shapes if s.type == "rect"]
    assert len(bands) == 2
    assert "2 changes of posture" in render("Part", [replace(section, plan=made_up)])


def test_a_failed_report_opens_at_the_failed_contour_and_says_first_what_to_do(
    section: ContourSection, infeasible: ContourSection
) -> None:
    advice = "sample the contour more finely"
    bad = replace(section, name="rim", checks=[replace(CHECKS[0], value=1.0, advice=advice)])
    stuck = replace(infeasible, remedy="slow down to 3 m/min")
    facts = [("Robot", "ABB")]
    sections = [section, bad, stuck]
    html = _own(render("Part", sections, facts=facts, faults=["no way between <holes>"]))
    assert html.count("<details") == 3
    assert '<details id="contour-2" open>' in html
    assert html.count("open>") == 1
    head = html[: html.index("</header>")]
    first = head[head.index("What to do first") : head.index('<dl class="facts">')]
    assert first.index("contour-2") < first.index(advice) < first.index("contour-3")
    assert "tool tip, node 3" in first
    assert "path breaks at node 7): cut slower, or relax a limit: slow down" in first
    assert "no way between &lt;holes&gt;" in first
    assert "What to do first" not in render("Part", [section])
    assert "not ready to be cut" in render("Part", [section], faults=["no program"])


def test_places_of_failure_are_marked_on_map_and_part(
    section: ContourSection, infeasible: ContourSection
) -> None:
    bad = replace(section, checks=[replace(CHECKS[0], value=1.0), CHECKS[1]])
    for failed, node in ((bad, 3), (infeasible, 7)):
        figure = scene([section, failed], None)
        (mark,) = [t for t in figure.data if (t.name or "").endswith("fails here")]
        np.testing.assert_allclose(
            [mark.x[0], mark.y[0], mark.z[0]], failed.path.points[node] * 1e3, atol=1e-3
        )
        (label,) = [a for a in figure.layout.scene.annotations if "node" in a.text]
        assert label.text.endswith(f"node {node}")
        drawn = _figures(render("Part", [failed]))[1]
        assert {shape["x0"] for shape in drawn["layout"]["shapes"]} == {node}


def test_scene_draws_part_and_contour_in_millimetres(
    section: ContourSection, infeasible: ContourSection
) -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    figure = scene([section, infeasible], (vertices, [[0, 1, 2]]))
    part = figure.data[0]
    assert part.type == "mesh3d"
    assert max(part.x) == 1000.0
    sides = figure.layout.scene.aspectratio
    assert sides.x / sides.y == pytest.approx(1150 / 1100, rel=1e-6)  # to one scale
    assert figure.layout.scene.xaxis.title.text == "x, mm"
    assert [t.name for t in figure.data].count("slot: fails here") == 1
    with pytest.raises(InputError, match="mesh triangles: expected indices from 0 to 2"):
        scene([section], (vertices, [[0, 1, 3]]))


@pytest.mark.parametrize("size", [(3, 2, 0), (0.2, 0.2, 6), (1, 5, 1)], ids=str)
def test_the_first_view_has_all_of_a_part_however_flat_or_long(
    section: ContourSection, size: tuple[float, float, float]
) -> None:
    corners = np.array(np.meshgrid(*[(0.0, s) for s in size])).reshape(3, -1).T
    figure = scene([section], (corners, [[0, 1, 2]]))
    seen = figure.layout.scene
    eye, up, sides = (
        np.array([each.x, each.y, each.z])
        for each in (seen.camera.eye, seen.camera.up, seen.aspectratio)
    )
    eye /= np.linalg.norm(eye)
    right = np.cross(up, eye) / np.linalg.norm(np.cross(up, eye))
    box = np.array(np.meshgrid(*[(-s / 2, s / 2) for s in sides])).reshape(3, -1).T
    across, along = (np.abs(box @ way).max() for way in (right, np.cross(eye, right)))
    # A browser draws 1.18 of these units above and below the middle; labels need some of them.
    assert max(across / 1.2, along) == pytest.approx(0.9, rel=1e-3)


def test_a_panel_without_curves_says_why(section: ContourSection) -> None:
    assert section.plan is not None
    arm = section.plan.robot
    where = {"tool": TOOL, "placement": PLACEMENT, "gamma_step": np.radians(15)}
    line = Contour([[0, 0, 0], [0.01, 0, 0]], [[0, 0, -1.0]] * 2, closed=False)
    (said,) = limit_shares(plan(line, arm, **where, speed=0.05)).layout.annotations
    assert said.text == "No acceleration to draw: it takes 3 nodes, and the plan has 2"
    assert said.yref == "y2 domain"


def test_labels_of_near_contours_lie_beside_each_other(section: ContourSection) -> None:
    near = [replace(section, name=f"hole {k} of many", path=section.path) for k in range(8)]
    labels = scene(near, None).layout.scene.annotations
    ends = {(each.ax, each.ay) for each in labels}  # they all begin at the same place
    assert len(ends) == len(near)
    for one in labels:
        for other in labels:
            beside = (one.ax > 0) != (other.ax > 0) or abs(one.ay - other.ay) >= 20
            assert one is other or beside


def test_scene_draws_moves_between_contours_and_marks_in_their_measure(
    section: ContourSection,
) -> None:
    plate = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0.0]]), [[0, 1, 2]]
    way = np.array([[0, 0, 0.1], [0.1, 0, 0.2]])
    figure = scene([section], plate, moves=[way, way + 0.1])
    moves = [trace for trace in figure.data if (trace.name or "").startswith("transfer move ")]
    np.testing.assert_allclose(moves[0].x, [0, 100])
    np.testing.assert_allclose(moves[1].z, [200, 300])
    extent = np.linalg.norm(np.ptp(section.path.points * 1e3, axis=0))
    (cone,) = [trace for trace in figure.data if trace.type == "cone"]
    assert cone.sizeref == pytest.approx(0.3 * extent)  # and not 0.03 of the plate's 12.7 m
    assert "transfer moves" in render("Part", [section], moves=[way])
    assert "transfer moves" not in render("Part", [section])


def test_audit_table_speaks_millimetres_degrees_and_per_cent(section: ContourSection) -> None:
    turned = Check(code="d", title="axis", value=np.pi, limit=np.pi / 180, unit="rad", node=-1)
    table = _table(render("Part", [replace(section, checks=[*CHECKS, turned])]), "Audit")
    assert "0.02 mm" in table
    assert "≤ 0.1 mm" in table
    assert "14.5 %" in table
    assert "180°" in table
    assert "≤ 1°" in table
    assert table.count("passed") == 2
    assert table.count("</b> failed") == 1


def test_tables_add_up(section: ContourSection) -> None:
    counts = section.graph.counts()
    page = render("Part", [section])
    table = _table(page, "Candidates")
    assert sum(counts.values()) == section.graph.reason.size
    assert all(word in table for word in counts)
    assert max(counts.values()) >= 1000
    shown = {int(n.replace(",", "")) for n in re.findall(r'<td class="n">([\d,]+)</td>', table)}
    assert shown == set(counts.values())
    row = _table(page, "Contours")
    assert "3.00" in row, "0.05 m/s is 3 m/min"
    assert f"{section.path.length * 1e3:.1f}" in row


def test_the_table_of_contours_has_bound_and_gap_and_the_page_says_what_they_are(
    section: ContourSection,
) -> None:
    proof = replace(section.plan.proof, bound=None, gap=None)
    plain = replace(section, plan=replace(section.plan, proof=proof))
    page = render("x", [plain])
    assert _table(page, "Contours").count('<td class="n">-</td>') == 2
    assert "no motion that keeps" not in page
    proof = replace(proof, bound=12.3456, gap=0.00123)
    bounded = replace(section, plan=replace(section.plan, proof=proof))
    row = _table(render("x", [bounded]), "Contours")
    assert "12.34<" in row, "never more than is proved"
    assert "0.13<" in row, "never less than it may be, in per cent"
    page = render("x", [plain, bounded])
    assert "Bound: no motion that keeps the velocity and acceleration limits" in page


def test_section_refuses_parts_of_different_length(section: ContourSection) -> None:
    with pytest.raises(
        InputError, match="expected the same nodes throughout, got graph 41, path 11"
    ):
        replace(section, plan=None, path=section.path.resample(count=11))


def test_fine_maps_stay_small(section: ContourSection) -> None:
    # The budget: eight contours of 1500 x 360 x 8 candidates in 12 MB, plotly (5 MB) included.
    K, m = 1500, 360
    x, y = np.meshgrid(np.linspace(0, 9, K), np.linspace(0, 2 * np.pi, m), indexing="ij")
    reason = np.empty((K, m, 8), np.uint8)
    for mu in range(8):
        reason[:, :, mu] = np.floor(3 + 2.9 * np.sin(x + mu) * np.cos(2 * y + x))
    graph = LayeredGraph(
        q=np.zeros((0, 6)),
        start=np.zeros(K + 1, int),
        gamma=np.linspace(-np.pi, np.pi, m + 1)[1:],
        tilt=np.zeros((1, 2)),
        sample=np.zeros(0, int),
        variant=np.zeros(0, int),
        posture=np.zeros(0, int),
        turn=np.zeros((0, 6), int),
        reason=reason,
        reasons=section.graph.reasons,
    )
    path = section.path.resample(count=K)
    fine = ContourSection(name="fine", graph=graph, path=path, failure="made up")
    assert len(_own(render("Part", [fine]))) < 0.8e6


@pytest.mark.slow
@needs_chromium
def test_browser_draws_every_figure_in_view(
    section: ContourSection, infeasible: ContourSection, tmp_path: Path
) -> None:
    page = tmp_path / "report.html"
    page.write_text(render("Part", [section, infeasible, infeasible]), encoding="utf-8")
    dom = dom_of(page, "#contour-1")
    # The scene, three figures of the first contour, which the address names, and the map of the
    # second, the first that failed; the third is closed.
    assert dom.count('data-state="drawn"') == 5
    assert dom.count("data-figure=") == 6
    assert dom.count('class="main-svg"') >= 5
    assert 'data-state="failed"' not in dom
    assert 'class="trouble"' not in dom
    assert "WebGL is not supported" not in dom
    assert "Share chart" not in dom, "the button that uploads the data to plotly"
    assert "Download plot" in dom


@pytest.mark.slow
@needs_chromium
def test_pointing_at_a_figure_marks_the_node_in_all_of_the_contour_and_on_the_part(
    section: ContourSection, tmp_path: Path
) -> None:
    page = tmp_path / "report.html"
    # The browser's clock of this test runs ahead of its frames: a frame here is 16 ms of the clock.
    frames = "<script>requestAnimationFrame = (draw) => setTimeout(draw, 16);</script>"
    script = """<script>
    document.addEventListener("drawn", async () => {
      const plots = [...document.querySelectorAll("#contour-1 [data-figure]")];
      if (plots.some((plot) => plot.dataset.state !== "drawn") || window.tried) return;
      if (SCENE.dataset.state !== "drawn") return;
      window.tried = true;
      const x = plots[1].layout.meta.nodes[20];
      plots[1].emit("plotly_hover", { points: [{ x, data: plots[1].data[0] }] });
      await new Promise((done) => setTimeout(done, 500));
      const { x: at } = SCENE.data.find((trace) => trace.name === "cursor");
      const lines = plots.map((plot) => plot.querySelectorAll(".cursor").length);
      document.body.dataset.seen = JSON.stringify({ lines, at: at[0] });
    });
    </script></body>"""
    html = render("Part", [section]).replace("<head>", f"<head>{frames}", 1)
    assert frames in html
    page.write_text(script.join(html.rsplit("</body>", 1)), encoding="utf-8")
    dom = dom_of(page)
    seen = json.loads(re.search(r'data-seen="([^"]+)"', dom)[1].replace("&quot;", '"'))
    panels = len(shown_postures(section.graph))
    assert seen["lines"] == [panels, 6, 2]
    assert seen["at"] == pytest.approx(section.path.points[20, 0] * 1e3, abs=1.0)


def _lightness(colour: str) -> int:
    return sum(int(colour[i : i + 2], 16) for i in (1, 3, 5))


def test_a_feed_that_dips_is_drawn(section: ContourSection) -> None:
    plan = section.plan
    time = plan.time.copy()
    time[10:] += 0.5
    feed = Feed(full=0.9, slowest=0.2, node=9, joint=3, limit="acceleration")
    dipped = replace(plan, time=time, feed=feed)
    shown = cutting_speed(dipped).data[0]
    speed = np.diff(plan.contour.s) / np.diff(time) * 60
    np.testing.assert_allclose(shown.y[:-1], speed, rtol=1e-5)
    assert np.argmin(shown.y) == 9
    html = render("x", [replace(section, plan=dipped)], facts=[], notes=[])
    assert "Full speed on 90.0% of the length" in html
    assert "Cutting speed" not in render("x", [section], facts=[], notes=[])
