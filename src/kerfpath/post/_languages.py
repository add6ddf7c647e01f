"""The robot languages that programs can be written in, and their properties."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.post._controller import Controller
from kerfpath.post._formatter import Formatter
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import Program
from kerfpath.post._read import Reader
from kerfpath.post._settings import LanguageSettings, Rules
from kerfpath.robots import AXIS_3, Robot

__all__ = ["ENTRY_POINTS", "Language", "language", "languages", "no_settings_needed"]

ENTRY_POINTS = "kerfpath.languages"
"""Group of entry points whose objects are languages."""
SHIPPED = {
    "csv": "kerfpath.post.csv:CSV",
    "fanuc": "kerfpath.post.fanuc:FANUC",
    "inform": "kerfpath.post.inform:INFORM",
    "krl": "kerfpath.post.krl:KRL",
    "rapid": "kerfpath.post.rapid:RAPID",
    "ros": "kerfpath.post.ros:ROS",
    "urscript": "kerfpath.post.urscript:URSCRIPT",
    "val3": "kerfpath.post.val3:VAL3",
}
"""Modules and names of the languages that come with the package."""
BROKEN = (ImportError, AttributeError, NameError, SyntaxError, TypeError, ValueError)
"""Exceptions that a module written for another version may raise when it is imported."""


def _none_is_reserved(name: str) -> bool:
    return False


def no_settings_needed(robot: Robot, settings: object) -> Iterator[str]:
    """Yield nothing: external axes have their own names and units in programs."""
    yield from ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Language:
    """One robot language, or a dialect of one.

    Parameters
    ----------
    name : str
        Name in jobs and on the command line.
    title : str
        Name in messages.
    manufacturers : tuple of str
        Manufacturers of the robots that it moves; empty: all.
    families : tuple of str
        The arms that it can express, by `Robot.kinematics`; empty: all.
    axis_3 : tuple of str
        The arms that it can express, by `Robot.axis_3`. Without "", it must be known what axis 3
        of the controller measures.
    suffix : str
        Suffix of the file to start, with its dot.
    settings : type of LanguageSettings
    rules : callable
        (settings) -> the Rules of programs.
    formatter : type of Formatter
    is_reserved : callable, optional
        Whether a name means something else in the language; default: none does.
    posture : callable, optional
        (robot, q (K, n) rad, settings) -> posture and turns at each target, in the words of its
        reader. None: targets do not contain them.
    check : callable, optional
        (program, settings) -> the issues that only this language has.
    sayable : callable, optional
        (program, settings) -> the program as far as the language can express it; `check` warns of
        all that is left out. None: it can express all.
    ahead : bool
        Whether outputs are switched on the path, ahead of a target; else the robot stops first.
    zones : bool
        Whether its moves are straight lines and arcs whose corners the controller rounds.
    assumed : mapping of str to value
        Values of settings that are None; the preflight warns of assumed outputs.
    externals : callable, optional
        (robot, settings) -> what is missing or wrong in the settings for the robot's external axes
        and coordinated motion, as sentences. None: the language has no external axes.
    read : Reader, optional
        Reader of the text; without one a program cannot be audited.
    """

    name: str
    title: str
    manufacturers: tuple[str, ...]
    families: tuple[str, ...]
    suffix: str
    settings: type[LanguageSettings]
    rules: Callable[[Any], Rules]
    formatter: type[Formatter]
    is_reserved: Callable[[str], bool] = _none_is_reserved
    posture: Callable[[Robot, Array, Any], list[tuple[int | str, ...]]] | None = None
    check: Callable[[Program, Any], Iterator[ProgramIssue]] | None = None
    sayable: Callable[[Program, Any], Program] | None = None
    ahead: bool = True
    zones: bool = True
    assumed: Mapping[str, Any] = field(default_factory=dict)
    externals: Callable[[Robot, Any], Iterator[str]] | None = None
    read: Reader | None = None
    axis_3: tuple[str, ...] = AXIS_3

    __repr__ = short_repr

    def completed(self, settings: LanguageSettings | None) -> LanguageSettings:
        """Return settings, by default those of the language, with `assumed` values where None."""
        settings = self.settings() if settings is None else settings
        lacks = {k: v for k, v in self.assumed.items() if getattr(settings, k, v) is None}
        return settings.model_copy(update=lacks) if lacks else settings

    def controller(self, settings: LanguageSettings | None = None) -> Controller:
        """Return the controller that settings describe, by default the language's defaults."""
        return self.rules(self.completed(settings)).controller

    def refusal(self, robot: Robot) -> str:
        """Return why no program in this language can move a robot; empty if one can."""
        if self.families and robot.kinematics not in self.families:
            return f"language {self.name!r} cannot yet express the axes of an arm like {robot.id!r}"
        if robot.externals and self.externals is None:
            names = ", ".join(axis.name for axis in robot.externals)
            return (
                f"language {self.name!r} is written here without external axes and cannot move "
                f"{names}; use another language, or plan the arm alone"
            )
        if robot.axis_3 in self.axis_3:
            return ""
        if robot.axis_3:
            return (
                f"language {self.name!r} cannot express a {robot.axis_3} axis 3 like that of "
                f"{robot.id!r}"
            )
        ways = {
            "serial": 'axis_3 = "serial" if it is joint 3 alone',
            "horizontal": (
                'axis_3 = "horizontal", with axis_3_deg = [LOWER, UPPER] from its data sheet, '
                "if it measures the upper arm from the horizontal, as with a parallel rod"
            ),
        }
        return (
            f"language {self.name!r} writes axis 3 of the controller, but it is not known what "
            f"axis 3 of {robot.id!r} measures (no arm of the library has its lengths); add to "
            "[robot] " + ", or ".join(ways[way] for way in self.axis_3 if way)
        )

    def doubt(self, robot: Robot) -> str:
        """Return why a robot may not understand this language; empty if it does."""
        if not self.manufacturers or robot.manufacturer in self.manufacturers:
            return ""
        return (
            f"language {self.name!r} is for robots by {' or '.join(self.manufacturers)}, but "
            f"{robot.id!r} is by {robot.manufacturer or 'an unknown maker'}"
        )


@cache
def languages() -> dict[str, Language]:
    """Return all languages by name: those shipped, and those that entry points add.

    An entry point that cannot be loaded, is not a language, or has the name of a shipped language
    is left out with a warning.
    """
    found = {name: _shipped_languages(name) for name in SHIPPED}
    for point in sorted(entry_points(group=ENTRY_POINTS), key=lambda point: point.name):
        try:
            loaded, fault = point.load(), ""
        except BROKEN as error:
            loaded, fault = None, f"cannot be loaded: {' '.join(str(error).split())}"
        if not fault and not isinstance(loaded, Language):
            fault = f"is a {type(loaded).__name__}, expected a kerfpath.post.Language"
        if not fault and loaded.name in found:
            fault = f"has the name {loaded.name!r} of another language; rename it"
        if fault:
            warnings.warn(f"language {point.name!r} ({point.value}) {fault}", stacklevel=2)
        else:
            found[loaded.name] = loaded
    return found


def _shipped_languages(name: str) -> Language:
    loaded = EntryPoint(name, SHIPPED[name], ENTRY_POINTS).load()
    assert isinstance(loaded, Language)
    return loaded


def language(name: str) -> Language:
    """Return a language by its name.

    Raises
    ------
    InputError
        An unknown language; the message lists those known.
    """
    known = languages()
    if name not in known:
        raise InputError(f"language {name!r} is not known; expected {', '.join(sorted(known))}")
    return known[name]
