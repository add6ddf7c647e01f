"""A task of a sweep: its key in the store, and the attempt to do it."""

from __future__ import annotations

import hashlib
import inspect
import json
import pickle
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from kerfpath import __version__
from kerfpath.arrays import short_repr
from kerfpath.effort import Effort, set_effort
from kerfpath.errors import InputError

SCHEMA = 1
"""Version of the store's format; a store with another number is refused."""


class UnfitWorker(InputError):
    """The worker lacks something that the task needs: the sweep ends, and no failure is stored."""


class Task(NamedTuple):
    """A call to do: the key of its result, and its parameters as JSON."""

    key: str
    parameters: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Failure:
    """The reason why a task has no value.

    Parameters
    ----------
    kind : str
        Type of the exception, such as "NoFeasiblePath" or "InputError"; "WorkerDied" where the task
        killed its process.
    message : str
    """

    kind: str
    message: str

    __repr__ = short_repr

    @property
    def reason(self) -> str:
        """The message; it begins with the kind unless that is one of kerfpath's own errors."""
        own = self.kind in ("InputError", "NoFeasiblePath")
        return self.message if own else f"{self.kind}: {self.message}"


@dataclass(frozen=True, kw_only=True, slots=True)
class TaskOutcome:
    """The outcome of an attempt: a value as JSON, or a failure, and the time it took, s."""

    key: str
    value: str | None
    failure: Failure | None
    seconds: float

    __repr__ = short_repr


def name_of(function: Callable[..., Any]) -> str:
    """Return "module:name" of a top-level function; the module of a script is its file name.

    Raises
    ------
    InputError
        A worker could not import the function.
    """
    module, name = getattr(function, "__module__", None), getattr(function, "__qualname__", "")
    home = sys.modules.get(module or "")
    if home is None or getattr(home, name, None) is not function:
        raise InputError(
            "a sweep needs a function that workers can import from the top level of a module, got "
            f"{function!r}; move it there"
        )
    if module == "__main__":
        spec, file = getattr(home, "__spec__", None), getattr(home, "__file__", None)
        if spec is None and file is None:
            raise InputError(
                f"{name} was defined interactively, so workers cannot import it: save it in a file"
            )
        module = spec.name if spec else Path(str(file)).stem
    return f"{module}:{name}"


def task_of(function: Callable[..., Any], parameters: Mapping[str, Any], where: str) -> Task:
    """Return the task `function(**parameters)`; the key hashes schema, version, name, parameters.

    Raises
    ------
    InputError
        The parameters are not JSON data, or not those of the function; the message begins with
        `where`.
    """
    try:
        text = json.dumps(parameters, sort_keys=True, separators=(",", ":"), allow_nan=False)
        inspect.signature(function).bind(**json.loads(text))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{where}: expected the parameters of {name_of(function)} as plain data (a mapping of "
            f"numbers, text, lists, None): {error}"
        ) from error
    whole = json.dumps([SCHEMA, __version__, name_of(function), text])
    return Task(hashlib.sha256(whole.encode()).hexdigest(), text)


def attempt(version: str, function: bytes, effort: Effort, task: Task) -> TaskOutcome:
    """Call a pickled function in a worker, with an effort; an exception becomes the outcome.

    Raises
    ------
    UnfitWorker
        The worker has another version of kerfpath than `version` or lacks the function, or the
        function raises it: this is not an outcome of the task.
    """
    if version != __version__:
        raise UnfitWorker(f"a worker has kerfpath {__version__}, this sweep needs {version}")
    try:
        call = pickle.loads(function)
    except (ImportError, AttributeError) as error:
        raise UnfitWorker(f"a worker cannot import the function of the sweep: {error}") from error
    set_effort(effort)
    value, failure = None, None
    begun = perf_counter()
    try:
        value = json.dumps(call(**json.loads(task.parameters)), allow_nan=False)
    except UnfitWorker:
        raise
    except (Exception, SystemExit) as error:  # recorded, not hidden: the other tasks go on
        message = str(error).encode(errors="replace").decode()
        failure = Failure(kind=type(error).__name__, message=message)
    return TaskOutcome(key=task.key, value=value, failure=failure, seconds=perf_counter() - begun)
