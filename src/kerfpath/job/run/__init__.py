"""The run of a job: plan every contour, audit every plan, find the order of cutting."""

from kerfpath.job.run._cut import Cut as Cut
from kerfpath.job.run._preview import Checked as Checked
from kerfpath.job.run._preview import check_job as check_job
from kerfpath.job.run._run import Chosen as Chosen
from kerfpath.job.run._run import Given as Given
from kerfpath.job.run._run import Outcome as Outcome
from kerfpath.job.run._run import Progress as Progress
from kerfpath.job.run._run import fastest_along as fastest_along
from kerfpath.job.run._run import fastest_speeds as fastest_speeds
from kerfpath.job.run._run import is_compiled as is_compiled
from kerfpath.job.run._run import run_job as run_job
from kerfpath.job.run._run import warm_up as warm_up
