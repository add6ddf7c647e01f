"""Every reader of files that people hand in, and small sound files of each to spoil."""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import logging
import shutil
from pathlib import Path

import numpy as np
from ezdxf.filemanagement import new
from OCP.BRep import BRep_Builder
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Trsf, gp_Vec
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Compound, TopoDS_Shape

import chart_files
import foreign
from kerfpath.cad import read, read_measured
from kerfpath.cell import Hull, link_bodies
from kerfpath.cell.mesh import close_surface, read_surface
from kerfpath.cli.drawing_output import list_contours
from kerfpath.cli.program_output import show_audit
from kerfpath.errors import InputError, about
from kerfpath.job import (
    cell_of_job,
    program_from_file,
    read_chart,
    read_job,
    run_job,
    write_result,
)
from kerfpath.placement import placement_from_points
from kerfpath.post import languages
from kerfpath.robots import Robot
from kerfpath.sweep.store import Store
from kerfpath.sweep.task import Failure, Task, TaskOutcome
from spoilt import Reader, Whole

LOOPS = 8
"""How many contours are taken from a part."""
JOB = """\
[robot]
model = "{model}"
endless = [6]
acceleration_ratio = "iontec_20_to_70kg"
[tool]
head = "laser-head-45"
[part]
file = "ring.csv"
xyz_mm = {place}
rpy_deg = [0, 0, 0]
[[contour]]
pick = "ring"
speed_m_min = 1.5
spacing_mm = 8
[plan]
gamma_step_deg = 20
method = "exact"
refine = false
{more}
[program]
name = "small"
language = "{language}"
"""
EVERYTHING = """\
closure = "free"
eta_velocity = 0.9
feed = "dip"
[comfort]
[audit]
path_tolerance_mm = 0.3
[sequence]
home_deg = [0, -20, 10, 0, 60, 0]
[cell]
near_miss_mm = 5
part = false
[cell.head]
body_radius_mm = 35
[[cell.fixture]]
name = "table"
size_mm = [400, 300, 50]
xyz_mm = [1200, 0, 200]
[[cell.fixture]]
name = "clamp"
file = "clamp.stl"
unit = "mm"
xyz_mm = [1500, 400, 300]
"""
PULSES = "[program.inform]\npulses_per_deg = [1000, 900, 1000, 700, 700, 400]\n"
LANGUAGES = {
    "rapid": ("abb_irb4600_60_205", [1100, 0, 600], ""),
    "krl": ("kuka_kr60_ha", [1100, 0, 600], "[program.krl]\nlaser_output = 5\n"),
    "fanuc": ("fanuc_m20ia", [1000, 0, 400], "[program.fanuc]\nlaser_output = 5\n"),
    "val3": ("staubli_rx160", [900, 0, 300], "[program.val3]\nlaser_output = 'BasicIO-1\\%Q0'\n"),
    "inform": (
        "yaskawa_gp25",
        [1000, 0, 400],
        PULSES,
    ),
    "urscript": ("ur_ur10e", [700, 0, 200], ""),
    "ros": ("abb_irb4600_60_205", [1100, 0, 600], ""),
    "csv": ("abb_irb4600_60_205", [1100, 0, 600], ""),
    "linuxcnc": ("abb_irb4600_60_205", [1100, 0, 600], ""),
}


def ring(radius: float = 20.0, count: int = 12) -> str:
    """A table of points around a circle, closed."""
    turn = np.linspace(0, 2 * np.pi, count + 1)
    rows = [
        f"ring,{x:.6f},{y:.6f},0,0,0,1"
        for x, y in zip(radius * np.cos(turn), radius * np.sin(turn), strict=True)
    ]
    return "contour,x_mm,y_mm,z_mm,nx,ny,nz\n" + "\n".join(rows) + "\n"


def _job(folder: Path, language: str, more: str = "") -> Path:
    model, place, settings = LANGUAGES[language]
    (folder / "ring.csv").write_text(ring())
    path = folder / "job.toml"
    text = JOB.format(model=model, place=place, language=language, more=more)
    path.write_text(text + settings)
    return path


def _planned(folder: Path, language: str, more: str = "") -> list[Path]:
    """Plan a small job in a folder and return the files that came of it."""
    folder.mkdir(parents=True)
    job = read_job(_job(folder, language, more))
    part = read(job.part_file)
    outcome = run_job(job, part)
    return [Path(file) for file in write_result(outcome, folder / "out").files]


# ---------------------------------------------------------------------------------------- drawings


