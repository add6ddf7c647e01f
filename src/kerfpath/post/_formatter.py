"""The base of all formatters, which turn the steps of a program into lines."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, Literal

from kerfpath.auditor import Level
from kerfpath.errors import InputError
from kerfpath.post._program import (
    Await,
    CircularMove,
    Comment,
    JointMove,
    LinearMove,
    Partner,
    Program,
    Request,
    Section,
    Signal,
    Step,
    Wait,
)
from kerfpath.post._settings import LanguageSettings

__all__ = ["Formatter", "number", "plain"]


class Formatter(ABC):
    """Formatter of one program in one language; each kind of step has its own method.

    A dialect is a subclass that overrides some of them. The program must have passed `preflight`.

    Parameters
    ----------
    program : Program
    settings : LanguageSettings
        Settings of the language.
    """

    program: Program
    settings: Any
    around = 0
    """Number of lines of a contour's routine, or of its file, beside those of its steps."""
    too_long: Level | None = None
    """Level of the issue that a contour is longer than a file may be; None: not checked."""

    def __init__(self, program: Program, settings: LanguageSettings) -> None:
        self.program, self.settings = program, settings

    @abstractmethod
    def files(self) -> dict[str, str]:
        """Return the text of every file by its name, the one to start first."""

    @abstractmethod
    def names(self) -> list[tuple[str, str]]:
        """Return every name that the text defines or uses, with what it names."""

    @abstractmethod
    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield the lines of a joint move."""

    @abstractmethod
    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield the lines of a linear move and of what is switched at its end."""

    def circular_move(self, move: CircularMove) -> Iterator[str]:
        """Yield the lines of a circular move and of what is switched at its end.

        Raises
        ------
        InputError
            The language has no arcs; its `check` reports that before.
        """
        raise InputError("the language has no arcs; leave arcs_mm out of the job")

    @abstractmethod
    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield the lines of a wait."""

    def request(self, request: Request) -> Iterator[str]:
        """Yield the lines that set or reset the output of a partner.

        Raises
        ------
        InputError
            The language has no such outputs; the preflight reports that before.
        """
        raise InputError("the language cannot request anything; leave request out of the job")

    def wait_for(self, awaited: Await) -> Iterator[str]:
        """Yield the lines that wait for an input, and end the program safely if it stays off.

        Raises
        ------
        InputError
            The language has no inputs; the preflight reports that before.
        """
        raise InputError("the language cannot wait for inputs; leave wait_for out of the job")

    @abstractmethod
    def comment(self, text: str) -> Iterator[str]:
        """Yield the lines of a comment; `text` is on one line, in plain characters."""

    def lines(self, section: Section) -> Iterator[str]:
        """Yield the lines of all steps of a section."""
        for step in section.steps:
            yield from self.step(step)

    def lengths(self) -> dict[str, int]:
        """Return how many lines each contour takes, by its name."""
        return {s.name: sum(1 for _ in self.lines(s)) + self.around for s in self.program.sections}

    def room(self) -> int:
        """Return how many lines of contours a file has room for."""
        return int(self.settings.lines_per_file)

    def step(self, step: Step) -> Iterator[str]:
        """Yield the lines of one step."""
        if isinstance(step, JointMove):
            yield from self.joint_move(step)
        elif isinstance(step, CircularMove):
            yield from self.circular_move(step)
        elif isinstance(step, LinearMove):
            yield from self.linear_move(step)
        elif isinstance(step, Wait):
            yield from self.wait(step)
        elif isinstance(step, Request):
            yield from self.request(step)
        elif isinstance(step, Await):
            yield from self.wait_for(step)
        elif isinstance(step, Comment):
            yield from self.comment(plain(step.text))

    def head(self, *about: str) -> list[str]:
        """Return the remarks at the head: the robot, `about`, and what is and is not proved."""
        robot = self.program.robot
        clear = "been proved clear in the planned cell"
        checked = clear if self.program.air_checked else "not been checked for collisions"
        return [
            f"Written by kerfpath for {plain(robot.model)} ({plain(robot.id)}).",
            *about,
            f"Transfer moves have {checked}.",
            *self.program.caveats,
        ]

    def output(self, signal: Signal) -> Any:
        """Return the output of a signal, from the settings `laser_output` and `gas_output`.

        Raises
        ------
        InputError
            The settings name no output for the signal.
        """
        name = getattr(self.settings, f"{signal}_output")
        if name is None:
            raise InputError(
                f"the program switches the {signal}, but no output is named for it; name it "
                f"with {signal}_output"
            )
        return name

    def port(self, partner: Partner, way: Literal["input", "output"]) -> Any:
        """Return the input by which a partner answers, or the output by which it is asked."""
        return getattr(self.settings, f"{partner}_{way}")


def number(value: float, decimals: int) -> str:
    """Return a number with `decimals` decimals, and no minus before zero."""
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}"


def plain(text: str) -> str:
    """Return `text` on one line, in the characters that every controller reads."""
    return re.sub(r"[^ -~]", "?", text)
