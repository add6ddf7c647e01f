"""The files that a run writes into its folder."""

from kerfpath.job.output.script import python_script as python_script
from kerfpath.job.output.script import script_refusal as script_refusal
from kerfpath.job.output.spent import Spent as Spent
from kerfpath.job.output.spent import power_of as power_of
from kerfpath.job.output.spent import spent_by_contour as spent_by_contour
from kerfpath.job.output.spent import spent_entry as spent_entry
from kerfpath.job.output.spent import spent_on as spent_on
from kerfpath.job.output.spent import spent_on_all as spent_on_all
from kerfpath.job.output.spent import spent_table as spent_table
from kerfpath.job.output.writing import FileTexts as FileTexts
from kerfpath.job.output.writing import ProgramPlaces as ProgramPlaces
from kerfpath.job.output.writing import WrittenFiles as WrittenFiles
from kerfpath.job.output.writing import make_folder as make_folder
from kerfpath.job.output.writing import plan_file_text as plan_file_text
from kerfpath.job.output.writing import program_places as program_places
from kerfpath.job.output.writing import program_texts as program_texts
from kerfpath.job.output.writing import require_folder as require_folder
from kerfpath.job.output.writing import require_language as require_language
from kerfpath.job.output.writing import require_place as require_place
from kerfpath.job.output.writing import result_texts as result_texts
from kerfpath.job.output.writing import stale_program as stale_program
from kerfpath.job.output.writing import write_result as write_result
