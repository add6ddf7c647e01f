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
    "printable",
]

LONGEST, BEGINNING = 600, 420
"""Most characters of a message about bad input; a longer one keeps its beginning and its end."""


def printable(text: str, *, keep: str = "") -> str:
    """Return a text with escapes for the characters that do not print, as direction marks.

    Parameters
    ----------
    text : str
    keep : str
        Characters that stay, as ends of lines do where several lines are shown.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in keep else repr(c)[1:-1] for c in text)


class KerfpathError(Exception):
    """Base of every exception that kerfpath raises on purpose."""


class InputError(KerfpathError, ValueError):
    """Bad input: one line that says what was expected, what came, where, and what to do.

    Control characters are escaped and long messages are cut, so that it stays one readable line
    whatever it quotes from a file.

    Parameters
    ----------
    message : str
    others : sequence of str
        Messages about further faults found at the same time; the line says how many.
    parameter : str
        Name of the parameter that is wrong or missing; a job has a key for it.
    """

    def __init__(self, message: str, others: Sequence[str] = (), *, parameter: str = "") -> None:
        self.message, self.others, self.parameter = _line(message), tuple(others), parameter
        super().__init__(_line(f"{message} (and {len(others)} more)" if others else message))


def _line(message: str) -> str:
    """Return a message as one readable line, cut in the middle if it is long."""
    line = printable(message)
    if len(line) <= LONGEST:
        return line
    return f"{line[:BEGINNING]} ... {line[BEGINNING + 5 - LONGEST :]}"


class OptionConflict(InputError):
    """Two options that do not go together.

    Parameters
    ----------
    option : str
        The option whose value does not go with the others.
    expected, got : object
        The value it must have with the others (a tuple: any of these; None: it must not be given),
        and the value it has.
    beside : mapping of str to object
        The other options, with their values.
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
    """Return a value as a message shows it: quoted text or a number; "" for any other object."""
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
        The reason, which the message contains.
    """

    def __init__(self, why: str) -> None:
        super().__init__(f"certificate: {why}; plan again")
        self.why = why


@contextmanager
def about(path: Path) -> Iterator[None]:
    """Put the path of a file before messages about bad input that do not name it yet."""
    try:
        yield
    except InputError as error:
        said = str(error)
        raise (error if path.name in said else InputError(f"{path}: {said}")) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class Closed:
    """Place that no motion passes; proved for every gamma, posture and turn.

    Parameters
    ----------
    node : int
        No motion that keeps the limits up to this node continues from it to the end.
    joint : int or None
        The joint that rules out most of the steps left there, 0-based; None with "pose" and "both".
    limit : {"velocity", "acceleration", "pose", "both"}
        The limit that rules them out; "pose" if the next node has no pose within the joint ranges,
        "both" if each of its poses is ruled out by the velocities or the accelerations.
    """

    node: int
    joint: int | None
    limit: Literal["velocity", "acceleration", "pose", "both"]

    def __str__(self) -> str:
        """Return the place in words."""
        if self.limit == "both":
            limits = "the velocity and acceleration limits"
            return f"no motion within {limits} passes node {self.node + 1}"
        if self.joint is None:
            return f"node {self.node + 1} has no pose within the ranges of the joints"
        return (
            f"no motion continues from node {self.node}, where the {self.limit} limit of joint "
            f"{self.joint + 1} rules out most steps"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Relaxation:
    """Lower speed, or higher limits, with which a motion was found.

    Parameters
    ----------
    speed : float
        Share of the speed asked for at which the motion keeps every limit, below 1.
    velocity, acceleration : float
        Factors on the usable velocities and accelerations: with both of them the motion keeps these
        limits at the speed asked for. A factor is 1 if its limit is kept as it is.
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
        True when no admissible path exists on this graph; False when the method cannot decide
        (the paper's acceleration test is greedy).
    node : int
        The last node that any admissible path reaches, 0-based; -1 when layer 0 is empty.
    back : int or None
        The first node from which an admissible path reaches the end, if known: the path breaks
        between `node` and `back`. It is the number of nodes when the last layer is empty.
    reached, leaving : (m,) int, optional
        Vertices, 0-based inside their layers: at `node` those where paths from the start end, and
        at `back` those where paths to the end begin.
    counts : mapping of str to int
        Number removed by each test where the path breaks: candidates of the empty layer, or edges
        into the unreached one. The keys are `kerfpath.losses.Reason`, a str. For a Pareto set
        without plans: the number of runs by outcome.
    closed : Closed, optional
        Where no motion passes at any gamma, if that is proved.
    relaxation : Relaxation, optional
        The lower speed, or the higher limits, with which a motion was found, if one was looked for.
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
        """Where it is proved that there is no path: at every gamma, or only on this grid of gamma.

        "undecided" if there may even be a path on the grid.
        """
        if self.closed is not None:
            return "every gamma"
        return "grid" if self.proved else "undecided"

    def lost_by(self, loss: Loss) -> list[Reason]:
        """Return the reasons in `counts` that are losses of one kind."""
        return [why for why in self.counts if isinstance(why, Reason) and why.loss is loss]

    def with_message(
        self,
        message: str,
        counts: Mapping[str, int] | None = None,
        closed: Closed | None = None,
        relaxation: Relaxation | None = None,
    ) -> NoFeasiblePath:
        """Return the same answer with another message and with the fields that are given."""
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
    """A plan or program that failed its audit; nothing is written from it."""
