"""Write report.html, the report of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kerfpath._arrays import Array
from kerfpath.cad import Departure
from kerfpath.job.format import Job
from kerfpath.job.run import JobResult
from kerfpath.report import ContourSection, render
from kerfpath.robots import Robot
from kerfpath.transfer import TransferMove

__all__ = ["report_text"]

PER_LEG = 17
"""Number of points with which a straight joint motion is drawn."""


def report_text(outcome: JobResult, notes: Sequence[str], faults: Sequence[str] = ()) -> str:
    """Return the HTML report of a run; `faults` say why it must not be cut although planned."""
    job = outcome.job
    sections = [
        ContourSection(
            name=cut.name,
            graph=cut.graph,
            path=cut.candidate.nodes,
            plan=cut.plan,
            checks=(*cut.checks, *cut.as_run.checks),
            failure="" if cut.broken is None else str(cut.broken),
            remedy=cut.remedy,
            broken_at=None if cut.broken is None else cut.broken.node + 1,
            clearance=cut.clearance,
            sampling=() if cut.departure is None else _sampling(cut.departure),
        )
        for cut in outcome.cuts
    ]
    speeds = sorted({task.speed * 60 for task in job.contours})
    robot, options = job.robot, job.options
    arm = robot.family.joints
    velocity, acceleration = (np.degrees(v[:arm]).round(1) for v in robot.speed_limits())
    facts = [
        ("Job", job.path.name),
        ("Part", job.part_file.name),
        ("Robot", f"{robot.manufacturer} {robot.model}".strip() or robot.id),
        ("Cutting speed", f"{' / '.join(f'{v:g}' for v in speeds)} m/min"),
        ("Gamma step", f"{np.degrees(options.gamma_step):g} deg"),
        ("Objective", f"{options.objective}, {options.metric} metric"),
        ("Method", f"{options.method}, {options.frames} frames"),
        ("Limits used", f"{options.eta_v:.0%} velocity, {options.eta_a:.0%} acceleration"),
        ("Joint velocity limits", f"{_row(velocity)} deg/s"),
        (
            "Joint acceleration limits",
            f"{_row(acceleration)} deg/s^2 ({robot.acceleration_source})",
        ),
        *_more_limits(robot),
        ("Endless axes", _row(np.flatnonzero(robot.endless[:arm]) + 1) or "none"),
        *_external_facts(robot),
    ]
    # Moves from and to home are long, and would make the part small in the picture.
    moves = outcome.moves
    between = moves[1:-1] if len(moves) > len(outcome.plans) else moves
    return render(
        f"{job.part_file.stem.replace('_', ' ')}",
        sections,
        mesh=outcome.mesh,
        cell=outcome.cell,
        moves=[_tips(job, move) for move in between],
        facts=facts,
        faults=faults,
        notes=notes,
        job_text=job.text,
    )


def _more_limits(robot: Robot) -> Iterator[tuple[str, str]]:
    """Yield the limits on jerk and torque, where there are any."""
    if robot.jerk is not None:
        yield "Joint jerk limits", f"{_row(np.degrees(robot.jerk).round(1))} deg/s^3"
    if robot.load is not None:
        load = f"load {robot.load.mass:g} kg, without friction and rotors"
        yield "Joint torque limits", f"{_row(robot.torque)} N m ({load})"


def _external_facts(robot: Robot) -> list[tuple[str, str]]:
    """Return a row for each external axis: what it carries, and its limits."""
    limits, arm = robot.joint_limits(), robot.family.joints
    facts = []
    for i, axis in enumerate(robot.externals, arm):
        scale, unit = (1e3, "mm") if axis.unit == "m" else (180 / np.pi, "deg")
        low, high, velocity, acceleration = (
            f"{scale * values[i]:.6g}"
            for values in (limits.lower, limits.upper, *robot.speed_limits())
        )
        travel = "endless" if robot.endless[i] else f"{low} to {high} {unit}"
        said = f"{axis.kind}, carries the {axis.carries}; {travel}"
        said += f", {velocity} {unit}/s, {acceleration} {unit}/s^2"
        facts.append((f"External axis {axis.name}", said))
    return facts


def _sampling(found: Departure) -> list[tuple[str, str]]:
    """Return the rows on how far the nodes leave the curve that they sample."""
    against = {
        "CAD curve": "the CAD curve",
        "points of the drawing": "the lines through the points of the drawing",
        "path as cut": "the path as cut, which differs from the drawn loop",
    }
    rows = [
        ("Measured against", against[found.against]),
        ("Largest chord error", f"{found.chord_error * 1e3:.4f} mm, after node {found.chord_node}"),
        (
            "Largest axis error between nodes",
            f"{np.degrees(found.axis_error):.3f} deg, after node {found.axis_node}",
        ),
        (
            "Largest axis step from node to node",
            f"{np.degrees(found.axis_step):.3f} deg, after node {found.step_node}",
        ),
    ]
    if (loop := found.path) is not None:
        off = f"{loop.chord_error * 1e3:.4f} mm and {np.degrees(loop.axis_error):.3f} deg"
        rows.append(("Drawn loop", f"within {off} of {against[loop.against]}"))
    return rows


def _tips(job: Job, move: TransferMove) -> Array:
    """Return points of the tool tip along a move, (m, 3) m, part frame."""
    legs = np.linspace(move.q[:-1], move.q[1:], PER_LEG, axis=1).reshape(-1, move.q.shape[1])
    T = np.linalg.inv(job.placement) @ job.robot.forward(legs) @ job.tool
    return np.asarray(T[:, :3, 3])


def _row(values: object) -> str:
    return " ".join(f"{v:g}" for v in np.asarray(values).tolist())
