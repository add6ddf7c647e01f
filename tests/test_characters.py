"""Files with odd characters everywhere: read as if they were not there, or refused in one line.

A character that changes nothing may be read; whatever changes a number, a word or a line must not.
"""

from __future__ import annotations

import base64
import json
import os
import re
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from benchmarks._document import leaves, put
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.gp import gp_Pln
from plotly.offline import get_plotlyjs
from tests.cad.test_apt import NX
from tests.cad.test_nc import SIEMENS

from characters import CONTROL, DIRECTION, spoilt, wholes
from commands import run
from kerfpath.cad import Part, read, read_measured
from kerfpath.cli.show import out, table
from kerfpath.errors import InputError
from kerfpath.job import program_from_file, read_job, read_plan_file
from kerfpath.job.output.writing import trajectory_text
from readers import _job, _planned, examples

HEAD = "0\nSECTION\n2\nENTITIES\n"
LINE = "0\nLINE\n8\nCUT\n10\n3.25\n20\n33\n11\n43.5\n21\n33\n"
DXF = HEAD + LINE + "0\nENDSEC\n0\nEOF\n"
TABLE = "contour,x_mm,y_mm,z_mm,nx,ny,nz\ntrim,33,3,0,0,0,1\ntrim,43.25,3,0,0,0,1\n"
SPACED = "x_mm y_mm z_mm nx ny nz\n33 3 0 0 0 1\n43.25 3 0 0 0 1\n"
COMMAS = TABLE.replace(",", ";").replace("43.25", "43,25")
KLARTEXT = """\
0 BEGIN PGM TRIM MM
1 TOOL CALL 1 Z
2 M128
3 LN X+0 Y+33 Z+5 TX+0 TY+0 TZ+1 FMAX
4 LN X+3.25 Y+33 Z+0 TX+0 TY+0 TZ+1 F500
5 LN X+43.5 Y+33 Z+0 TX+0 TY+0 TZ+1
6 L Z+50 FMAX
7 END PGM TRIM MM
"""
MEASURED = (
    "nominal_x_mm,nominal_y_mm,nominal_z_mm,measured_x_mm,measured_y_mm,measured_z_mm\n"
    "0,0,0,1000,0,500\n33,0,0,1033,0,500\n0,3.25,0,1000,3.25,500\n"
)


def geometry(part: Part) -> list[np.ndarray]:
    return [part.contour(loop.name, closed=False).points for loop in part.loops]


def drawing(path: Path) -> list[np.ndarray]:
    return geometry(read(path, "mm" if path.suffix in (".dxf", ".cls") else None))


def solid(path: Path) -> list[np.ndarray]:
    """What is drawn in a STEP or IGES file; what it says of entities left out is a refusal."""
    part = read(path)
    if part.left_out:
        raise InputError(f"{path}: {'; '.join(part.notes)}")
    return geometry(part)


def rectangle(path: Path) -> str:
    """The text of a STEP or IGES file of one face, after it has been written."""
    write = examples().write_step if path.suffix == ".step" else examples().write_iges
    write(path, BRepBuilderAPI_MakeFace(gp_Pln(), 3.25, 43.5, 0.0, 33.0).Face())
    return path.read_text("ascii")


def fitted(content: bytes) -> bytes:
    """An IGES file whose lines lose or get blanks, so that each section stays in its columns."""
    return b"\n".join(map(_fitted, content.split(b"\n")))


def _fitted(line: bytes) -> bytes:
    section, over = line[-8:-7], len(line) - 80
    if section not in (b"S", b"G", b"D", b"P"):
        return line
    end = len(line) - (16 if section == b"P" else 8)
    if over <= 0:
        return line[:end] + b" " * -over + line[end:]
    blanks = line.rfind(b" " * over, 0, end)
    return line if blanks < 0 else line[:blanks] + line[blanks + over :]


class Kind(NamedTuple):
    name: str
    text: str | Callable[[Path], str]
    read: Callable[[Path], list[np.ndarray]]


