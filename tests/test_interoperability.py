"""Plans and robots as other Python packages take them: tables, notebooks, the page on all of it."""

import csv
import io
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pinocchio as pin
import plotly.graph_objects as go
import pytest
from ruamel.yaml import YAML
from tests.post.external_cells import moving_plan

import kerfpath
from conftest import ROOT
from kerfpath import InputError, Tilt, plot, robot
from kerfpath.job.output.writing import trajectory_text
from kerfpath.post import joint_trajectory, post
from kerfpath.post.ros import RosSettings
from kerfpath.report.motion import cutting_speed, joint_positions, limit_shares
from programs import arc, frames, hand_plan

PAGE = (ROOT / "docs" / "interoperability.md").read_text(encoding="utf-8")
SHOWN = {"rad": ("deg", 180 / np.pi), "m": ("mm", 1e3)}
"""What trajectory.csv has in place of SI, and the factor."""


@pytest.fixture(scope="module")
def plain(arm):
    return hand_plan(arc(count=9), arm, *frames())


def carried(arm, *names):
    """A plan on a gantry's linear axes of these names, and a table, all of which move."""
    slow = {"velocity": 2.0, "acceleration": 4.0}
    cell = arm
    for i, name in enumerate(names):
        cell = cell.on_rail(np.eye(3)[i], lower=-1.0, upper=1.0, name=name, **slow)
    tool, placement = frames()
    cell = cell.with_positioner(
        [0, 0, 1], placement[:3, 3], lower=-1.0, upper=1.0, name="table", **slow
    )
    share = np.linspace(0, 1, 7)[:, None]
    course = share * np.linspace(0.03, 0.1, len(cell.externals))
    return moving_plan(arc(count=7), cell, tool, placement, course)


# Tables.


def test_a_table_says_what_the_plan_says(plain):
    table = plain.to_pandas()
    assert isinstance(table, pd.DataFrame)
    assert len(table) == len(plain.q)
    np.testing.assert_array_equal(table[[f"q{i}_rad" for i in range(1, 7)]], plain.q)
    np.testing.assert_array_equal(table[["x_m", "y_m", "z_m"]], plain.points)
    np.testing.assert_array_equal(table[["axis_x", "axis_y", "axis_z"]], plain.axes)
    for name, values in (("t_s", plain.time), ("gamma_rad", plain.gamma), ("s_m", plain.contour.s)):
        np.testing.assert_array_equal(table[name], values)
    # Way over time, as hand_plan was asked for: 0.1 m/s; nothing follows the last node.
    np.testing.assert_allclose(table["speed_m_s"][:-1], 0.1, rtol=1e-6)
    assert np.isnan(table["speed_m_s"].iloc[-1])
    assert "lead_rad" not in table
    assert table["contour"].unique().tolist() == [plain.name]


@pytest.mark.parametrize("names", [(), ("rail",), ("x", "y")])
def test_a_table_and_trajectory_csv_have_the_same_names_and_values(arm, names):
    plan = carried(arm, *names)
    kept = pd.read_csv(io.StringIO(trajectory_text([plan])))
    table = plan.to_pandas().drop(columns=["s_m", "speed_m_s"])
    shown = {}
    for name, values in table.items():
        stem, _, unit = name.rpartition("_")
        word, factor = SHOWN.get(unit, ("", 1.0))
        shown[f"{stem}_{word}" if word else name] = values * factor if word else values
    assert list(shown) == list(kept)
    for name, values in shown.items():
        if name in ("contour", "kind"):
            assert values.tolist() == kept[name].tolist()
        else:  # a multiplication, in another order: one rounding
            np.testing.assert_allclose(values, kept[name], rtol=1e-15)


def test_an_axis_called_as_a_column_of_the_tool_has_a_column_of_its_own(arm):
    plan = carried(arm, "x", "y")
    table = plan.to_pandas()
    np.testing.assert_array_equal(table[["x_axis_m", "y_axis_m", "table_rad"]], plan.external)
    np.testing.assert_array_equal(table[["x_m", "y_m"]], plan.points[:, :2])
    header = next(csv.reader(io.StringIO(trajectory_text([plan]))))
    assert len(set(header)) == len(header)


def test_a_tilt_has_columns_where_it_was_asked_for(plain):
    asked = replace(plain.settings, tilt=Tilt(cone=0.05, steps=1))
    tilt = np.linspace(0, 0.02, 2 * len(plain.q)).reshape(-1, 2)
    table = replace(plain, tilt=tilt, settings=asked).to_pandas()
    np.testing.assert_array_equal(table[["lead_rad", "lean_rad"]], tilt)


