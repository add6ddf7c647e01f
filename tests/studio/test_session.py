"""A session: the job is planned, changed and planned again, and every page sees the same."""

import base64
import re
import struct
import tomllib

import numpy as np
import pytest

from kerfpath.job import Job, read_job, run_job, write_result
from kerfpath.kernels.metric import wrap
from studio.talk import QUICK, serving, talking, write_job

SEQUENCE = """
[sequence]
home_deg = [0, -20, 10, 0, 60, 0]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("studio")


@pytest.fixture(scope="module")
def planned(folder):
    """A studio whose job has been planned, and what its page has heard by then."""
    with serving(write_job(folder, name="planned.toml")) as client, talking(client) as page:
        page.done(1)
        yield client, page, page.heard[:]


def last(heard, kind, **keys):
    fitting = [m for m in heard if m["type"] == kind and keys.items() <= m.items()]
    return fitting[-1]


def matrix(numbers):
    return np.array(numbers).reshape(4, 4)


def forward(robot, q):
    """Forward kinematics as the page has it: joint after joint, each about its axis."""
    T = np.eye(4)
    for joint, angle in zip(robot["joints"], q, strict=True):
        x, y, z = joint["axis"]
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = np.eye(4)
        turn[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        T = T @ matrix(joint["T"]) @ turn
    return T @ matrix(robot["T_flange"]) @ matrix(robot["T_tool"])


def test_the_scene_says_the_robot_so_that_a_page_finds_its_poses(planned):
    _, _, heard = planned
    scene = last(heard, "scene")
    found = forward(scene["robot"], scene["sample"]["q"])
    # Products of six matrices of numbers of order one, in double precision.
    assert found == pytest.approx(matrix(scene["sample"]["T"]), abs=1e-12)


def test_plans_lead_the_tip_along_their_contours_in_the_scene(planned):
    _, _, heard = planned
    scene = last(heard, "scene")
    for contour in scene["contours"]:
        made = last(heard, "plan", contour=contour["name"])
        points = np.array(made["points"]).reshape(-1, 3)
        q = np.array(made["q"]).reshape(len(points), 6)
        tips = np.array([forward(scene["robot"], one)[:3, 3] for one in q])
        # Joints are said to a nanoradian, at arms of metres; refinement ends below a micrometre.
        assert tips == pytest.approx(points, abs=1e-6)
        assert points == pytest.approx(np.array(contour["points"]).reshape(-1, 3), abs=1e-8)
        assert (np.diff(made["time"]) > 0).all()
        speed = np.diff(made["s"]) / np.diff(made["time"])
        assert made["speed"] == pytest.approx(speed, rel=1e-6)  # of numbers to a nanometre
        assert made["settled"]
        assert made["passed"]
        assert made["previous_cost"] is None
        shares = np.abs(made["velocity_share"]), np.abs(made["acceleration_share"])
        # Rounded to a millionth.
        assert max(made["joint_load"]) == pytest.approx(max(s.max() for s in shares), abs=1e-6)


def test_executed_paths_are_beside_their_contours_as_far_as_the_audit_says(planned):
    _, _, heard = planned
    for contour in last(heard, "scene")["contours"]:
        made = last(heard, "plan", contour=contour["name"])
        drawn, tip = (np.array(made["executed"][key]).reshape(-1, 3) for key in ("drawn", "tip"))
        off = np.linalg.norm(tip - drawn, axis=1)
        (said,) = [each for each in made["checks"] if each["code"] == "tip-as-run"]
        assert made["executed"]["largest"] == said["value"]
        # Points are rounded to 0.1 um, and are not at the very instant of the largest error.
        assert 0.9 * said["value"] < off.max() < said["value"] + 1e-6
        assert "assumed" in made["executed"]["joints"]
        points = np.array(contour["points"]).reshape(-1, 3)
        apart = np.linalg.norm(drawn[:, None] - points[None], axis=2).min(axis=1)
        assert apart.max() < 2e-3  # as far as nodes are from each other


def test_robot_and_head_are_seen_before_the_drawing_has_been_read(planned):
    _, _, heard = planned
    soon, scene = (message for message in heard if message["type"] == "scene")
    assert {body["kind"] for body in soon["bodies"]} == {"robot", "head"}
    assert soon["contours"] == []
    assert soon["robot"] == scene["robot"]
    assert [body for body in scene["bodies"] if body["kind"] != "part"] == soon["bodies"]


def test_meshes_are_those_of_the_bodies_and_never_change(planned):
    client, _, heard = planned
    scene = last(heard, "scene")
    kinds = {body["kind"] for body in scene["bodies"]}
    assert kinds >= {"robot", "head", "part"}
    assert not scene["cell"]
    frames = {body["frame"] for body in scene["bodies"]}
    assert frames <= set(range(7))
    for body in scene["bodies"]:
        answer = client.get(f"/mesh/{body['mesh']}")
        assert "immutable" in answer.headers["cache-control"]
        nv, nt = struct.unpack_from("<2I", answer.content)
        assert len(answer.content) == 8 + 12 * nv + 12 * nt
        corners = np.frombuffer(answer.content, "<u4", offset=8 + 12 * nv)
        assert corners.max() < nv
    part = next(body for body in scene["bodies"] if body["kind"] == "part")
    data = client.get(f"/mesh/{part['mesh']}").content
    points = np.frombuffer(data, "<f4", 3 * struct.unpack_from("<I", data)[0], 8).reshape(-1, 3)
    on_it = np.array(scene["contours"][0]["points"]).reshape(-1, 3)
    apart = np.linalg.norm(points[None] - on_it[::9, None], axis=2).min(axis=1)
    assert apart.max() < 5e-3  # the mesh has a corner near every place of the edge of a hole


def test_the_program_is_played_in_its_order_without_a_gap(planned):
    _, _, heard = planned
    program, plans = last(heard, "program"), {m["name"]: m for m in heard if m["type"] == "plan"}
    segments = program["segments"]
    kinds = [segment["kind"] for segment in segments]
    assert kinds == ["approach", "cut", "retract", "move", "approach", "cut", "retract"]
    assert "have not been checked for collisions" in program["notes"][0]
    clock, here = 0.0, None
    for segment in segments:
        made = plans.get(segment["plan"], segment)
        q = np.array(made["q"]).reshape(-1, 6)
        assert segment["begin"] == pytest.approx(clock, abs=1e-9)
        assert made["time"][0] == 0
        assert made["time"][-1] == pytest.approx(segment["end"] - segment["begin"], abs=1e-8)
        if here is not None:
            # Joints are said to a nanoradian; a plan counts the turns of endless ones anew.
            assert wrap(q[0] - here) == pytest.approx(0, abs=1e-6)
        clock, here = segment["end"], q[-1]
    assert program["total"] == pytest.approx(clock)
    move = segments[3]
    q, time = np.array(move["q"]).reshape(-1, 6), np.array(move["time"])
    speed = np.diff(q, axis=0) / np.diff(time)[:, None]
    scene = last(heard, "scene")
    limits = np.array([joint["velocity"] for joint in scene["robot"]["joints"]])
    assert (np.abs(speed) <= limits * (1 + 1e-6)).all()  # of numbers to a nanoradian
    assert np.abs(speed[0]).max() < np.abs(speed[len(speed) // 2]).max() / 5  # it gains speed


@pytest.mark.slow
def test_the_outcome_is_that_of_the_command(planned, folder):
    client, _, heard = planned
    outcome = last(heard, "outcome")
    assert outcome["passed"]
    assert all(export["ready"] for export in outcome["exports"])
    job = read_job(folder / "planned.toml")
    written = write_result(run_job(job), folder / "by-command")
    for name in ("plan.json", "trajectory.csv"):
        by_command = (folder / "by-command" / name).read_text()
        assert client.get(f"/export/{name}").text == by_command
    program = next(f for f in written.files if f.suffix == ".mod")
    answer = client.get("/export/program")
    assert answer.text == program.read_text()
    assert program.name in answer.headers["content-disposition"]
    report = client.get("/report")
    assert report.status_code == 200
    assert report.headers["content-security-policy"].startswith("sandbox")
    cycle = outcome["cycle"]
    parts = cycle["cutting"] + cycle["air"] + cycle["piercing"]
    assert cycle["total"] == pytest.approx(parts)


@pytest.mark.parametrize(("language", "file"), [("krl", "planned.zip"), ("urscript", ".script")])
def test_the_program_is_had_in_another_language(planned, language, file):
    client, page, _ = planned
    page.say("program", language=language)
    said = page.until("program_text")
    answer = client.get(f"/export/program?language={language}")
    if said["files"]:
        assert answer.status_code == 200
        assert said["language"] == language
    else:
        assert answer.status_code == 409
        assert said["faults"]


def test_an_unknown_language_is_refused_in_one_line(planned):
    client, page, _ = planned
    page.say("program", language="cobol")
    assert "cobol" in page.until("error", about="program")["message"]
    assert client.get("/export/program?language=cobol").status_code == 409


def test_the_map_says_what_became_of_every_pose(planned):
    _, page, heard = planned
    page.say("map", contour="slot")
    found, made = page.until("map"), last(heard, "plan", contour="slot")
    assert found["graph"] == made["graph"]
    assert found["s"] == made["s"]
    assert len(found["reasons"]) == len(found["kinds"]) == len(found["colours"])
    assert {"front/up/plus", "front/up/minus"} == {layer["name"] for layer in found["layers"]}
    codes = {}
    for layer in found["layers"]:
        data = np.frombuffer(base64.b64decode(layer["codes"]), np.uint8)
        codes[layer["posture"]] = data.reshape(found["nodes"], len(found["gamma"]))
        assert data.max() < len(found["reasons"])
    # The course goes by admitted samples, or between two of them.
    (course,) = found["course"]
    step = found["gamma"][1] - found["gamma"][0]
    for k, (gamma, mu) in enumerate(zip(course["gamma"], course["posture"], strict=True)):
        near = np.abs(wrap(np.array(found["gamma"]) - gamma)) <= step + 1e-9
        kinds = {found["kinds"][code] for code in codes[mu][k][near]}
        assert "admitted" in kinds


def test_a_place_of_the_map_says_the_pose_and_its_reason(planned):
    _, page, heard = planned
    page.say("map", contour="slot")
    found, scene = page.until("map"), last(heard, "scene")
    codes = np.frombuffer(base64.b64decode(found["layers"][0]["codes"]), np.uint8)
    codes = codes.reshape(found["nodes"], -1)
    seen = set()
    for code, words in enumerate(found["reasons"]):
        places = np.argwhere(codes == code)
        if not len(places):
            continue
        node, sample = map(int, places[len(places) // 2])
        gamma, mu = found["gamma"][sample], found["layers"][0]["posture"]
        page.say("reason", contour="slot", node=node, gamma=gamma, posture=mu)
        said = page.until("pose")
        assert said["reason"].startswith(words)
        assert said["admitted"] == (found["kinds"][code] == "admitted")
        if said["q"] is not None:
            tip = forward(scene["robot"], said["q"])[:3, 3]
            contour = next(c for c in scene["contours"] if c["name"] == "slot")
            # Joints are said to a nanoradian, at an arm of metres.
            assert tip == pytest.approx(contour["points"][3 * node : 3 * node + 3], abs=1e-7)
        if found["kinds"][code] == "joint":
            assert " deg, its limits are " in said["reason"]
        seen.add(found["kinds"][code])
    assert "admitted" in seen
    page.say("reason", contour="slot", node=10**5, gamma=0, posture=0)
    assert "expected a node below" in page.until("error", about="reason")["message"]


def test_values_have_every_key_with_its_default(planned):
    _, _, heard = planned
    job = last(heard, "job")
    assert job["values"]["plan"]["metric"] == "manhattan"
    assert job["values"]["plan"]["gamma_step_deg"] == 3
    assert job["values"]["contour"][1]["spacing_mm"] == 1
    groups = last(heard, "options")["groups"]
    assert "plan.metric" in [field["key"] for group in groups for field in group["fields"]]
    assert job["contours"] == [{"name": "hole 10", "index": 0}, {"name": "slot", "index": 1}]
    made = last(heard, "plan", contour="hole 10")
    assert job["weights"] == pytest.approx(made["weights"])


@pytest.fixture
def studio(folder, request):
    """A studio of its own, planned; the job is named after the test."""
    path = write_job(folder, getattr(request, "param", QUICK), f"{request.node.name[:40]}.toml")
    with serving(path) as client, talking(client) as page:
        page.done(1)
        yield client, page, path


def test_an_edit_is_planned_again_at_once_and_undone(studio):
    _, page, path = studio
    before = last(page.heard, "plan", contour="slot")
    weights = [3 * w if i == 0 else w for i, w in enumerate(before["weights"])]
    page.say("focus", contour="slot")
    page.say("edit", path=["plan", "weights"], value=weights)
    job = page.until("job", revision=2)
    assert (job["undo"], job["redo"], job["saved"]) == (True, False, False)
    assert tomllib.loads(job["text"])["plan"]["weights"] == pytest.approx(weights, rel=1e-11)
    draft = page.until("plan", revision=2)
    assert draft["contour"] == "slot"
    assert draft["graph"] == before["graph"]
    assert draft["statement"].startswith("a draft")
    assert (draft["settled"], draft["checks"], draft["passed"]) == (False, None, None)
    assert draft["executed"] is None
    made = page.until("plan", revision=2, contour="slot")
    assert made["passed"]
    # A draft keeps the limits; what the search finds everywhere is better, or as good.
    assert made["cost"] <= draft["cost"] * (1 + 1e-6)
    assert made["previous_cost"] == before["cost"]
    assert np.abs(wrap(np.array(made["gamma"]) - before["gamma"])).max() > 1e-3
    page.done(2)
    page.say("undo")
    assert page.until("job", revision=3)["text"] == path.read_text()
    again = page.until("plan", revision=3, contour="slot", passed=True)
    assert again["cost"] == before["cost"]
    assert again["q"] == before["q"]


@pytest.mark.slow
def test_what_has_not_changed_is_not_planned_again(studio, monkeypatch):
    _, page, _ = studio
    asked, real = [], Job.graph

    def graph(job, nodes, *rest, only=None, **more):
        if only is None:  # what is foreseen looks at the ends alone
            asked.append(nodes.name)
        return real(job, nodes, *rest, only=only, **more)

    monkeypatch.setattr(Job, "graph", graph)
    page.say("edit", path=["contour", 1, "speed_m_min"], value=2.5)
    page.done(2)
    assert asked == []  # the nodes are where they were
    page.say("edit", path=["contour", 1, "spacing_mm"], value=1.5)
    page.done(3)
    assert asked == ["slot"]
    page.say("edit", path=["plan", "gamma_step_deg"], value=4)
    page.done(4)
    assert sorted(asked[1:]) == ["hole 10", "slot"]


def test_the_newest_of_many_edits_wins(studio):
    _, page, _ = studio
    for i in range(30):
        page.say("edit", path=["plan", "eta_velocity"], value=0.9 - i / 100, gesture="drag")
    outcome = page.done(31)
    assert outcome["revision"] == 31
    revisions = [m["revision"] for m in page.heard if m["type"] == "plan"]
    assert revisions == sorted(revisions)
    assert {m["revision"] for m in page.heard if m["type"] == "outcome"} == {1, 31}
    page.say("undo")
    assert not page.until("job", revision=32)["undo"]


def test_a_fault_is_said_with_its_key_and_undone(studio):
    _, page, path = studio
    page.say("edit", path=["plan", "metric"], value="nonsense")
    job = page.until("job", revision=2)
    (fault,) = job["faults"]
    assert fault["key"] == ["plan", "metric"]
    assert job["text"].split("\n")[fault["line"] - 1] == 'metric = "nonsense"'
    assert fault["message"].startswith("expected 'manhattan'")
    assert job["values"] is None
    page.say("edit", path=["contour", 1, "speed_m_min"], value=-1)
    job = page.until("job", revision=3)
    assert ["contour", 1, "speed_m_min"] in [fault["key"] for fault in job["faults"]]
    page.say("undo")
    page.say("undo")
    job = page.until("job", lambda m: not m["faults"])
    assert job["text"] == path.read_text()
    page.done(job["revision"])


def test_a_loop_that_there_is_not_is_a_fault(studio):
    _, page, _ = studio
    page.say("edit", path=["contour", 0, "pick"], value="skin/hole99")
    job = page.until("job", lambda m: m["faults"])
    assert "hole99" in job["faults"][0]["message"]
    page.say("text", text="[robot\n")
    job = page.until("job", lambda m: m["faults"] and m["revision"] == 3)
    assert "not valid TOML" in job["faults"][0]["message"]
    page.say("edit", path=["plan", "metric"], value="max")
    assert "not valid TOML" in page.until("error", about="edit")["message"]


FAR = re.sub(r"xyz_mm = \[.*\]", "xyz_mm = [2500, -600, 500]", QUICK, count=1)


def test_a_part_out_of_reach_is_moved_by_one_button_as_a_plan_says(folder):
    path = write_job(folder, FAR, name="far.toml")
    with serving(path) as client, talking(client) as page:
        page.done(1)
        found = {m["contour"]: m for m in page.heard if m["type"] == "nopath"}
        assert set(found) == {"slot", "hole 10"}
        failures = {cut.contour: cut.failure for cut in run_job(read_job(path)).cuts}
        for name, answer in found.items():
            assert failures[name].startswith(answer["remedy"])
            (option,) = answer["relaxations"]  # slower motions have no poses, either
            assert re.fullmatch(r"move the part \d+ mm towards the robot", option["label"])
        page.say("relax", contour="slot", index=0)
        moved = page.until("job", revision=2)
        by = re.search(r"by (.*) mm in", found["slot"]["remedy"])[1].split()
        moved_by = np.subtract(moved["values"]["part"]["xyz_mm"], [2500, -600, 500])
        assert moved_by == pytest.approx([float(v) for v in by], abs=1e-6)
        page.done(2)
        now = [m for m in page.heard if m.get("revision") == 2]
        assert {m["contour"] for m in now if m["type"] in ("plan", "nopath")} == set(found)
        assert not any("moved" in m["remedy"] for m in now if m["type"] == "nopath")
        page.say("undo")
        assert page.until("job", revision=3)["text"] == FAR


@pytest.mark.slow
def test_no_path_says_why_and_its_relaxations_open_the_way(studio):
    _, page, _ = studio
    page.say("edit", path=["contour", 1, "speed_m_min"], value=60)
    soon = page.until("nopath", contour="slot")
    assert soon["relaxations"] is None
    assert soon["statement"]
    program = page.until("program", revision=2)
    assert program["segments"] == []
    assert "no path for slot" in program["notes"][0]
    found = page.until("nopath", contour="slot")
    assert found["relaxations"]
    labels = [option["label"] for option in found["relaxations"]]
    assert labels[0].startswith("cut slower: ")
    page.done(2)
    page.say("relax", contour="slot", index=0)
    made = page.until("plan", contour="slot", revision=3, passed=True)
    asked = found["relaxations"][0]["edits"][0]
    assert asked["path"] == ["contour", 1, "speed_m_min"]
    length = made["s"][-1]
    assert length / made["time"][-1] * 60 == pytest.approx(asked["value"], rel=0.2)
    page.say("relax", contour="slot", index=99)
    assert "no relaxation" in page.until("error", about="relax")["message"]


@pytest.mark.slow
def test_the_fastest_speed_is_found_and_can_be_cut_at(studio):
    _, page, _ = studio
    page.say("fastest", contour="slot")
    found = page.until("fastest")
    assert found["speed_m_min"] >= found["on_grid_m_min"] > 3
    (edit,) = found["edits"]
    page.say("edit", **edit)
    page.until("plan", contour="slot", revision=2, passed=True)


def test_two_pages_see_the_same_and_a_new_one_sees_it_at_once(studio):
    client, page, _ = studio
    with talking(client) as other:
        kinds = [other.hear()["type"] for _ in range(9)]
        expected = "job options outcome part plan plan program progress scene"
        assert sorted(kinds) == expected.split()
        other.say("edit", path=["plan", "metric"], value="euclid")
        for one in (page, other):
            assert one.until("job", revision=2)["values"]["plan"]["metric"] == "euclid"
            made = one.until("plan", contour="slot", revision=2, passed=True)
            one.made = made
        assert page.made == other.made
        other.say("map", contour="slot")
        other.until("map")
    page.say("undo")
    page.until("job", revision=3)
    assert not any(m["type"] == "map" for m in page.heard)


def test_work_is_found_again_after_the_server_has_gone(folder):
    path = write_job(folder, name="gone.toml")
    with serving(path) as client, talking(client) as page:
        page.until("job")
        page.say("edit", path=["plan", "metric"], value="chebychev")
        text = page.until("job", revision=2)["text"]
    assert path.read_text() == QUICK
    with serving(path) as client, talking(client) as page:
        job = page.until("job")
        assert job["text"] == text
        assert (job["saved"], job["undo"]) == (False, True)
        page.say("save")
        assert page.until("job", saved=True)["text"] == text
    assert path.read_text() == text


@pytest.mark.slow
def test_cancel_stops_and_plan_goes_on(folder):
    with serving(write_job(folder, name="cancel.toml")) as client, talking(client) as page:
        page.until("scene", lambda message: message["contours"])
        page.say("cancel")
        page.until("progress", busy=False)
        page.say("plan")
        assert page.done(1)["passed"]


@pytest.mark.parametrize("studio", [QUICK + SEQUENCE], indirect=True)
def test_the_moves_between_contours_are_those_of_the_run(studio):
    _, page, path = studio
    program = last(page.heard, "program")
    kinds = [segment["kind"] for segment in program["segments"]]
    assert kinds == ["move", *["approach", "cut", "retract", "move"] * 2]
    home = np.radians([0, -20, 10, 0, 60, 0])
    for segment, end in ((program["segments"][0], 0), (program["segments"][-1], -1)):
        q = np.array(segment["q"]).reshape(-1, 6)[end]
        assert wrap(q - home) == pytest.approx(0, abs=1e-8)  # to a nanoradian
    result = run_job(read_job(path))
    assert program["total"] == pytest.approx(result.part.cycle_time, rel=1e-6)
    cycle = last(page.heard, "outcome")["cycle"]
    assert cycle["cutting"] == pytest.approx(result.part.cutting_time, rel=1e-6)