KINDS = {
    "DXF": Kind("a.dxf", DXF, drawing),
    "table": Kind("a.csv", TABLE, drawing),
    "spaced table": Kind("a.txt", SPACED, drawing),
    "decimal commas": Kind("a.tsv", COMMAS, drawing),
    "APT": Kind("a.cls", NX, drawing),
    "Siemens": Kind("a.mpf", SIEMENS, drawing),
    "Heidenhain": Kind("a.h", KLARTEXT, drawing),
    "measured": Kind("a.csv", MEASURED, lambda path: list(read_measured(path))),
    "STEP": Kind("a.step", rectangle, solid),
    "IGES": Kind("a.iges", rectangle, solid),
}
UNPRINTED = {*CONTROL, *DIRECTION}
FEWER = {"APT": 11, "Siemens": 11, "Heidenhain": 5, "STEP": 401, "IGES": 397}
"""Of longer files, one place in so many."""


def answer(reading: Callable[[Path], object], path: Path) -> object:
    """What is read from a file, or the message with which it is refused."""
    try:
        return reading(path)
    except InputError as error:
        return str(error)


def same(found: list[np.ndarray], meant: list[np.ndarray]) -> bool:
    return len(found) == len(meant) and all(map(np.array_equal, found, meant))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_character_changes_a_path(tmp_path: Path, kind: str) -> None:
    """Each file is refused in one line, or read as the same path.

    Digits may be added to a number, and a part of a line taken out, by what is plain ASCII: of
    these files nothing is said but that they do not crash.
    """
    name, made, reading = KINDS[kind]
    path = tmp_path / name
    text = made if isinstance(made, str) else made(path)
    path.write_text(text)
    meant, refused, tried = reading(path), 0, 0
    contents = [
        odd.encode("utf-8", "surrogatepass") for odd in spoilt(text, every=FEWER.get(kind, 7))
    ]
    for each in [*contents, *wholes(text)]:
        content = fitted(each) if kind == "IGES" else each
        path.write_bytes(content)
        tried += 1
        found = answer(reading, path)
        if isinstance(found, str):
            assert found.isprintable(), content[-200:]
            assert name in found
            refused += 1
            continue
        plain = content.isascii() and not any(c.encode() in content for c in CONTROL)
        assert plain or same(found, meant), content[-300:]
    assert tried > 100
    assert refused > tried / 3


@pytest.mark.parametrize(
    ("number", "odd"),
    [
        ("43.5,33.,0.", "43.5,\u0663,0."),
        ("43.5,33.,0.", "43.5,3_3.,0."),
        ("110,43.5", "\uff1110,43.5"),
        (",1.,2,2HMM", ",1\0,2,2HMM"),
        ("     110       5", "     11\u0660       5"),
    ],
)
def test_what_is_no_number_in_an_iges_file_is_not_0(tmp_path: Path, number: str, odd: str) -> None:
    path = tmp_path / "a.iges"
    text = rectangle(path)
    assert number in text
    path.write_bytes(fitted(text.replace(number, odd).encode()))
    with pytest.raises(InputError, match=r"a\.iges: .*expected a number in line \d+, got"):
        read(path)


def test_a_number_of_many_digits_is_refused_in_a_step_file(tmp_path: Path) -> None:
    """Python itself converts no more than 4300 digits."""
    path = tmp_path / "a.step"
    path.write_text(rectangle(path).replace("#18", f"#18{'9' * 5000}"))
    with pytest.raises(InputError, match=r"a\.step: .*#18999.* is more than 2147483647"):
        read(path)


def test_names_of_drawings_are_shown_in_characters_that_print(tmp_path: Path) -> None:
    path = tmp_path / "a.dxf"
    path.write_text(DXF.replace("CUT", "A\u202eB\u2028"), "utf-8")
    (loop,) = read(path, "mm").loops
    assert loop.layer.isprintable()
    assert loop.name.isprintable()
    path = tmp_path / "a.csv"
    path.write_text(TABLE.replace("trim", "t\u202erim"), "utf-8")
    with pytest.raises(InputError, match=r"a\.csv: line 2: .*U\+202E RIGHT-TO-LEFT OVERRIDE"):
        read(path)


