"""Turn a loop of a drawing into a cut: start, kerf, leads, micro joints, corners, tool axes.

Each operation takes a contour and returns a new one. Sides are seen from the nozzle, looking along
the direction of travel: loops of CAD files have the material on their left and the scrap on their
right (see `Side`).
"""

from kerfpath.operations._axes import bevel as bevel
from kerfpath.operations._axes import smooth_axes as smooth_axes
from kerfpath.operations._corners import loop_corners as loop_corners
from kerfpath.operations._corners import round_corners as round_corners
from kerfpath.operations._corners import slow_corners as slow_corners
from kerfpath.operations._kerf import offset as offset
from kerfpath.operations._leads import LeadShape as LeadShape
from kerfpath.operations._leads import lead_in as lead_in
from kerfpath.operations._leads import lead_out as lead_out
from kerfpath.operations._start import micro_joints as micro_joints
from kerfpath.operations._start import overlap as overlap
from kerfpath.operations._start import reverse as reverse
from kerfpath.operations._start import smoothest_start as smoothest_start
from kerfpath.operations._start import start_at as start_at
from kerfpath.operations._surface import IN_SCRAP as IN_SCRAP
from kerfpath.operations._surface import Ribbon as Ribbon
from kerfpath.operations._surface import Side as Side
from kerfpath.operations._surface import Surface as Surface
from kerfpath.operations._surface import edge as edge
from kerfpath.operations._surface import nearest as nearest
from kerfpath.operations._touch import touched_up as touched_up
