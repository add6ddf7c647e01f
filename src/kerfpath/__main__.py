"""Run the command `kerfpath` by `python -m kerfpath`."""

from kerfpath.cli import main

if __name__ == "__main__":
    main()
