"""Semantic descriptions: the pairs that they disable are not judged, and no other."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from jobs import ROBOT_AND_HEAD
from kerfpath import InputError, Robot
from kerfpath.cell import allowed_pairs, caveats, cell_of, link_bodies
from kerfpath.job import cell_of_job, read_job
from kerfpath.urdf import Semantics, read_semantics, read_srdf

LENGTHS = (0.3, 0.7, 0.4, 0.4, 0.2, 0.2)


def arm(folder: Path) -> Path:
    """Write an arm with a box on each link, two on the first, none on the last."""
    names = ["base", *(f"link_{k}" for k in range(1, 7))]
    places = ["0 0 0.3", "0.2 0 0.2", "0 0 0.8", "0.1 0 0.4", "0 0 0.4", "0 0 0.1"]
    axes = ["0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1"]
    text = ["<robot name='arm'>"]
    for k, name in enumerate(names):
        box = "<collision><origin xyz='{} 0 0.05'/><geometry><box size='0.05 0.05 0.1'/></geometry>"
        boxes = "".join((box + "</collision>").format(x) for x in ("0", "0.06")[: 1 + (k == 1)])
        text.append(f"<link name='{name}'>{boxes if k < 6 else ''}</link>")
    for k in range(6):
        text.append(
            f"<joint name='j{k + 1}' type='revolute'><parent link='{names[k]}'/>"
            f"<child link='{names[k + 1]}'/><origin xyz='{places[k]}'/><axis xyz='{axes[k]}'/>"
            "<limit lower='-3' upper='3' velocity='2' effort='1'/></joint>"
        )
    (folder / "arm.urdf").write_text("\n".join([*text, "</robot>"]))
    return folder / "arm.urdf"


def srdf(folder: Path, *lines: str, name: str = "arm") -> Path:
    (folder / "arm.srdf").write_text("\n".join([f"<robot name='{name}'>", *lines, "</robot>"]))
    return folder / "arm.srdf"


def off(one: str, two: str, reason: str | None = "Never") -> str:
    why = "" if reason is None else f" reason='{reason}'"
    return f"<disable_collisions link1='{one}' link2='{two}'{why}/>"


def judged(cell: object) -> set[frozenset[str]]:
    return {frozenset(pair) for pair in cell.pair_names}


def test_only_the_pairs_of_the_file_are_not_judged(tmp_path: Path) -> None:
    urdf = arm(tmp_path)
    robot = Robot.from_urdf(urdf, acceleration=np.full(6, 5.0))
    links = read_srdf(
        srdf(
            tmp_path,
            "<group name='arm'><chain base_link='base' tip_link='link_6'/></group>",
            "<enable_collisions link1='base' link2='link_5'/>",
            off("link_1", "link_3"),
            off("base", "link_4", "User"),
            off("link_4", "base", "again"),
            off("link_6", "link_2", None),
        ),
        urdf,
    )
    assert links == {
        ("link_1", "link_3"): "SRDF: Never",
        ("base", "link_4"): "SRDF: User",
        ("link_6", "link_2"): "SRDF: no reason given",
    }
    pairs = allowed_pairs(robot, links)
    # Both bodies of link 1; none of link 6, which has no body, and nothing of the head.
    assert pairs == {
        ("link_1", "link_3"): "SRDF: Never",
        ("link_1 2", "link_3"): "SRDF: Never",
        ("base", "link_4"): "SRDF: User",
    }
    whole = cell_of(robot, tool=np.eye(4), near_miss=0.001)
    cell = cell_of(robot, tool=np.eye(4), near_miss=0.001, may_touch=pairs)
    assert judged(whole) - judged(cell) == {frozenset(pair) for pair in pairs} & judged(whole)
    assert judged(cell) <= judged(whole)
    assert {frozenset(("base", "link_4")), frozenset(("link_1", "link_3"))} <= judged(whole)
    for pair, why in pairs.items():
        assert {frozenset(p): w for p, w in cell.unjudged.items()}[frozenset(pair)] == why
    (said,) = [each for each in caveats(cell) if "may touch" in each]
    assert "base - link_4 (SRDF: User)" in said
    assert {body.name for body in link_bodies(robot)} >= {"link_1", "link_1 2"}


REFUSED = {
    "a link that is not there": (off("base", "gripper"), "the link 'gripper', which is not in"),
    "one link": (off("base", "base"), "names the link 'base' twice"),
    "half a pair": ("<disable_collisions link1='base'/>", "expected link1= and link2="),
    "enabled, too": (
        off("base", "link_4") + "<enable_collisions link1='link_4' link2='base'/>",
        "'base' and 'link_4' are both disabled and enabled; remove one",
    ),
    "every pair of a link": (
        "<disable_default_collisions link='base'/>", "<disable_default_collisions> disables every"
    ),
    "no XML": ("<a", r"expected an XML semantic description \(SRDF\)"),
}  # fmt: skip


@pytest.mark.parametrize("fault", REFUSED)
def test_a_faulty_file_is_refused_in_one_line(tmp_path: Path, fault: str) -> None:
    text, message = REFUSED[fault]
    with pytest.raises(InputError, match=message) as error:
        read_srdf(srdf(tmp_path, text), arm(tmp_path))
    assert str(error.value).startswith(str(tmp_path / "arm.srdf"))
    assert "\n" not in str(error.value)


def test_a_file_of_another_robot_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"describes the robot 'leg', but arm\.urdf describes"):
        read_srdf(srdf(tmp_path, name="leg"), arm(tmp_path))
    (tmp_path / "arm.srdf").write_text("<!DOCTYPE robot><robot name='arm'/>")
    with pytest.raises(InputError, match="a document type"):
        read_srdf(tmp_path / "arm.srdf", arm(tmp_path))
    with pytest.raises(InputError, match="cannot be read"):
        read_srdf(tmp_path / "none.srdf", arm(tmp_path))


JOB = """\
[robot]
urdf = "arm.urdf"
{robot}
acceleration_deg_s2 = [300, 300, 300, 300, 300, 300]
{head}[part]
file = "line.csv"
xyz_mm = [800, 0, 400]
rpy_deg = [0, 0, 0]
[[contour]]
pick = "contour"
speed_m_min = 1
spacing_mm = 5
[cell]
near_miss_mm = 1
part = false
{cell}
"""


def test_a_job_takes_it_and_its_own_distances_come_first(tmp_path: Path) -> None:
    arm(tmp_path)
    srdf(tmp_path, off("link_1", "link_3"), off("base", "link_4", "User"))
    (tmp_path / "line.csv").write_text("x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n50,0,0,0,0,1\n")
    head = ROBOT_AND_HEAD[ROBOT_AND_HEAD.index("[tool]") :]

    def cell(robot: str, more: str = "") -> object:
        path = tmp_path / "job.toml"
        path.write_text(JOB.format(robot=robot, head=head, cell=more))
        job = read_job(path)
        return cell_of_job(job, job.read_part())

    plain, said = cell(""), cell('srdf = "arm.srdf"')
    free = [{"link_1", "link_3"}, {"link_1 2", "link_3"}, {"base", "link_4"}]
    assert judged(plain) - judged(said) == {frozenset(pair) for pair in free} & judged(plain)
    own = '[[cell.pair]]\nbetween = ["link_4", "base"]\nnear_miss_mm = 5\n'
    assert frozenset({"base", "link_4"}) in judged(cell('srdf = "arm.srdf"', own))
    own = '[[cell.pair]]\nbetween = ["link_4", "base"]\nallowed = "the hose"\n'
    assert "the hose" in cell('srdf = "arm.srdf"', own).unjudged.values()
    with pytest.raises(InputError, match=r'cell\.links: expected links = "description" with srdf'):
        cell('srdf = "arm.srdf"', 'links = "capsules"')
    with pytest.raises(InputError, match=r"robot\.srdf: .*other\.srdf"):
        cell('srdf = "other.srdf"')
    srdf(tmp_path, off("base", "gripper"))
    with pytest.raises(InputError, match=r"job\.toml:3: robot\.srdf: .*the link 'gripper'"):
        cell('srdf = "arm.srdf"')
    (tmp_path / "job.toml").write_text(
        JOB.format(robot='srdf = "arm.srdf"', head=head, cell="").replace(
            'urdf = "arm.urdf"', 'model = "abb_irb4600_60_205"'
        )
    )
    with pytest.raises(InputError, match=r"robot\.srdf: expected srdf only with urdf"):
        read_job(tmp_path / "job.toml")


def semantics(folder: Path, *lines: str) -> Semantics:
    return read_semantics(srdf(folder, *lines), arm(folder))


CHAIN = "<group name='arm'><chain base_link='base' tip_link='link_6'/></group>"


def a_state(values: str, group: str = "arm") -> str:
    joints = zip(("j6", "j1", "j2", "j3", "j4", "j5"), values.split(), strict=False)
    inside = "".join(f"<joint name='{name}' value='{value}'/>" for name, value in joints)
    return f"<group_state name='home' group='{group}'>{inside}</group_state>"


def test_groups_states_and_end_effectors_are_read(tmp_path: Path) -> None:
    found = semantics(
        tmp_path,
        CHAIN,
        "<group name='wrist'><joint name='j4'/><joint name='j5'/><joint name='j6'/></group>",
        "<group name='links'><link name='link_1'/><link name='link_2'/></group>",
        "<group name='all'><group name='arm'/><group name='wrist'/></group>",
        "<group name='gap'><joint name='j1'/><joint name='j3'/></group>",
        a_state("0.6 0.1 0.2 0.3 0.4 0.5"),
        "<end_effector name='head' parent_link='link_6' group='links' parent_group='arm'/>",
        "<virtual_joint name='v' type='fixed' parent_frame='world' child_link='base'/>",
        "<virtual_joint name='w' type='planar' parent_frame='odom' child_link='base'/>",
        "<passive_joint name='j5'/>",
        off("base", "link_2"),
    )
    arm_group, wrist = found.groups["arm"], found.groups["wrist"]
    assert arm_group.joints == ("j1", "j2", "j3", "j4", "j5", "j6")
    # In the order of the joints, whatever the order of the file.
    np.testing.assert_array_equal(arm_group.states["home"], [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert (wrist.base, wrist.tip, wrist.joints) == ("link_3", "link_6", ("j4", "j5", "j6"))
    assert found.groups["links"].joints == ("j2",)
    assert found.others == ("all", "gap")
    assert [(e.name, e.parent_link, e.parent_group) for e in found.end_effectors] == [
        ("head", "link_6", "arm")
    ]
    assert set(found.frames) == {"base", "world"}
    assert set(arm_group.carried) == {"link_6"}
    assert found.disabled == {("base", "link_2"): "SRDF: Never"}
    with pytest.raises(InputError, match=r"group 'arm': nothing drives its joints j5"):
        found.group("arm")
    assert found.group("links").name == "links"
    with pytest.raises(InputError, match="a name is needed; groups that are chains: arm, links"):
        found.group()


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["<group/>"], "expected name= in <group>"),
        (
            ["<group name='a'><chain base_link='base' tip_link='nil'/></group>"],
            "<chain> names 'nil', not in the description",
        ),
        (
            ["<group name='a'><chain base_link='link_6' tip_link='base'/></group>"],
            "no joints lead from link 'link_6' to link 'base'",
        ),
        (["<group name='a'><joint name='nil'/></group>"], "<joint> names 'nil'"),
        ([CHAIN, a_state("0 0 0")], "expected a value of joint 'j3', got none"),
        ([CHAIN, a_state("0 0 x 0 0 0")], "expected one finite number for each joint"),
        ([CHAIN, a_state("0 0 inf 0 0 0")], "expected one finite number for each joint"),
        (["<end_effector name='a' parent_link='nil' group='b'/>"], "names 'nil'"),
        (["<virtual_joint name='a' type='fixed' child_link='nil'/>"], "names 'nil'"),
    ],
)
def test_semantics_that_contradict_the_description_are_refused(
    tmp_path: Path, lines: list[str], said: str
) -> None:
    with pytest.raises(InputError, match=re.escape(said)):
        semantics(tmp_path, *lines)
