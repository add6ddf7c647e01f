"""The command line: `kerfpath --help`."""

import sys

from kerfpath._extras import require_extra
from kerfpath.cli._stop import stoppable
from kerfpath.errors import InputError

__all__ = ["main"]


def main() -> None:
    """Run the command line and exit with its exit code."""
    with stoppable():  # from the first import on
        try:
            require_extra("programs", "the command line")
        except InputError as error:
            print(f"kerfpath: error: {error}", file=sys.stderr)
            sys.exit(2)
        from kerfpath.cli import _programs, _studies
        from kerfpath.cli._main import run

        assert _programs, _studies  # their commands
        run()
