"""docs/job-file.md has every table and every key of a job, and no other.

The keys of [plan] are in a table that is written from their declarations.
"""

import re

import pytest

from conftest import ROOT
from kerfpath.job.format.tables import REPEATED, TABLES

TEXT = (ROOT / "docs" / "job-file.md").read_text()
SECTIONS = {
    heading: body
    for heading, body in re.findall(
        r"^## \[+([a-z]+)\]+.*?\n(.*?)(?=^## |\Z)", TEXT, re.MULTILINE | re.DOTALL
    )
}


def words_of(section):
    """The words in backticks, and those at the front of such an entry: `key = value`."""
    return {re.split(r"[ =]", code)[0] for code in re.findall(r"`([^`]+)`", section)}


def test_every_table_has_a_section():
    assert set(SECTIONS) == {name for name in TABLES if "." not in name}


@pytest.mark.parametrize("table", sorted(TABLES.keys() - {"plan"}))
def test_every_key_of_a_table_is_told(table):
    section = SECTIONS[table.split(".")[0]]
    known = words_of(section)
    if "." in table:
        header = f"[[{table}]]" if table in REPEATED else f"[{table}]"
        row = [line for line in section.splitlines() if f"`{header}`" in line]
        assert row, header
        known = words_of("\n".join(row))
    inner = {name.rpartition(".")[2] for name in TABLES if name.rpartition(".")[0] == table}
    missing = set(TABLES[table].model_fields) - known - inner
    assert not missing, f"[{table}]: {sorted(missing)}"


@pytest.mark.parametrize("section", SECTIONS)
def test_no_key_is_told_that_is_not_there(section):
    known = set(TABLES[section].model_fields)
    for line in SECTIONS[section].splitlines():
        if line.startswith("| `") and not line.startswith("| `["):
            for key in re.findall(r"`([^`]+)`", line.split("|")[1]):
                assert key in known, key
