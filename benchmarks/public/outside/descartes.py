"""Tesseract's Descartes: the shortest path through a ladder of poses, sampled about the beam."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import tesseract_robotics
from tesseract_robotics import tesseract_command_language as language
from tesseract_robotics import tesseract_common as common
from tesseract_robotics import tesseract_environment as environments
from tesseract_robotics import tesseract_motion_planners as planners
from tesseract_robotics import tesseract_motion_planners_descartes as descartes

from benchmarks.public.check import Array, Instance
from benchmarks.public.outside._chain import urdf

__all__ = ["SETTINGS", "plan"]

SAMPLES = 36
SETTINGS = (
    f"tesseract-robotics, DescartesMotionPlannerD; {SAMPLES} samples about the beam, inverse "
    "kinematics of OPW arms, edges by its own measure (joint distance); it knows ranges, and no "
    "limits of velocity or acceleration; endless joints turn by three half turns either way"
)
NAMESPACE, PROFILE = "DescartesMotionPlannerTask", "set"


def plan(task: Instance, _: np.random.Generator) -> tuple[Array | None, str]:
    """Return its path, and a word on it."""
    if task.external or task.closed_form["family"] != "opw":
        return None, "not run: it has inverse kinematics of OPW arms alone"
    with tempfile.TemporaryDirectory() as folder:
        kinematics, contacts = Path(folder) / "kinematics.yaml", Path(folder) / "contacts.yaml"
        kinematics.write_text(_kinematics(task))
        contacts.write_text(_contacts())
        srdf = (
            f'<robot name="{task.name}" version="1.0.0"><group name="manipulator">'
            '<chain base_link="part" tip_link="flange"/></group>'
            f'<kinematics_plugin_config filename="file://{kinematics}"/>'
            f'<contact_managers_plugin_config filename="file://{contacts}"/></robot>'
        )
        environment = environments.Environment()
        if not environment.init(urdf(task), srdf, common.GeneralResourceLocator()):
            return None, "its environment refused the description"
    info = common.ManipulatorInfo()
    info.manipulator, info.manipulator_ik_solver = "manipulator", "OPWInvKin"
    info.working_frame, info.tcp_frame = "part", "flange"
    info.tcp_offset = common.Isometry3d(task.tool)

    profile = descartes.DescartesDefaultPlanProfileD()
    profile.target_pose_fixed = False
    profile.target_pose_sample_axis = np.array([0.0, 0.0, 1.0])
    profile.target_pose_sample_min, profile.target_pose_sample_max = -np.pi, np.pi
    # Both ends are sampled, and are the same.
    profile.target_pose_sample_resolution = 2 * np.pi / SAMPLES * (1 + 1e-9)
    profile.enable_collision = profile.enable_edge_collision = False
    profile.allow_collision = True  # else poses that nobody checked count as colliding
    profiles = language.ProfileDictionary()
    profiles.addProfile(NAMESPACE, PROFILE, descartes.cast_DescartesPlanProfileD(profile))

    program = language.CompositeInstruction()
    program.setManipulatorInfo(info)
    for frame in _frames(task):
        waypoint = language.CartesianWaypoint(common.Isometry3d(frame))
        move = language.MoveInstruction(
            language.CartesianWaypointPoly_wrap_CartesianWaypoint(waypoint),
            language.MoveInstructionType_LINEAR,
            PROFILE,
            info,
        )
        program.appendMoveInstruction(language.MoveInstructionPoly_wrap_MoveInstruction(move))
    request = planners.PlannerRequest()
    request.instructions, request.env, request.profiles = program, environment, profiles
    response = descartes.DescartesMotionPlannerD(NAMESPACE).solve(request)
    if not response.successful:
        return None, f"it found no plan ({response.message})"
    rows = []
    for instruction in response.results.flatten():
        # Each wrapper must outlive the next: chained calls read freed memory.
        moved = language.InstructionPoly_as_MoveInstructionPoly(instruction)
        reached = moved.getWaypoint()
        state = language.WaypointPoly_as_StateWaypointPoly(reached)
        rows.append(np.array(state.getPosition(), dtype=float).ravel())
    return np.array(rows), "planned"


def _frames(task: Instance) -> list[Array]:
    """Return a frame with its z along the beam for each node, (4, 4)."""
    frames = []
    for point, z in zip(task.points, task.axes, strict=True):
        x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
        x /= np.linalg.norm(x)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = np.array([x, np.cross(z, x), z]).T, point
        frames.append(T)
    return frames


def _libraries(pattern: str) -> str:
    """Return where the wheel keeps its libraries, and those that match, as its lists name them."""
    libraries = Path(tesseract_robotics.__file__).parent.parent / "tesseract_robotics.libs"
    found = sorted(libraries.glob(f"libtesseract_{pattern}.so"))
    names = "".join(f"    - {f.name.removeprefix('lib').removesuffix('.so')}\n" for f in found)
    return f"  search_paths:\n    - {libraries}\n  search_libraries:\n{names}"


def _contacts() -> str:
    text = f"contact_manager_plugins:\n{_libraries('collision_bullet_factor*')}"
    for kind, group in (("Discrete", "discrete"), ("Cast", "continuous")):
        manager = f"Bullet{kind}BVHManager"
        text += (
            f"  {group}_plugins:\n    default: {manager}\n    plugins:\n"
            f"      {manager}:\n        class: {manager}Factory\n"
        )
    return text


def _kinematics(task: Instance) -> str:
    form = task.closed_form
    lengths = "".join(f"              {key}: {value!r}\n" for key, value in form["lengths"].items())
    opw = (
        f"            params:\n{lengths}              offsets: {form['offset']}\n"
        f"              sign_corrections: {[int(sign) for sign in form['sign']]}\n"
    )

    def group(kind: str, plugin: str, params: str) -> str:
        return (
            f"  {kind}:\n    manipulator:\n      default: {plugin}\n      plugins:\n"
            f"        {plugin}:\n          class: {plugin}Factory\n          config:\n"
            f"            base_link: part\n            tip_link: flange\n{params}"
        )

    return (
        f"kinematic_plugins:\n{_libraries('kinematics_*_factor*')}"
        + group("fwd_kin_plugins", "KDLFwdKinChain", "")
        + group("inv_kin_plugins", "OPWInvKin", opw)
    )
