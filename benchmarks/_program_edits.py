"""A grammar of edits of the text of robot programs.

An edit deletes, doubles, moves, swaps or copies a line, scales or nudges a number, flips a sign or
a state, or takes another word of the same family.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

__all__ = ["WORDS", "Edit", "Words", "edits", "idle_at", "is_remark", "numbered"]

NUMBER = re.compile(r"(?<![\w.])-?\d*\.?\d+(?![\w.]|E)")
FACTORS = (0.0, 0.5, 0.9, 1.1, 2.0, 10.0, 30.0, 100.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """What the grammar needs to know of a language.

    Parameters
    ----------
    remark : str
        Matches lines that no controller acts on.
    idle : tuple of str
        Each matches lines with a group that has no effect on motions and switches.
    families : tuple of str
        Each matches words that can replace one another.
    orderless : tuple of str
        Each matches lines whose order and repetition have no effect.
    held : tuple of str
        Each matches lines whose only effect is what the reader makes of the moves after them.
    """

    remark: str
    idle: tuple[str, ...] = ()
    families: tuple[str, ...] = ()
    orderless: tuple[str, ...] = ()
    held: tuple[str, ...] = ()


STATES = (r"\b(?:ON|OFF)\b", r"\b(?:TRUE|FALSE)\b", r"\b(?:true|false)\b", r"\b(?:True|False)\b",
          r"\b(?:on|off)\b")  # fmt: skip
WORDS = {
    "rapid": Words(
        remark=r"\s*(!.*)?",
        idle=(r".*tooldata.*,(\[-?[\d.]+,\[[^]]*\],\[[^]]*\],0,0,0\])\];",),
        families=(r"\bv(?:Air|Approach|Cut)\d*\b", r"\b(?:zCorner\d*|fine)\b",
                  r"\btr(?:Gas)?(?:On|Off)\d*\b", r"\bdo(?:Laser|Gas)\b", r",[01];"),
        orderless=(r"  (?:CONST|VAR|PERS) .*", r"    SetDO .*,0;", r"    TriggIO .*",
                   r"    ConfL.*"),
    ),
    "krl": Words(
        remark=r"\s*(;.*)?",
        idle=(r"(&(?:ACCESS|REL) .*)",),  # the controller's own
        families=(*STATES, r"\$OUT\[\d\]", r"\$VEL\.ORI\d", r"\b(?:LIN|PTP)\b"),
        orderless=(r"\$OUT\[\d\]=FALSE", r"\$(?:TOOL|BASE)=.*",
                   r"\$(?:ADV|IPO|ORI|CIRC|VEL\.ORI).*"),
        held=(r"BAS\(#VEL_PTP,.*", r"\$VEL\.CP=.*", r"\$APO\.CDIS=.*"),
    ),
    "fanuc": Words(
        remark=r"\s*\d+:  !(?!UFRAME|UTOOL).*|",
        idle=(r"(?:OWNER|COMMENT|PROG_SIZE|FILE_NAME|VERSION|LINE_COUNT|MEMORY_SIZE|PROTECT|"
              r"CONTROL_CODE|CREATE|MODIFIED)(.*)", r"((?:TCD:)?\s+[A-Z_]+\s*= .*)",
              r"(DEFAULT_GROUP.*)"),
        families=(*STATES, r"\bDO\[\d\]", r"\bP\[\d+\]", r"\b(?:FINE|CNT\d+)\b",
                  r"'[NF] [UD] [TB]"),
        orderless=(r"\s*\d+:  (?:DO\[\d\]=OFF ;|U(?:FRAME|TOOL)_NUM.*|!U.*)",),
    ),
    "inform": Words(
        remark=r"'(?!UFRAME|TOOL).*|",
        families=(*STATES, r"OT#\(\d\)", r"\bC\d{5}\b", r"\bPL=\d", r"\b(?:MOVL|MOVJ)\b",
                  r"RCONF .*"),
        orderless=(r"(?:'(?:UFRAME|TOOL) .*|DOUT OT#\(\d\) OFF)",),
    ),
    "val3": Words(
        remark=r"\s*(//.*)?",
        idle=(r"(<\?xml.*)", r"<\w+ (xmlns.*)"),
        families=(*STATES, r"\bdio(?:Laser|Gas)\b", r"\bmPath\[\d+\]", r"\bpPath\[\d+\]",
                  r"\bjAir\[\d+\]", r"blend=\"\w+\"", r"elbow=\"\w+\"", r"shoulder=\"\w+\""),
        orderless=(r"\s*waitEndMove\(\)", r"\s*<Program file=.*/>"),
    ),
    "urscript": Words(
        remark=r"\s*(#.*)?",
        families=(*STATES, r"\b(?:laser|gas)\b", r"\bmove[lj]\b"),
        idle=(r".*movej\(.*, (v=[\d.]+), t=.*",),  # the time counts
        held=(r"\s*(?:laser|gas)_ahead.*",),
    ),
    "linuxcnc": Words(
        remark=r"\s*(;.*)?|#(?!\d).*",
        families=(*STATES, r"\bM6[2-5]\b", r"\bG(?:1|53 G1|61\.1)\b", r"\bP[01]\b"),
        orderless=(r"M65 P\d",),
        held=(r"  G6(?:1\.1|4 .*)",),
    ),
    "ros": Words(remark=r"\s*(#.*)?", families=(*STATES, r"\b(?:laser|gas)\b"),
                 held=(r"- {positions.*",)),
    "csv": Words(remark=r"", families=(*STATES, r"\b(?:laser|gas)\b", r"\b(?:linear|joint)\b")),
}  # fmt: skip
"""The words of each language."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Edit:
    """One edit of a program.

    Parameters
    ----------
    kind : str
    file, line : str, int
        Place of the edit; lines are counted from 1.
    files : mapping of str to str
        The edited program.
    idle : bool
        Whether the changed text acts only by the moves, waits and switches that are read from it.
    remark : bool
        Whether only a remark was changed.
    said : str
        What was changed, in words.
    """

    kind: str
    file: str
    line: int
    files: Mapping[str, str]
    idle: bool
    remark: bool
    said: str


