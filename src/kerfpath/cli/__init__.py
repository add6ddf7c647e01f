"""The command line: `kerfpath --help`."""

from kerfpath.cli._main import main as main
