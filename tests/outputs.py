"""Every output of kerfpath in one folder, to be compared with that of another commit.

    python tests/outputs.py make DIR                 write the outputs, one folder for each case
    python tests/outputs.py compare DIR REFERENCE    compare them byte for byte
    python tests/outputs.py check REFERENCE          do both, in a temporary folder
    python tests/outputs.py list                     print the names of the cases

`--only PATTERN` selects the cases whose names contain the pattern. Only commands, the protocol
of the studio and written files are used, so that this script runs unchanged on other commits:
`PYTHONPATH=OTHER/src python tests/outputs.py make REFERENCE`. Jobs and drawings are those beside
this script.

Floating point differs between machines, so both folders are made on one machine, with the same
packages; that is why no reference is in the repository.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import chdir, contextmanager, redirect_stderr, redirect_stdout
from importlib.util import find_spec
from itertools import zip_longest
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
JOBS = ROOT / "tests" / "outputs"
INPUTS = (ROOT / "src" / "kerfpath" / "demo", ROOT / "examples" / "parts", JOBS)
"""Folders of jobs and drawings; every case begins with a copy of their files."""
MASKS = {
    r'(?m)(?<="seconds": )[\d.e-]+(?=}$)': "SECONDS",  # of a plan, in the messages of the studio
    r"(\.toml +\d+/\d+ +\w+ +[\d.]+) +[\d.]+": r"\1 SECONDS",  # of a job, in the table of a batch
}
"""What two runs of one commit write differently, and what stands for it.

The folder of a case is masked, too, and what a stopped study goes on from (.sqlite) is left out.
Progress is neither shown (`--quiet`) nor recorded.
"""


class Workshop:
    """A folder with all inputs, in which a case runs commands; what they write are its outputs."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for place in INPUTS:
            for file in place.glob("*.*"):
                shutil.copy(file, folder)
        self._inputs = set(folder.iterdir())

    def text(self, name: str) -> str:
        """Return the text of a file."""
        return (self.folder / name).read_text()

    def input(self, name: str, text: str) -> None:
        """Write an input, such as a job."""
        (self.folder / name).write_text(text)
        self._inputs.add(self.folder / name)

    def output(self, name: str, text: str) -> None:
        """Write an output."""
        (self.folder / name.replace("/", " ")).write_text(text)

    def run(self, command: str, name: str = "") -> None:
        """Run a command; what it prints and its exit code are an output of this name."""
        from kerfpath.cli import main

        stdout, stderr, code = io.StringIO(), io.StringIO(), 0
        sys.argv = ["kerfpath", "--quiet", *shlex.split(command)]
        with chdir(self.folder), redirect_stdout(stdout), redirect_stderr(stderr):
            try:
                main()
            except SystemExit as leaving:
                code = leaving.code or 0
            except Exception as error:  # a fault of kerfpath is an output, too
                code = repr(error)
        printed = f"{stderr.getvalue()}\n{stdout.getvalue()}"
        self.output(f"{name or command}.txt", f"$ kerfpath {command}\nexit code {code}\n{printed}")

    def both(self, command: str) -> None:
        """Run a command twice: for people, and as JSON."""
        self.run(command)
        self.run(f"{command} --json")

    def collect(self, folder: Path) -> None:
        """Copy all outputs to a folder, masked."""
        for file in sorted(self.folder.rglob("*")):
            if file.is_file() and file not in self._inputs and file.suffix != ".sqlite":
                text = file.read_bytes().decode("latin-1").replace(str(self.folder), "FOLDER")
                for pattern, instead in MASKS.items():
                    text = re.sub(pattern, instead, text)
                target = folder / file.relative_to(self.folder)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(text.encode("latin-1"))


def with_keys(job: str, keys: str) -> str:
    """Return a job with other keys, given as tables of TOML; a line `-key` removes one.

    The keys go to the first table of that name in the job, or to a new one at its end.
    """
    for table in re.findall(r"^\[.*\n(?:(?!\[).*\n)*", keys, re.MULTILINE):
        header, _, lines = table.partition("\n")
        before, _, after = job.partition(f"{header}\n")
        own, rest = re.fullmatch(r"((?:(?!\[).*\n)*)([\s\S]*)", after).groups()
        for key in re.findall(r"^-?(\w+)", lines, re.MULTILINE):
            own = re.sub(rf"^{key} *=.*\n", "", own, flags=re.MULTILINE)
        added = re.sub(r"^(-.*)?\n", "", lines, flags=re.MULTILINE)
        job = f"{before}{header}\n{added}{own}{rest}"
    return job


