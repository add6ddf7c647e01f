"""plan.json: written, read back, and audited against the job."""

from kerfpath.job.plan_file._asked import Asked as Asked
from kerfpath.job.plan_file._asked import asked_of as asked_of
from kerfpath.job.plan_file._audit import PlanAudit as PlanAudit
from kerfpath.job.plan_file._audit import audit_file as audit_file
from kerfpath.job.plan_file._read import PlanFile as PlanFile
from kerfpath.job.plan_file._read import read_plan_file as read_plan_file
from kerfpath.job.plan_file._read import table_of as table_of
from kerfpath.job.plan_file._result import Audited as Audited
from kerfpath.job.plan_file._result import collision_note as collision_note
from kerfpath.job.plan_file._sequence import sequence_entry as sequence_entry
from kerfpath.job.plan_file._write import broken_entry as broken_entry
from kerfpath.job.plan_file._write import plan_entry as plan_entry
from kerfpath.job.plan_file._write import plan_text as plan_text
