"""A table of all targets (CSV), for spreadsheets and your own programs."""

from kerfpath.post._languages import Language, no_settings_needed
from kerfpath.post._times import check_times
from kerfpath.post.csv._read import read
from kerfpath.post.csv._write import Csv as Csv
from kerfpath.post.csv._write import CsvSettings as CsvSettings
from kerfpath.post.csv._write import is_reserved, rules

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