@pytest.mark.parametrize(
    "odd", [*"\0\x07\x1b\x7f\x85\u2028\u202e\ufeff\U000e0041", "\n", "\t", "\r"]
)
def test_a_string_of_a_job_is_one_line_of_text(tmp_path: Path, odd: str) -> None:
    job = _job(tmp_path, "rapid")
    job.write_text(job.read_text().replace('name = "small"', f'name = "a\\U{ord(odd):08x}b"'))
    with pytest.raises(
        InputError, match=r"job\.toml:\d+: program\.name: expected one line of text"
    ):
        read_job(job)


@pytest.mark.slow
def test_a_job_with_odd_characters_means_the_same_or_is_refused(tmp_path: Path) -> None:
    """What it means are its values: TOML itself allows 1_0, inf and tabs."""
    job = _job(tmp_path, "rapid")
    text, meant = job.read_text(), read_job(job).source
    refused = 0
    contents = [odd.encode("utf-8", "surrogatepass") for odd in spoilt(text, every=29)]
    for content in [*contents, *wholes(text)]:
        job.write_bytes(content)
        found = answer(read_job, job)
        if isinstance(found, str):
            assert found.isprintable()
            assert "job.toml" in found
            refused += 1
        else:
            assert content.isascii() or values(found.source) == values(meant)
    assert refused > len(contents) / 2


def values(source: dict) -> list:
    """The tables of which no value is a name, which may have any letters that print."""
    return [source[table] for table in ("tool", "part", "plan")]


@pytest.mark.parametrize(
    ("argument", "said"),
    [
        ("a\x1b[31m.toml", "U+001B"),
        ("a\u202e.toml", "U+202E RIGHT-TO-LEFT OVERRIDE"),
        ("a\nb.toml", ""),
        (os.fsdecode(b"door\xe9.toml"), "bytes that are not UTF-8"),
        ("--\x1b[31m", "U+001B"),
    ],
)
@pytest.mark.parametrize("command", ["plan", "check", "contours", "audit", "studio", "post"])
def test_arguments_that_are_no_text_are_refused_in_one_line(command, argument, said):
    result = run(command, argument)
    assert result.returncode == 2
    assert said in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stderr.strip().isprintable()


def test_a_current_folder_that_is_no_text_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"door\xe9")
    folder.mkdir()
    result = run("robots", cwd=folder)
    assert result.returncode == 2
    assert "bytes that are not UTF-8" in result.stderr


def test_names_from_files_reach_the_terminal_as_text(tmp_path: Path) -> None:
    """The terminal is sent no control sequence, and no mark that turns the direction."""
    path = tmp_path / "arm.urdf"
    path.write_text('<robot name="a&#x202e;b&#x85;"><link name="c&#x2067;"/></robot>')
    job = _job(tmp_path, "rapid")
    job.write_text(job.read_text().replace('model = "abb_irb4600_60_205"', 'urdf = "arm.urdf"'))
    result = run("check", job)
    assert result.returncode == 2
    assert all(line.isprintable() for line in result.stderr.splitlines())


def test_a_console_prints_escapes(capsys: pytest.CaptureFixture[str]) -> None:
    out.print("a\x1b]0;title\u202e\x85b\nnext")
    table(["name"], [["x\u2066\x1by"]])
    said = capsys.readouterr().out
    assert "a\\x1b]0;title\\u202e\\x85b\nnext" in said
    assert "x\\u2066\\x1by" in said


def test_no_name_in_a_table_is_a_formula(planned: Path) -> None:
    file = read_plan_file(planned)
    contour = replace(file.plans[0].contour, name='=cmd|"/c calc"!A1')
    rows = trajectory_text([replace(file.plans[0], contour=contour)]).splitlines()
    assert all(row.startswith("\"'=cmd|") for row in rows[1:])
    assert [row.partition(",")[0] for row in trajectory_text(file.plans).splitlines()[:2]] == [
        "contour", "ring",
    ]  # fmt: skip


CODE = """=<img src=x onerror=alert(1)>"'&amp;</script><script>alert(2)</script>{{7*7}}"""


