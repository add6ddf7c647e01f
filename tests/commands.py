"""The command, run in this process, and what it leaves."""

import io
import re
import sys
from contextlib import redirect_stderr, redirect_stdout
from typing import NamedTuple

import pytest

from kerfpath.cli import main


class Result(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


def run(*arguments, cwd="."):
    """Run the command in this process, as its entry point would."""
    stdout, stderr = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["kerfpath", *map(str, arguments)])
        patch.chdir(cwd)
        with redirect_stdout(stdout), redirect_stderr(stderr):
            try:
                main()
                code = 0
            except SystemExit as leaving:
                code = leaving.code or 0
    return Result(code, stdout.getvalue(), stderr.getvalue())


def assert_refused(result, *words):
    """Assert bad input: exit code 2, a line for each fault, at most the drawing on stdout."""
    assert result.returncode == 2, result.stderr
    assert all("(file in" in line for line in result.stdout.splitlines())
    lines = result.stderr.strip().splitlines()
    assert all(line.startswith("kerfpath: error: ") for line in lines), result.stderr
    # The first line says how many more there are: of a job's faults all, of a program's just that.
    more = re.search(r"\(and (\d+) more\)$", lines[0])
    assert len(lines) in (1, 1 + int(more[1]) if more else 1), result.stderr
    for word in words:
        assert word in result.stderr
