"""Messages of MoveIt as dataclasses of rosbags, by the fields that moveit_msgs has in ROS 2."""

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from conftest import ROOT

ACTION = ROOT / "examples" / "ros" / "kerfpath_msgs" / "action" / "Plan.action"
FIELDS = {
    "object_recognition_msgs/msg/ObjectType": "string key\nstring db",
    "octomap_msgs/msg/Octomap": """
        std_msgs/Header header\nbool binary\nstring id\nfloat64 resolution\nint8[] data""",
    "octomap_msgs/msg/OctomapWithPose": """
        std_msgs/Header header\ngeometry_msgs/Pose origin\noctomap_msgs/Octomap octomap""",
    "moveit_msgs/msg/CollisionObject": """
        std_msgs/Header header\ngeometry_msgs/Pose pose\nstring id
        object_recognition_msgs/ObjectType type
        shape_msgs/SolidPrimitive[] primitives\ngeometry_msgs/Pose[] primitive_poses
        shape_msgs/Mesh[] meshes\ngeometry_msgs/Pose[] mesh_poses
        shape_msgs/Plane[] planes\ngeometry_msgs/Pose[] plane_poses
        string[] subframe_names\ngeometry_msgs/Pose[] subframe_poses\nbyte operation""",
    "moveit_msgs/msg/AttachedCollisionObject": """
        string link_name\nmoveit_msgs/CollisionObject object\nstring[] touch_links
        trajectory_msgs/JointTrajectory detach_posture\nfloat64 weight""",
    "moveit_msgs/msg/RobotState": """
        sensor_msgs/JointState joint_state\nsensor_msgs/MultiDOFJointState multi_dof_joint_state
        moveit_msgs/AttachedCollisionObject[] attached_collision_objects\nbool is_diff""",
    "moveit_msgs/msg/AllowedCollisionEntry": "bool[] enabled",
    "moveit_msgs/msg/AllowedCollisionMatrix": """
        string[] entry_names\nmoveit_msgs/AllowedCollisionEntry[] entry_values
        string[] default_entry_names\nbool[] default_entry_values""",
    "moveit_msgs/msg/LinkPadding": "string link_name\nfloat64 padding",
    "moveit_msgs/msg/LinkScale": "string link_name\nfloat64 scale",
    "moveit_msgs/msg/ObjectColor": "string id\nstd_msgs/ColorRGBA color",
    "moveit_msgs/msg/PlanningSceneWorld": """
        moveit_msgs/CollisionObject[] collision_objects\noctomap_msgs/OctomapWithPose octomap""",
    "moveit_msgs/msg/PlanningScene": """
        string name\nmoveit_msgs/RobotState robot_state\nstring robot_model_name
        geometry_msgs/TransformStamped[] fixed_frame_transforms
        moveit_msgs/AllowedCollisionMatrix allowed_collision_matrix
        moveit_msgs/LinkPadding[] link_padding\nmoveit_msgs/LinkScale[] link_scale
        moveit_msgs/ObjectColor[] object_colors
        moveit_msgs/PlanningSceneWorld world\nbool is_diff""",
    "moveit_msgs/msg/RobotTrajectory": """
        trajectory_msgs/JointTrajectory joint_trajectory
        trajectory_msgs/MultiDOFJointTrajectory multi_dof_joint_trajectory""",
    "moveit_msgs/msg/DisplayTrajectory": """
        string model_id\nmoveit_msgs/RobotTrajectory[] trajectory
        moveit_msgs/RobotState trajectory_start""",
    "moveit_msgs/msg/MoveItErrorCodes": "int32 val\nstring message\nstring source",
}
STORE = get_typestore(Stores.ROS2_JAZZY)
for name, text in FIELDS.items():
    STORE.register(get_types_from_msg(text, name))
for part, text in zip(
    ("Goal", "Result", "Feedback"), ACTION.read_text().split("---\n"), strict=True
):
    STORE.register(get_types_from_msg(text, f"kerfpath_msgs/action/Plan_{part}"))


def made(name, values=()):
    """A message with some fields set, from plain data, and the others empty.

    As `rosidl_runtime_py.set_message_fields` does for messages of rclpy.
    """
    values, fields = dict(values), STORE.get_msgdef(name).fields
    assert set(values) <= {field for field, _ in fields}, (name, set(values))
    return STORE.types[name](**{field: _value(desc, values.get(field)) for field, desc in fields})


def _value(desc, given):
    kind, inner = desc
    if kind == Nodetype.NAME:
        return given if hasattr(given, "__msgtype__") else made(inner, given or {})
    if kind == Nodetype.BASE:
        plain = {"string": str, "bool": bool, "float64": float, "float32": float}.get(inner[0], int)
        return plain() if given is None else plain(given)
    (of, length), given = inner, [] if given is None else given
    if of[0] == Nodetype.BASE and of[1][0] != "string":
        fixed = length if kind == Nodetype.ARRAY else 0
        return np.array(given if len(given) else [0] * fixed, of[1][0])
    return [_value(of, one) for one in given]


def through_cdr(message):
    """The message as it comes back from bytes on the wire."""
    name = message.__msgtype__
    return STORE.deserialize_cdr(STORE.serialize_cdr(message, name), name)
