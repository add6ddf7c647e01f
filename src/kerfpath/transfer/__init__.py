"""Transfer moves: straight joint motions where they are clear, otherwise around obstacles."""

from kerfpath.transfer._move import TransferMove as TransferMove
from kerfpath.transfer._move import least_time as least_time
from kerfpath.transfer._move import speed_share as speed_share
from kerfpath.transfer._move import transfer_move as transfer_move
from kerfpath.transfer._near_miss import explain_collision as explain_collision
from kerfpath.transfer._retract import End as End
from kerfpath.transfer._retract import back_off as back_off
