"""What plan.json says of the order of cutting and of the transfer moves."""

from __future__ import annotations

from kerfpath._arrays import floats
from kerfpath.job.plan_file._layout import SequenceData
from kerfpath.sequence import PartPlan
from kerfpath.transfer import TransferMove

__all__ = ["read_moves", "sequence_entry"]


def sequence_entry(part: PartPlan) -> SequenceData:
    """Return what plan.json says of a part's order, its times and its moves."""
    return {
        "optimal": part.order.optimal,
        "duration_s": part.order.duration,
        "at_least_s": part.order.at_least,
        "cycle_s": part.cycle_time,
        "cutting_s": part.cutting_time,
        "air_s": part.air_time,
        "piercing_s": part.piercing_time,
        "retract_m": part.retract,
        "moves": [
            {"clear": move.clear, "time_s": move.time.tolist(), "q_rad": move.q.tolist()}
            for move in part.moves
        ],
    }


def read_moves(entry: SequenceData | None) -> tuple[TransferMove, ...]:
    """Return the moves of such an entry."""
    if entry is None:
        return ()
    return tuple(
        TransferMove(
            q=floats(move["q_rad"], "q_rad of a move", (None, None)),
            time=floats(move["time_s"], "time_s of a move", (len(move["q_rad"]),)),
            clear=bool(move["clear"]),
        )
        for move in entry["moves"]
    )