@functools.cache
def examples():
    """The script that models the example drawings."""
    path = Path(__file__).parents[1] / "examples" / "model_drawings.py"
    spec = importlib.util.spec_from_file_location("model_drawings", path)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


def _alone(paths: list[Path]) -> list[Whole]:
    return [Whole(path, path) for path in sorted(paths)]


def steps(folder: Path) -> list[Whole]:
    made = examples()
    made.write_step(folder / "bracket.step", made.bracket())
    plate, pipe = _plate(), _pipe()
    made.write_step(folder / "plate.step", plate)
    made.write_step(folder / "pipe.step", pipe)
    made.write_step(folder / "pair.step", _pair(plate, pipe))
    return _alone(list(folder.glob("*.step")))


def igess(folder: Path) -> list[Whole]:
    examples().write_iges(folder / "plate.iges", _plate())
    examples().write_iges(folder / "pipe.iges", _pipe())
    return _alone(list(folder.glob("*.iges")))


def _plate() -> TopoDS_Shape:
    box = BRepPrimAPI_MakeBox(20.0, 10.0, 1.0).Shape()
    return examples().drilled(box, 4.0, (6, 5, -1), (0, 0, 1), 3.0)


def _pipe() -> TopoDS_Shape:
    tube = BRepPrimAPI_MakeCylinder(8.0, 20.0).Shape()
    return examples().drilled(tube, 5.0, (0, 0, 10), (1, 0, 0), 20.0)


def _pair(a: TopoDS_Shape, b: TopoDS_Shape) -> TopoDS_Shape:
    whole, move = TopoDS_Compound(), gp_Trsf()
    move.SetTranslation(gp_Vec(50, 0, 0))
    BRep_Builder().MakeCompound(whole)
    for shape in (a, b.Located(TopLoc_Location(move))):
        BRep_Builder().Add(whole, shape)
    return whole


def dxfs(folder: Path) -> list[Whole]:
    logging.disable(logging.WARNING)
    examples().write_blank(folder / "blank.dxf")
    document = new("R12")
    space = document.modelspace()
    block = document.blocks.new("B")
    block.add_arc((1, 1), 2, 0, 90)
    for a, b in (((0, 0), (10, 0)), ((10, 0), (10, 10)), ((10, 10), (0, 0))):
        space.add_line(a, b)
    space.add_polyline2d([(30, 0, 0.1), (35, 5, 0), (39, 2, 0.1)], format="xyb", close=True)
    space.add_blockref("B", (60, 60), dxfattribs={"xscale": -2, "row_count": 2, "row_spacing": 90})
    document.saveas(folder / "old.dxf")
    document.saveas(folder / "binary.dxf", fmt="bin")
    logging.disable(logging.NOTSET)
    return _alone(list(folder.glob("*.dxf")))


def tables(folder: Path) -> list[Whole]:
    rows = [(0, 0, 0), (10, 0, 0), (10, 20, 0), (0, 20, 1), (0, 0, 0)]
    head = [("contour", "x_mm", "y_mm", "z_mm", "nx", "ny", "nz")]
    table = [*head, *(("trim", *row, 0, 0.1, 1) for row in rows)]
    for name, comma in (("points.csv", ","), ("points.tsv", "\t"), ("semicolon.csv", ";")):
        (folder / name).write_text("".join(comma.join(map(str, row)) + "\n" for row in table))
    (folder / "ring.txt").write_text(ring())
    return _alone(list(folder.iterdir()))


def paths(folder: Path) -> list[Whole]:
    """Robot programs of others, as drawings; the data of one are in a file beside it."""
    for name, text in foreign.TEXTS.items():
        (folder / name).write_text(text)
    mains = [path for path in folder.iterdir() if path.suffix != ".dat"]
    return [*_alone(mains), Whole(folder / "trim.dat", folder / "trim.src")]


def read_drawing(path: Path) -> None:
    unit = "mm" if path.suffix == ".dxf" else None
    list_contours(read(path, unit), None, everything=True)
    part = read(path, unit)
    part.mesh()
    for loop in part.loops[:LOOPS]:
        part.contour(loop.name, closed=False)


# ------------------------------------------------------------------------------------------ meshes


def _box(size=(0.2, 0.1, 0.05)):
    corners = np.array(np.meshgrid(*[(0.0, s) for s in size], indexing="ij")).reshape(3, -1).T
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    return corners, np.array(faces)


def meshes(folder: Path) -> list[Whole]:
    corners, faces = _box()
    write_meshes(folder, corners, faces)
    return _alone(list(folder.iterdir()))


