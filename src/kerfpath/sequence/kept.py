"""A part of which some motions are kept: plans in their order, and the moves that they lack."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np

from kerfpath.arrays import Array, floats, freeze
from kerfpath.errors import NoFeasiblePath
from kerfpath.kernels.metric import increments_between
from kerfpath.plans import Plan, TransferMove
from kerfpath.sequence.order import Order
from kerfpath.sequence.part import OrderKeywords, OrderOptions, PartPlan
from kerfpath.transfer import (
    back_off,
    between_which,
    least_times,
    on_near_turns,
    transfer_move,
)

SAME_END = 1e-6
"""rad, or m: rounding tolerance between an end of a move and where the tool has backed off."""


def _leads(move: TransferMove, one: Array, two: Array) -> bool:
    """Return whether a move leads from joints to other joints, (n,) rad each."""
    return bool(max(np.abs(move.q[0] - one).max(), np.abs(move.q[-1] - two).max()) <= SAME_END)


def on_turns_of(made: Plan, was: Plan) -> Plan:
    """Return a plan on the turns of its joints that are nearest to those of an earlier plan."""
    near = on_near_turns(made, was.q.mean(axis=0))[-1]
    turns = np.round((was.q[0] - near.q[0]) / (2 * np.pi)) * made.robot.endless
    own = np.arange(len(turns)) < made.robot.family.joints  # an external axis has no turns
    whole = turns.astype(np.int64)
    return replace(near, q=near.q + 2 * np.pi * whole, turn=near.turn + own * whole)


def rejoined(
    plans: Sequence[Plan], kept: Mapping[int, TransferMove], **keywords: Unpack[OrderKeywords]
) -> PartPlan:
    """Return plans in their order, each as it is, with the moves between them.

    Endless joints move to the turn that the next plan is on, and home the short way. Nothing is
    proved about the order.

    Parameters
    ----------
    plans : sequence of Plan
    kept : mapping of int to TransferMove
        Moves that need not be planned, by their number among the moves of a `PartPlan`. One that
        does not lead from plan to plan is planned nevertheless. Its time is counted anew.
    **keywords
        As in `OrderOptions`.

    Raises
    ------
    NoFeasiblePath
        There is no way between two plans; the message names them.
    InputError
        A length, speed or time is out of range, or the tool cannot back off.
    """
    options, robot, settings = OrderOptions(**keywords), plans[0].robot, plans[0].settings
    home = None if options.home is None else floats(options.home, "home", (robot.joints,))
    starts = [back_off(made, "start", options.retract) for made in plans]
    ends = [back_off(made, "end", options.retract) for made in plans]
    around: list[Plan | None] = list(plans)
    if home is not None:
        starts, ends, around = [*starts, home], [home, *ends], [None, *plans, None]
    else:
        starts, ends = starts[1:], ends[:-1]

    eta, moves = (settings.eta_v, settings.eta_a), list[TransferMove]()
    for k, (one, two) in enumerate(zip(ends, starts, strict=True)):
        short = robot.endless if around[k + 1] is None else np.zeros_like(robot.endless)
        to = one + increments_between(one, two, short)
        if k in kept and _leads(kept[k], one, to):
            q = kept[k].q
            time, clear = least_times(robot, q, *eta), options.cell is not None
            found = TransferMove(q=q, time=time, clear=clear)
        else:
            try:
                found = transfer_move(
                    robot, one, to, cell=options.cell, eta_v=eta[0], eta_a=eta[1],
                    seconds=options.seconds,
                )  # fmt: skip
            except NoFeasiblePath as broken:
                which = between_which(around[k], around[k + 1])
                raise broken.with_message(f"{which}: {broken}") from None
        moves.append(replace(found, time=freeze(found.time / options.air_speed)))
    pierce = options.pierce_time
    part = PartPlan(
        plans=tuple(plans),
        moves=tuple(moves),
        order=Order(candidates=np.arange(len(plans)), duration=0.0, at_least=0.0),
        chosen=tuple((k, 0) for k in range(len(plans))),
        retract=options.retract,
        approach_speed=options.approach_speed,
        pierce_time=tuple(pierce) if isinstance(pierce, Sequence) else pierce,
    )
    return replace(part, order=replace(part.order, duration=part.cycle_time))
