"""Search for the best placement of the part, the robot base and the head."""

from kerfpath.study.placing.place import DEFAULT_RANGES as DEFAULT_RANGES
from kerfpath.study.placing.place import Placement as Placement
from kerfpath.study.placing.place import changes_of as changes_of
from kerfpath.study.placing.place import middle_of as middle_of
from kerfpath.study.placing.place import placed_text as placed_text
from kerfpath.study.placing.place import placement_of as placement_of
from kerfpath.study.placing.place import ranges_of as ranges_of
from kerfpath.study.placing.search import PlacementTrial as PlacementTrial
from kerfpath.study.placing.study import Layout as Layout
from kerfpath.study.placing.study import contours_of as contours_of
from kerfpath.study.placing.study import layout as layout
from kerfpath.study.placing.study import layout_as as layout_as
from kerfpath.study.placing.study import layout_entry as layout_entry
from kerfpath.study.placing.study import nodes_of as nodes_of
from kerfpath.study.placing.study import write_layout as write_layout
