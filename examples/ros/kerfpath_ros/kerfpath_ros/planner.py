"""The action server: a goal becomes a plan of kerfpath, and its trajectory goes to RViz, too."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import rclpy
from ament_index_python.packages import get_package_share_directory
from kerfpath_msgs.action import Plan
from moveit_msgs.msg import DisplayTrajectory
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.exceptions import ParameterUninitializedException
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosidl_runtime_py import set_message_fields

from kerfpath.ros import PREEMPTED, Setting, display_trajectory, plan_goal


class Planner(Node):
    """Answers the action `plan`, each goal in a process that ends when the goal is cancelled."""

    def __init__(self, folder):
        super().__init__("kerfpath_planner")
        urdf = self.given("robot_description", Parameter.Type.STRING, "the URDF as text")
        srdf = self.given("robot_description_semantic", Parameter.Type.STRING, "the SRDF as text")
        acceleration = self.given(
            "acceleration", Parameter.Type.DOUBLE_ARRAY,
            "the limits of the joints in rad/s^2, as [8.0, 8.0, ...], which a URDF does not have",
        )  # fmt: skip
        (folder / "robot.urdf").write_text(urdf, encoding="utf-8")
        (folder / "robot.srdf").write_text(srdf, encoding="utf-8")
        packages = set(re.findall(r"package://([^/\"]+)/", urdf))
        self.model = ElementTree.fromstring(urdf).get("name")
        self.setting = Setting(
            urdf=folder / "robot.urdf",
            srdf=folder / "robot.srdf",
            acceleration=list(acceleration),
            packages={one: get_package_share_directory(one) for one in packages},
        )
        self.shown = self.create_publisher(DisplayTrajectory, "display_planned_path", 1)
        group = ReentrantCallbackGroup()
        self.server = ActionServer(
            self, Plan, "plan", self.execute, callback_group=group,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip

    def given(self, name, kind, what):
        """Return a parameter that must be set."""
        self.declare_parameter(name, kind)
        try:
            value = self.get_parameter(name).value
        except ParameterUninitializedException:
            value = None
        if not value:
            raise SystemExit(f"kerfpath_planner: parameter {name} is not set: give {what}")
        return value

    def execute(self, handle):
        """Plan a goal until it is planned or cancelled."""
        handle.publish_feedback(Plan.Feedback(state="planning"))
        fields = plan_goal(handle.request, self.setting, lambda: handle.is_cancel_requested)
        result = Plan.Result()
        set_message_fields(result, fields)
        if fields["trajectory"]:
            display = DisplayTrajectory()
            set_message_fields(display, display_trajectory(fields["trajectory"], self.model))
            self.shown.publish(display)
            handle.succeed()
        elif fields["error_code"]["val"] == PREEMPTED:
            handle.canceled()
        else:
            self.get_logger().warning(fields["message"])
            handle.abort()
        return result


def main():
    """Run the node until it is stopped."""
    rclpy.init()
    try:
        with TemporaryDirectory() as folder:
            rclpy.spin(Planner(Path(folder)), MultiThreadedExecutor())
    finally:
        rclpy.try_shutdown()
