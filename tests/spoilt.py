"""Small drawings, spoilt as people, programs and disks spoil files.

    python tests/spoilt.py [SECONDS] [FIRST_SEED]

spoils one per seed and reads it in a child process. What crashes, hangs, ends in a traceback or
says more than one line is printed, and the file is left in the folder spoilt.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import io
import logging
import random
import re
import select
import subprocess
import sys
import time
import traceback
from pathlib import Path

from ezdxf.filemanagement import new
from OCP.BRep import BRep_Builder
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Trsf, gp_Vec
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Compound, TopoDS_Shape

from kerfpath.cad import read
from kerfpath.cli._contours import list_contours
from kerfpath.errors import InputError

FOLDER = Path("spoilt")
HANG = 20.0
"""s that no small drawing needs."""
LOOPS = 8
"""How many contours are taken from a part."""
LONGEST = 400
"""Characters of a message."""
NUMBERS = (
    b" 0 -1 1 2 3 17 1. -0. 1E-300 1.E+300 -1E20 1e400 nan inf 99999999999999999999 2147483648"
    b" -2147483649 1e 0x10 1,5 1.D5"
).split(b" ")
NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eEdD][-+]?\d+)?")


def spoil(raw: bytes, rng: random.Random) -> bytes:
    """Return a drawing's bytes after one to three of the accidents that befall files."""
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        raw = rng.choice(ACCIDENTS)(raw, rng)
    return raw


def _truncated(raw: bytes, rng: random.Random) -> bytes:
    return raw[: rng.randint(0, len(raw))]