def edits(files: Mapping[str, str], language: str, rng: np.random.Generator) -> Iterator[Edit]:
    """Yield random edits of a program without end."""
    words = WORDS[language]
    names = [name for name in files if any(line.strip() for line in files[name].splitlines())]
    sizes = np.array([len(files[name].splitlines()) for name in names], dtype=float)
    makers = (_delete, _double, _move, _swap, _copy, _scale, _scale, _scale, _nudge, _flip, _other,
              _other, _remark)  # fmt: skip
    while True:
        name = names[int(rng.choice(len(names), p=sizes / sizes.sum()))]
        lines = files[name].splitlines()
        made = makers[int(rng.integers(len(makers)))](lines, words, rng)
        if made is None:
            continue
        kind, line, changed, idle, said = made
        text = numbered("\n".join([*changed, ""]), language)
        if text.split() == files[name].split():
            continue
        end = "\r\n" if "\r\n" in files[name] else "\n"
        yield Edit(
            kind=kind,
            file=name,
            line=line + 1,
            files={**files, name: text.replace("\n", end)},
            idle=idle,
            remark=_in_remarks(files[name], text, words),
            said=said,
        )


def _in_remarks(before: str, after: str, words: Words) -> bool:
    """Return whether two texts are the same line by line, except for remarks."""
    one, two = (
        [line.rstrip() for line in text.splitlines() if not re.fullmatch(words.remark, line)]
        for text in (before, after)
    )
    return one == two


Made = tuple[str, int, list[str], bool, str] | None
"""Kind of the edit, its line, all lines, whether it is idle, and what was changed in words."""


def numbered(text: str, language: str) -> str:
    """Return a text as the editor of the controller saves it: FANUC's renumbers the lines."""
    if language != "fanuc":
        return text
    count = 0

    def next_number(match: re.Match[str]) -> str:
        nonlocal count
        count += 1
        return f"{count:4d}:"

    text = re.sub(r"^ *\d+:(?!  P\[)", next_number, text, flags=re.MULTILINE)
    return re.sub(r"(LINE_COUNT\s*= )\d+", rf"\g<1>{count}", text)


def is_remark(line: str, words: Words) -> bool:
    """Return whether a line has no effect, or only through what the reader makes of the moves."""
    whole = (words.remark, *words.held, *(p for p in words.idle if not p.startswith(".*")))
    return any(re.fullmatch(pattern, line) for pattern in whole)


def _line(lines: list[str], rng: np.random.Generator) -> int:
    return int(rng.integers(len(lines)))


def _same_kind(one: str, two: str, words: Words) -> bool:
    return any(re.fullmatch(p, one) and re.fullmatch(p, two) for p in words.orderless)


def _delete(lines: list[str], words: Words, rng: np.random.Generator) -> Made:
    k = _line(lines, rng)
    idle = is_remark(lines[k], words)
    return "line deleted", k, [*lines[:k], *lines[k + 1 :]], idle, lines[k].strip()


def _double(lines: list[str], words: Words, rng: np.random.Generator) -> Made:
    k = _line(lines, rng)
    idle = is_remark(lines[k], words) or _same_kind(lines[k], lines[k], words)
    return "line doubled", k, [*lines[: k + 1], *lines[k:]], idle, lines[k].strip()


def _move(lines: list[str], words: Words, rng: np.random.Generator) -> Made:
    k, to = _line(lines, rng), _line(lines, rng)
    rest = [*lines[:k], *lines[k + 1 :]]
    between = rest[min(k, to) : max(k, to)]
    idle = is_remark(lines[k], words) or all(
        _same_kind(lines[k], line, words) or is_remark(line, words) for line in between
    )
    return "line moved", k, [*rest[:to], lines[k], *rest[to:]], idle, lines[k].strip()


