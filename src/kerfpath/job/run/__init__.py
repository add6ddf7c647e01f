"""The run of a job: plan every contour, audit every plan, find the order of cutting."""

from kerfpath.job.run.contour import advised as advised
from kerfpath.job.run.contour import course_of_plans as course_of_plans
from kerfpath.job.run.contour import cut_as_before as cut_as_before
from kerfpath.job.run.contour import cut_candidate as cut_candidate
from kerfpath.job.run.contour import moved_into_reach as moved_into_reach
from kerfpath.job.run.foresee import JobPreview as JobPreview
from kerfpath.job.run.foresee import check_job as check_job
from kerfpath.job.run.foresee import foresee as foresee
from kerfpath.job.run.foresee import require_foreseen as require_foreseen
from kerfpath.job.run.foresee import sides_in_doubt as sides_in_doubt
from kerfpath.job.run.job import certified as certified
from kerfpath.job.run.job import measured as measured
from kerfpath.job.run.job import order_cuts as order_cuts
from kerfpath.job.run.job import run_again as run_again
from kerfpath.job.run.job import run_job as run_job
from kerfpath.job.run.job import run_prepared as run_prepared
from kerfpath.job.run.results import CutResult as CutResult
from kerfpath.job.run.results import JobResult as JobResult
from kerfpath.job.run.speeds import ContourSpeed as ContourSpeed
from kerfpath.job.run.speeds import fastest_along as fastest_along
from kerfpath.job.run.speeds import fastest_speeds as fastest_speeds
