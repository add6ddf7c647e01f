"""ROS trajectories: trajectory_msgs/JointTrajectory and switching events, as YAML."""

from kerfpath.post._languages import Language, no_settings_needed
from kerfpath.post.ros._check import check
from kerfpath.post.ros._read import read
from kerfpath.post.ros._trajectory import Trajectory as Trajectory
from kerfpath.post.ros._trajectory import trajectory as trajectory
from kerfpath.post.ros._write import Message as Message
from kerfpath.post.ros._write import Ros as Ros
from kerfpath.post.ros._write import RosSettings as RosSettings
from kerfpath.post.ros._write import message as message
from kerfpath.post.ros._write import rules

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
    read=read,
)
"""The language as registered."""
