"""Transfer moves: straight joint motions where they are clear, otherwise around obstacles."""

from kerfpath.transfer.move import End as End
from kerfpath.transfer.move import TransferMove as TransferMove
from kerfpath.transfer.move import back_off as back_off
from kerfpath.transfer.move import explain_collision as explain_collision
from kerfpath.transfer.move import least_time as least_time
from kerfpath.transfer.move import speed_share as speed_share
from kerfpath.transfer.move import transfer_move as transfer_move
