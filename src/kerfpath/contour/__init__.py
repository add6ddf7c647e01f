"""The contour: the paper's augmented line of points and tool axes, its sampling and its frames."""

from kerfpath.contour.contour import FRAME_KINDS as FRAME_KINDS
from kerfpath.contour.contour import KINDS as KINDS
from kerfpath.contour.contour import Contour as Contour
from kerfpath.contour.contour import FrameKind as FrameKind
from kerfpath.contour.contour import join as join
from kerfpath.contour.sampling import CORNER as CORNER
from kerfpath.contour.sampling import angle_between as angle_between
from kerfpath.contour.sampling import slerp as slerp
from kerfpath.contour.sampling import turned_about as turned_about
from kerfpath.contour.sampling import unit as unit
