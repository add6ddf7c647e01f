"""kerfpath: from a CAD drawing to an audited robot program.

The free rotation about the laser beam is resolved under joint velocity and acceleration limits.
Names load when they are first used, so that ``kerfpath --help`` does not wait for the kernels.
"""

from importlib import import_module

__version__ = "0.1.0"

TYPE_CHECKING = False  # as that of typing, which takes longer to load than this module
if TYPE_CHECKING:
    from kerfpath.acceleration_table import AccelerationTable as AccelerationTable
    from kerfpath.auditor import audit as audit
    from kerfpath.certificate import Certify as Certify
    from kerfpath.comfort import Band as Band
    from kerfpath.comfort import Comfort as Comfort
    from kerfpath.comfort import Reversals as Reversals
    from kerfpath.contour import Contour as Contour
    from kerfpath.contour import join as join
    from kerfpath.errors import AuditFailed as AuditFailed
    from kerfpath.errors import InputError as InputError
    from kerfpath.errors import KerfpathError as KerfpathError
    from kerfpath.errors import NoFeasiblePath as NoFeasiblePath
    from kerfpath.execution import Response as Response
    from kerfpath.execution import Target as Target
    from kerfpath.execution import keep_limits as keep_limits
    from kerfpath.execution import response as response
    from kerfpath.execution import simulate as simulate
    from kerfpath.front import ParetoSet as ParetoSet
    from kerfpath.front import pareto as pareto
    from kerfpath.job import read_plan_file as read_plan_file
    from kerfpath.options import OptionConflict as OptionConflict
    from kerfpath.options import PlanOptions as PlanOptions
    from kerfpath.placement import placed as placed
    from kerfpath.placement import placement_from_points as placement_from_points
    from kerfpath.planner import fastest_speed as fastest_speed
    from kerfpath.planner import plan as plan
    from kerfpath.planner import plan_in_pieces as plan_in_pieces
    from kerfpath.plans import Plan as Plan
    from kerfpath.post import joint_trajectory as joint_trajectory
    from kerfpath.refiner import Refinement as Refinement
    from kerfpath.refiner import refine as refine
    from kerfpath.report import plot as plot
    from kerfpath.robots import Robot as Robot
    from kerfpath.robots import external as external
    from kerfpath.robots import robot as robot
    from kerfpath.search import LayeredPath as LayeredPath
    from kerfpath.search import shortest_path as shortest_path
    from kerfpath.tilt import Tilt as Tilt
    from kerfpath.windows import GammaWindow as GammaWindow

_HOME = {
    "AccelerationTable": "acceleration_table",
    "AuditFailed": "errors",
    "Band": "comfort",
    "Certify": "certificate",
    "Comfort": "comfort",
    "Contour": "contour",
    "GammaWindow": "windows",
    "InputError": "errors",
    "KerfpathError": "errors",
    "LayeredPath": "search",
    "NoFeasiblePath": "errors",
    "OptionConflict": "options",
    "ParetoSet": "front",
    "Plan": "plans",
    "PlanOptions": "options",
    "Refinement": "refiner",
    "Response": "execution",
    "Reversals": "comfort",
    "Robot": "robots",
    "Target": "execution",
    "Tilt": "tilt",
    "audit": "auditor",
    "external": "robots",
    "fastest_speed": "planner",
    "join": "contour",
    "joint_trajectory": "post",
    "keep_limits": "execution",
    "pareto": "front",
    "placed": "placement",
    "placement_from_points": "placement",
    "plan": "planner",
    "plan_in_pieces": "planner",
    "plot": "report",
    "read_plan_file": "job",
    "refine": "refiner",
    "response": "execution",
    "robot": "robots",
    "shortest_path": "search",
    "simulate": "execution",
}

__all__ = sorted([*_HOME, "__version__"])


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'kerfpath' has no attribute {name!r}")
    value = getattr(import_module(f"kerfpath.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)
