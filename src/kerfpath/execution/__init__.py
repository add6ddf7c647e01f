"""The motion as a controller runs it: straight and circular moves, rounded in zones."""

from kerfpath.execution._course import ToolCourse as ToolCourse
from kerfpath.execution._executed import Executed as Executed
from kerfpath.execution._executed import Peak as Peak
from kerfpath.execution._executed import executed as executed