def _lines(raw: bytes, rng: random.Random) -> bytes:
    """Return it with a line deleted, doubled, swapped with another, or split."""
    lines = raw.split(b"\n")
    k, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    many = rng.choice([1, 1, 2, 5])
    way = rng.randrange(4)
    if way == 0:
        del lines[k : k + many]
    elif way == 1:
        lines[k:k] = lines[k : k + many]
    elif way == 2:
        lines[k], lines[j] = lines[j], lines[k]
    else:
        lines[k] = lines[k][: len(lines[k]) // 2] + b"\n" + lines[k][len(lines[k]) // 2 :]
    return b"\n".join(lines)


def _numbers(raw: bytes, rng: random.Random) -> bytes:
    """Return it with some numbers replaced by odd ones, by their neighbours or scaled."""
    found = list(NUMBER.finditer(raw))
    if not found:
        return raw
    for at in sorted(
        rng.sample(found, min(len(found), rng.choice([1, 1, 2, 8]))), key=lambda m: -m.start()
    ):
        with_ = rng.choice([*NUMBERS, rng.choice(found)[0], b"-" + at[0], at[0] + b"0"])
        raw = raw[: at.start()] + with_ + raw[at.end() :]
    return raw


def _references(raw: bytes, rng: random.Random) -> bytes:
    """Return it with some STEP references (or other words) swapped with others."""
    found = list(re.finditer(rb"#\d+" if b"#" in raw else rb"[A-Za-z_]+", raw))
    if not found:
        return raw
    for at in sorted(
        rng.sample(found, min(len(found), rng.choice([1, 1, 2, 8]))), key=lambda m: -m.start()
    ):
        raw = (
            raw[: at.start()]
            + rng.choice([rng.choice(found)[0], b"$", b"*", b"()"])
            + raw[at.end() :]
        )
    return raw


def _bytes(raw: bytes, rng: random.Random) -> bytes:
    k = rng.randint(0, len(raw))
    junk = rng.choice(
        [
            b"\0",
            b"\0" * 50,
            b"\xff\xfe",
            b"\xc3",
            rng.randbytes(rng.randint(0, 20)),
            b"'",
            b"(",
            b")",
            b";",
            b'"',
            b"/*",
        ]
    )
    return raw[:k] + junk + raw[k + rng.choice([0, 0, 1, 8, 60]) :]


def _whole(raw: bytes, rng: random.Random) -> bytes:
    """Return it with other line ends, in another encoding, upper or lower case, or twice."""
    text = raw.decode("latin-1")
    return rng.choice(
        [
            lambda: text.replace("\r\n", "\n").replace("\n", "\r\n").encode("latin-1"),
            lambda: text.replace("\n", "\r").encode("latin-1"),
            lambda: text.replace("\n", "").encode("latin-1"),
            lambda: text.encode("utf-16"),
            lambda: text.encode("utf-8-sig"),
            lambda: text.replace("e", "é").encode("utf-8"),
            lambda: text.upper().encode("latin-1", "ignore"),
            lambda: raw + raw,
            lambda: raw[: len(raw) // rng.choice([3, 10, 30, 100])] + raw[-200:],
        ]
    )()


ACCIDENTS = [
    _truncated,
    _lines,
    _lines,
    _numbers,
    _numbers,
    _numbers,
    _references,
    _references,
    _bytes,
    _whole,
]


@functools.cache
def drawings(folder: Path) -> dict[str, bytes]:
    """Return small drawings of each format by file name."""
    path = Path(__file__).parents[1] / "examples" / "model_drawings.py"
    spec = importlib.util.spec_from_file_location("model_drawings", path)
    assert spec is not None
    assert spec.loader is not None
    examples = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(examples)
    folder.mkdir(parents=True, exist_ok=True)
    logging.disable(logging.WARNING)
    examples.write(folder)
    plate = examples.drilled(
        BRepPrimAPI_MakeBox(20.0, 10.0, 1.0).Shape(), 4.0, (6, 5, -1), (0, 0, 1), 3.0
    )
    pipe = examples.drilled(
        BRepPrimAPI_MakeCylinder(8.0, 20.0).Shape(), 5.0, (0, 0, 10), (1, 0, 0), 20.0
    )
    examples.write_step(folder / "plate.step", plate)
    examples.write_step(folder / "pipe.step", pipe)
    examples.write_step(folder / "pair.step", _pair(plate, pipe))
    examples.write_iges(folder / "plate.iges", plate)
    examples.write_iges(folder / "pipe.iges", pipe)
    _write_r12(folder / "old.dxf")
    rows = [(0, 0, 0), (10, 0, 0), (10, 20, 0), (0, 20, 1), (0, 0, 0)]
    table = [
        ("contour", "x_mm", "y_mm", "z_mm", "nx", "ny", "nz"),
        *(("trim", *row, 0, 0.1, 1) for row in rows),
    ]
    for name, comma in (("points.csv", ","), ("points.tsv", "\t"), ("semicolon.csv", ";")):
        (folder / name).write_text("".join(comma.join(map(str, row)) + "\n" for row in table))
    logging.disable(logging.NOTSET)
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.suffix}


def _pair(a: TopoDS_Shape, b: TopoDS_Shape) -> TopoDS_Shape:
    whole, move = TopoDS_Compound(), gp_Trsf()
    move.SetTranslation(gp_Vec(50, 0, 0))
    BRep_Builder().MakeCompound(whole)
    for shape in (a, b.Located(TopLoc_Location(move))):
        BRep_Builder().Add(whole, shape)
    return whole


def _write_r12(path: Path) -> None:
    document = new("R12")
    space = document.modelspace()
    block = document.blocks.new("B")
    block.add_arc((1, 1), 2, 0, 90)
    for a, b in (((0, 0), (10, 0)), ((10, 0), (10, 10)), ((10, 10), (0, 0))):
        space.add_line(a, b)
    space.add_polyline2d([(0, 0, 1), (5, 5, 0), (9, 2, 0.3)], format="xyb", close=True)
    space.add_blockref("B", (3, 3), dxfattribs={"xscale": -2, "row_count": 2})
    document.saveas(path)


def spoilt_file(seed: int, folder: Path) -> Path:
    """Write the drawing of a seed, spoilt, and return where it is."""
    rng = random.Random(seed)
    originals = drawings(folder / "whole")
    name = rng.choice(list(originals))
    path = folder / f"{seed}-{name}"
    path.write_bytes(spoil(originals[name], rng))
    return path


def complaint(path: Path) -> str:
    """Return what is wrong with the answer to a spoilt drawing, "" if it is one as promised."""
    unit = "mm" if path.suffix == ".dxf" else None
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            list_contours(path, unit, None, everything=True, as_json=True)
        part = read(path, unit)
        part.mesh()
        for loop in part.loops[:LOOPS]:
            part.contour(loop.name, closed=False)
    except InputError as error:
        line = str(error)
        if "\n" in line or str(path) not in line or len(line) > LONGEST:
            return f"not one short line that names the file: {line!r}"
    except Exception:
        return traceback.format_exc()
    return ""


def _child() -> None:
    answers = sys.stdout
    for line in sys.stdin:
        seed = int(line)
        path = spoilt_file(seed, FOLDER)
        started = time.monotonic()
        wrong = complaint(path)
        if (took := time.monotonic() - started) > HANG / 4:
            wrong += f" took {took:.1f} s"
        if not wrong:
            path.unlink()
        print(repr(wrong), file=answers, flush=True)


def _main(seconds: float, seed: int) -> None:
    FOLDER.mkdir(exist_ok=True)
    until, child, first, where = time.monotonic() + seconds, None, seed, 0
    with (FOLDER / "stderr.txt").open("w+") as said:
        while time.monotonic() < until:
            if child is None:
                child = subprocess.Popen(
                    [sys.executable, __file__, "child"],
                    stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=said, text=True,
                )  # fmt: skip
                assert child.stdin is not None
                assert child.stdout is not None
                patience = 2 * HANG
            child.stdin.write(f"{seed}\n")
            child.stdin.flush()
            if select.select([child.stdout], [], [], patience)[0]:
                answer = child.stdout.readline().strip() or f"crashes: {child.wait()}"
            else:
                child.kill()
                answer = f"hangs: {child.wait()}"
            said.seek(where)
            if more := said.read().strip():
                answer += f" says {more}"
            where = said.tell()
            if answer != "''":
                name = next(FOLDER.glob(f"{seed}-*"), seed)
                print(name, answer.replace("\\n", "\n"), flush=True)
            patience = HANG
            if child.poll() is not None:
                child = None
            seed += 1
    if child is not None:
        child.kill()
    print(f"{seed - first} seeds")


if __name__ == "__main__":
    if sys.argv[1:] == ["child"]:
        _child()
    else:
        _main(
            float(sys.argv[1]) if len(sys.argv) > 1 else 600.0,
            int(sys.argv[2]) if len(sys.argv) > 2 else 0,
        )
