"""The exceptions of kerfpath: bad input, no feasible path, a failed audit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from kerfpath.losses import Loss, Reason

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "AuditFailed",
    "CertificateRefused",
    "Closed",
    "InputError",
    "KerfpathError",
    "NoFeasiblePath",
    "OptionConflict",
    "Relaxation",
    "about",
]

LONGEST, BEGINNING = 600, 420
"""Characters of a message about bad input; of a longer one its beginning and its end are kept."""


class KerfpathError(Exception):
    """Base of every exception that kerfpath raises on purpose."""


class InputError(KerfpathError, ValueError):
    """Bad input: one line that says what was expected, what came, where, and what to do.

    It stays one line, and one that can be read, whatever of a file is quoted in it.

    Parameters
    ----------
    message : str
    others : sequence of str
        Lines about further faults that were found with it.
    """

    def __init__(self, message: str, others: Sequence[str] = ()) -> None:
        self.others = tuple(others)
        line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in message)
        if len(line) > LONGEST:
            line = f"{line[:BEGINNING]} ... {line[BEGINNING + 5 - LONGEST :]}"
        super().__init__(line)


class OptionConflict(InputError):
    """Two options that do not go together.

    Parameters
    ----------
    option : str
        The one that another forbids.
    expected, got : object
        Its only value beside the other (a tuple: any of them), None for none; and its value.
    beside : mapping of str to object
        The options that forbid it, with their values.
    """

    def __init__(
        self, option: str, expected: object, got: object, beside: Mapping[str, object]
    ) -> None:
        self.option, self.expected, self.got, self.beside = option, expected, got, beside
        said = " and ".join(f"{name} {_value(value)}".strip() for name, value in beside.items())
        super().__init__(
            f"{option}: expected {_value(expected) or 'none'} with {said}, got "
            f"{_value(got) or type(got).__name__}; change one"
        )


def _value(value: object) -> str:
    """Return a value in a message: text in quotes, numbers; nothing for an object."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return " or ".join(f'"{one}"' for one in value)
    return f"{value}" if isinstance(value, int | float) and value is not True else ""


class CertificateRefused(InputError):
    """A certificate that proves no bound of its plan.

    Parameters
    ----------
    why : str
        Part of the message.
    """

    def __init__(self, why: str) -> None:
        super().__init__(f"certificate: {why}; plan again")
        self.why = why


@contextmanager
def about(path: Path) -> Iterator[None]:
    """Have errors about bad input name the file that they are about, where they do not."""
    try:
        yield
    except InputError as error:
        said = str(error)
        raise (error if path.name in said else InputError(f"{path}: {said}")) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class Closed:
    """Where it is proved that no motion passes, whatever its gamma, postures and turns.

    Parameters
    ----------
    node : int
        No motion that keeps the limits up to this node goes on from it and reaches the end.
    joint : int or None
        The joint that stops most of what is left there, 0-based; None with "pose".
    limit : {"velocity", "acceleration", "pose"}
        Which of its limits does; "pose" where the next node has no pose within the ranges.
    """

    node: int
    joint: int | None
    limit: Literal["velocity", "acceleration", "pose"]

    def __str__(self) -> str:
        """Say it in words."""
        if self.joint is None:
            return f"node {self.node + 1} has no pose within the ranges of the joints"
        return (
            f"no motion goes on from node {self.node}, where the {self.limit} of joint "
            f"{self.joint + 1} stops most"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Relaxation:
    """What a motion that was found asks for beyond what was asked: less speed, or more limits.

    Parameters
    ----------
    speed : float
        Share of the speed asked for at which it keeps every limit, below 1.
    velocity, acceleration : float
        At the speed asked for: the multiples of the velocities and of the accelerations that may be
        used with both of which it keeps them; 1 where they are enough as they are.
    """

    speed: float
    velocity: float
    acceleration: float


class NoFeasiblePath(KerfpathError):
    """No admissible path was found: an answer with a reason, not a fault of the input.

    Parameters
    ----------
    message : str
        One line: where the path breaks and what each test removed there.
    proved : bool
        True when no admissible path exists on this graph; False when the method cannot tell
        (the paper's acceleration test is greedy).
    node : int
        The last node that any admissible path reaches, 0-based; -1 when layer 0 is empty.
    back : int or None
        The first node from which an admissible path reaches the end, where that is known: with
        `node` it brackets the cut. The number of nodes when the last layer is empty.
    reached, leaving : (m,) int, optional
        Vertices, 0-based inside their layers, in which the paths from the front end at `node`, and
        from which those to the end begin at `back`.
    counts : mapping of str to int
        What each test removed where the path breaks: candidates of the empty layer or edges into
        the unreached one, by `kerfpath.losses.Reason`, which is its words; of a Pareto set without
        plans the runs by what became of them.
    closed : Closed, optional
        Where no motion passes at any gamma, if that is proved.
    relaxation : Relaxation, optional
        With what a motion was found, where one was looked for.
    """

    def __init__(
        self,
        message: str,
        *,
        proved: bool,
        node: int,
        back: int | None = None,
        reached: NDArray[np.int64] | None = None,
        leaving: NDArray[np.int64] | None = None,
        counts: Mapping[str, int] | None = None,
        closed: Closed | None = None,
        relaxation: Relaxation | None = None,
    ) -> None:
        super().__init__(message)
        self.proved = proved
        self.node = node
        self.back = back
        self.reached = reached
        self.leaving = leaving
        self.counts = dict(counts or {})
        self.closed = closed
        self.relaxation = relaxation

    @property
    def scope(self) -> Literal["every gamma", "grid", "undecided"]:
        """Of what it is proved that there is no path: of every gamma, or of this grid of it alone.

        "undecided" where a path may even be on the grid.
        """
        if self.closed is not None:
            return "every gamma"
        return "grid" if self.proved else "undecided"

    def lost_by(self, loss: Loss) -> list[Reason]:
        """Return the reasons of one kind among the counts."""
        return [why for why in self.counts if isinstance(why, Reason) and why.loss is loss]

    def with_message(
        self,
        message: str,
        counts: Mapping[str, int] | None = None,
        closed: Closed | None = None,
        relaxation: Relaxation | None = None,
    ) -> NoFeasiblePath:
        """Return the same answer in other words, with what else is given."""
        return NoFeasiblePath(
            message,
            proved=self.proved,
            node=self.node,
            back=self.back,
            reached=self.reached,
            leaving=self.leaving,
            counts=self.counts if counts is None else counts,
            closed=self.closed if closed is None else closed,
            relaxation=self.relaxation if relaxation is None else relaxation,
        )


class AuditFailed(KerfpathError):
    """A plan or program that its audit refuses; nothing is written from it."""
