"""Read a TOML job file into a job in SI with all its references resolved."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ValidationError

from kerfpath.arrays import Array, Ints, freeze, short_repr
from kerfpath.cad import Machine, Part, unit_question
from kerfpath.cell import Cell
from kerfpath.comfort import Comfort
from kerfpath.contour import Contour
from kerfpath.dynamics import STANDARD_GRAVITY
from kerfpath.errors import InputError
from kerfpath.execution import IDEAL, Correction, Response, read_correction
from kerfpath.graph import LayeredGraph
from kerfpath.job.format.contour import ContourSpec, contour_request, keys_of_closed_loops
from kerfpath.job.format.process import (
    SmallHoles,
    contours_of,
    require_prices,
    sheet_of,
    small_holes_of,
    with_process,
)
from kerfpath.job.format.tables import (
    LIMITS_MARGIN,
    CellTable,
    ContourTable,
    CostTable,
    ExternalTable,
    JobFile,
    LayoutTable,
    MachineTable,
    SequenceTable,
)
from kerfpath.job.format.tables.job import Tolerances, said_in_keys
from kerfpath.job.format.tables.part import Drawing
from kerfpath.job.format.tables.table import Table, nearest
from kerfpath.job.format.toml_file import all_of, read_tables, read_text, refusal, refusal_at
from kerfpath.options import OptionConflict, PlanOptions
from kerfpath.planner import coarse_places, external_course, folds, layered_graph
from kerfpath.post import ProgramOptions, languages
from kerfpath.robots import Robot
from kerfpath.setup import Setup

NEEDED = "[robot], [tool], [part] and [[contour]]"
"""The tables that every job has."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Job:
    """A job file, read and resolved: all values are in SI, only the part is not read yet.

    Parameters
    ----------
    path : Path
        The job file.
    robot : Robot
        The robot, with the limits of the job.
    tool : (4, 4) m
        T_flange_tip.
    placement : (4, 4) m
        T_base_part.
    drawing : Drawing
        The CAD file and how to read it.
    contours : tuple of ContourSpec
        The contours, in the order of the file.
    options : PlanOptions
        Options for planning every contour.
    cell : CellTable or None
        The [cell] table; without one, collisions are not checked.
    home : (n,) rad, optional
        Joints at the beginning and the end of the program, external axes last (m if linear).
    sequence : SequenceTable or None
        The [sequence] table; without one, the order is that of the file and no moves are planned.
    layout : LayoutTable
        The [layout] table: what `kerfpath layout` may move, and how far.
    tolerances : Tolerances
        Tolerances of the audit between the nodes.
    program : ProgramOptions
        Options of the robot program.
    source : mapping
        The parsed file: its tables and keys, with values that JSON can hold, and those that a
        chart fills in, see `kerfpath.job.format.process`.
    response : Response
        How the joints of the robot follow what its controller commands.
    path_tolerance : float m, optional
        Largest distance of the executed tip from the path; None: it is only reported.
    compensation : "model", Correction or None
        How targets are moved so that the executed path is as drawn: by the response, or as
        measured runs have shown; None: they are not.
    most_moved : float m
        Largest displacement of a target by it.
    text : str
        The text of the file, with its comments.
    accepts_incomplete : bool
        Whether a program may lack contours that have no path.
    switched_off : tuple of str
        Names of contours that are not cut.
    small_holes : SmallHoles or None
        How holes up to a size are cut, if not as their contour says.
    cost : CostTable or None
        Prices.
    """

    path: Path
    robot: Robot
    tool: Array
    placement: Array
    drawing: Drawing
    contours: tuple[ContourSpec, ...]
    options: PlanOptions
    cell: CellTable | None
    home: Array | None
    sequence: SequenceTable | None
    layout: LayoutTable
    tolerances: Tolerances
    program: ProgramOptions
    source: Mapping[str, Any]
    response: Response = IDEAL
    path_tolerance: float | None = None
    compensation: Literal["model"] | Correction | None = None
    most_moved: float = 2e-3
    text: str = ""
    accepts_incomplete: bool = False
    switched_off: tuple[str, ...] = ()
    small_holes: SmallHoles | None = None
    cost: CostTable | None = None

    __repr__ = short_repr

    @property
    def part_file(self) -> Path:
        """The CAD file; it existed when the job was read."""
        return self.drawing.file

    @property
    def turns_within(self) -> tuple[Array, Array] | None:
        """Least and greatest angles (n,) rad of endless joints in the program; None without any."""
        language = languages().get(self.program.language)
        return None if language is None else language.turns_within(self.robot)

    def read_part(self) -> Part:
        """Return the part in the CAD file.

        Raises
        ------
        InputError
            The file cannot be read, its unit is surely wrong and not confirmed, or geometry that
            may have to be cut is left out.
        """
        part = self.drawing.read()
        if self.drawing.unit is None and (question := unit_question(part.unit, part.bounding_box)):
            raise refusal_at(self.path, ("part", "file"), question)
        doubtful = [str(one) for one in part.left_out if one.may_cut]
        if doubtful and not self.drawing.accept_left_out:
            said = (
                f"expected a drawing that can be read completely; {'; '.join(doubtful)}; repair "
                f'{self.part_file.name}, or write left_out = "accept"'
            )
            raise refusal_at(self.path, ("part", "file"), said)
        return part

    def setup_in(self, cell: Cell | None) -> Setup:
        """Return the setup of the job's contours in its cell, or without one."""
        return Setup(robot=self.robot, tool=self.tool, placement=self.placement, cell=cell)

    def graph(
        self,
        nodes: Contour,
        options: PlanOptions | None = None,
        *,
        only: Ints | None = None,
        external: Array | None = None,
        folded_at: float | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> LayeredGraph:
        """Return the layered graph of a contour's nodes, by these options or those of the job.

        With `only` (M,), the graph has the layers of these nodes only. External axes are at
        `external`, (K, E) or (K, X, E) rad or m; by default the continuous method takes the
        course of `kerfpath.planner.external_course`. With `folded_at` it has one turn only of each
        joint that a plan folds where nodes are so many seconds apart.
        """
        chosen = options or self.options
        if self.robot.free.size and external is None and chosen.method == "continuous":
            external = external_course(
                nodes, self.robot, tool=self.tool, placement=self.placement, options=chosen
            )
        return layered_graph(
            nodes,
            self.robot,
            tool=self.tool,
            placement=self.placement,
            options=chosen,
            nodes=only,
            external=external,
            fold=None if folded_at is None else folds(self.robot, chosen, folded_at),
            progress=progress,
        )

    def tasks(self, part: Part) -> tuple[ContourSpec, ...]:
        """Return the contours to cut, one for each loop that is picked and not switched off.

        Raises
        ------
        InputError
            A loop does not exist or is picked twice, has no speed, or is an open line with a key
            that needs a closed loop; a name that is switched off is no contour, or every contour
            is switched off.
        """
        tasks, faults = list[ContourSpec](), list[InputError]()
        for number, table in enumerate(self.contours):
            try:
                for task in table.expanded(part):
                    loop = part.loop(task.pick)
                    if lacks := task.lacks_speed(loop):
                        raise refusal_at(self.path, ("contour", number, "speed_m_min"), lacks)
                    if loop.kind == "open":
                        self._require_open(task, number)
                    tasks.append(task)
            except InputError as fault:
                faults.append(fault)
        if faults:
            raise all_of(faults)
        names = [task.name for task in tasks]
        for name in names:
            if names.count(name) > 1:
                raise InputError(
                    f"{self.path}: contour {name!r} is picked twice; give one of the two another "
                    "name, or narrow [contour.pick_all]"
                )
        at = ("part", "switched_off")
        for name in self.switched_off:
            if name not in names:
                said = f"expected names of contours, got {name!r}; {nearest(name, names)}"
                raise refusal_at(self.path, at, said)
        on = tuple(task for task in tasks if task.name not in self.switched_off)
        if not on:
            raise refusal_at(self.path, at, "every contour is switched off; switch one on")
        return on

    def _require_open(self, task: ContourSpec, number: int) -> None:
        """Raise InputError if table `number` has a key that its open line cannot have."""
        line = f"loop {task.pick!r} is an open line, which"
        for key, why in keys_of_closed_loops(task.table).items():
            raise refusal_at(self.path, ("contour", number, key), f"{line} {why}; remove {key}")
        if self.options.closure == "periodic":
            said = f'{line} does not return to its start; write closure = "free"'
            raise refusal_at(self.path, ("plan", "closure"), said)


def read_job(path: str | Path, *, copy_of: Path | None = None) -> Job:
    """Return the job in a TOML file.

    If the file is a copy beside the job, `copy_of` is the job, which the program is named after.

    Raises
    ------
    InputError
        The file is not a valid job. One line names file, line and key, what was expected, what
        came and what to do, for the first problem, and how many more there are.
    """
    path = Path(path)
    text = read_text(path, "a job file")
    source = with_process(path, text, read_tables(path, text, "a job file", NEEDED))
    try:
        file = JobFile.model_validate(source, context={"folder": path.parent})
    except ValidationError as error:
        raise refusal(path, text, error) from None
    described = file.cell is not None and file.cell.links != "capsules"
    robot = _loaded(path, file, file.robot.resolve(path.parent, bodies=described))
    robot = _expressible(path, file, robot)
    if file.plan.rotation_deg is not None and not robot.endless.any():
        raise refusal_at(
            path,
            ("plan", "rotation_deg"),
            "expected an endless axis to limit, got none; remove rotation_deg, or list endless "
            "axes with endless in [robot]",
        )
    try:
        moves = file.program.language != "none" or file.sequence is not None
        options = file.plan.resolve(
            robot,
            comfort=_comfort(path, file, robot),
            retract=file.program.retract_mm / 1000 if moves else None,
            floor=file.robot.height_of_floor(),
        )
    except OptionConflict as conflict:
        raise refusal_at(path, *said_in_keys(conflict, file.plan)) from None
    drawing = file.part.drawing(path.parent)
    small = small_holes_of(path, text, source)
    if file.cost is not None and file.process is not None:
        rows = [*file.process.row, *([small.row] if small else [])]
        require_prices(path, file.cost, file.process, rows)
    return Job(
        path=path,
        robot=robot,
        tool=file.tool.resolve(),
        placement=file.part.resolve(drawing),
        drawing=drawing,
        contours=_requests(path, file, small),
        options=options,
        cell=file.cell,
        home=home_of(file.sequence, file.robot.external, robot),
        sequence=file.sequence,
        layout=file.layout,
        tolerances=file.audit.resolve(),
        response=file.robot.response_in(path.parent),
        path_tolerance=file.plan.executed_tolerance,
        compensation=_compensation(path, file),
        most_moved=file.program.compensate_most_mm / 1000,
        program=file.program.resolve(
            (copy_of or path).stem,
            file.audit.resolve().path,
            sheet_of(source),
            contours_of(source),
        ),
        source=source,
        text=text,
        accepts_incomplete=file.program.incomplete == "accept",
        switched_off=file.part.switched_off,
        small_holes=small,
        cost=file.cost,
    )


def _requests(path: Path, file: JobFile, small: SmallHoles | None) -> tuple[ContourSpec, ...]:
    """Return what each [[contour]] asks for, and how it is cut if it is a small hole."""
    asked = tuple(contour_request(table) for table in file.contour)
    if small is None:
        return asked
    found = []
    for number, (spec, own) in enumerate(zip(asked, small.tables, strict=True)):
        if own is None:
            found.append(spec)
            continue
        try:
            other = contour_request(ContourTable.model_validate(own))
        except ValidationError as error:
            said = error.errors(include_url=False)[0]["msg"]
            said = f"with the values of {small.row.place} for small holes: {said}"
            raise refusal_at(path, ("contour", number), said) from None
        other = replace(other, by_size=True)
        found.append(replace(spec, small=other, small_size=small.size))
    return tuple(found)


def _compensation(path: Path, file: JobFile) -> Literal["model"] | Correction | None:
    """Return how targets are moved, or raise InputError at the key if they cannot be."""
    said, at = file.program.compensate, ("program", "compensate")
    if said is None:
        return None
    if file.program.language == "none":
        raise refusal_at(path, at, "expected a program to compensate, got none; name a language")
    if said != "model":
        try:
            return read_correction(path.parent / said)
        except InputError as error:
            raise refusal_at(path, at, f"{error}") from None
    if file.robot.response_in(path.parent).model == "ideal":
        raise refusal_at(
            path,
            at,
            "expected joints that lag, got an ideal response in [robot.response], with which there "
            "is nothing to compensate; name another source, or remove compensate",
        )
    return "model"


def places_of(job: Job, nodes: Contour) -> Array | None:
    """Return a coarse grid (K, X, E) of the joints that a pose leaves free; None without any."""
    if not job.robot.free.size:
        return None
    places = coarse_places(job.robot)
    return np.broadcast_to(places, (len(nodes), *places.shape))


def home_of(
    sequence: SequenceTable | None, external: Sequence[ExternalTable], robot: Robot
) -> Array | None:
    """Return the joints (n,) at home, external axes last; None where a job has no home.

    An external axis without a home in its table is at zero, or at its limit nearest to zero.
    """
    if sequence is None or sequence.home_deg is None:
        return None
    said = {table.called: table.home for table in external if table.home is not None}
    limits = robot.joint_limits()
    nearest = np.clip(0.0, limits.lower, limits.upper)
    more = [
        said.get(axis.name, nearest[i])
        for i, axis in enumerate(robot.externals, robot.family.joints)
    ]
    return freeze(np.append(np.radians(sequence.home_deg), more))


def _loaded(path: Path, file: JobFile, robot: Robot) -> Robot:
    """Return the robot with the load on its flange if the job gives one; torques need it."""
    table, load = file.robot, file.tool.load()
    asked = next((k for k in ("torque_nm", "gravity_m_s2") if getattr(table, k) is not None), None)
    if load is None:
        if asked is not None:
            said = (
                f"expected mass_kg and centre_mm of the load on the flange, as {asked} is given, "
                "got none; add them, or mass_kg = 0 without a load"
            )
            raise refusal_at(path, ("tool", "mass_kg"), said)
        return robot
    try:
        return robot.with_load(load, gravity=table.gravity_m_s2 or STANDARD_GRAVITY)
    except InputError as error:
        if robot.limits.torque is None and robot.dynamics.inertia is not None:
            said = (
                f"expected torque limits, as {table.urdf} does not state that of every joint, got "
                f"none; add torque_nm = [{robot.joints} numbers, N m]"
            )
            raise refusal_at(path, ("robot", "torque_nm"), said) from None
        said = f"{error}; give urdf with inertias in [robot], or remove mass_kg"
        raise refusal_at(path, ("tool", "mass_kg"), said) from None


def _expressible(path: Path, file: JobFile, robot: Robot) -> Robot:
    """Return the robot with the joints that targets in the language of the program can express."""
    if (language := languages().get(file.program.language)) is None or language.bounds is None:
        return robot
    limits = robot.joint_limits()
    lower, upper = language.expressible(robot, limits.lower, limits.upper)
    if (bad := np.flatnonzero(lower > upper)).size:
        joint = int(bad[0])
        ends = np.degrees([limits.lower[joint], limits.upper[joint]])
        said = (
            f"{language.title} can express no angle of joint {joint + 1} from {ends[0]:g} to "
            f"{ends[1]:g} deg; change the limits in [robot], or take another language"
        )
        raise refusal_at(path, ("program", "language"), said)
    return robot.with_limits(lower=lower, upper=upper)


def _comfort(path: Path, file: JobFile, robot: Robot) -> Comfort | None:
    """Return the margins and penalties of plans.

    By default joints keep a margin to their limits, for the digits of a program and for straight
    joint motions between nodes, unless the range of a joint is too small for it.
    """
    limits, own = robot.joint_limits(), slice(robot.family.joints)
    ranges = (limits.upper - limits.lower)[own][~limits.endless[own]]
    wide = bool((ranges > np.radians(2 * LIMITS_MARGIN)).all())
    comfort = file.comfort.resolve({"limits": LIMITS_MARGIN} if wide else None)
    try:
        if comfort is not None:
            comfort.price_of_reversals(robot)
    except InputError as error:
        said = str(error).removeprefix("comfort reversals joints: ")
        raise refusal_at(path, ("comfort", "reversals_joints"), said) from None
    return comfort


class _OnlyPart(Table):
    class _OnlyMachine(Table):
        machine: MachineTable

    part: _OnlyMachine


def machine_of(text: str, name: str) -> Machine:
    """Return the machine in the value of a key `machine` of [part], such as { head = "CB" }.

    Raises
    ------
    InputError
        It is not valid; the message begins with `name`.
    """
    source = f"part.machine = {text}"
    try:
        file = _OnlyPart.model_validate(read_tables(Path(name), source, "a job file", NEEDED))
    except ValidationError as error:
        raise refusal(Path(name), source, error) from None
    return file.part.machine.machine()
