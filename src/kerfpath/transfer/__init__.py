"""Transfer moves: straight joint motions where they are clear, otherwise around obstacles."""

import warnings

from kerfpath.transfer.choice import HOME as HOME
from kerfpath.transfer.choice import PATIENCE as PATIENCE
from kerfpath.transfer.choice import MoveTimes as MoveTimes
from kerfpath.transfer.choice import between_which as between_which
from kerfpath.transfer.choice import can_back_off as can_back_off
from kerfpath.transfer.choice import require_clear_ends as require_clear_ends
from kerfpath.transfer.move import SECONDS as SECONDS
from kerfpath.transfer.move import End as End
from kerfpath.transfer.move import back_off as back_off
from kerfpath.transfer.move import explain_collision as explain_collision
from kerfpath.transfer.move import least_time as least_time
from kerfpath.transfer.move import least_times as least_times
from kerfpath.transfer.move import share_of_way as share_of_way
from kerfpath.transfer.move import speed_share as speed_share
from kerfpath.transfer.move import transfer_move as transfer_move
from kerfpath.transfer.turns import on_near_turns as on_near_turns
from kerfpath.transfer.turns import on_nearest_turns as on_nearest_turns


def __getattr__(name: str) -> object:
    if name != "TransferMove":
        raise AttributeError(f"module 'kerfpath.transfer' has no attribute {name!r}")
    from kerfpath.plans import TransferMove

    warnings.warn(
        "kerfpath.transfer.TransferMove is now kerfpath.plans.TransferMove",
        DeprecationWarning,
        stacklevel=2,
    )
    return TransferMove
