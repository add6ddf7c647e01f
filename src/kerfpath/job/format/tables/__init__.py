"""The tables and keys of a job file: units, bounds, and the rules between them.

Units are in the names of the keys. Angles `rpy_deg` are roll, pitch and yaw about the fixed axes
x, y and z, R = Rz(yaw) Ry(pitch) Rx(roll), as in URDF. Messages about a field show its description
as the expected value and its example as the way to write it.
"""

from kerfpath.job.format.tables._cell import CellTable as CellTable
from kerfpath.job.format.tables._cell import FixtureTable as FixtureTable
from kerfpath.job.format.tables._comfort import LIMITS_MARGIN as LIMITS_MARGIN
from kerfpath.job.format.tables._contour import ContourTable as ContourTable
from kerfpath.job.format.tables._external import ExternalTable as ExternalTable
from kerfpath.job.format.tables._job import REPEATED as REPEATED
from kerfpath.job.format.tables._job import TABLES as TABLES
from kerfpath.job.format.tables._job import JobFile as JobFile
from kerfpath.job.format.tables._layout import VARIABLES as VARIABLES
from kerfpath.job.format.tables._layout import Goal as Goal
from kerfpath.job.format.tables._layout import LayoutTable as LayoutTable
from kerfpath.job.format.tables._plan import PlanTable as PlanTable
from kerfpath.job.format.tables._program import AuditTable as AuditTable
from kerfpath.job.format.tables._program import ProgramTable as ProgramTable
from kerfpath.job.format.tables._sequence import SequenceTable as SequenceTable
from kerfpath.job.format.tables._table import given as given
