"""A table of all targets (CSV), for spreadsheets and your own programs."""

from kerfpath.post.arcs import check_times
from kerfpath.post.csv.reader import read
from kerfpath.post.csv.writer import Csv as Csv
from kerfpath.post.csv.writer import CsvSettings as CsvSettings
from kerfpath.post.csv.writer import is_reserved, rules
from kerfpath.post.languages import Language, no_settings_needed

CSV = Language(
    name="csv",
    title="a CSV table",
    manufacturers=(),
    families=(),
    suffix=".csv",
    settings=CsvSettings,
    rules=rules,
    formatter=Csv,
    is_reserved=is_reserved,
    check=check_times,
    zones=False,
    externals=no_settings_needed,
    read=read,
)
"""The language as registered."""
