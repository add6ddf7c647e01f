"""The command line: `kerfpath --help`."""

from kerfpath.cli import _studies as _studies  # its commands
from kerfpath.cli._main import main as main
