"""The run of a job: plan every contour, audit every plan, find the order of cutting."""

from kerfpath.job.run._contour import advised as advised
from kerfpath.job.run._contour import course_of_plans as course_of_plans
from kerfpath.job.run._contour import cut_candidate as cut_candidate
from kerfpath.job.run._foresee import foresee as foresee
from kerfpath.job.run._foresee import require_foreseen as require_foreseen
from kerfpath.job.run._order import order_cuts as order_cuts
from kerfpath.job.run._preview import JobPreview as JobPreview
from kerfpath.job.run._preview import check_job as check_job
from kerfpath.job.run._result import CutResult as CutResult
from kerfpath.job.run._result import JobResult as JobResult
from kerfpath.job.run._run import certified as certified
from kerfpath.job.run._run import measured as measured
from kerfpath.job.run._run import run_job as run_job
from kerfpath.job.run._run import run_prepared as run_prepared
from kerfpath.job.run._speeds import ContourSpeed as ContourSpeed
from kerfpath.job.run._speeds import fastest_along as fastest_along
from kerfpath.job.run._speeds import fastest_speeds as fastest_speeds
