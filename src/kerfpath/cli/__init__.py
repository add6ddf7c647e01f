"""The command line: `kerfpath --help`."""

import sys

from kerfpath.cli.stop import stoppable
from kerfpath.cli.streams import settle
from kerfpath.errors import InputError
from kerfpath.extras import require_extra

__all__ = ["main"]

SAID_OF_MEMORY = ("failed to map segment", "annot allocate memory", "can't start new thread")
"""What errors of libraries, imports and threads say where there is no memory."""
NO_MEMORY = "there is not enough memory for this; free some, or raise the limit (ulimit -v)"


def main() -> None:
    """Run the command line and exit with its exit code."""
    try:
        settle()  # before anything is opened
        with stoppable():  # from the first import on
            require_extra("programs", "the command line")
            from kerfpath.cli import programs, studies
            from kerfpath.cli.app import run

            assert programs, studies  # their commands
            run()
    except InputError as error:
        print(f"kerfpath: error: {error}", file=sys.stderr)
        sys.exit(2)
    except (MemoryError, ImportError, OSError, RuntimeError) as error:
        if not isinstance(error, MemoryError) and not any(w in str(error) for w in SAID_OF_MEMORY):
            raise
        print(f"kerfpath: error: {NO_MEMORY}", file=sys.stderr)
        sys.exit(2)