def _swap(lines: list[str], words: Words, rng: np.random.Generator) -> Made:
    k = _line(lines[:-1], rng)
    one, two = lines[k : k + 2]
    idle = one == two or _same_kind(one, two, words) or any(is_remark(x, words) for x in (one, two))
    return "lines swapped", k, [*lines[:k], two, one, *lines[k + 2 :]], idle, one.strip()


def _copy(lines: list[str], words: Words, rng: np.random.Generator) -> Made:
    """Copy a line elsewhere: one more move, wait, switch or call."""
    k, to = _line(lines, rng), _line(lines, rng)
    beside = lines[max(to - 1, 0) : to + 1]
    idle = is_remark(lines[k], words) or any(_same_kind(lines[k], x, words) for x in beside)
    return "line inserted", to, [*lines[:to], lines[k], *lines[to:]], idle, lines[k].strip()


def _number(
    lines: list[str], words: Words, rng: np.random.Generator
) -> tuple[int, re.Match[str], bool] | None:
    k = _line(lines, rng)
    found = list(NUMBER.finditer(lines[k]))
    if not found:
        return None
    match = found[int(rng.integers(len(found)))]
    return k, match, idle_at(lines[k], match.start(), words)


def idle_at(line: str, at: int, words: Words) -> bool:
    """Return whether the text at a place of a line has no effect."""
    said = [match for pattern in words.idle if (match := re.fullmatch(pattern, line))]
    return is_remark(line, words) or any(m.start(1) <= at < m.end(1) for m in said)


def _with_number(lines: list[str], k: int, match: re.Match[str], value: float) -> list[str]:
    decimals = len(match[0].partition(".")[2])
    text = f"{value:.{decimals}f}" if "." in match[0] else str(round(value))
    if match[0].startswith("."):
        text = text.removeprefix("0")
    changed = lines[k][: match.start()] + text + lines[k][match.end() :]
    return [*lines[:k], changed, *lines[k + 1 :]]


def _scale(lines: list[str], words: Words, rng: np.random.Generator) -> Made:
    found = _number(lines, words, rng)
    if found is None:
        return None
    k, match, idle = found
    value = float(match[0]) * float(rng.choice(FACTORS))
    said = f"{match[0]} to {value:g} in {lines[k].strip()}"
    return "number scaled", k, _with_number(lines, k, match, value), idle, said


def _nudge(lines: list[str], words: Words, rng: np.random.Generator) -> Made:
    """Add to a number, or change its sign."""
    found = _number(lines, words, rng)
    if found is None:
        return None
    k, match, idle = found
    value = float(match[0])
    value = (
        -value
        if value and rng.random() < 0.3
        else value + float(rng.choice([-20, -1, 1, 0.5, 5, 20]))
    )
    said = f"{match[0]} to {value:g} in {lines[k].strip()}"
    return "number nudged", k, _with_number(lines, k, match, value), idle, said


def _flip(lines: list[str], words: Words, rng: np.random.Generator) -> Made:
    return _taken("state flipped", lines, words, (*STATES, r"(?<=,)[01](?=;)"), rng)


def _other(lines: list[str], words: Words, rng: np.random.Generator) -> Made:
    return _taken("word of its family", lines, words, words.families, rng)


def _taken(
    kind: str, lines: list[str], words: Words, families: tuple[str, ...], rng: np.random.Generator
) -> Made:
    """Replace a word by another of the same family."""
    if not families:
        return None
    family = families[int(rng.integers(len(families)))]
    found = [(k, m) for k, line in enumerate(lines) for m in re.finditer(family, line)]
    others = sorted({m[0] for _, m in found})
    pairs = {"ON": "OFF", "TRUE": "FALSE", "true": "false", "True": "False", "on": "off", "0": "1"}
    pairs |= {b: a for a, b in pairs.items()}
    if not found:
        return None
    k, match = found[int(rng.integers(len(found)))]
    choice = [w for w in others if w != match[0]] or [pairs.get(match[0], match[0])]
    word = choice[int(rng.integers(len(choice)))]
    changed = lines[k][: match.start()] + word + lines[k][match.end() :]
    said = f"{match[0]} to {word} in {lines[k].strip()}"
    return (
        kind,
        k,
        [*lines[:k], changed, *lines[k + 1 :]],
        idle_at(lines[k], match.start(), words),
        said,
    )


def _remark(lines: list[str], words: Words, rng: np.random.Generator) -> Made:
    """Change the text of a remark."""
    remarks = [
        k for k, line in enumerate(lines) if line.strip() and re.fullmatch(words.remark, line)
    ]
    if not remarks:
        return None
    k = remarks[int(rng.integers(len(remarks)))]
    at = max(lines[k].rfind(" "), len(lines[k]) // 2)
    changed = f"{lines[k][:at]} shift two {lines[k][at:].strip()}"[: 30 if ":" in lines[k] else 200]
    return "remark", k, [*lines[:k], changed + (" ;" if lines[k].endswith(" ;") else ""),
                         *lines[k + 1 :]], True, lines[k].strip()  # fmt: skip
