"""Programs judged by parsers that others wrote; each runs as a program of its own."""

import ast
import os
import re
import subprocess

import numpy as np
import pytest
from lxml import etree
from tests.post.test_arcs import slot

from kerfpath import robot
from kerfpath.post import Await, Request, build_program, post, write_files
from kerfpath.post.rapid import RapidSettings
from kerfpath.post.urscript import URScriptSettings
from kerfpath.post.val3 import Val3Settings
from programs import arc, frames, hand_plan

RAPIDCHECKER = os.environ.get("RAPIDCHECKER")
"""A Python that has rapidchecker; .ci/run makes one."""


ASKED = (Request(partner="shutter", on=True), Await(partner="ready", timeout=4.0))


def programs(arm, place):
    """Programs with everything that a program can have, of a part at `place` (m)."""
    tool, placement = frames()
    placement[:3, 3] = place
    arm = arm.with_limits(acceleration=np.full(arm.joints, 20.0))  # rad/s^2; arcs need them
    plain = hand_plan(arc(count=60), arm, tool, placement)
    round_ = hand_plan(slot(), arm, tool, placement)
    yield "plain", build_program([plain])
    yield (
        "whole",
        build_program(
            [plain, round_], gas_lead=0.2, pierce_time=0.3, arc_tolerance=2e-5, handshakes=ASKED
        ),
    )


@pytest.mark.skipif(RAPIDCHECKER is None, reason="RAPIDCHECKER names no Python that has it")
@pytest.mark.parametrize("lines", [100, 5000])
def test_rapidchecker_finds_nothing_wrong(tmp_path, lines):
    settings = RapidSettings(
        gas_output="doGas", shutter_output="doOpen", ready_input="diReady", lines_per_file=lines
    )
    for name, program in programs(robot("abb_irb4600_60_205"), (1.05, -0.15, 0.61)):
        paths = write_files(tmp_path / name, post(program, "rapid", settings))
        command = [RAPIDCHECKER, "-m", "rapidchecker", *map(str, paths)]
        judged = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=300)
        assert judged.returncode == 0, judged.stdout
        assert "No RAPID format errors" in judged.stdout
        broken = paths[0].read_text().replace("PROC main()", "PROC main(")
        paths[0].write_text(broken)
        judged = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=300)
        assert judged.returncode != 0, "a checker that passes everything says nothing"


def as_python(text):
    """URScript in Python's words: the two differ in ends of blocks, poses and constants."""
    lines = []
    for line in text.splitlines():
        code = line.split("#", 1)[0].rstrip()
        if code.strip() == "end":
            continue
        code = re.sub(r"\bp\[", "pose[", code)
        code = re.sub(r"^(\s*)(local|global) ", r"\1", code)
        code = re.sub(r"^(\s*)thread ", r"\1def ", code)
        code = re.sub(r"\b(run|kill) ", "", code)
        lines.append(code)
    return "\n".join(lines)


def test_urscript_is_python_but_for_its_ends():
    settings = URScriptSettings(laser_output=0, gas_output=1, shutter_output=2, ready_input=3)
    for _, program in programs(robot("ur_ur10e"), (0.75, 0.1, 0.2)):
        (text,) = post(program, "urscript", settings).values()
        assert text.count("\nend") + text.count("  end") >= len(program.sections) + 1
        ast.parse(as_python(text))
        with pytest.raises(SyntaxError):
            ast.parse(as_python(text.replace("movel(", "movel((", 1)))


VAL3 = "{{http://www.staubli.com/robotics/VAL3/{}}}{}"


def test_val3_is_xml_of_its_namespaces_in_which_every_program_is_listed():
    for _, program in programs(robot("staubli_tx2_160l"), (1.05, -0.15, 0.61)):
        files = post(
            program,
            "val3",
            Val3Settings(laser_output="a", gas_output="b", shutter_output="c", ready_input="d"),
        )
        trees = {name: etree.fromstring(text.encode()) for name, text in files.items()}
        for name, tree in trees.items():
            kind = {"pjx": ("Project/3", "Project"), "dtx": ("Data/2", "Database")}
            space, tag = kind.get(name[-3:], ("Program/2", "Programs"))
            assert tree.tag == VAL3.format(space, tag), name
        for name, tree in trees.items():
            if name.endswith(".pjx"):
                folder = name.rpartition("/")[0]
                listed = [p.get("file") for p in tree.iter(VAL3.format("Project/3", "Program"))]
                here = {n for n in files if n.rpartition("/")[0] == folder and n.endswith(".pgx")}
                assert {f"{folder}/{file}" for file in listed} == here
