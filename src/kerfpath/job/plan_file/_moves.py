"""Audit the transfer moves of a plan.json against the job."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kerfpath._arrays import Array
from kerfpath.auditor import Check, transfer_checks, worst_of
from kerfpath.errors import InputError
from kerfpath.job.format import PreparedJob
from kerfpath.job.plan_file._checks import check, count
from kerfpath.plans import Plan
from kerfpath.sequence import Order, PartPlan
from kerfpath.transfer import End, TransferMove, back_off, least_time

__all__ = ["check_moves", "expect_sequence"]

SAME_CORNER = 1e-6
"""Rounding tolerance, rad, between an end of a move and the end of the retract."""
FARTHEST = 1e3
"""Joint value, rad, that no joint ever has."""
SHARES = np.linspace(0.0, 1.0, 9)
"""Shares of the retract at which approach and retract are checked for collisions."""


def check_moves(
    prepared: PreparedJob, plans: Sequence[Plan], moves: Sequence[TransferMove]
) -> list[Check]:
    """Return the worst of each check over all moves; its node is the number of the move.

    Each must lead from the retract of one cut to the approach of the next, or home, within the
    limits, not faster than the robot can, and free of collisions, as must approach and retract.
    """
    sequence, robot = prepared.job.sequence, prepared.job.robot
    if sequence is None:
        return [count("moves", "moves that the job does not ask for", len(moves))] if moves else []
    homes = 2 if prepared.job.home is not None else 0
    wanted = len(plans) - 1 + homes
    rows = [count("moves", "missing or surplus moves", abs(len(moves) - wanted))]
    odd = [m for m in moves if m.q.shape[1] != robot.joints or len(m.q) < 2]
    far = [m for m in moves if not np.abs(m.q).max(initial=0.0) < FARTHEST]
    rows.append(count("corners", "moves without two corners of the robot's joints", len(odd)))
    rows.append(count("air-limits", "moves with corners beyond any joint's range", len(far)))
    if len(moves) != wanted or odd or far:
        return rows
    try:
        ways = [(_approach(prepared, p, "start"), _approach(prepared, p, "end")) for p in plans]
    except InputError as error:
        return [*rows, count("retract", f"ends of cuts without a possible retract: {error}", 1)]
    o, cell = prepared.job.options, prepared.cell
    tables = [
        transfer_checks(robot, m.q, m.time, cell=cell, eta_v=o.eta_v, eta_a=o.eta_a) for m in moves
    ]
    for table, move, ends in zip(tables, moves, _ends(prepared, ways), strict=True):
        table += _fits(prepared, move, ends)
    rows += worst_of(tables)
    if cell is not None:
        ups = [
            [c for c in transfer_checks(robot, way, np.arange(len(way)) * 1e3, cell=cell)
             if c.code.startswith("collision")]
            for pair in ways for way in pair
        ]  # fmt: skip
        rows += [_way_row(row) for row in worst_of(ups)]
    return rows


def expect_sequence(
    prepared: PreparedJob, plans: Sequence[Plan], moves: Sequence[TransferMove], at_least: float
) -> PartPlan | None:
    """Return the plans and moves as the job asks for them, in the times that the moves need.

    The claim about other orders (`at_least` s) is not checked.
    """
    if prepared.job.sequence is None:
        return None
    program = prepared.job.program
    candidates = np.arange(len(plans))
    part = PartPlan(
        plans=tuple(plans),
        moves=tuple(
            TransferMove(q=m.q, time=_times(plans[0], m.q), clear=prepared.cell is not None)
            for m in moves
        ),
        order=Order(candidates=candidates, duration=0.0, at_least=at_least),
        chosen=(),
        retract=program.retract,
        approach_speed=program.approach_speed,
        pierce_time=program.pierce_time,
    )
    order = Order(candidates=candidates, duration=part.cycle_time, at_least=at_least)
    return replace(part, order=order)


def _times(first: Plan, q: Array) -> Array:
    """Return when the corners of a planned move are reached in the least time, s."""
    velocity, acceleration = first.robot.speed_limits()
    eta_v, eta_a = first.settings.eta_v, first.settings.eta_a
    took = least_time(np.diff(q, axis=0), eta_v * velocity, eta_a * acceleration)
    return np.concatenate([[0.0], np.cumsum(np.maximum(took, 1e-9))])


def _approach(prepared: PreparedJob, plan: Plan, end: End) -> Array:
    """Return joints (9, n) rad along the approach or the retract of a cut, from the cut on."""
    retract = prepared.job.program.retract
    return np.array([back_off(plan, end, float(share) * retract) for share in SHARES])


def _ends(prepared: PreparedJob, ways: Sequence[tuple[Array, Array]]) -> list[tuple[Array, Array]]:
    """Return where each move begins and ends, (n,) rad each."""
    home = prepared.job.home
    starts, ends = [way[0][-1] for way in ways], [way[1][-1] for way in ways]
    if home is not None:
        starts, ends = [*starts, home], [home, *ends]
        return list(zip(ends, starts, strict=True))
    return list(zip(ends[:-1], starts[1:], strict=True))


def _fits(prepared: PreparedJob, move: TransferMove, ends: tuple[Array, Array]) -> list[Check]:
    """Compare the ends of a move with those of the cuts and home, and its start time with zero.

    In the last move, endless joints may be at home on another turn.
    """
    first, last = np.abs(move.q[0] - ends[0]), np.abs(move.q[-1] - ends[1])
    home = prepared.job.home
    if home is not None and np.array_equal(ends[1], home):
        whole = 2 * np.pi * np.round(last / (2 * np.pi))
        last = np.where(prepared.job.robot.endless, np.abs(last - whole), last)
    off = max(float(first.max()), float(last.max()))
    begins = abs(float(move.time[0]))
    return [
        check(
            "air-ends", "distance of a move's ends from the cuts and home", off, SAME_CORNER, "rad"
        ),
        check("air-begins", "time at the start of a move", begins, 1e-9, "s"),
    ]


def _way_row(row: Check) -> Check:
    title = f"in approach and retract: {row.title}"
    return replace(row, code=f"approach-{row.code}", title=title, node=row.node // 2)
