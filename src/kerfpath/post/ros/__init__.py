"""ROS trajectories: trajectory_msgs/JointTrajectory and switching events, as YAML."""

from kerfpath.post.languages import Language, no_settings_needed
from kerfpath.post.ros.reader import read
from kerfpath.post.ros.writer import Message as Message
from kerfpath.post.ros.writer import Ros as Ros
from kerfpath.post.ros.writer import RosSettings as RosSettings
from kerfpath.post.ros.writer import Trajectory as Trajectory
from kerfpath.post.ros.writer import check, rules
from kerfpath.post.ros.writer import message as message
from kerfpath.post.ros.writer import trajectory as trajectory

ROS = Language(
    name="ros",
    title="a ROS trajectory",
    manufacturers=(),
    families=(),
    suffix=".yaml",
    settings=RosSettings,
    rules=rules,
    formatter=Ros,
    check=check,
    zones=False,
    externals=no_settings_needed,
    no_power="a ROS trajectory has no values of power",
    read=read,
)
"""The language as registered."""
