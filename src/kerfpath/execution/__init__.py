"""The motion as a controller runs it: straight and circular moves, with rounded corners."""

from kerfpath.execution._course import ToolCourse as ToolCourse
from kerfpath.execution._deviation import Deviation as Deviation
from kerfpath.execution._deviation import deviation_of as deviation_of
from kerfpath.execution._executed import Executed as Executed
from kerfpath.execution._executed import Peak as Peak
from kerfpath.execution._executed import executed as executed
from kerfpath.execution._executed import from_stop_to_stop as from_stop_to_stop
from kerfpath.execution._executed import run_along as run_along
from kerfpath.execution._keep import Kept as Kept
from kerfpath.execution._keep import keep_limits as keep_limits
from kerfpath.execution._keep import longest_run as longest_run
from kerfpath.execution._timing import AT_SPEED as AT_SPEED
from kerfpath.execution._timing import Timing as Timing
from kerfpath.execution._timing import timing_of as timing_of
