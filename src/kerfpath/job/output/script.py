"""Write a job as a Python script that calls the public functions, to be read and extended."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np

from kerfpath.cad import Machine, Part
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.job.as_run import keeps_between_nodes
from kerfpath.job.format import ContourSpec, CutRequest, Job, PreparedJob, pose
from kerfpath.job.format.cell import SHAPES, SIZES
from kerfpath.job.format.contour import OTHER_SIDE
from kerfpath.job.format.tables import CellTable, given
from kerfpath.options import PlanOptions
from kerfpath.post import ProgramOptions
from kerfpath.robots import robot as robot_of
from kerfpath.setting import settings as settings_of
from kerfpath.tilt import Tilt
from kerfpath.tolerances import SAME_PLACE

# -----------------------------------------------------------------------------
# Write the cell of a job as lines of a Python script.


def has_files(table: CellTable) -> bool:
    """Return whether anything in a cell except the part is read from a file."""
    return table.head.file is not None or any(each.file is not None for each in table.fixture)


def cell_lines(job: Job, cell: Cell) -> Iterator[str]:
    """Yield the lines that build `cell`, the cell of a job whose bodies need no files."""
    table = job.cell
    assert table is not None
    yield "# The bodies that the motions keep clear of."
    named = {"tool": "T_flange_tip", "head": _head(table)}
    if table.part:
        yield f"vertices, triangles = weld(*part.mesh({table.deviation_mm!r} * MM), {SAME_PLACE!r})"
        if table.sheet_mm is not None:
            yield f"vertices, triangles = thicken(vertices, triangles, {table.sheet_mm!r} * MM)"
        yield "solid = Mesh("
        yield "    vertices=vertices,"
        yield "    triangles=triangles,"
        yield f"    deviation={table.deviation_mm!r} * MM,"
        yield f"    name={job.part_file.name!r},"
        yield ")"
        named |= {"part": "solid"}
    yield "fixtures = {"
    for fixture in table.fixture:
        (key,) = given(fixture, *SHAPES)
        size = ", ".join(f"{mm!r} * MM" for mm in getattr(fixture, key))
        yield f"    {fixture.name!r}: {SHAPES[key].__name__}("
        yield f"        [{size}],"
        yield "        np.array(["
        yield from (
            f"            {row!r}," for row in pose(fixture.xyz_mm, fixture.rpy_deg).tolist()
        )
        yield "        ]),"
        yield "    ),"
    yield "}"
    floor = job.options.floor if all(each.name != "floor" for each in table.fixture) else None
    named |= {"placement": "T_base_part", "fixtures": "fixtures"}
    if on := {each.name: each.on for each in table.fixture if each.on is not None}:
        named["on"] = repr(on)
    if table.links == "capsules":
        named["links"] = "link_capsules(arm)"
    named |= {"near_miss": f"{table.near_miss_mm!r} * MM", "floor": repr(floor)}
    named["near_miss_of"] = repr(dict(cell.near_miss_of))
    touching = cell.may_touch
    named["may_touch"] = repr(dict(touching) if isinstance(touching, Mapping) else [*touching])
    yield "cell = cell_of("
    yield "    arm,"
    yield from (f"    {name}={value}," for name, value in named.items())
    yield ")"


def _head(table: CellTable) -> str:
    sizes = {"stand_off": f"{table.stand_off_mm!r} * MM", "share": repr(table.share)}
    for name in SIZES:
        mm = getattr(table.head, name)
        if isinstance(mm, tuple):
            sizes[name.removesuffix("_mm")] = f"({', '.join(f'{each!r} * MM' for each in mm)})"
        elif mm is not None:
            sizes[name.removesuffix("_mm")] = f"{mm!r} * MM"
    return f"CuttingHead({', '.join(f'{name}={value}' for name, value in sizes.items())})"


# -----------------------------------------------------------------------------
# Write a job as a Python script that calls the public functions, to be read and extended.

ANGLES = {"angle", "lower", "upper", "velocity", "acceleration"} | {
    name
    for kind in (PlanOptions, Tilt)
    for name, each in settings_of(kind).items()
    if each.kind is float and each.unit == "deg"
}
"""Arguments in rad, rad/s and rad/s^2, which are written in degrees if that loses no digit."""
CLASSES = ("Band", "Certify", "Comfort", "PlanOptions", "Reversals", "Tilt")
"""Names that the planning options may use."""
OF_CELL = ("CuttingHead", "Mesh", "box", "cell_of", "cylinder", "link_capsules", "thicken", "weld")
"""Names that a cell may use."""
SAY = "print"
"""The function with which the script prints; no module of this package except the CLI calls it."""
WIDTH = 99
"""Characters of a line beyond which the arguments of a call are written one per line."""
HEAD = '''\
"""The job {job}: read the drawing, plan each contour, audit, write the program.

