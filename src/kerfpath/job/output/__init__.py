"""The files that a run leaves in its folder."""

from kerfpath.job.output._files import Texts as Texts
from kerfpath.job.output._files import Written as Written
from kerfpath.job.output._files import make_folder as make_folder
from kerfpath.job.output._files import outcome_texts as outcome_texts
from kerfpath.job.output._files import planned_text as planned_text
from kerfpath.job.output._files import require_folder as require_folder
from kerfpath.job.output._files import require_language as require_language
from kerfpath.job.output._files import stale_program as stale_program
from kerfpath.job.output._files import write_outcome as write_outcome
