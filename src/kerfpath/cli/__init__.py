"""The command line: `kerfpath --help`."""

import sys

from kerfpath.cli.stop import stoppable
from kerfpath.errors import InputError
from kerfpath.extras import require_extra

__all__ = ["main"]


def main() -> None:
    """Run the command line and exit with its exit code."""
    with stoppable():  # from the first import on
        try:
            require_extra("programs", "the command line")
        except InputError as error:
            print(f"kerfpath: error: {error}", file=sys.stderr)
            sys.exit(2)
        from kerfpath.cli import programs, studies
        from kerfpath.cli.app import run

        assert programs, studies  # their commands
        run()
