"""The tables and keys of a job file: units, bounds, and the rules between them.

Units are in the names of the keys. Angles `rpy_deg` are roll, pitch and yaw about the fixed axes
x, y and z, R = Rz(yaw) Ry(pitch) Rx(roll), as in URDF. Messages about a field show its description
as the expected value and its example as the way to write it.
"""

from kerfpath.job.format.tables.cell import SOLIDS as SOLIDS
from kerfpath.job.format.tables.cell import CellTable as CellTable
from kerfpath.job.format.tables.cell import FixtureTable as FixtureTable
from kerfpath.job.format.tables.job import LIMITS_MARGIN as LIMITS_MARGIN
from kerfpath.job.format.tables.job import REPEATED as REPEATED
from kerfpath.job.format.tables.job import TABLES as TABLES
from kerfpath.job.format.tables.job import VARIABLES as VARIABLES
from kerfpath.job.format.tables.job import AuditTable as AuditTable
from kerfpath.job.format.tables.job import Goal as Goal
from kerfpath.job.format.tables.job import JobFile as JobFile
from kerfpath.job.format.tables.job import LayoutTable as LayoutTable
from kerfpath.job.format.tables.job import ProgramTable as ProgramTable
from kerfpath.job.format.tables.job import SequenceTable as SequenceTable
from kerfpath.job.format.tables.job import tables_in as tables_in
from kerfpath.job.format.tables.part import ContourTable as ContourTable
from kerfpath.job.format.tables.part import MachineTable as MachineTable
from kerfpath.job.format.tables.process import LONGEST_WORD as LONGEST_WORD
from kerfpath.job.format.tables.process import ChartFile as ChartFile
from kerfpath.job.format.tables.process import CostTable as CostTable
from kerfpath.job.format.tables.process import JobRowTable as JobRowTable
from kerfpath.job.format.tables.process import ProcessTable as ProcessTable
from kerfpath.job.format.tables.process import RowTable as RowTable
from kerfpath.job.format.tables.process import StageTable as StageTable
from kerfpath.job.format.tables.robot import ExternalTable as ExternalTable
from kerfpath.job.format.tables.table import given as given
