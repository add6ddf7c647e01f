"""The text of the job, its undo history, and the jobs that are kept for comparison."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from string import ascii_uppercase
from typing import Any, NamedTuple

import tomlkit
from tomlkit.exceptions import TOMLKitError

from kerfpath.errors import InputError
from kerfpath.files import write_whole
from kerfpath.studio.messages import (
    Cycle,
    KeptEntry,
    KeptMessage,
    Message,
    OutcomeMessage,
    PlanMessage,
)

# -----------------------------------------------------------------------------
# The text of the job: key-by-key edits that keep its comments, undo, redo and save.

Key = tuple[str | int, ...]
"""The path to a value: names of tables and keys, and indices of tables and elements."""
Change = tuple[Key, object]
"""A key and its new value; None removes it."""

MOST_STEPS = 300
"""Number of steps that can be undone."""
MOST_BYTES = 50_000_000
"""Largest size of all these steps together; of larger jobs fewer steps can be undone."""
DIGITS = 12
"""Significant digits of a written number: sliders send values like 0.30000000000000004."""


class Document:
    """The text of a job file with its undo history.

    Every change is immediately written to a file beside the job, and restored from there.

    Parameters
    ----------
    path : Path
        Path of the job file.

    Attributes
    ----------
    revision : int
        Grows with each change.

    Raises
    ------
    InputError
        The job cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.beside = path.with_name(f"{path.stem}.studio.toml")
        self._on_disk = self.text = _read(path)
        self._before: list[bytes] = []
        self._after: list[bytes] = []
        self._gesture: tuple[str, Key] | None = None
        self.revision = 1
        if self.beside.is_file() and (kept := _read(self.beside)) != self.text:
            self._before, self.text = [self.text.encode()], kept

    @property
    def saved(self) -> bool:
        """Whether the job file has this text."""
        return self.text == self._on_disk

    @property
    def file(self) -> Path:
        """The file that has this text: the job file, or the file beside it."""
        return self.path if self.saved else self.beside

    @property
    def can_undo(self) -> bool:
        """Whether there is a step back."""
        return bool(self._before)

    @property
    def can_redo(self) -> bool:
        """Whether there is a step forward."""
        return bool(self._after)

    def change(self, changes: Sequence[Change], gesture: str | None = None) -> None:
        """Make changes as one step of undo; changes of one key in one gesture share a step.

        Raises
        ------
        InputError
            A key is not possible, the text is not valid TOML, or the folder is not writable.
        """
        same = None if gesture is None else (gesture, changes[0][0])
        made = with_values(self.text, changes)
        self._step_to(made, merge=same is not None and same == self._gesture)
        self._gesture = same

    def replace(self, text: str) -> None:
        """Replace the text, as one step of undo.

        Raises
        ------
        InputError
            The folder is not writable.
        """
        self._step_to(text)

    def undo(self) -> None:
        """Go one step back, if there is one."""
        self._shift(self._before, self._after)

    def redo(self) -> None:
        """Go one step forward, if there is one."""
        self._shift(self._after, self._before)

    def save(self, *, over: bool = False) -> None:
        """Write the job file.

        Raises
        ------
        InputError
            The file has been changed since it was read and `over` is False, or it cannot be
            written.
        """
        if not over and self.path.exists() and _read(self.path) != self._on_disk:
            raise InputError(
                f"{self.path}: the file has been changed since it was read; save over it, or take "
                "a copy and open the job again"
            )
        _write(self.path.resolve(), self.text)  # a job may be a link, which stays
        self._on_disk = self.text
        self._keep()

    def _step_to(self, text: str, *, merge: bool = False) -> None:
        if text == self.text:
            return
        if not merge or not self._before:
            self._before = [*self._before[1 - MOST_STEPS :], self.text.encode()]
        while sum(map(len, self._before)) > MOST_BYTES:
            del self._before[0]
        self._after.clear()
        self._take(text)

    def _shift(self, back: list[bytes], forth: list[bytes]) -> None:
        if back:
            forth.append(self.text.encode())
            self._take(back.pop().decode())

    def _take(self, text: str) -> None:
        self._gesture = None
        self.text = text
        self.revision += 1
        self._keep()

    def _keep(self) -> None:
        """Write the text beside the job file; remove that copy once the job is saved."""
        if not self.saved:
            _write(self.beside, self.text)
            return
        with suppress(OSError):
            self.beside.unlink(missing_ok=True)


def with_values(text: str, changes: Sequence[Change]) -> str:
    """Return a TOML text with values changed; comments and all other lines stay unchanged.

    Parameters
    ----------
    text : str
    changes : sequence of (key, value)
        The value None removes a key. Missing tables on the path to a key are added.

    Raises
    ------
    InputError
        The text is not valid TOML, or a key leads through a value or to a table that does not
        exist.
    """
    try:
        tables = tomlkit.parse(text)
    except TOMLKitError as error:
        raise InputError(f"job: not valid TOML: {error}; correct the text or undo") from None
    for key, value in changes:
        try:
            _set(tables, key, value)
        except (LookupError, TypeError, AttributeError, ValueError, TOMLKitError):
            raise InputError(f"job: expected a key of a table, got {_dotted(key)}") from None
    return tomlkit.dumps(tables)


def _set(tables: Any, key: Key, value: object) -> None:
    *way, last = key
    node = tables
    for name in way:
        if isinstance(name, str) and name not in node:
            if value is None:
                return
            node[name] = tomlkit.table()
        node = node[name]
    if value is None:
        if isinstance(last, int) or last in node:
            del node[last]
        if not node and len(way) > 1 and isinstance(way[-1], str):
            _set(tables, tuple(way), None)  # no empty table stays inside another one
        return
    if isinstance(last, int) and not 0 <= last < len(node):
        raise LookupError(last)
    node[last] = _short(value)


