"""The contour: the paper's augmented line of points and tool axes, its sampling and its frames."""

from kerfpath.contour._contour import FRAME_KINDS as FRAME_KINDS
from kerfpath.contour._contour import KINDS as KINDS
from kerfpath.contour._contour import Contour as Contour
from kerfpath.contour._contour import FrameKind as FrameKind
from kerfpath.contour._join import join as join
from kerfpath.contour._sampling import CORNER as CORNER
from kerfpath.contour._vectors import angle_between as angle_between
from kerfpath.contour._vectors import slerp as slerp
from kerfpath.contour._vectors import unit as unit
