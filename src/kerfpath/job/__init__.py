"""The job: one file that says what to cut and how, its run, and the files the run leaves."""

from kerfpath.job._again import Audited as Audited
from kerfpath.job._again import audit_file as audit_file
from kerfpath.job._again import program_from_file as program_from_file
from kerfpath.job._cell import cell_of_job as cell_of_job
from kerfpath.job._cell import with_map as with_map
from kerfpath.job._check import Checked as Checked
from kerfpath.job._check import check_job as check_job
from kerfpath.job._files import Written as Written
from kerfpath.job._files import collision_note as collision_note
from kerfpath.job._files import program_of as program_of
from kerfpath.job._files import require_folder as require_folder
from kerfpath.job._files import require_language as require_language
from kerfpath.job._files import write_outcome as write_outcome
from kerfpath.job._planfile import PlanFile as PlanFile
from kerfpath.job._planfile import read_plan_file as read_plan_file
from kerfpath.job._read import Job as Job
from kerfpath.job._read import ProgramOptions as ProgramOptions
from kerfpath.job._read import program_options as program_options
from kerfpath.job._read import read_job as read_job
from kerfpath.job._run import Cut as Cut
from kerfpath.job._run import Outcome as Outcome
from kerfpath.job._run import fastest_speeds as fastest_speeds
from kerfpath.job._run import run_job as run_job
from kerfpath.job._run import warm_up as warm_up
from kerfpath.job._sequencefile import sequence_entry as sequence_entry
from kerfpath.job._task import ContourTask as ContourTask