@pytest.mark.slow
def test_no_name_is_code_in_any_page(tmp_path: Path) -> None:
    """Of contours, drawing and job, in the pages, and in the figures that they hold."""
    job = _job(tmp_path, "csv")
    (tmp_path / "ring.csv").rename(tmp_path / "a<b>'&.csv")
    drawn, quoted = tmp_path / "a<b>'&.csv", CODE.replace('"', '""')
    drawn.write_text(drawn.read_text().replace("ring,", f'"{quoted}",'))
    text = job.read_text().replace('"ring.csv"', json.dumps(drawn.name))
    job = job.rename(tmp_path / "job<i>'&.toml")
    job.write_text(text.replace('"ring"', json.dumps(CODE)))
    assert run("contours", drawn, "--html", tmp_path / "drawing.html").returncode == 0
    assert run("plan", job, "--out", tmp_path / "out").returncode == 0
    for page in (tmp_path / "drawing.html", tmp_path / "out" / "report.html"):
        html = page.read_text("utf-8").replace(get_plotlyjs(), "")
        packed = re.findall(r'<script type="application/octet-stream" id="[^"]+">([^<]+)<', html)
        figures = [
            json.dumps(json.loads(zlib.decompress(base64.b64decode(text)))) for text in packed
        ]
        assert any("&lt;img src=x onerror" in each for each in (html, *figures))
        for each in (html, *figures):
            assert not any(code in each for code in ("<img", "<script>alert", "<b>'", "<i>'"))
    rows = (tmp_path / "out" / "trajectory.csv").read_text().splitlines()[1:]
    assert all(row.startswith("\"'=<img") for row in rows)


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("planned") / "rapid"
    _planned(folder, "rapid")
    return folder / "out" / "plan.json"


@pytest.mark.parametrize("odd", [1.5, "x", None, True, [], [1.5], 10**399, "\x1b[31m\u202e"])
@pytest.mark.parametrize("key", ["robot", "program", "audit", "sequence", "cell", "x\u202e"])
def test_what_is_no_table_in_the_job_of_a_plan_is_refused(planned, tmp_path, key, odd):
    data = json.loads(planned.read_text())
    data["job"][key] = odd
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(data))
    said = r"plan\.json: (job\..*: expected a table|not a plan\.json: expected texts of .*), got"
    with pytest.raises(InputError, match=said) as error:
        program_from_file(path, "csv")
    assert str(error.value).isprintable()
    assert run("audit", path).returncode == 2


def test_every_text_of_a_plan_is_one_line(planned: Path, tmp_path: Path) -> None:
    """Names of a plan go into the program that is written from it, as remarks for example."""
    data = json.loads(planned.read_text())
    texts = [place for place, value in leaves(data) if isinstance(value, str)]
    odds = [*UNPRINTED, "\ud800", "\n", "\r", "\t"]
    path = tmp_path / "plan.json"
    for k in range(max(len(texts), len(odds))):
        place, odd = texts[k % len(texts)], odds[k % len(odds)]
        path.write_text(json.dumps(put(data, place, f"a{odd}")))
        found = answer(read_plan_file, path)
        assert (
            f"plan.json: not a plan.json: expected texts of one line, got U+{ord(odd):04X}" in found
        )
    path.write_text(json.dumps(put(data, ("contours", 0, "name"), 'a\\n "b" \\u202e \xa0')))
    assert read_plan_file(path).plans[0].contour.name == 'a\\n "b" \\u202e \xa0'


@pytest.mark.slow
def test_a_plan_with_odd_characters_means_the_same_or_is_refused(planned, tmp_path) -> None:
    path = tmp_path / "plan.json"
    text = planned.read_text("utf-8")

    def values(path: Path) -> list[np.ndarray]:
        plans = read_plan_file(path).plans
        return [array for plan in plans for array in (plan.q, plan.gamma, plan.contour.points)]

    path.write_text(text)
    meant, refused, tried = values(path), 0, 0
    contents = [odd.encode("utf-8", "surrogatepass") for odd in spoilt(text, every=1999)]
    for content in [*contents, *wholes(text)]:
        path.write_bytes(content)
        tried += 1
        found = answer(values, path)
        if isinstance(found, str):
            assert found.isprintable()
            assert "plan.json" in found
            refused += 1
        else:
            assert content.isascii() or same(found, meant), content[:300]
    assert tried > 500
    assert refused > tried / 2
