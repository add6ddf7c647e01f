"""What Tesseract's Descartes needs to run from its wheel, which has no robots or plugin lists.

It needs only the wheel and numpy, so that planners of the public set can also use it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tesseract_robotics
from numpy.typing import NDArray
from tesseract_robotics import tesseract_command_language as language
from tesseract_robotics import tesseract_common as common
from tesseract_robotics import tesseract_environment as environments
from tesseract_robotics import tesseract_motion_planners as planners
from tesseract_robotics import tesseract_motion_planners_descartes as descartes

__all__ = ["environment", "plugins", "request", "solved", "waypoints"]

Array = NDArray[np.float64]
NAMESPACE, PROFILE = "DescartesMotionPlannerTask", "benchmark"


def plugins(
    folder: Path,
    *,
    base: str,
    tip: str,
    lengths: Mapping[str, float],
    offsets: Sequence[float],
    signs: Sequence[float],
) -> str:
    """Write the plugin lists of an OPW arm from base to tip; return their SRDF entries.

    Raises
    ------
    ImportError
        The wheel lacks a library.
    """
    kinematics, contacts = folder / "plugins.yaml", folder / "contacts.yaml"
    kinematics.write_text(_kinematics(base, tip, lengths, offsets, signs))
    contacts.write_text(_contacts())
    return (
        f'<group name="manipulator"><chain base_link="{base}" tip_link="{tip}"/></group>'
        f'<kinematics_plugin_config filename="file://{kinematics}"/>'
        f'<contact_managers_plugin_config filename="file://{contacts}"/>'
    )


def environment(urdf: str, srdf: str) -> Any:
    """Return the environment of a robot; None if it refuses the descriptions."""
    made = environments.Environment()
    return made if made.init(urdf, srdf, common.GeneralResourceLocator()) else None


def request(
    made: Any,
    *,
    base: str,
    tip: str,
    tool: Array,
    frames: Sequence[Array],
    samples: int,
    collisions: bool = False,
) -> Any:
    """Return the request to a planner: tip poses (4, 4), free to rotate about z."""
    info = common.ManipulatorInfo()
    info.manipulator, info.manipulator_ik_solver = "manipulator", "OPWInvKin"
    info.working_frame, info.tcp_frame = base, tip
    info.tcp_offset = common.Isometry3d(tool)

    profile = descartes.DescartesDefaultPlanProfileD()
    profile.target_pose_fixed = False
    profile.target_pose_sample_axis = np.array([0.0, 0.0, 1.0])
    profile.target_pose_sample_min, profile.target_pose_sample_max = -np.pi, np.pi
    # Both ends are sampled: one more sample than requested, the last the same as the first.
    profile.target_pose_sample_resolution = 2 * np.pi / samples * (1 + 1e-9)
    profile.enable_collision = profile.enable_edge_collision = collisions
    # Otherwise poses that are not checked count as colliding.
    profile.allow_collision = not collisions
    profiles = language.ProfileDictionary()
    profiles.addProfile(NAMESPACE, PROFILE, descartes.cast_DescartesPlanProfileD(profile))

    program = language.CompositeInstruction()
    program.setManipulatorInfo(info)
    for frame in frames:
        waypoint = language.CartesianWaypoint(common.Isometry3d(np.array(frame)))
        move = language.MoveInstruction(
            language.CartesianWaypointPoly_wrap_CartesianWaypoint(waypoint),
            language.MoveInstructionType_LINEAR,
            PROFILE,
            info,
        )
        program.appendMoveInstruction(language.MoveInstructionPoly_wrap_MoveInstruction(move))
    asked = planners.PlannerRequest()
    asked.instructions, asked.env, asked.profiles = program, made, profiles
    return asked


def solved(asked: Any) -> Any:
    """Return the planner's response to a request."""
    return descartes.DescartesMotionPlannerD(NAMESPACE).solve(asked)


def waypoints(response: Any) -> Array:
    """Return the joints (K, n) of a successful response."""
    rows = []
    for instruction in response.results.flatten():
        # Each wrapper must outlive the next: chained calls read freed memory.
        moved = language.InstructionPoly_as_MoveInstructionPoly(instruction)
        reached = moved.getWaypoint()
        state = language.WaypointPoly_as_StateWaypointPoly(reached)
        rows.append(np.array(state.getPosition(), dtype=float).ravel())
    return np.array(rows)


def _libraries(pattern: str) -> str:
    """Return the libraries that match (their names contain a hash) and their folder, for a list."""
    folder = Path(tesseract_robotics.__file__).parent.parent / "tesseract_robotics.libs"
    found = sorted(folder.glob(f"libtesseract_{pattern}.so"))
    if not found:
        raise ImportError(f"its wheel has no {pattern} in {folder}")
    names = "".join(f"    - {f.name.removeprefix('lib').removesuffix('.so')}\n" for f in found)
    return f"  search_paths:\n    - {folder}\n  search_libraries:\n{names}"


def _contacts() -> str:
    text = f"contact_manager_plugins:\n{_libraries('collision_bullet_factor*')}"
    for kind, group in (("Discrete", "discrete"), ("Cast", "continuous")):
        manager = f"Bullet{kind}BVHManager"
        text += (
            f"  {group}_plugins:\n    default: {manager}\n    plugins:\n"
            f"      {manager}:\n        class: {manager}Factory\n"
        )
    return text


def _kinematics(
    base: str,
    tip: str,
    lengths: Mapping[str, float],
    offsets: Sequence[float],
    signs: Sequence[float],
) -> str:
    listed = "".join(f"              {key}: {float(value)!r}\n" for key, value in lengths.items())
    opw = (
        f"            params:\n{listed}              offsets: {[float(o) for o in offsets]}\n"
        f"              sign_corrections: {[int(sign) for sign in signs]}\n"
    )

    def group(kind: str, plugin: str, params: str) -> str:
        return (
            f"  {kind}:\n    manipulator:\n      default: {plugin}\n      plugins:\n"
            f"        {plugin}:\n          class: {plugin}Factory\n          config:\n"
            f"            base_link: {base}\n            tip_link: {tip}\n{params}"
        )

    return (
        f"kinematic_plugins:\n{_libraries('kinematics_*_factor*')}"
        + group("fwd_kin_plugins", "KDLFwdKinChain", "")
        + group("inv_kin_plugins", "OPWInvKin", opw)
    )
