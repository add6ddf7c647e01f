"""The same small program in every language, for the laws that hold in all of them."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module

import numpy as np
import pytest

from conftest import ROOT
from kerfpath import InputError, robot
from kerfpath.contour import KINDS
from kerfpath.post import (
    build_program,
    deviations,
    language,
    post,
    read_program,
    unsafe_paths,
)
from programs import arc, assert_at, codes, edited, frames, hand_plan

DATA = ROOT / "tests" / "data"
LETTERS = {"p": "pierce", "i": "lead-in", "c": "cut", "m": "micro joint", "o": "lead-out"}

ARMS = {
    "rapid": ("abb_irb4600_60_205", (1.05, -0.15, 0.61)),
    "krl": ("kuka_kr16_r2010_2", (1.05, -0.15, 0.61)),
    "fanuc": ("fanuc_m20id_25", (1.05, -0.15, 0.61)),
    "val3": ("staubli_tx2_160l", (1.05, -0.15, 0.61)),
    "inform": ("yaskawa_gp25", (1.0, -0.15, 0.55)),
    "urscript": ("ur_ur10e", (0.75, 0.1, 0.2)),
}
"""A robot for each language that has outputs, and where a part lies that it reaches, m."""
ASKING = {**ARMS, "linuxcnc": ("abb_irb4600_60_205", (1.05, -0.15, 0.61))}
"""The same for each language that can ask partners and wait for them."""


ZONE = 3e-4
"""m: that of the golden programs, whose corners are far from half way."""


def kinds_of(text):
    """The kind of each stretch, from single letters."""
    return np.array([KINDS.index(LETTERS[letter]) for letter in text])


def no_words(rear, down, minus):
    return ()


def refusal(files, name, made, options, main=None):
    """Why a text is refused by reader, comparison or flow; "" if it is accepted."""
    try:
        read = read_program(files, name, made.robot, options, main=main)
    except InputError as error:
        return str(error)
    found = deviations(made, read, language(name), options) or unsafe_paths(read)
    return "; ".join(map(str, found))


def renumbered(listing):
    """A listing with its lines numbered from 1 and counted, as a FANUC controller does."""
    numbers = iter(range(1, 10**4))
    text = re.sub(r"(?m)^ *\d+:", lambda _: f"{next(numbers):4d}:", listing)
    return re.sub(r"LINE_COUNT\t= \d+", f"LINE_COUNT\t= {next(numbers) - 1}", text)


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A language with a robot, a part within its reach, settings, and the program kept as golden.

    Parameters
    ----------
    name, arm : str
    place : (3,) m
        Of the part; default: that of `frames`.
    options : dict
        Settings that name what is wired, as `gas_output`.
    build : dict
        How the golden program is built.
    kinds : str
        Of its stretches, as `kinds_of` has them.
    golden_files : dict of str to str
        Where the golden files lie, by their names, in order.
    width : int
        Characters of a line.
    new_line : str
    comment, naming : str
        Regular expressions of lines that are comments, and that differ by names alone.
    bare : (str) to str
        A line without its number.
    timed : bool
        Whether it says times, which need limits of acceleration.
    flying : bool
        Whether it switches while the tip moves, though not ahead of a target.
    joint_step : float rad
        What digits leave of the joints of a target.
    posture_place, posture_reach : (3,) m, float rad
        Where the arm reaches a part in all eight postures, with which limits.
    windings : tuple of int
        Turns of joint 6 by which it is wound there.
    words : (rear, down, minus) to words
        What targets say of a posture, from its three bits; `said` bounds it.
    """

    name: str
    arm: str
    place: tuple[float, ...] | None = None
    options: dict = field(default_factory=dict)
    build: dict = field(default_factory=dict)
    kinds: str = ""
    golden_files: dict = field(default_factory=dict)
    width: int = 200
    new_line: str = "\n"
    comment: str = r"\Z."
    naming: str = r"\Z."
    bare: Callable = str
    timed: bool = False
    flying: bool = False
    point: float = 1e-6
    joint_step: float = 2e-8
    posture_place: tuple[float, ...] = (0.55, 0.1, 0.9)
    posture_reach: float = 7.0
    windings: tuple[int, ...] = (0,)
    said: tuple[int, int] = (0, 0)
    words: Callable = no_words

    def __str__(self):
        return self.name

    @cached_property
    def language(self):
        return language(self.name)

    @cached_property
    def module(self):
        return import_module(f"kerfpath.post.{self.name}")

    @cached_property
    def settings(self):
        return self.language.settings(**self.options)

    @cached_property
    def cell(self):
        """Robot, tool and placement."""
        tool, placement = frames()
        if self.place is not None:
            placement[:3, 3] = self.place
        limits = {"acceleration": np.radians([500] * 6)} if self.timed else {}
        return robot(self.arm).with_limits(**limits), tool, placement

    @cached_property
    def small(self):
        """The plan of the golden program."""
        contour = replace(arc(), kind=kinds_of(self.kinds)) if self.kinds else arc()
        return hand_plan(contour, *self.cell, speed=0.12)

    @cached_property
    def program(self):
        """The golden program."""
        return self.built([self.small])

    def built(self, plans):
        """The program of plans, built as the golden one."""
        return build_program(plans, **{"zone": ZONE, **self.build})

    @cached_property
    def golden(self):
        """Its files."""
        return {
            name: (DATA / path).read_bytes().decode("ascii")
            for name, path in self.golden_files.items()
        }

    def codes(self, program, level=None, settings=None):
        """Codes of the issues that the preflight finds."""
        return codes(program, level, self.name, settings or self.settings)

    def post(self, program, settings=None):
        return post(program, self.name, settings or self.settings)

    def read(self, files, arm=None, settings=None):
        arm = self.cell[0] if arm is None else arm
        return read_program(files, self.name, arm, settings or self.settings)

    def deviations(self, program, files, settings=None):
        """What the files say otherwise than the program."""
        settings = settings or self.settings
        read = self.read(files, program.robot, settings)
        return deviations(program, read, self.language, settings)

    def reads_back(self, program, settings=None):
        """Write and read back; check every target by the robot's forward kinematics."""
        settings = settings or self.settings
        files = self.post(program, settings)
        read = self.read(files, program.robot, settings)
        assert deviations(program, read, self.language, settings) == []
        sayable = self.language.sayable
        said = program if sayable is None else sayable(program, settings)
        T_base_tip = program.robot.forward([m.q for m in program.moves]) @ program.T_flange_tip
        for expected, ours, move in zip(T_base_tip, said.moves, read.moves, strict=True):
            if move.T_part_tip is not None:
                assert_at(program.T_base_part @ move.T_part_tip, expected, self.point)
            if move.q is not None and not move.posture:
                np.testing.assert_allclose(move.q, ours.q, atol=self.joint_step)
            on = [(s.signal, s.on) for s in move.switches]
            assert on == [(s.signal, s.on) for s in getattr(ours, "switches", ())]
        return files, read

    def refuses(self, file, old, new, message, files=None):
        """Check that the reader refuses the golden program with an edit, in one line."""
        with pytest.raises(InputError, match=re.escape(message)) as caught:
            self.read(edited(self.golden if files is None else files, file, old, new))
        assert "\n" not in str(caught.value)

    def finds(self, file, old, new, message=""):
        """Check that the golden program with an edit is read, and found to be another."""
        files = edited(self.golden, file, old, new)
        issues = self.deviations(self.program, files)
        assert issues
        assert message in " ".join(map(str, issues))

    def in_posture(self, number):
        """A plan in one of the eight postures."""
        arm, tool, _ = self.cell
        reach = np.full(6, self.posture_reach)
        reach[5] += 2 * np.pi * max(map(abs, self.windings))
        placement = np.eye(4)
        placement[:3, 3] = self.posture_place
        wide = arm.with_limits(lower=-reach, upper=reach, velocity=np.full(6, 50.0))
        free = wide.with_limits(couplings=())
        return hand_plan(arc(count=20, radius=0.03), free, tool, placement, posture=number)