def _short(value: object) -> Any:
    """Return a value with its numbers rounded to `DIGITS` significant digits."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, list):
        return [_short(one) for one in value]
    if isinstance(value, dict):
        return {name: _short(one) for name, one in value.items()}
    return value


def _dotted(key: Key) -> str:
    return ".".join(str(part) for part in key)


def _read(path: Path) -> str:
    try:
        return path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; give the path of a job file") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: expected UTF-8 text; save the file as UTF-8") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give another job") from None


def _write(path: Path, text: str) -> None:
    try:
        write_whole({path: text.encode()})
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror}); the studio keeps changes beside the "
            "job file: open a job in a writable folder"
        ) from None


# -----------------------------------------------------------------------------
# Jobs that are kept for comparison: their texts, and the motions that were found for them.

MOST_KEPT = 8
"""Largest number of kept jobs: more could not be distinguished, and each holds its motions."""

Plans = dict[str, dict[str, PlanMessage]]
"""Plans by contour, then by the name of the plan."""


class _Copy(NamedTuple):
    """A job that is kept."""

    id: int
    name: str
    revision: int
    text: str
    metric: str
    objective: str
    plans: Plans
    cycle: Cycle | None


class KeptJobs:
    """The kept jobs, and the newest plans and outcome of the current one."""

    def __init__(self) -> None:
        self._now: Plans = {}
        self._outcome: OutcomeMessage | None = None
        self._copies: dict[int, _Copy] = {}
        self._count = 0

    def take(self, message: Message) -> bool:
        """Take a message about the job; return whether it concerns a kept job."""
        if isinstance(message, OutcomeMessage):
            self._outcome = message
            found = [one for one in self._copies.values() if one.revision == message.revision]
            for one in found:
                self._copies[one.id] = one._replace(cycle=message.cycle)
            return bool(found)
        if not isinstance(message, PlanMessage):
            return False
        _put(self._now, message)
        # The bound of a plan, and the turns of its joints, follow later than the plan.
        found = [one for one in self._copies.values() if one.revision == message.revision]
        for one in found:
            _put(one.plans, message)
        return bool(found)

    def keep(self, document: Document, name: str | None, metric: str, objective: str) -> None:
        """Keep the current job under a name, by default the next letter.

        Raises
        ------
        InputError
            The job is not planned yet, `MOST_KEPT` jobs are kept already, or the name is blank.
        """
        now = document.revision
        plans = {
            contour: dict(pieces)
            for contour, pieces in self._now.items()
            if all(one.revision == now and one.checks is not None for one in pieces.values())
        }
        if not plans:
            raise InputError("keep: the current job is not planned yet; wait until it is")
        if len(self._copies) >= MOST_KEPT:
            raise InputError(f"keep: {MOST_KEPT} plans are kept already; forget one of them first")
        self._count += 1
        known = self._outcome if self._outcome and self._outcome.revision == now else None
        self._copies[self._count] = _Copy(
            id=self._count,
            name=_words(name or self._letter()),
            revision=now,
            text=document.text,
            metric=metric,
            objective=objective,
            plans=plans,
            cycle=None if known is None else known.cycle,
        )

    def rename(self, number: int, name: str) -> None:
        """Rename a kept job.

        Raises
        ------
        InputError
            No kept job has this number, or the name is blank.
        """
        self._copies[number] = self._of(number)._replace(name=_words(name))

    def forget(self, number: int) -> None:
        """Drop a kept job.

        Raises
        ------
        InputError
            No kept job has this number.
        """
        del self._copies[self._of(number).id]

    def text(self, number: int) -> str:
        """Return the text of a kept job.

        Raises
        ------
        InputError
            No kept job has this number.
        """
        return self._of(number).text

    def plans(self, number: int) -> str:
        """Return the plans of a kept job as a JSON list.

        Raises
        ------
        InputError
            No kept job has this number.
        """
        found = self._of(number).plans.values()
        said = [plan.model_dump_json() for pieces in found for plan in pieces.values()]
        return f"[{','.join(said)}]"

    def message(self) -> KeptMessage:
        """Return the message that lists the kept jobs, without their motions."""
        return KeptMessage(
            plans=[
                KeptEntry(
                    id=one.id,
                    name=one.name,
                    revision=one.revision,
                    metric=one.metric,
                    objective=one.objective,
                    contours=list(one.plans),
                    cycle=one.cycle,
                    settled=all(
                        plan.settled for pieces in one.plans.values() for plan in pieces.values()
                    ),
                )
                for one in self._copies.values()
            ]
        )

    def keep_only(self, contours: list[str]) -> None:
        """Forget the plans of contours that the job no longer has."""
        self._now = {name: pieces for name, pieces in self._now.items() if name in set(contours)}

    def _of(self, number: int) -> _Copy:
        found = self._copies.get(number)
        if found is None:
            raise InputError("there is no such plan any more; it has been forgotten")
        return found

    def _letter(self) -> str:
        taken = {one.name for one in self._copies.values()}
        return next(letter for letter in ascii_uppercase if letter not in taken)


def _put(plans: Plans, message: PlanMessage) -> None:
    """Add a plan to the pieces of its contour; drop the pieces that it replaces."""
    held = plans.setdefault(message.contour, {})
    others = [one for one in held.values() if one.name != message.name]
    if message.pieces == 1 or any(one.revision != message.revision for one in others):
        held.clear()
    held[message.name] = message


def _words(name: str) -> str:
    if not name.strip():
        raise InputError('keep: expected a name such as "A" or "slower", got none')
    return name.strip()
