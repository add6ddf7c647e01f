"""Turn a loop of a drawing into a cut: start, kerf, leads, micro joints, corners, tool axes.

Each operation takes a contour and returns a new one. Sides are seen from the nozzle, looking along
the direction of travel: loops of CAD files have the material on their left and the scrap on their
right (see `Side`).
"""

from kerfpath.operations.corners import loop_corners as loop_corners
from kerfpath.operations.corners import quick_turns as quick_turns
from kerfpath.operations.corners import round_corners as round_corners
from kerfpath.operations.corners import slow_corners as slow_corners
from kerfpath.operations.corners import slow_turns as slow_turns
from kerfpath.operations.kerf import LeadShape as LeadShape
from kerfpath.operations.kerf import lead_in as lead_in
from kerfpath.operations.kerf import lead_out as lead_out
from kerfpath.operations.kerf import micro_joints as micro_joints
from kerfpath.operations.kerf import offset as offset
from kerfpath.operations.kerf import overlap as overlap
from kerfpath.operations.kerf import reverse as reverse
from kerfpath.operations.kerf import smoothest_start as smoothest_start
from kerfpath.operations.kerf import start_at as start_at
from kerfpath.operations.surface import IN_SCRAP as IN_SCRAP
from kerfpath.operations.surface import Ribbon as Ribbon
from kerfpath.operations.surface import Side as Side
from kerfpath.operations.surface import Surface as Surface
from kerfpath.operations.surface import bevel as bevel
from kerfpath.operations.surface import edge as edge
from kerfpath.operations.surface import nearest as nearest
from kerfpath.operations.surface import smooth_axes as smooth_axes
from kerfpath.operations.surface import touched_up as touched_up
