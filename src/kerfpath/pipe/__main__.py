"""Answer requests: JSON from standard input, a line each, and its answer to standard output."""

from __future__ import annotations

import json
import sys
from typing import Any

from kerfpath.pipe.answer import answer


def main() -> None:
    """Answer until the input ends. What else is printed goes to standard error."""
    answers, sys.stdout = sys.stdout, sys.stderr
    for line in sys.stdin:
        answers.write(json.dumps(_answered(line)) + "\n")
        answers.flush()


def _answered(line: str) -> dict[str, Any]:
    """Return the answer to a line, whatever it says."""
    try:
        request = json.loads(line)
        if not isinstance(request, dict):
            raise TypeError(f"expected an object, got {line.strip()[:40]!r}")
        return answer(request)
    except KeyError as error:
        return {"error": "input", "message": f"request: expected {error.args[0]!r}, got none"}
    except (TypeError, ValueError) as error:  # JSON that does not end, too
        return {"error": "input", "message": f"request: {error}"}


if __name__ == "__main__":
    main()
