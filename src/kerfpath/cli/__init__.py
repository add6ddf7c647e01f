"""The command line: `kerfpath --help`."""

from kerfpath.cli._stop import stoppable

__all__ = ["main"]


def main() -> None:
    """Run the command line and leave with its exit code."""
    with stoppable():  # from the first import on
        from kerfpath.cli import _programs, _studies
        from kerfpath.cli._main import run

        assert _programs, _studies  # their commands
        run()