def write_meshes(folder: Path, corners, faces) -> None:
    """Write a solid as text and binary STL, OBJ and COLLADA."""
    text = ["solid box"]
    binary = b"\0" * 80 + len(faces).to_bytes(4, "little")
    for face in faces:
        lines = "\n".join("vertex " + " ".join(f"{v:.6f}" for v in p) for p in corners[face])
        text.append(f"facet normal 0 0 0\nouter loop\n{lines}\nendloop\nendfacet")
        binary += b"\0" * 12 + corners[face].astype("<f4").tobytes() + b"\0\0"
    (folder / "text.stl").write_text("\n".join([*text, "endsolid box", ""]))
    (folder / "binary.stl").write_bytes(binary)
    points = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    polygons = "".join("f " + " ".join(str(i + 1) for i in face) + "\n" for face in faces)
    (folder / "box.obj").write_text(points + polygons)
    numbers = " ".join(str(v) for v in corners.ravel())
    indices = " ".join(str(i) for i in faces.ravel())
    (folder / "box.dae").write_text(
        f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1.0" name="meter"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="{corners.size}">{numbers}</float_array>
<technique_common><accessor source="#a" count="{len(corners)}" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{len(faces)}"><input semantic="VERTEX" source="#v" offset="0"/>
<p>{indices}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1
</matrix><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""
    )


def read_mesh(path: Path) -> None:
    """Read it as a head or fixture is read, and as a link is."""
    vertices, triangles = read_surface(path, path.name)
    with about(path):
        Hull(vertices[np.unique(triangles)])
    close_surface(vertices, triangles, 1.0, path.name)


# ------------------------------------------------------------------------------------------ robots

DESCRIPTION = """<?xml version="1.0"?>
<robot name="arm">
<link name="base_link"><collision><geometry><mesh filename="link.stl"/></geometry></collision>
</link><link name="link_1"><collision><origin xyz="0 0 0.1" rpy="0 0.5 0"/>
<geometry><box size="0.2 0.1 0.1"/></geometry></collision></link>
<link name="link_2"><collision><geometry><cylinder radius="0.1" length="0.4"/></geometry>
</collision></link><link name="link_3"><collision><geometry><sphere radius="0.1"/></geometry>
</collision></link><link name="link_4"/><link name="link_5"/><link name="link_6"/>
<link name="tool0"/>
{joints}
<joint name="end" type="fixed"><parent link="link_6"/><child link="tool0"/>
<origin xyz="0 0 0.1" rpy="0 0 0"/></joint>
</robot>
"""
JOINTS = [
    ("0 0 0.4", "0 0 1"), ("0.15 0 0", "0 1 0"), ("0 0 0.6", "0 1 0"), ("0.3 0 0.1", "1 0 0"),
    ("0.3 0 0", "0 1 0"), ("0.1 0 0", "1 0 0"),
]  # fmt: skip


def urdfs(folder: Path) -> list[Whole]:
    links = ["base_link", *(f"link_{i}" for i in range(1, 7))]
    joints = "\n".join(
        f'<joint name="joint_{i}" type="revolute"><parent link="{links[i - 1]}"/>'
        f'<child link="{links[i]}"/><origin xyz="{xyz}" rpy="0 0 0"/><axis xyz="{axis}"/>'
        '<limit lower="-2.9" upper="2.9" effort="1" velocity="3.5"/></joint>'
        for i, (xyz, axis) in enumerate(JOINTS, start=1)
    )
    corners, faces = _box()
    write_meshes(folder, corners, faces)
    shutil.move(folder / "text.stl", folder / "link.stl")
    (folder / "arm.urdf").write_text(DESCRIPTION.format(joints=joints))
    main = folder / "arm.urdf"
    return [Whole(main, main), Whole(main, main), Whole(folder / "link.stl", main)]


def read_robot(path: Path) -> None:
    found = Robot.from_urdf(path)
    link_bodies(found)
    found.forward(np.zeros(found.joints))


# --------------------------------------------------------------------------- jobs, plans, programs


PROCESS = """
[process]
material = "steel"
thickness_mm = 2
chart = "chart.toml"
[[process.row]]
material = "steel"
thickness_mm = 3
speed_m_min = 2
"""
CHART = """
source = "trials"
[[row]]
material = "steel"
thickness_mm = 2
speed_m_min = 1.5
kerf_mm = 0.2
lead_in_mm = 2
pierce = [{ time_s = 0.1, power_w = 900 }]
"""


