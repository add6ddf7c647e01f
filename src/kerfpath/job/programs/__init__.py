"""Robot programs of a job: built from plans, read back, audited, compared and touched up."""

from kerfpath.job.programs.audit import ProgramAudit as ProgramAudit
from kerfpath.job.programs.audit import audit_program as audit_program
from kerfpath.job.programs.from_plan import audit_of_cuts as audit_of_cuts
from kerfpath.job.programs.from_plan import program_from_file as program_from_file
from kerfpath.job.programs.from_plan import program_language as program_language
from kerfpath.job.programs.from_plan import program_of as program_of
from kerfpath.job.programs.reading import ProgramComparison as ProgramComparison
from kerfpath.job.programs.reading import compare_programs as compare_programs
from kerfpath.job.programs.touch_up import MovedTarget as MovedTarget
from kerfpath.job.programs.touch_up import TouchUp as TouchUp
from kerfpath.job.programs.touch_up import touch_up as touch_up
