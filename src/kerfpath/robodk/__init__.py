"""Programs for RoboDK from its machining projects, see `kerfpath.robodk.station`."""

from kerfpath.extras import require_extra

require_extra("robodk", "the add-in for RoboDK")

from kerfpath.robodk.station import Outcome as Outcome
from kerfpath.robodk.station import Settings as Settings
from kerfpath.robodk.station import StationError as StationError
from kerfpath.robodk.station import connect as connect
from kerfpath.robodk.station import plan_project as plan_project
