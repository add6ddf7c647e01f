"""Where the part, the robot's base and the head are best."""

from kerfpath.study.placing._files import layout_entry as layout_entry
from kerfpath.study.placing._files import write_layout as write_layout
from kerfpath.study.placing._layout import Layout as Layout
from kerfpath.study.placing._layout import layout as layout
from kerfpath.study.placing._place import ranges_of as ranges_of
