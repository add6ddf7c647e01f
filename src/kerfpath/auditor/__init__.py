"""The audit: check a plan again with kinematics that share no code with the planner."""

import warnings

from kerfpath.auditor.certificate import BOUND as BOUND
from kerfpath.auditor.certificate import bound_checks as bound_checks
from kerfpath.auditor.certificate import certified_bound as certified_bound
from kerfpath.auditor.chain import JointChain as JointChain
from kerfpath.auditor.chain import chain_of as chain_of
from kerfpath.auditor.motion import ENCLOSED as ENCLOSED
from kerfpath.auditor.motion import MotionPieces as MotionPieces
from kerfpath.auditor.motion import rates_along as rates_along
from kerfpath.auditor.nodes import audit as audit
from kerfpath.auditor.nodes import checks as checks
from kerfpath.auditor.nodes import window_checks as window_checks
from kerfpath.auditor.rounding import MOST_ROUNDED as MOST_ROUNDED
from kerfpath.auditor.rounding import Rounding as Rounding
from kerfpath.auditor.rounding import rounding_of as rounding_of
from kerfpath.auditor.table import Check as Check
from kerfpath.auditor.table import Issue as Issue
from kerfpath.auditor.table import Issues as Issues
from kerfpath.auditor.table import Level as Level
from kerfpath.auditor.table import Unit as Unit
from kerfpath.auditor.table import format_value as format_value
from kerfpath.auditor.table import worst_of as worst_of
from kerfpath.auditor.transfer import approach_checks as approach_checks
from kerfpath.auditor.transfer import retract_checks as retract_checks
from kerfpath.auditor.transfer import transfer_checks as transfer_checks


def __getattr__(name: str) -> object:
    if name != "air_checks":
        raise AttributeError(f"module 'kerfpath.auditor' has no attribute {name!r}")
    warnings.warn(
        "kerfpath.auditor.air_checks has been renamed to transfer_checks",
        DeprecationWarning,
        stacklevel=2,
    )
    return transfer_checks
