"""Studies of a job, many tasks each: on the cores of this machine or on a cluster."""

from kerfpath.study._batch import Planned as Planned
from kerfpath.study._batch import batch as batch
from kerfpath.study._job import Loaded as Loaded
from kerfpath.study._job import digest as digest
from kerfpath.study._job import loaded as loaded
from kerfpath.study._layout import Layout as Layout
from kerfpath.study._layout import layout as layout
from kerfpath.study._layout_files import layout_entry as layout_entry
from kerfpath.study._layout_files import write_layout as write_layout
from kerfpath.study._layout_place import ranges_of as ranges_of
from kerfpath.study._pareto import Studied as Studied
from kerfpath.study._pareto import pareto_of_job as pareto_of_job
from kerfpath.study._pareto_files import Pick as Pick
from kerfpath.study._pareto_files import axes_of as axes_of
from kerfpath.study._pareto_files import picked as picked
from kerfpath.study._pareto_files import plan_picked as plan_picked
from kerfpath.study._pareto_files import write_pareto as write_pareto
from kerfpath.study._robots import NEAREST as NEAREST
from kerfpath.study._robots import ContourSpeed as ContourSpeed
from kerfpath.study._robots import RobotSpeed as RobotSpeed
from kerfpath.study._robots import contour_speeds as contour_speeds
from kerfpath.study._robots import which_robots as which_robots
from kerfpath.study._robots import with_robot as with_robot
from kerfpath.study._robots_files import robots_entry as robots_entry
from kerfpath.study._robots_files import write_robots as write_robots
