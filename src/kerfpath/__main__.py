"""`python -m kerfpath` is the command `kerfpath`."""

from kerfpath.cli import main

if __name__ == "__main__":
    main()
