"""The job file: its tables, what they mean in SI, and what is wrong with one, said in a line."""

from kerfpath.job.format._cell import cell_of_job as cell_of_job
from kerfpath.job.format._cell import with_map as with_map
from kerfpath.job.format._contour import ContourSpec as ContourSpec
from kerfpath.job.format._drawing import Drawing as Drawing
from kerfpath.job.format._poses import pose as pose
from kerfpath.job.format._prepared import Candidate as Candidate
from kerfpath.job.format._prepared import CutRequest as CutRequest
from kerfpath.job.format._prepared import PreparedJob as PreparedJob
from kerfpath.job.format._prepared import divide_nodes as divide_nodes
from kerfpath.job.format._prepared import prepare as prepare
from kerfpath.job.format._program import ProgramOptions as ProgramOptions
from kerfpath.job.format._program import Tolerances as Tolerances
from kerfpath.job.format._program import program_options as program_options
from kerfpath.job.format._program import tolerances_of as tolerances_of
from kerfpath.job.format._read import Job as Job
from kerfpath.job.format._read import read_job as read_job
from kerfpath.job.format._refusals import all_of as all_of
from kerfpath.job.format._refusals import refusal_at as refusal_at
from kerfpath.job.format.tables import VARIABLES as VARIABLES
from kerfpath.job.format.tables import AuditTable as AuditTable
from kerfpath.job.format.tables import ContourTable as ContourTable
from kerfpath.job.format.tables import Goal as Goal
from kerfpath.job.format.tables import JobFile as JobFile
from kerfpath.job.format.tables import LayoutTable as LayoutTable
from kerfpath.job.format.tables import ProgramTable as ProgramTable
from kerfpath.job.format.tables import SequenceTable as SequenceTable
