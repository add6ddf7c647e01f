"""Run the command `kerfpath` by `python -m kerfpath`."""

import sys

if __name__ == "__main__":
    if not sys.flags.safe_path:
        del sys.path[0]  # the current folder: nothing is imported from it
    from kerfpath.cli import main

    main()
