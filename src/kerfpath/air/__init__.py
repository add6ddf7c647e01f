"""Moves through the air: straight joint motions where they are clear, else around obstacles."""

from kerfpath.air._move import AirMove as AirMove
from kerfpath.air._move import air_move as air_move
from kerfpath.air._move import least_time as least_time
from kerfpath.air._move import speed_share as speed_share
from kerfpath.air._near_miss import why_not_clear as why_not_clear
from kerfpath.air._retract import End as End
from kerfpath.air._retract import backed_off as backed_off
