"""The command line: `kerfpath --help`."""

import sys

from kerfpath.cli.surroundings import settle, stoppable
from kerfpath.errors import InputError
from kerfpath.extras import require_extra
from kerfpath.memory import require_memory

__all__ = ["main"]

SAID_OF_MEMORY = ("failed to map segment", "annot allocate memory", "can't start new thread")
"""What errors of libraries, imports and threads say where there is no memory."""
AT_START = 1300 * 1024**2
"""Bytes of addresses that the libraries of a command that plans take (OCP 500, LLVM 200 MB ...).

Each of them ends with less in a way of its own: an error of some type, or the whole process.
"""
NO_MEMORY = "there is not enough memory for this; free some, or raise the limit (ulimit -v)"


def main() -> None:
    """Run the command line and exit with its exit code."""
    try:
        settle()  # before anything is opened
        require_memory(AT_START)
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
        if not _says_memory(error):
            raise
        print(f"kerfpath: error: {NO_MEMORY}", file=sys.stderr)
        sys.exit(2)


def _says_memory(error: BaseException | None) -> bool:
    """Return whether an error, or one that it arose from, says that there is no memory."""
    if error is None or isinstance(error, MemoryError):
        return error is not None
    said = any(words in str(error) for words in SAID_OF_MEMORY)
    return said or _says_memory(error.__cause__ or error.__context__)