Put it beside {drawing} and run it with Python. Lengths are in m, angles in rad, times in s and
speeds in m/s, unless a name says another unit; T_a_b maps coordinates of b into a.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from kerfpath import {used}
{cell}{execution}from kerfpath.post import build_program, language, post, write_files
{robots}
HERE = Path(__file__).parent
MM = 1e-3  # m
M_MIN = 1 / 60  # m/s

'''
CUT = '''
plans, faults = [], []


def cut(nodes, path, speed):
    """Plan a contour and audit the plan against its path; speed None: the nodes have times."""
    made = plan(
        nodes, arm, tool=T_flange_tip, placement=T_base_part, speed=speed, options=options{cell}
    )
{keep}    found = audit(
        made, reference=path, path_tolerance={path!r}, axis_tolerance={axis!r}{cell}
    )
    faults.extend(f"{{made.name}}: {{issue}}" for issue in found if issue.level == "error")
    plans.append(made)
    {say}(f"{{made.name}}: cost {{made.cost:.6g}}, {{made.proof.statement}}")

'''
KEEP = """\
    kept = keep_limits(made, lambda one: program([one]), controller=controller)
    made = kept.plan
    if not kept.done:
        {say}(f"{{made.name}}: {{kept.statement}}")
"""
WRITE = """
files = post(program(plans), {language!r}, settings)
(HERE / "out").mkdir(exist_ok=True)
for written in write_files(HERE / "out", files):
    {say}(written)
"""
REFUSE = """
if faults:
    raise SystemExit("\\n".join(faults))
"""


def python_script(prepared: PreparedJob, folder: Path | None = None) -> str:
    """Return a script that plans the contours of a job as its run does, and writes its program.

    Parameters
    ----------
    prepared : PreparedJob
    folder : Path, optional
        Folder of the script; default: that of the job.

    Raises
    ------
    InputError
        The job has a feature that a script cannot express; the message names it.
    """
    job = prepared.job
    if refusal := script_refusal(job, prepared.contours):
        said = f"{job.path}: {refusal}; run the job itself with kerfpath.job.run_job"
        raise InputError(said)
    drawing = os.path.relpath(job.part_file.absolute(), folder or job.path.absolute().parent)
    at_nodes = replace(job.options, between_nodes="reported")  # the rest follows after each plan
    lines = [_robot(job), *_externals(job), f"T_flange_tip = {_array(job.tool)}", ""]
    lines += [f"T_base_part = {_array(job.placement)}", "", _part(job, drawing), ""]
    lines += ["# The options of every plan.", _options(at_nodes)]
    if prepared.cell is not None:
        lines += ["", *cell_lines(job, prepared.cell)]
    within, cell = job.tolerances, "" if prepared.cell is None else ", cell=cell"
    keeps = keeps_between_nodes(job)
    failing = "faults.append" if job.options.between_nodes == "guaranteed" else SAY
    keep = KEEP.format(say=failing) if keeps else ""
    if job.program.language != "none":
        lines += _program(job)
    lines.append(CUT.format(path=within.path, axis=within.axis, say=SAY, keep=keep, cell=cell))
    for request in prepared.contours:
        lines += [*_contour(request, prepared.part), ""]
    lines.append(REFUSE)
    if job.program.language != "none":
        lines += [WRITE.format(language=job.program.language, say=SAY)]
    text = "\n".join(lines).replace("\n\n\n\n", "\n\n\n").rstrip() + "\n"
    classes = [name for name in CLASSES if f"{name}(" in text]
    used = ", ".join([*classes, "audit", "cad", "operations", "plan", "robot"])
    execution = "from kerfpath.execution import keep_limits\n" if keeps else ""
    of_cell = ", ".join(name for name in OF_CELL if f"{name}(" in text)
    cell = f"from kerfpath.cell import {of_cell}\n" if prepared.cell is not None else ""
    robots = "from kerfpath.robots import ExternalAxis\n" if job.robot.externals else ""
    names = {"job": _plain(job.path.name), "drawing": _plain(drawing)}
    head = HEAD.format(**names, used=used, execution=execution, cell=cell, robots=robots)
    return head + text


def script_refusal(job: Job, requests: Sequence[CutRequest]) -> str:
    """Return what a job asks for that a script cannot express; empty if there is none."""
    table = job.source["robot"].get("acceleration_table")
    assumed = not keeps_between_nodes(job) or bool(job.program.rules.controller.assumed)
    beyond = {
        'between_nodes = "guaranteed" without a proof': assumed
        and job.options.between_nodes == "guaranteed",
        "solids from files in [cell]": job.cell is not None and has_files(job.cell),
        "lines in [part]": job.drawing.lines is not None,
        "[sequence]": job.sequence is not None,
        "[robot] without model": "model" not in job.source["robot"],
        'start = "best" or direction = "best"': any(len(r.candidates) > 1 for r in requests),
        "interruptions": job.options.interruptions != "none",
        "refine with parts": job.options.refine_parts > 1,
        "handshakes": bool(job.program.handshakes),
        "compensate": job.compensation is not None,
        "power_by_speed": job.program.power is not None,
        "techniques with another pierce, gas or power": bool(job.program.contours),
        "acceleration_table from a file": table not in (None, "library"),
        "acceleration_table beside other accelerations": table is not None
        and {"acceleration_deg_s2", "acceleration_ratio"} & {*job.source["robot"]},
    }
    found = ", ".join(name for name, asked in beyond.items() if asked)
    return f"a script cannot express {found}" if found else ""


def _robot(job: Job) -> str:
    model = job.source["robot"]["model"]
    table = job.source["robot"].get("acceleration_table")
    plain, own = robot_of(model, acceleration_table=table), job.robot.alone()
    limits, before = own.joint_limits(), plain.joint_limits()
    known = {"velocity": plain.velocity, "acceleration": plain.acceleration}
    changed: dict[str, object] = {}
    for name, new, old in (
        ("lower", limits.lower, before.lower),
        ("upper", limits.upper, before.upper),
        ("velocity", own.velocity, known["velocity"]),
        ("acceleration", own.acceleration, known["acceleration"]),
        ("jerk", own.limits.jerk, plain.limits.jerk),
        ("endless", own.endless, plain.endless),
    ):
        if new is None:
            continue
        if old is None or not np.array_equal(np.asarray(new), np.asarray(old)):
            changed[name] = np.asarray(new)
    asked = "" if table is None else f", acceleration_table={table!r}"
    text = f"arm = robot({model!r}{asked})"
    return _call(f"{text}.with_limits", changed) if changed else text


def _externals(job: Job) -> Iterator[str]:
    """Yield the lines that give the robot its external axes."""
    robot, n = job.robot, job.robot.family.joints
    limits = robot.joint_limits()
    travel = zip(limits.lower, limits.upper, *robot.speed_limits(), strict=True)
    for i, (axis, values) in enumerate(zip(robot.externals, [*travel][n:], strict=True)):
        said: dict[str, object] = {
            "name": axis.name,
            "kind": axis.kind,
            "carries": axis.carries,
            "axis": axis.axis,
            "point": axis.point,
        }
        said |= {} if axis.step is None else {"step": axis.step}
        told = _mm if axis.kind == "linear" else _angle
        yield "arm = arm.with_external("
        yield f"    {_call('ExternalAxis', said).replace(chr(10), chr(10) + '    ')},"
        for name, value in zip(("lower", "upper", "velocity", "acceleration"), values, strict=True):
            yield f"    {name}={told(float(value))},"
        if robot.endless[n + i]:
            yield "    endless=True,"
        yield ")"


def _part(job: Job, file: str) -> str:
    drawing = job.drawing
    named = {
        field.name: value
        for field in fields(drawing)
        if field.name not in ("file", "accept_left_out")
        and _differs(value := getattr(drawing, field.name), field.default)
    }
    more = f", {_arguments(named)}" if named else ""
    return f"part = cad.read(HERE / {file!r}{more})"


def _options(options: PlanOptions) -> str:
    plain = PlanOptions()
    named = {
        field.name: value
        for field in fields(PlanOptions)
        if _differs(value := getattr(options, field.name), getattr(plain, field.name))
    }
    return _call("options = PlanOptions", named)


def _differs(one: object, two: object) -> bool:
    if isinstance(one, np.ndarray) or isinstance(two, np.ndarray):
        return not np.array_equal(np.asarray(one), np.asarray(two))
    return one != two


def _contour(request: CutRequest, part: Part) -> Iterator[str]:
    """Yield the lines that cut a contour."""
    task, (candidate,) = request.task, request.candidates
    table = task.table
    yield f"# {_plain(task.name)}"
    yield f"path = part.contour({task.pick!r}, closed={request.loop.closed})"
    if table.lead_in or table.lead_out or table.corners:
        yield f"surface = part.surface({task.pick!r})"
    for call in _operations(task, part):
        yield f"path = operations.{call}"
    yield f"path = replace(path, name={task.name!r})"
    speed = f"{task.table.speed_m_min:g} * M_MIN"
    yield from _nodes(task, candidate.path, speed)
    yield f"cut(nodes, path, {'None' if candidate.speed is None else speed})"


def _nodes(task: ContourSpec, path: Contour, speed: str) -> Iterator[str]:
    """Yield how a path is sampled, see `ContourSpec.sample`."""
    slowed = bool((path.speed_share < 1).any())
    step = None if task.time_step is None else repr(task.time_step)
    if task.spacing is not None and slowed:
        step = f"{_mm(task.spacing)} / ({speed})"
    if step is not None:
        more = ", bend_ends=True" if task.bend_ends else ""
        yield f"nodes = path.resample(dt={step}, speed={speed}{more})"
        if not slowed:
            yield "nodes = replace(nodes, time=None)"
        return
    asked = {
        "spacing": None if task.spacing is None else _mm(task.spacing),
        "count": None if task.count is None else str(task.count),
        "tolerance": None if task.tolerance is None else _mm(task.tolerance),
        "axis_tolerance": None if task.axis_tolerance is None else _angle(task.axis_tolerance),
        "bend_ends": "True" if task.bend_ends else None,
    }
    said = ", ".join(f"{name}={value}" for name, value in asked.items() if value is not None)
    yield f"nodes = path.resample({said})"


def _operations(task: ContourSpec, part: Part) -> Iterator[str]:
    """Yield the operations on a loop in their order, see `ContourSpec.candidates`."""
    table = task.table
    back = table.direction == "reversed"
    scrap = OTHER_SIDE[table.scrap] if back else table.scrap
    corners, surface = table.corners, "surface=surface"
    if back:
        yield "reverse(path)"
    if (smooth := table.smooth_axes) is not None:
        limit = f"np.radians({smooth.limit_deg!r})"
        yield f"smooth_axes(path, {smooth.distance_mm!r} * MM, limit={limit})"
    if table.kerf_mm:
        sharp = corners is not None
        yield f"offset(path, {table.kerf_mm!r} * MM / 2, side={scrap!r}, sharp={sharp})"
    if corners is not None and corners.round_mm is not None:
        yield f"round_corners(path, {corners.round_mm!r} * MM, {surface})"
    if corners is not None and corners.loop_mm is not None:
        yield f"loop_corners(path, {corners.loop_mm!r} * MM, side={scrap!r}, {surface})"
    if table.start_mm is not None:
        yield f"start_at(path, path.s[0] + {table.start_mm!r} * MM)"
    elif table.start == "smoothest":
        yield "start_at(path, operations.smoothest_start(path))"
    if table.bevel_deg:
        yield f"bevel(path, np.radians({table.bevel_deg!r}), side={scrap!r})"
    if (joints := table.micro_joints) is not None:
        yield f"micro_joints(path, {joints.width_mm!r} * MM, count={joints.count})"
    if table.overlap_mm is not None:
        yield f"overlap(path, {table.overlap_mm!r} * MM)"
    for name, lead in (("lead_out", table.lead_out), ("lead_in", table.lead_in)):
        if lead is not None:
            fan = None if lead.fan_mm is None else f"{lead.fan_mm!r} * MM"
            yield (
                f"{name}(path, {lead.length_mm!r} * MM, shape={lead.shape!r}, "
                f"angle=np.radians({lead.angle_deg!r}), side={scrap!r}, {surface}, fan={fan}, "
                f"speed_share={lead.speed_share!r})"
            )
    if corners is not None and corners.slow_share is not None:
        yield (
            f"slow_corners(path, {corners.slow_share!r}, distance={corners.slow_mm!r} * MM, "
            f"ramp={corners.ramp_mm!r} * MM)"
        )
    if task.turn_step is not None and task.edges(part):
        yield (
            f"slow_turns(path, [turn.at for turn in part.loop({task.pick!r}).edge_turns], "
            f"distance=part.edge_turn, step={_mm(task.turn_step)})"
        )


def _program(job: Job) -> list[str]:
    options = job.program
    known = settings_of(ProgramOptions).items()
    named = {name: getattr(options, name) for name, each in known if each.takes is not None}
    del named["language"]
    if options.remarks:
        named["remarks"] = options.remarks
    said = {} if options.settings is None else options.settings.model_dump(exclude_defaults=True)
    settings = f"language({options.language!r}).settings({_arguments(said)})"
    made = _call("return build_program", named, "plans").replace("\n", "\n    ")
    controller = f"controller = language({options.language!r}).controller(settings)"
    return [
        f"settings = {settings}",
        *([controller] if keeps_between_nodes(job) else []),
        "",
        "",
        "def program(plans):",
        '    """Return the neutral program that cuts the plans."""',
        f"    {made}",
        "",
    ]


def _arguments(values: Mapping[str, object]) -> str:
    return ", ".join(f"{name}={_value(value, name)}" for name, value in values.items())


def _call(what: str, values: Mapping[str, object], *first: str) -> str:
    """Return a call, its arguments below each other where the line would be long."""
    said = [*first, *(f"{name}={_value(value, name)}" for name, value in values.items())]
    line = f"{what}({', '.join(said)})"
    return line if len(line) <= WIDTH else f"{what}(\n    " + ",\n    ".join(said) + ",\n)"


def _plain(name: str) -> str:
    """Return a name for a comment: nothing in it that could end one."""
    return re.sub(r"[^\w .,()+/-]+", " ", " ".join(name.split()))


def _value(value: object, name: str = "") -> str:
    """Return a value as Python writes it; angles by their names in degrees."""
    if isinstance(value, np.ndarray):
        return _degrees(value) if name in ANGLES else _array(value)
    if isinstance(value, float) and name in ANGLES:
        return _angle(value)
    if is_dataclass(value) and not isinstance(value, type):
        inner = {field.name: getattr(value, field.name) for field in fields(value)}
        given = {key: each for key, each in inner.items() if each is not None}
        module = "cad." if isinstance(value, Machine) else ""
        return f"{module}{type(value).__name__}({_arguments(given)})"
    return "np.inf" if value == np.inf else repr(value)


def _array(values: np.ndarray) -> str:
    if values.ndim == 2:
        rows = ",\n".join(f"        {row!r}" for row in values.tolist())
        return f"np.array(\n    [\n{rows},\n    ]\n)"
    return f"np.array({values.tolist()!r})".replace("inf", "np.inf")


def _degrees(values: np.ndarray) -> str:
    shown = [float(f"{value:.10g}") for value in np.degrees(values).tolist()]
    if np.array_equal(np.radians(shown), values):
        return f"np.radians({[_short(value) for value in shown]!r})".replace("'", "")
    return _array(values)


def _angle(value: float) -> str:
    shown = float(f"{np.degrees(value):.10g}")
    return f"np.radians({_short(shown)})" if np.radians(shown) == value else repr(value)


def _mm(metres: float) -> str:
    shown = float(f"{metres * 1e3:.10g}")
    return f"{_short(shown)} * MM" if shown * 1e-3 == metres else repr(metres)


def _short(value: float) -> str:
    return f"{value:.10g}"
