"""The motion as a controller runs it: straight and circular moves, with rounded corners."""

from kerfpath.execution.executed import AT_SPEED as AT_SPEED
from kerfpath.execution.executed import Deviation as Deviation
from kerfpath.execution.executed import Executed as Executed
from kerfpath.execution.executed import Peak as Peak
from kerfpath.execution.executed import Timing as Timing
from kerfpath.execution.executed import deviation_of as deviation_of
from kerfpath.execution.executed import executed as executed
from kerfpath.execution.executed import from_stop_to_stop as from_stop_to_stop
from kerfpath.execution.executed import run_along as run_along
from kerfpath.execution.executed import timing_of as timing_of
from kerfpath.execution.keep import Kept as Kept
from kerfpath.execution.keep import keep_limits as keep_limits
from kerfpath.execution.keep import longest_run as longest_run
from kerfpath.execution.tool_motion import ToolMotion as ToolMotion
