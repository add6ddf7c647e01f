"""The order of cutting and the transfer moves in plan.json."""

from __future__ import annotations

from kerfpath._arrays import floats
from kerfpath.job.plan_file._external import joints
from kerfpath.job.plan_file._layout import MoveData, SequenceData
from kerfpath.robots import Robot
from kerfpath.sequence import PartPlan
from kerfpath.transfer import TransferMove

__all__ = ["read_moves", "sequence_entry"]


def sequence_entry(part: PartPlan) -> SequenceData:
    """Return the plan.json entry of a part's order, times and moves."""
    robot = part.plans[0].robot
    return {
        "optimal": part.order.optimal,
        "duration_s": part.order.duration,
        "at_least_s": part.order.at_least,
        "cycle_s": part.cycle_time,
        "cutting_s": part.cutting_time,
        "air_s": part.air_time,
        "piercing_s": part.piercing_time,
        "retract_m": part.retract,
        "moves": [_move_entry(move, robot) for move in part.moves],
    }


def read_moves(entry: SequenceData | None, robot: Robot) -> tuple[TransferMove, ...]:
    """Return the moves of such an entry.

    Raises
    ------
    InputError
        Joints and times do not fit together, or external axes are missing.
    """
    if entry is None:
        return ()
    return tuple(
        TransferMove(
            q=floats(joints(move, "q", robot), "corners of a move", (None, None)),
            time=floats(move["time_s"], "time_s of a move", (len(move["q_rad"]),)),
            clear=bool(move["clear"]),
        )
        for move in entry["moves"]
    )


def _move_entry(move: TransferMove, robot: Robot) -> MoveData:
    n = robot.family.joints
    entry: MoveData = {
        "clear": move.clear,
        "time_s": move.time.tolist(),
        "q_rad": move.q[:, :n].tolist(),
    }
    if robot.externals:
        entry["external_q"] = move.q[:, n:].tolist()
    return entry