def test_tables_of_several_contours_stand_below_each_other(arm):
    plans = [hand_plan(arc(name, count=5), arm, *frames()) for name in ("one", "two")]
    table = pd.concat([plan.to_pandas() for plan in plans], ignore_index=True)
    assert table.groupby("contour")["node"].max().tolist() == [4, 4]


def test_without_pandas_the_columns_are_there_and_to_pandas_says_what_to_install(
    plain, monkeypatch
):
    monkeypatch.setitem(sys.modules, "pandas", None)
    assert plain.columns["q1_rad"].shape == (len(plain.q),)
    with pytest.raises(InputError, match=r"Plan.to_pandas: pandas is .* 'kerfpath\[tables\]'"):
        plain.to_pandas()


def test_the_core_imports_nothing_of_its_extras():
    code = (
        "import sys, kerfpath; [getattr(kerfpath, n) for n in ('Plan', 'Robot', 'plan', 'robot')];"
        "sys.exit(bool({'pandas', 'plotly', 'OCP', 'pinocchio'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# Motions.


def test_rates_are_those_of_a_parabola_wherever_its_nodes_are(plain):
    """A law: of a motion that is one parabola they are exact, at the ends as well."""
    rng = np.random.default_rng(3)
    time = np.concatenate([[0.0], np.cumsum(rng.uniform(0.02, 0.2, len(plain.q) - 1))])
    c0, c1, c2 = rng.normal(size=(3, 6)) * [[0.1], [0.1], [0.05]]
    q = c0 + c1 * time[:, None] + c2 * time[:, None] ** 2
    motion = replace(plain, q=q, time=time).motion
    np.testing.assert_allclose(motion.q, q, atol=1e-14)
    # Second differences of numbers of about 1 over steps of 0.02 s: 1e-16 / 4e-4 each.
    np.testing.assert_allclose(motion.v, c1 + 2 * c2 * time[:, None], atol=1e-12)
    np.testing.assert_allclose(motion.a, np.tile(2 * c2, (len(time), 1)), atol=1e-10)


def test_two_nodes_are_a_straight_line(arm):
    two = hand_plan(arc(count=2), arm, *frames())
    slope = np.diff(two.q, axis=0) / two.time[-1]
    np.testing.assert_allclose(two.motion.v, np.vstack([slope, slope]), rtol=1e-12)
    assert not two.motion.a.any()


def test_an_endless_joint_goes_on_where_the_plan_is_wrapped(plain):
    q = np.array(plain.q)
    q[:, 5] = np.linspace(3.0, 3.8, len(q))
    expected = q[:, 5].copy()
    q[q > np.pi] -= 2 * np.pi
    motion = replace(plain, q=q).motion
    np.testing.assert_allclose(motion.q[:, 5], expected, atol=1e-14)
    assert np.ptp(motion.v[:, 5]) < 1e-12


@pytest.mark.parametrize("names", [(), ("y",)])
def test_pinocchio_moves_as_the_plan_does(arm, names):
    plan = carried(arm.with_limits(endless=[0, 0, 0, 1, 0, 1]), *names)
    robot = plan.robot
    model = pin.buildModelFromXML(robot.to_urdf())
    motion = plan.to_pinocchio(model)
    assert motion.q.shape == (len(plan.q), model.nq)
    assert motion.v.shape == motion.a.shape == (len(plan.q), model.nv)
    data, dt = model.createData(), 1e-6
    flange, part = (model.getFrameId(name) for name in ("tool0", "part"))
    for q, v, row, dq in zip(motion.q, motion.v, plan.q, plan.motion.v, strict=True):
        assert pin.isNormalized(model, q, 1e-12)
        pin.framesForwardKinematics(model, data, q)
        T = data.oMf[part].actInv(data.oMf[flange]).homogeneous
        np.testing.assert_allclose(T, robot.forward(row), atol=1e-9)
        # A step along v leads where a step of all joints leads.
        pin.framesForwardKinematics(model, data, pin.integrate(model, q, v * dt))
        T = data.oMf[part].actInv(data.oMf[flange]).homogeneous
        np.testing.assert_allclose(T, robot.forward(row + dq * dt), atol=1e-9)


def test_a_model_of_other_joints_is_refused(plain, arm):
    railed = carried(arm, "rail")
    model = pin.buildModelFromXML(plain.robot.to_urdf())
    with pytest.raises(InputError, match=r"model: expected .* got one with no rail, table; use p"):
        railed.to_pinocchio(model)
    with pytest.raises(InputError, match=r"expected a pinocchio.Model, got str"):
        plain.to_pinocchio("arm.urdf")
    with pytest.raises(InputError, match="got one with 8 degrees of freedom"):
        plain.to_pinocchio(pin.buildModelFromXML(railed.robot.to_urdf()))


@pytest.mark.parametrize("names", [(), ("rail",)])
def test_the_ros_message_is_the_one_that_is_written(arm, names):
    plan = carried(arm, *names)
    (text, _) = post([plan], "ros").values()
    made = joint_trajectory([plan])
    assert made == YAML(typ="safe").load(text)
    assert made["joint_names"] == [f"joint_{i}" for i in range(1, 7)] + [*names, "table"]
    urdf = plan.robot.to_urdf()
    assert all(f'<joint name="{name}"' in urdf for name in made["joint_names"])


def test_settings_of_the_ros_message_and_its_refusals_are_those_of_the_program(plain):
    settings = RosSettings(joint_names=[f"a{i}" for i in range(6)], step_ms=100)
    coarse = joint_trajectory([plain], settings)
    assert coarse["joint_names"] == settings.joint_names
    assert len(coarse["points"]) < len(joint_trajectory([plain])["points"])
    with pytest.raises(InputError, match="expected 6 names in joint_names, got 5"):
        joint_trajectory([plain], RosSettings(joint_names=[f"a{i}" for i in range(5)]))


# Notebooks.


class Cells(HTMLParser):
    """The tags of a piece of HTML, and the text of each row of its table."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.rows, self.open = set(), [], []
        self.feed(html)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        self.open.append(tag)
        assert not attributes
        if tag == "tr":
            self.rows.append([])

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1].append(data)


def test_a_plan_shows_its_joints_in_a_notebook(arm):
    plan = carried(arm, "x")
    shown = Cells(plan._repr_html_())
    assert shown.tags <= {"table", "caption", "tr", "th", "td", "p"}
    assert [row[0] for row in shown.rows[1:]] == list(plan.robot.joint_names)
    joint_2, x = shown.rows[2], shown.rows[7]
    assert joint_2[2] == f"{np.degrees(np.ptp(plan.q[:, 1])):.2f} deg"
    assert x[2] == f"{1e3 * np.ptp(plan.q[:, 6]):.2f} mm"
    assert x[3] == f"{100 * np.abs(plan.velocity_share[:, 6]).max():.0f} %"


def test_a_robot_shows_its_limits_in_a_notebook(arm):
    rows = Cells(carried(arm, "x").robot._repr_html_()).rows
    assert rows[1] == ["joint 1", "-180.00 deg", "180.00 deg", "175.00 deg/s", "320.00 deg/s^2"]
    assert rows[4][:3] == ["joint 4", "endless", "endless"]
    assert rows[7] == ["x", "-1000.00 mm", "1000.00 mm", "2000.00 mm/s", "4000.00 mm/s^2"]
    unknown = Cells(robot("kuka_kr120_r2500_pro")._repr_html_()).rows
    assert unknown[1] == ["joint 1", *["not known"] * 4]


def test_names_are_text_in_notebooks_and_nothing_else(plain):
    mean = '<script src="https://example.com/x.js"></script>'
    named = replace(plain, contour=replace(plain.contour, name=mean))
    named = replace(named, robot=replace(plain.robot, id=mean))
    named = replace(named, proof=replace(plain.proof, statement=mean))
    for html in (named._repr_html_(), named.robot._repr_html_()):
        assert "script" not in Cells(html).tags


# Figures.


@pytest.mark.parametrize(("what", "drawn"), [("joints", 7), ("limits", 14), ("speed", 1)])
def test_a_plan_is_drawn_as_in_reports(arm, what, drawn):
    plan = carried(arm)
    figure = plot(plan, what)
    assert isinstance(figure, go.Figure)
    assert len(figure.data) == drawn
    own = {"joints": joint_positions, "limits": limit_shares, "speed": cutting_speed}[what]
    assert figure.to_json() == own(plan).to_json()


def test_another_figure_is_refused_and_a_missing_library_said(plain, monkeypatch):
    with pytest.raises(InputError, match="plot: expected one of joints, limits, speed, got 'all'"):
        plot(plain, "all")
    for name in [name for name in sys.modules if name.startswith("kerfpath.report")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(vars(kerfpath), "plot")
    monkeypatch.setitem(sys.modules, "plotly", None)
    with pytest.raises(InputError, match=r"reports: plotly is needed .* 'kerfpath\[report\]'"):
        kerfpath.plot(plain)


# The page.


@pytest.mark.slow
def test_the_examples_of_the_page_run_in_a_new_session(tmp_path):
    code = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", "\n".join(code)],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert {file.name for file in tmp_path.iterdir()} == {"arm.urdf", "cell.glb", "limits.html"}
    # How far the description's kinematics are off, by this package and by pinocchio.
    off = [float(line) for line in done.stdout.splitlines() if re.fullmatch(r"[\d.e-]+", line)]
    assert len(off) == 2
    assert max(off) < 1e-9
