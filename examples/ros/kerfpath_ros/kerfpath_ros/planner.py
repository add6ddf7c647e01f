"""The action server: a goal becomes a plan of kerfpath, and its trajectory goes to RViz, too."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import rclpy
from ament_index_python.packages import get_package_share_directory
from kerfpath_msgs.action import Plan
from moveit_msgs.msg import DisplayTrajectory
from rclpy.action import ActionServer
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rosidl_runtime_py import set_message_fields

from kerfpath.ros import Setting, display_trajectory, plan_goal


class Planner(Node):
    """Answers the action `plan`, one goal after the other."""

    def __init__(self, folder):
        super().__init__("kerfpath_planner")
        texts = {}
        for name in ("robot_description", "robot_description_semantic"):
            self.declare_parameter(name, "")
            texts[name] = self.get_parameter(name).value
            (folder / name).write_text(texts[name], encoding="utf-8")
        self.declare_parameter("acceleration", [8.0])  # rad/s^2, of your robot
        urdf = texts["robot_description"]
        packages = set(re.findall(r"package://([^/\"]+)/", urdf))
        self.model = ElementTree.fromstring(urdf).get("name")
        self.setting = Setting(
            urdf=folder / "robot_description",
            srdf=folder / "robot_description_semantic",
            acceleration=list(self.get_parameter("acceleration").value),
            packages={one: get_package_share_directory(one) for one in packages},
        )
        self.shown = self.create_publisher(DisplayTrajectory, "display_planned_path", 1)
        group = ReentrantCallbackGroup()
        self.server = ActionServer(self, Plan, "plan", self.execute, callback_group=group)

    def execute(self, handle):
        """Plan a goal. Planning is not interrupted: a goal that is cancelled is still planned."""
        handle.publish_feedback(Plan.Feedback(state="planning"))
        fields, result = plan_goal(handle.request, self.setting), Plan.Result()
        set_message_fields(result, fields)
        if fields["trajectory"]:
            display = DisplayTrajectory()
            set_message_fields(display, display_trajectory(fields["trajectory"], self.model))
            self.shown.publish(display)
            handle.succeed()
        else:
            self.get_logger().warning(fields["message"])
            handle.abort()
        return result


def main():
    """Run the node until it is stopped."""
    rclpy.init()
    with TemporaryDirectory() as folder:
        node = Planner(Path(folder))
        try:
            rclpy.spin(node, MultiThreadedExecutor())
        finally:
            node.destroy_node()
            rclpy.try_shutdown()