def variants(name: str) -> dict[str, str]:
    """Return the keys of jobs by name, from a file in which `# name` stands above each."""
    parts = re.split(r"^# (.*)\n", (JOBS / name).read_text(), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


# Jobs, planned.

LANGUAGES = ("rapid", "krl", "fanuc", "val3", "inform", "urscript", "ros", "csv", "linuxcnc")
LASER = """\
[program.krl]
laser_output = 1
[program.fanuc]
laser_output = 1
[program.inform]
laser_output = 1
[program.val3]
laser_output = "BasicIO-1\\\\%Q0"
[program.urscript]
laser_output = 0
"""
"""The settings without which a program of these languages is refused."""
COARSE = """\
[plan]
gamma_step_deg = 20
certify = false
[audit]
path_tolerance_mm = 10
axis_tolerance_deg = 30
"""
SHIPPED = "b_pillar b_pillar_cell beam blank bracket table_tube tube turned_tube"
MAKERS = {
    "krl": "kuka_kr16_r2010_2",
    "fanuc": "fanuc_m20id_25",
    "val3": "staubli_tx2_90xl",
    "inform": "yaskawa_gp25",
    "urscript": "ur_ur10e",
}
"""A robot of the maker of each language that no other job is in."""
OF_MAKER = """\
[robot]
model = "MODEL"
-acceleration_ratio
acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]
[tool]
head = "laser-head-straight"
[part]
xyz_mm = [750, -100, 350]
[program]
language = "LANGUAGE"
pierce_time_s = 0.3
lead_time_s = 0.01
"""


def planned(shop: Workshop, text: str, *languages: str) -> None:
    """Plan a job, audit what is written, and write its script, and its program in languages."""
    shop.input("job.toml", with_keys(text, LASER))
    shop.run("plan job.toml --out out")
    shop.run("script job.toml")
    if (shop.folder / "out/plan.json").exists():
        shop.run("audit out/plan.json")
        shop.run("audit out/plan.json --job job.toml")
        for program in sorted((shop.folder / "out").glob("job.*")):
            shop.run(f"audit out/{program.name} --job job.toml")
        for language in languages:
            shop.run(f"post out/plan.json --language {language}")


def shipped(name: str) -> Callable[[Workshop], None]:
    """Return the case of a shipped job, with fewer nodes, and only one loop of a pick_all."""

    def work(shop: Workshop) -> None:
        text = shop.text(f"{name}.toml").replace("pick_all]\n", "pick_all]\nnear_mm = [0, 0, 0]\n")
        text = re.sub(r"(?<=^spacing_mm = )\S+", lambda at: f"{4 * float(at[0])}", text, flags=re.M)
        planned(shop, with_keys(text, COARSE), *LANGUAGES)

    return work


def odd(keys: str) -> Callable[[Workshop], None]:
    """Return the case of a job that differs from plate.toml in some keys."""

    def work(shop: Workshop) -> None:
        if "arm.urdf" in keys:
            write_arm(shop)
        planned(shop, with_keys(shop.text("plate.toml"), keys))

    return work


def write_arm(shop: Workshop) -> None:
    """Write the description of a library robot, with masses in its links."""
    shop.run("robots abb_irb4600_60_205 --urdf arm.urdf")
    text = shop.text("arm.urdf")
    for link, mass in enumerate((180, 150, 70, 30, 12, 3), start=1):
        moment = f"{mass / 50}"
        body = (
            f'<inertial><origin xyz="0.05 0 0.1"/><mass value="{mass}"/><inertia ixx="{moment}" '
            f'iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial>'
        )
        text = text.replace(f'"link_{link}" />', f'"link_{link}">{body}</link>', 1)
    shop.input("arm.urdf", text)


# The other cases.


def commands(shop: Workshop) -> None:
    """Run every command, for people and as JSON."""
    for command in COMMANDS.split("\n\n")[0].splitlines():
        shop.both(command)
    moved = re.sub(r"(MoveL \[\[-?\d+)\.", r"\g<1>9.", shop.text("slits/slits.mod"), count=1)
    shop.input("moved.mod", moved)
    shop.input("points.csv", MEASURED)
    one_slit = re.sub(r'\[\[contour\]\]\npick = "b"[^[]*', "", shop.text("slits.toml"))
    shop.input("slit.toml", with_keys(one_slit, ON_GRID))
    shop.both("speed slit.toml")
    shop.run("check b_pillar_cell.toml")
    for command in COMMANDS.split("\n\n")[1].splitlines():
        shop.both(command)
    for language in LANGUAGES:
        shop.run(f"post slits/plan.json --language {language} -o posted_{language}")
    shop.run("script slits.toml -o slits.py")
    for name in ("", *HELP.split()):
        shop.run(f"{name} --help")


COMMANDS = """\
plan slits.toml --out slits
check slits.toml
robots
robots abb_irb4600_60_205
robots fanuc_m20id_25
robots kuka_dkp400.tilt
contours blank.dxf
contours bracket.step --html bracket.html
contours beam.step --all
contours slits.csv

audit slits/plan.json --job slits.toml
audit slits/slits.mod --job slits.toml
post slits/plan.json -o posted.mod
post slits/plan.json --dry-run 0.2 -o dry.mod
post slits/plan.json --measured points.csv -o measured.mod
compare slits/slits.mod moved.mod --job slits.toml
touch-up moved.mod --job slits.toml --plan slits/plan.json --out touched
"""
"""Commands before and after a target of their program is moved."""
ON_GRID = """\
[[contour]]
count = 3
[plan]
method = "exact"
refine = false
between_nodes = "reported"
posture = "front/up"
"""
HELP = """\
plan check speed contours robots post audit compare run touch-up script
pareto batch layout studio demo
"""
MEASURED = """\
nominal_x_mm,nominal_y_mm,nominal_z_mm,measured_x_mm,measured_y_mm,measured_z_mm
0,0,0,1201.0,0.5,500.2
30,0,0,1230.9,0.5,500.3
0,20,0,1201.0,20.4,500.1
"""


def studies(shop: Workshop) -> None:
    """Run the studies, small."""
    shop.input("grid.toml", with_keys(shop.text("slits.toml"), ON_GRID))
    for command in STUDIES.splitlines():
        shop.run(f"{command} --processes 1")


STUDIES = """\
pareto grid.toml --runs 10 --out pareto
layout grid.toml --evaluations 8 --map-points 3 --out layout
batch slits.toml plate.toml --out batch
"""


def refusals(shop: Workshop) -> None:
    """Check jobs that are refused, and run commands that are."""
    good = shop.text("slits.toml")
    jobs = {name: with_keys(good, keys) for name, keys in variants("refused.txt").items()}
    jobs |= {"empty": "", "no TOML": "[robot\n", "quote left open": good.replace('"a"', '"a', 1)}
    for name, text in jobs.items():
        shop.input("job.toml", text)
        shop.run("check job.toml", f"job {name}")
    shop.input("plan.json", '{"schema": 10}')
    shop.input("old.json", '{"schema": 1, "kerfpath": "0.0.1"}')
    shop.input("broken.step", "ISO-10303-21;\nHEADER;\n")
    shop.input("empty.mod", "MODULE nothing\nENDMODULE\n")
    for command in REFUSED.splitlines():
        shop.run(command)


REFUSED = """\
plan
plan no.toml
plan slits.toml --fast
cut slits.toml
speed slits.csv
contours no.step
contours broken.step
contours blank.dxf --unit yard
contours blank.dxf --gap-mm -1
contours slits.csv --columns x,y,y
robots abb_irb1
robots --urdf arm.urdf
post no.json
post old.json
post plan.json
post slits.csv --language rapid
audit plan.json
audit empty.mod
audit empty.mod --job slits.toml
compare empty.mod empty.mod --job slits.toml
touch-up empty.mod --job slits.toml --plan plan.json
script no.toml
pareto slits.toml --criteria beauty
layout slits.toml --vary w_mm=1:2
layout slits.toml --vary x_mm=2:1
studio no.toml --no-browser
"""


def audits(shop: Workshop) -> None:
    """Audit plans and programs in which something has been changed."""
    shop.run("plan plate.toml --out out")
    whole, program = shop.text("out/plan.json"), shop.text("out/plate.mod")
    for name, (*place, last), change in TAMPERED:
        plan = into = json.loads(whole)
        for step in place:
            into = into[step]
        into[last] = change(into[last])
        shop.input("tampered.json", json.dumps(plan))
        shop.run("audit tampered.json --job plate.toml", f"plan {name}")
        shop.run("audit tampered.json", f"plan {name} alone")
    for name, (pattern, instead) in EDITED.items():
        text, count = re.subn(pattern, instead, program, count=1)
        assert count, f"nothing to edit in the program: {name}"
        shop.input("edited.mod", text)
        shop.run("audit edited.mod --job plate.toml", f"program {name}")
        shop.run("compare out/plate.mod edited.mod --job plate.toml", f"program {name} compared")


TAMPERED: tuple[tuple[str, tuple[str | int, ...], Callable[[Any], Any]], ...] = (
    ("other schema", ("schema",), lambda n: n + 1),
    ("other robot", ("robot", "id"), lambda _: "abb_irb1600_10_145"),
    ("longer arm", ("robot", "geometry_m", "c3"), lambda c: c + 0.001),
    ("other tip", ("T_flange_tip", 2, 3), lambda z: z + 0.0005),
    ("part moved", ("T_base_part", 0, 3), lambda x: x + 0.001),
    ("lower limit", ("limits", "velocity_rad_s", 0), lambda v: v / 100),
    ("faster", ("contours", 0, "dt"), lambda dt: dt / 2),
    ("lower cost", ("contours", 0, "cost"), lambda cost: cost / 2),
    ("other name", ("contours", 0, "name"), lambda _: "trim"),
    ("no contours", ("contours",), lambda _: []),
    ("wrong type", ("contours", 0, "eta_v"), str),
    ("contour left out", ("contours",), lambda cuts: cuts[:1]),
)
"""Changes of plan.json: a name, the place, and the change of the value there."""
EDITED = {
    "unchanged": (r"\A", ""),
    "point moved": (r"(MoveL \[\[-?\d+)\.", r"\g<1>7."),
    "line removed": (r"\n.*MoveL .*", ""),
    "switch removed": (r"\n.*Trigg.*", ""),
    "speed": (r"(CONST speeddata vCut1:=\[)", r"\g<1>1"),
    "zone": (r"(CONST zonedata zCorner1:=\[FALSE,)", r"\g<1>9"),
    "frame": (r"(wPart:=.*\[\[)", r"\g<1>1"),
    "comment": (r"\n  ! Written by", "\n  ! Edited by"),
    "unknown line": (r"\n(.*MoveL )", r"\n    WaitUntil di1=1;\n\1"),
    "cut short": (r"(?s)(.{3000}).*", r"\1"),
}
"""Edits of a RAPID program: a pattern, whose first place is replaced, and what replaces it."""


def studio(shop: Workshop) -> None:
    """Talk to the studio about slits.toml, and record what it says."""
    with talking(shop, "slits.toml") as page:
        for number, (name, message, expected) in enumerate(ASKS, start=1):
            shop.output(f"{number:02} {name}.txt", page.answers(message, expected))


ASKS: tuple[tuple[str, dict[str, Any], str | int], ...] = (
    ("open", {}, 1),
    ("map", {"type": "map", "contour": "b"}, "map"),
    ("reason", {"type": "reason", "contour": "b", "node": 3, "gamma": 0.5, "posture": 0}, "pose"),
    ("no node", {"type": "reason", "contour": "b", "node": 99, "gamma": 0, "posture": 0}, "error"),
    ("shade", {"type": "shade", "contour": "b", "by": "wrist"}, "shade"),
    ("technique", {"type": "technique", "contour": "b", "method": "known"}, "technique"),
    ("fastest", {"type": "fastest", "contour": "b"}, "fastest"),
    ("program", {"type": "program"}, "program_text"),
    ("program in KRL", {"type": "program", "language": "krl"}, "program_text"),
    ("keep", {"type": "keep"}, "kept"),
    ("reach", {"type": "reach", "offsets": {"x_mm": 300}, "number": 1}, "reach"),
    ("nonsense", {"type": "nonsense"}, "error"),
    ("edit", {"type": "edit", "path": ["plan", "metric"], "value": "euclid"}, 2),
    ("undo", {"type": "undo"}, 3),
    ("fault", {"type": "edit", "path": ["plan", "metric"], "value": "taxi"}, "job"),
    ("undo the fault", {"type": "undo"}, 5),
    ("too fast", {"type": "edit", "path": ["contour", 1, "speed_m_min"], "value": 900}, 6),
    ("relax", {"type": "relax", "contour": "b", "index": 0}, 7),
    ("leave", {"type": "leave", "index": 0}, 8),
    ("cut", {"type": "cut", "loops": ["a"]}, 9),
    ("save", {"type": "save"}, "job"),
)
"""What the page says: a name, the message, and what ends the answers: an outcome of this revision
of the job, or a message of this type."""


class Page:
    """A page of the studio."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket

    def answers(self, message: Mapping[str, object], expected: str | int) -> str:
        """Send a message; return the last answers of each kind once the studio is at rest."""
        if message:
            self._socket.send(json.dumps(message))
        heard, busy, found = {}, False, False
        while True:
            at_rest = found and not busy
            try:
                answer = json.loads(self._socket.recv(timeout=1 if at_rest else 300))
            except TimeoutError:
                if not at_rest:
                    raise
                break
            if answer["type"] == "progress":
                busy = answer["busy"]
                continue
            heard[answer["type"], answer.get("contour"), answer.get("name")] = answer
            outcome = answer["revision"] if answer["type"] == "outcome" else None
            found = found or expected in (answer["type"], outcome)
        return "\n".join(json.dumps(heard[key]) for key in sorted(heard, key=str))


@contextmanager
def talking(shop: Workshop, job: str) -> Iterator[Page]:
    """A page of a studio at work on a job."""
    from websockets.sync.client import connect

    command = [sys.executable, "-u", "-m", *f"kerfpath studio {job} --no-browser --port 0".split()]
    server = subprocess.Popen(command, cwd=shop.folder, stdout=subprocess.PIPE, text=True)
    try:
        host, token = re.search(r"http://([^/\s]+)/(\S*)", server.stdout.readline()).groups()
        patient = {"open_timeout": 300, "ping_interval": None, "max_size": None}
        with connect(f"ws://{host}/ws{token}", origin=f"http://{host}", **patient) as socket:
            yield Page(socket)
    finally:
        server.terminate()
        server.wait()


CASES: dict[str, Callable[[Workshop], None]] = {
    "refusals": refusals,
    "commands": commands,
    "audits": audits,
    "studio": studio,
    "studies": studies,
    **{f"odd {name}": odd(keys) for name, keys in variants("odd.txt").items()},
    **{
        f"odd {language}": odd(OF_MAKER.replace("MODEL", model).replace("LANGUAGE", language))
        for language, model in MAKERS.items()
    },
    **{f"shipped {name}": shipped(name) for name in SHIPPED.split()},
}
"""The cases by name, in order."""


# The commands of this script.


def make(folder: Path, pattern: str) -> list[str]:
    """Write the outputs of the cases whose names contain a pattern, and return these names."""
    if find_spec("coal") is None:
        sys.exit(
            "outputs: expected kerfpath with all extras (coal is not found): outputs would differ"
        )
    names = [name for name in CASES if pattern in name]
    for name in names:
        began = time.process_time()
        with tempfile.TemporaryDirectory() as place:
            shop = Workshop(Path(place).resolve())
            CASES[name](shop)
            shutil.rmtree(folder / name, ignore_errors=True)
            shop.collect(folder / name)
        print(f"{time.process_time() - began:6.1f} s  {name}", flush=True)
    return names


def compare(folder: Path, reference: Path, names: list[str] | None = None) -> int:
    """Print how the files in two folders differ, and return the number of files that do."""
    known = [file.name for place in (folder, reference) for file in place.iterdir()]
    differing = 0
    for name in sorted(set(known if names is None else names)):
        files = {
            file.relative_to(place)
            for place in (folder, reference)
            for file in (place / name).rglob("*")
            if file.is_file()
        }
        for file in sorted(files):
            ours, theirs = ((place / file) for place in (folder, reference))
            if not (ours.exists() and theirs.exists()):
                print(f"{file}: only in {folder if ours.exists() else reference}")
            elif (new := ours.read_bytes()) != (old := theirs.read_bytes()):
                print(f"{file}:{difference(new, old)}")
            else:
                continue
            differing += 1
    print(f"{differing} files differ" if differing else "no file differs")
    return differing


def difference(new: bytes, old: bytes) -> str:
    """Return the first line that differs, with its number and what stands around the difference."""
    lines = (text.decode("latin-1").splitlines() for text in (new, old))
    for number, (ours, theirs) in enumerate(zip_longest(*lines, fillvalue=""), start=1):
        if ours != theirs:
            pairs = enumerate(zip_longest(ours, theirs))
            at = next(place for place, (a, b) in pairs if a != b)
            around = slice(max(0, at - 60), at + 100)
            return f"{number}:{at + 1}\n  is  {ours[around]}\n  was {theirs[around]}"
    return " other line ends"


def main() -> int:
    """Run this script, and return its exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("do", choices=("make", "compare", "check", "list"))
    parser.add_argument("folders", type=Path, nargs="*", metavar="DIR")
    parser.add_argument("--only", default="", metavar="PATTERN")
    asked = parser.parse_args()
    match asked.do, asked.folders:
        case "list", []:
            print("\n".join(CASES))
        case "make", [folder]:
            make(folder, asked.only)
        case "compare", [folder, reference]:
            return bool(compare(folder, reference))
        case "check", [reference]:
            with tempfile.TemporaryDirectory() as folder:
                names = make(Path(folder), asked.only)
                return bool(compare(Path(folder), reference, names))
        case _:
            parser.error("expected make DIR, compare DIR REFERENCE, check REFERENCE or list")
    return 0


if __name__ == "__main__":
    os.environ |= {"COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb", "PYTHONHASHSEED": "0"}
    sys.exit(main())
