"""The audit: a re-check of a plan by kinematics that share no code with the planner."""

from kerfpath.auditor._air import air_checks as air_checks
from kerfpath.auditor._audit import audit as audit
from kerfpath.auditor._audit import checks as checks
from kerfpath.auditor._chain import JointChain as JointChain
from kerfpath.auditor._chain import chain_of as chain_of
from kerfpath.auditor._rounding import Rounding as Rounding
from kerfpath.auditor._rounding import rounding_of as rounding_of
from kerfpath.auditor._table import Check as Check
from kerfpath.auditor._table import Issue as Issue
from kerfpath.auditor._table import Level as Level
from kerfpath.auditor._table import Unit as Unit
from kerfpath.auditor._table import in_words as in_words
from kerfpath.auditor._table import worst_of as worst_of
