"""Answer requests: JSON from standard input, a line each, and its answer to standard output."""

from __future__ import annotations

import json
import sys

from kerfpath.pipe.answer import answer


def main() -> None:
    """Answer until the input ends. What else is printed goes to standard error."""
    answers, sys.stdout = sys.stdout, sys.stderr
    for line in sys.stdin:
        try:
            request = json.loads(line)
            if not isinstance(request, dict):
                raise ValueError("expected an object")
            found = answer(request)
        except (ValueError, KeyError) as error:
            found = {"error": "input", "message": f"request: {error!r}"}
        answers.write(json.dumps(found) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