def jobs(folder: Path) -> list[Whole]:
    found = []
    for number, more in enumerate(("", EVERYTHING, PROCESS)):
        place = folder / str(number)
        place.mkdir()
        (place / "chart.toml").write_text(CHART)
        corners, faces = _box()
        write_meshes(place, corners * 1000, faces)
        shutil.move(place / "text.stl", place / "clamp.stl")
        path = _job(place, "rapid", more)
        found.append(Whole(path, path))
    beside = [(folder / "1" / "clamp.stl", 1), (folder / "2" / "chart.toml", 2)]
    return [*found, *(Whole(spoilt, found[number].main) for spoilt, number in beside)]


def read_a_job(path: Path) -> None:
    job = read_job(path)
    part = job.read_part()
    for task in job.tasks(part):
        task.candidates(part)
    cell_of_job(job, part)


def plans(folder: Path) -> list[Whole]:
    """Plans of an arm with everything, and of one on a rail."""
    _planned(folder / "rapid", "rapid")
    plan = folder / "rapid" / "out" / "plan.json"
    return [Whole(plan, plan)]


def read_plan(path: Path) -> None:
    show_audit(path, None)
    show_audit(path, path.parents[1] / "job.toml")
    with about(path):
        program_from_file(path, "csv")


def programs(language: str, folder: Path) -> list[Whole]:
    _planned(folder / "in", language)
    out = folder / "in" / "out"
    beside = {"plan.json", "trajectory.csv", "report.html"}
    texts = [p for p in sorted(out.rglob("*")) if p.is_file() and p.name not in beside]
    assert texts, f"no program in {language}"
    main = _main_of(language, texts)
    for path in texts:
        assert path.stat().st_size < 400_000, path
    return [Whole(path, main) for path in texts]


def _main_of(language: str, texts: list[Path]) -> Path:
    suffix = languages()[language].suffix.lower()
    return next(p for p in texts if p.name.lower() == f"small{suffix}")


def read_a_program(path: Path) -> None:
    at = next(folder for folder in path.parents if (folder / "job.toml").exists())
    show_audit(path, at / "job.toml")


# ------------------------------------------------------------------------------ measured, stores


def measured(folder: Path) -> list[Whole]:
    head = ",".join(f"{side}_{axis}_mm" for side in ("nominal", "measured") for axis in "xyz")
    rows = ["0,0,0,1000,0,500", "100,0,0,1000,100,500", "0,100,0,900,0,500", "0,0,50,1000,0,550"]
    (folder / "points.csv").write_text("\n".join([f"point,{head}", *map("p,".__add__, rows)]))
    (folder / "points.tsv").write_text("\n".join([head, *rows]).replace(",", "\t"))
    return _alone(list(folder.iterdir()))


def read_points(path: Path) -> None:
    points = read_measured(path)
    with contextlib.suppress(InputError):  # which is about the points, not about the file
        placement_from_points(*points)


def stores(folder: Path) -> list[Whole]:
    tasks = [Task(f"{k:064}", f'{{"speed":{k}}}') for k in range(4)]
    failure = Failure(kind="NoFeasiblePath", message="none")
    outcomes = [
        TaskOutcome(key=task.key, value='{"cost": 1.5}', failure=None, seconds=0.1)
        for task in tasks
    ]
    outcomes[-1] = TaskOutcome(key=tasks[-1].key, value=None, failure=failure, seconds=0.1)
    with Store(folder / "sweep.sqlite") as store:
        store.add("a.function", zip(tasks, outcomes, strict=True))
    return _alone([folder / "sweep.sqlite"])


def read_store(path: Path) -> None:
    with Store(path) as store:
        for key in store.keys():  # noqa: SIM118 - no mapping
            store.outcome(key)


READERS: dict[str, Reader] = {
    "step": Reader(steps, read_drawing),
    "iges": Reader(igess, read_drawing),
    "dxf": Reader(dxfs, read_drawing),
    "table": Reader(tables, read_drawing),
    "mesh": Reader(meshes, read_mesh),
    "path": Reader(paths, read_drawing),
    "urdf": Reader(urdfs, read_robot),
    "job": Reader(jobs, read_a_job),
    "chart": Reader(chart_files.charts, read_chart),
    "foreign chart": Reader(chart_files.foreign_charts, chart_files.read_foreign_chart),
    "plan": Reader(plans, read_plan),
    **{
        language: Reader(functools.partial(programs, language), read_a_program)
        for language in LANGUAGES
    },
    "measured": Reader(measured, read_points),
    "store": Reader(stores, read_store),
}
