"""What people and controllers change in a program that changes nothing of what it does.

An edit on the pendant that does not matter must pass the audit. Readers ignore blanks and empty
lines, remarks, the case of letters where the controller ignores it, and the lines listed here.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import Literal

Where = Literal["", "head", "data"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Harmless:
    """Lines of one kind that do nothing.

    Parameters
    ----------
    pattern : str
        Regular expression of a whole line without its remark; a blank stands for any blanks.
    example : str
    why : str
        Why it makes no difference.
    where : {"", "head", "data"}
        Where they stand: anywhere; before the program; among its data, apart from its routines.

    A group `mass` (kg) or `schedule` of the pattern says a load, which the reader checks.
    """

    pattern: str
    example: str
    why: str
    where: Where = ""


CASELESS = ("krl", "linuxcnc", "rapid")
"""Languages that do not distinguish capital and small letters."""
_TEXT = r'"[^"\\]{0,80}"'
_NUMBER = r"-?(?:\d+\.?\d*|\.\d+)"
_MASS = rf"(?P<mass>{_NUMBER})"
_LOAD = "the load on the flange, up to that of the job; the path stays the same"
HARMLESS: dict[str, tuple[Harmless, ...]] = {
    "krl": (
        Harmless(
            pattern=r"&(?:ACCESS R[VO]?[OP]?\d?|REL \d+|COMMENT.*|PARAM \w+ = .*)",
            example="&REL 57",
            why="the controller counts changes and notes who may see and edit the file",
            where="head",
        ),
        Harmless(
            pattern=rf"\$LOAD = \{{ M {_MASS}"
            rf"(?: , CM \{{ (?:[XYZABC] {_NUMBER} ,? ){{1,6}}\}})?"
            rf"(?: , J \{{ (?:[XYZ] {_NUMBER} ,? ){{1,3}}\}})? \}}",
            example="$LOAD={M 12.0,CM {X 10.0,Y 0.0,Z 90.0}}",
            why=_LOAD,
        ),
        Harmless(
            pattern=r"DECL (?:E6POS X|E6AXIS X|FDAT F|LDAT L|PDAT P)\w+ = \{[^=$]*\}",
            example="DECL E6POS XP1={X 10.0,Y 0.0,Z 90.0,A 0.0,B 0.0,C 0.0}",
            why="data of the pendant's forms, which no line uses",
            where="data",
        ),
    ),
    "rapid": (
        Harmless(
            pattern=r"%%%|VERSION : \d+|LANGUAGE : \w+",
            example="%%%",
            why="controllers write these lines before a module",
            where="head",
        ),
        Harmless(pattern=rf"TPWrite {_TEXT} ;", example='TPWrite "one";', why="it only shows text"),
        Harmless(
            pattern=r"VAR clock \w+ ;|Clk(?:Reset|Start|Stop) \w+ ;",
            example="ClkStart clock1;",
            why="a clock that nothing waits for",
        ),
    ),
    "fanuc": (
        Harmless(pattern=r"", example="12:   ;", why="an empty line"),
        Harmless(
            pattern=r"TIMER \[ \d+ \] = (?:START|STOP|RESET)",
            example="TIMER[1]=START",
            why="a timer that nothing waits for",
        ),
        Harmless(pattern=r"MESSAGE \[[^\]]*\]", example="MESSAGE[one]", why="it only shows text"),
        Harmless(
            pattern=r"PAYLOAD \[ (?P<schedule>\d+)(?: : [^\]]*)? \]",
            example="PAYLOAD[1]",
            why="`payload_schedule` says that it holds the load on the flange",
        ),
    ),
    "inform": (
        Harmless(
            pattern=r"///COMM.*|///LVARS [\d,]+",
            example="///COMM one",
            why="remarks on the job, and counts of variables that it does not use",
        ),
        Harmless(pattern=rf"MSG {_TEXT}", example='MSG "one"', why="it only shows text"),
    ),
    "urscript": (
        Harmless(pattern=rf"textmsg \( {_TEXT} \)", example='textmsg("one")', why="a log entry"),
        Harmless(
            pattern=rf"set_(?:target_)?payload \( {_MASS}"
            rf"(?: , \[ {_NUMBER} , {_NUMBER} , {_NUMBER} \])? \)",
            example="set_payload(12.0, [0.0, 0.0, 0.09])",
            why=_LOAD,
        ),
        Harmless(
            pattern=rf"\$ \d+ {_TEXT}",
            example='$ 12 "one"',
            why="the pendant labels nodes of its program so",
        ),
    ),
    "val3": (
        Harmless(pattern=rf"logMsg \( {_TEXT} \)", example='logMsg("one")', why="a log entry"),
    ),
}
"""The lines that are ignored, by language."""


class LinePattern:
    """A regular expression of a line, in which a blank stands for blanks, if any are needed.

    Between two letters, digits, underscores or points there must be one, elsewhere may be any.
    Letters, digits and blanks are ASCII.

    Parameters
    ----------
    pattern : str
    caseless : bool
        Whether capital and small letters are the same.
    """

    def __init__(self, pattern: str, *, caseless: bool = False) -> None:
        self.as_written = re.compile(pattern, re.ASCII)
        flags = re.ASCII | (re.IGNORECASE if caseless else re.NOFLAG)
        self.compacted = re.compile(pattern.replace(" ", r"(?: |(?<![\w.])|(?![\w.]))"), flags)

    def fullmatch(self, line: str) -> re.Match[str] | None:
        """Return the match of a line, written with any blanks."""
        return self.as_written.fullmatch(line) or self.compacted.fullmatch(compact(line))


@cache
def harmless_lines(language: str, where: Where = "") -> re.Pattern[str]:
    """Return a regular expression of all lines of a language that do nothing, with any blanks.

    `where` adds those that do nothing in one place alone.
    """
    here = (each for each in HARMLESS.get(language, ()) if each.where in ("", where))
    known = (f"(?:{each.pattern})" for each in here)
    pattern = "|".join(known).replace(" ", r"[ \t]*")
    flags = re.ASCII | (re.IGNORECASE if language in CASELESS else re.NOFLAG)
    return re.compile(rf"[ \t]*(?:{pattern or '(?!)'})[ \t]*", flags)


_BLANKS = re.compile(r'(?P<quoted>"[^"]*")|(?P<between>(?<=[\w.])[ \t]+(?=[\w.]))|[ \t]+', re.ASCII)


def compact(line: str) -> str:
    """Return a line with one blank where two words meet, and none elsewhere but in quoted text."""
    return _BLANKS.sub(lambda found: found["quoted"] or (" " if found["between"] else ""), line)


def without_remark(line: str, mark: str) -> str:
    """Return a line without the remark that begins with `mark` outside quoted text.

    Text whose quote is not closed goes to the end of the line.
    """
    if mark not in line:
        return line
    match = re.match(rf'(?:"[^"]*(?:"|$)|(?!{re.escape(mark)})[^"])*', line)
    return match[0] if match else line
