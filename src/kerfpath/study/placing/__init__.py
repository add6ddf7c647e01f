"""Search for the best placement of the part, the robot base and the head."""

from kerfpath.study.placing._evaluate import contours_of as contours_of
from kerfpath.study.placing._evaluate import nodes_of as nodes_of
from kerfpath.study.placing._files import UNITS as UNITS
from kerfpath.study.placing._files import layout_entry as layout_entry
from kerfpath.study.placing._files import write_layout as write_layout
from kerfpath.study.placing._layout import Layout as Layout
from kerfpath.study.placing._layout import layout as layout
from kerfpath.study.placing._layout import layout_as as layout_as
from kerfpath.study.placing._place import changes_of as changes_of
from kerfpath.study.placing._place import middle_of as middle_of
from kerfpath.study.placing._place import placed_text as placed_text
from kerfpath.study.placing._place import ranges_of as ranges_of
from kerfpath.study.placing._reach import Placement as Placement
from kerfpath.study.placing._reach import placement_of as placement_of
from kerfpath.study.placing._search import PlacementTrial as PlacementTrial
