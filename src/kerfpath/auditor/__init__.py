"""The audit: check a plan again with kinematics that share no code with the planner."""

import warnings

from kerfpath.auditor._air import transfer_checks as transfer_checks
from kerfpath.auditor._audit import audit as audit
from kerfpath.auditor._audit import checks as checks
from kerfpath.auditor._certificate import BOUND as BOUND
from kerfpath.auditor._certificate import bound_checks as bound_checks
from kerfpath.auditor._certificate import certified_bound as certified_bound
from kerfpath.auditor._chain import JointChain as JointChain
from kerfpath.auditor._chain import chain_of as chain_of
from kerfpath.auditor._course import ENCLOSED as ENCLOSED
from kerfpath.auditor._course import CoursePieces as CoursePieces
from kerfpath.auditor._course import rates_along as rates_along
from kerfpath.auditor._room import retract_checks as retract_checks
from kerfpath.auditor._rounding import MOST_ROUNDED as MOST_ROUNDED
from kerfpath.auditor._rounding import Rounding as Rounding
from kerfpath.auditor._rounding import rounding_of as rounding_of
from kerfpath.auditor._table import Check as Check
from kerfpath.auditor._table import Issue as Issue
from kerfpath.auditor._table import Level as Level
from kerfpath.auditor._table import Unit as Unit
from kerfpath.auditor._table import format_value as format_value
from kerfpath.auditor._table import worst_of as worst_of
from kerfpath.auditor._windows import window_checks as window_checks


def __getattr__(name: str) -> object:
    if name != "air_checks":
        raise AttributeError(f"module 'kerfpath.auditor' has no attribute {name!r}")
    warnings.warn(
        "kerfpath.auditor.air_checks has been renamed to transfer_checks",
        DeprecationWarning,
        stacklevel=2,
    )
    return transfer_checks
