"""Write plan.json, read it back, and audit it against its job."""

from kerfpath.job.plan_file.audit import PlanAudit as PlanAudit
from kerfpath.job.plan_file.audit import audit_file as audit_file
from kerfpath.job.plan_file.layout import ContourData as ContourData
from kerfpath.job.plan_file.reading import PlanFile as PlanFile
from kerfpath.job.plan_file.reading import read_plan_file as read_plan_file
from kerfpath.job.plan_file.reading import table_of as table_of
from kerfpath.job.plan_file.schema import sequence_entry as sequence_entry
from kerfpath.job.plan_file.writing import broken_entry as broken_entry
from kerfpath.job.plan_file.writing import plan_document as plan_document
from kerfpath.job.plan_file.writing import plan_entry as plan_entry
from kerfpath.job.plan_file.writing import plan_text as plan_text