def _fanuc_bare(row):
    return re.sub(r"^ *\d+:|(?<=LINE_COUNT\t= )\d+", "", row)


PULSES = [1341.4, 1341.4, -1203.7, 1000.0, 980.1, 622.2]
GAS = {"pierce_time": 0.4, "gas_lead": 0.3}
CUT = "cut_skin_outer"
CASES = {
    case.name: case
    for case in (
        Case(
            name="rapid",
            arm="abb_irb4600_60_205",
            golden_files={f"{CUT}.mod": "golden_rapid.mod"},
            comment=r"\s*!",
            naming=r"MODULE \w+|  PROC \w+\(\)|    IF nFirst<=1 \w+;",
            said=(3, 4),
            words=lambda rear, down, minus: (4 * rear + 2 * (rear ^ down) + minus,),
        ),
        Case(
            name="krl",
            arm="kuka_kr16_r2010_2",
            options={"laser_output": 5, "gas_output": 6},
            build=GAS,
            golden_files={f"{CUT}{end}": f"golden_krl{end}" for end in (".src", ".dat")},
            width=120,
            new_line="\r\n",
            comment=r";(?!\s*(END)?FOLD)",
            naming=r"DEF \w+\(\)|DEFDAT \w+|\w+\(\)",
            posture_reach=6.2,
            said=(0, 1),
            words=lambda rear, down, minus: (rear + 2 * (1 - (rear ^ down)) + 4 * minus,),
        ),
        Case(
            name="fanuc",
            arm="fanuc_m20id_25",
            options={"laser_output": 1},
            golden_files={
                f"{name}.ls": f"golden_fanuc/{name}.ls"
                for name in (CUT.upper(), "SKIN_OUTER", f"{CUT.upper()}_OFF")
            },
            new_line="\r\n",
            comment=r" *\d+:  ! [ -:<-~]{0,31} ;$",
            naming=r"/PROG  \w+|  CALL \w+    ;",
            bare=_fanuc_bare,
            point=2e-6,
            joint_step=1e-6,
            posture_reach=4.0,
            said=(0, 3),
            words=lambda rear, down, minus: ("NF"[minus], "UD"[rear ^ down], "TB"[rear]),
        ),
        Case(
            name="inform",
            arm="yaskawa_gp25",
            place=(1.0, -0.15, 0.55),
            options={"laser_output": 1, "gas_output": 2, "pulses_per_deg": PULSES},
            build=GAS,
            golden_files={
                f"{name}.JBI": f"golden_inform/{name}.JBI"
                for name in (CUT.upper(), "SKIN_OUTER_AIR", "SKIN_OUTER", f"{CUT.upper()}_OFF")
            },
            width=80,
            new_line="\r\n",
            comment=r"' .{1,30}$",
            naming=r"//NAME \w+|CALL JOB:\w+",
            point=2e-6,
            joint_step=np.radians(0.51 / 622.2),  # half a pulse of the coarsest axis
            posture_place=(0.45, 0.1, 0.7),
            posture_reach=6.28,
            said=(1, 3),
            words=lambda rear, down, minus: (rear ^ down, rear),
        ),
        Case(
            name="val3",
            arm="staubli_tx2_90xl",
            place=(0.75, -0.15, 0.35),
            options={"laser_output": r"BasicIO-1\%Q0", "gas_output": r"BasicIO-1\%Q1"},
            build=GAS,
            golden_files={
                f"{CUT}/{part}": f"golden_val3/{CUT}/{part}"
                for part in (f"{CUT}.pjx", f"{CUT}.dtx", "start.pgx", "stop.pgx", "skin_outer.pgx")
            },
            comment=r"\s*//",
            naming=r' +<(Program|Data) (name|file)="\w+(\.\w+)?"( access="public")?(>| />)'
            r"|    call \w+\(\)",
            posture_place=(0.45, 0.1, 0.6),
            said=(0, 3),
            words=lambda rear, down, minus: (
                ("lefty", "righty")[rear],
                ("epositive", "enegative")[rear ^ down],
                ("wpositive", "wnegative")[minus],
            ),
        ),
        Case(
            name="urscript",
            arm="ur_ur10e",
            place=(0.75, 0.1, 0.2),
            options={"laser_output": 0, "gas_output": 1},
            build={"pierce_time": 0.3, "gas_lead": 0.2},
            kinds="picmmcoo",
            golden_files={f"{CUT}.script": "golden_urscript.script"},
            comment=r"\s*#",
            naming=r"\s*(def )?\w+\(\):?",
            posture_place=(0.5, 0.2, 0.3),
        ),
        Case(
            name="linuxcnc",
            arm="abb_irb4600_60_205",
            options={"laser_output": 0, "gas_output": 1},
            build={"pierce_time": 0.3, "gas_lead": 0.2},
            kinds="picmmcoo",
            golden_files={
                f"{CUT}{end}": f"golden_linuxcnc{end}" for end in (".ngc", ".ini", ".hal")
            },
            comment=r"\s*;|#",
            naming=r"o<\w+> (sub|endsub|call)|MACHINE = \w+|HALFILE = \w+\.hal",
            timed=True,
            flying=True,
            joint_step=1e-9,
            windings=(-2, 0, 1),
        ),
        Case(
            name="csv",
            arm="abb_irb4600_60_205",
            build={"pierce_time": 0.3, "gas_lead": 0.2},
            golden_files={f"{CUT}.csv": "golden_csv.csv"},
            width=330,
            timed=True,
            joint_step=1e-9,
            windings=(-2, 0, 1),
            bare=lambda row: row.partition(",")[2],  # the name of the section
        ),
        Case(
            name="ros",
            arm="abb_irb4600_60_205",
            build={"pierce_time": 0.3, "gas_lead": 0.2},
            golden_files={f"{CUT}{end}": f"golden_ros{end}" for end in (".yaml", ".events.yaml")},
            width=400,
            timed=True,
            joint_step=1e-9,
            windings=(-2, 0, 1),
            comment="#",
            naming=r'- {section: "\w+"}|trajectory: \w+\.yaml',
        ),
    )
}
