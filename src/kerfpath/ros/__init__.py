"""Messages of MoveIt: a planning scene and a goal in, trajectories out, as fields of messages.

Messages are read by the names of their fields, whichever package made them; `rclpy` is not needed.
"""

from kerfpath.ros.goal import PREEMPTED as PREEMPTED
from kerfpath.ros.goal import Setting as Setting
from kerfpath.ros.goal import display_trajectory as display_trajectory
from kerfpath.ros.goal import plan_goal as plan_goal
from kerfpath.ros.goal import robot_trajectory as robot_trajectory
from kerfpath.ros.scene import around_robot as around_robot
