"""The robot languages that programs can be written in, and the rules of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from kerfpath.errors import InputError
from kerfpath.post import _rapid
from kerfpath.post._program import LONGEST_NAME, Program
from kerfpath.robots import Robot

__all__ = ["LANGUAGES", "Language", "language"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Language:
    """One robot language.

    Parameters
    ----------
    name : str
    manufacturer : str
        Whose robots it moves.
    families : tuple of str
        Those of them that the formatter can express, by `Robot.kinematics`.
    suffix : str
        File suffix, with its dot.
    write : callable
        The formatter, Program to text.
    declared : callable
        Every name that the text of a Program would define or use, with what it names.
    is_reserved : callable
        Whether a name means something else in the language.
    longest_name : int
        Characters allowed in a name.
    slowest : float m/s
        The lowest speed that the formatter's digits can say.
    turning_speed : float rad/s
        How fast the tool may turn in linear moves before the controller slows down.
    longest_lead : float s
        The longest lead time of a switch on the path.
    """

    name: str
    manufacturer: str
    families: tuple[str, ...]
    suffix: str
    write: Callable[[Program], str]
    declared: Callable[[Program], list[tuple[str, str]]]
    is_reserved: Callable[[str], bool]
    longest_name: int
    slowest: float
    turning_speed: float
    longest_lead: float

    def refusal(self, robot: Robot) -> str:
        """Say why no program in this language can move a robot; empty where one can."""
        if robot.manufacturer != self.manufacturer:
            return (
                f"language {self.name!r} is for robots by {self.manufacturer}, but {robot.id!r} is "
                f"by {robot.manufacturer or 'an unknown maker'}"
            )
        if robot.kinematics not in self.families:
            return f"language {self.name!r} cannot yet say the axes of an arm like {robot.id!r}"
        return ""


LANGUAGES = {
    "rapid": Language(
        name="rapid",
        manufacturer="ABB",
        families=("opw",),
        suffix=".mod",
        write=_rapid.rapid,
        declared=_rapid.declared,
        is_reserved=_rapid.is_reserved,
        longest_name=LONGEST_NAME,
        slowest=_rapid.SLOWEST,
        turning_speed=_rapid.TURNING_SPEED,
        longest_lead=_rapid.LONGEST_LEAD,
    )
}


def language(name: str) -> Language:
    """Return a language by its name.

    Raises
    ------
    InputError
        An unknown language; the message lists those known.
    """
    if name not in LANGUAGES:
        raise InputError(f"language {name!r} is not known; expected {', '.join(sorted(LANGUAGES))}")
    return LANGUAGES[name]
