"""Edits of the characters of robot programs, and a model of what a controller takes for a remark.

Unlike `_program_edits`, which changes what a program says, these edits change how it is spelled:
control characters and separators, foreign digits, letters and blanks, numbers as other languages
spell them, lines commented out, quoted, broken, joined, made too long. The model is slow and
obvious and shares nothing with the readers: it only knows where remarks and texts begin and end.
Whatever is changed outside of them must not pass, nor a control character anywhere.

`harmless_edits` are the changes that people and pendants make all the time; they must pass.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from benchmarks._program_edits import WORDS, Edit, idle_at, is_remark, numbered

__all__ = ["character_edits", "harmless_edits"]

CONTROLS = [
    c
    for c in map(chr, range(0x20_00 + 0x100))
    if unicodedata.category(c) in ("Cc", "Cf", "Zl", "Zp")
    and c not in "\t\n\u00ad"
    and not 0x600 <= ord(c) < 0x900  # signs of Arabic numbers, which have a glyph
] + ["\ufeff", "\ufff9", "\U000e0041"]
"""Controls, separators of lines and characters without a glyph; CR inside a line is one of them."""
FOREIGN = (
    "\u00a0\u2003\u3000\u0660\u0663\uff11\uff10\u06f5\u0967\u017f\u212a\u0131\u0130\uff2f\u0430\u0435\u041e\u0421"
    "\u00b2\u00bd\u2212\u2013\uff1b\uff1a\uff1d\uff0e\u066b\u2019\u201c\u0301\u00e9\u00fc\u8868\U0001f525"
)
"""Blanks, digits, letters and signs that look or count as others somewhere."""
ALIKE = {
    **{str(k): (chr(0x660 + k), chr(0xFF10 + k), chr(0x966 + k)) for k in range(10)},
    " ": ("\u00a0", "\u2003", "\u3000"), "-": ("\u2212", "\u2013"), ".": ("\uff0e", "\u066b"),
    ",": ("\uff0c", "\u066b"), "=": ("\uff1d",), "[": ("\uff3b",), "(": ("\uff08",),
    "S": ("\u017f", "\u0405"), "s": ("\u017f",), "K": ("\u212a", "\u041a"), "O": ("\u041e",),
    "C": ("\u0421",), "A": ("\u0410",), "a": ("\u0430",), "e": ("\u0435",), "i": ("\u0131",),
    "T": ("\u0422",), "P": ("\u0420",), "N": ("\u039d",), "E": ("\u0415",),
}  # fmt: skip
"""Characters that look like those of a program."""
MARKS = (
    ("!", ""), (";", ""), ("'", ""), ("//", ""), ("#", ""), ("--", ""), ("/* ", " */"),
    ("(* ", " *)"), ("COMM ", ""), ("EDTLCK COMM ", ""), ("--eg:", ""), ("REM ", ""), ("%", ""),
    ("<!-- ", " -->"), ('$ 1 "', '"'), ("&COMMENT ", ""), ("///COMM ", ""), ("{", "}"), ("\\", ""),
)  # fmt: skip
"""What begins and ends a remark in one language or another."""
NUMBER = re.compile(r"(?<![\w.])-?\d*\.?\d+(?![\w.])", re.ASCII)
TOKEN = re.compile(r"(?<=[\w.])(?=[\w.])", re.ASCII)
"""Places inside a word or number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lexis:
    """What the model knows of a language.

    Parameters
    ----------
    mark : str
        Regular expression of the start of a remark.
    at_start : bool
        Whether a remark only begins where a statement may begin.
    statement : str
        Regular expression of what comes before a statement on its line.
    end : str
        What ends a statement, and a remark, too.
    caseless, short_lines : bool
        Whether case makes no difference, and lines have at most 250 characters.
    said : str
        A statement that shows a text.
    extra : tuple of str
        Statements that do nothing to the motion.
    """

    mark: str = r"(?!)"
    at_start: bool = False
    statement: str = r"[ \t]*"
    end: str = ""
    caseless: bool = False
    short_lines: bool = False
    said: str = ""
    extra: tuple[str, ...] = ()


LEXES = {
    "rapid": Lexis(mark="!", caseless=True, said='TPWrite "{}";', extra=("ClkStart clock1;",)),
    "krl": Lexis(mark=";|^&(?:COMMENT|PARAM)", caseless=True, short_lines=True),
    "fanuc": Lexis(mark="!", at_start=True, statement=r"[ \t]*\d*:[ \t]*", end=" ;",
                   short_lines=True, said="MESSAGE[{}] ;", extra=("TIMER[3]=START ;",)),
    "inform": Lexis(mark="'|///COMM", at_start=True, short_lines=True, said='MSG "{}"'),
    "val3": Lexis(mark="//", said='logMsg("{}")'),
    "urscript": Lexis(mark=r"#|^\s*\$", said='textmsg("{}")',
                      extra=("set_payload(3.5)", "set_target_payload(3.5, [0, 0, 0.09])")),
    "linuxcnc": Lexis(mark=r";|^#(?!\d)", caseless=True),
    "ros": Lexis(mark=r"(?:^|(?<=[ \t]))#"),
    "csv": Lexis(),
}  # fmt: skip


def live(line: str, language: str) -> list[bool]:
    """Return for each place of a line, its end too, whether it is outside remarks and texts."""
    lexis, words = LEXES[language], WORDS[language]
    if re.match(r"\s*\d*:?\s*[!'](?:UFRAME|TOOL|UTOOL)", line):  # says a frame to people
        return [False] * (len(line) + 1)
    found, quoted, remark = [], False, False
    start = re.match(lexis.statement, line)
    first = start.end() if start else 0
    for k in range(len(line) + 1):
        if not quoted and not remark and (not lexis.at_start or k == first):
            remark = re.compile(lexis.mark).match(line, k) is not None
        if language == "inform" and line[:3] == "MOV" and line[k : k + 2] == "//":
            remark = True
        found.append(not (quoted or remark or idle_at(line, k, words)))
        if line[k : k + 1] == '"' and not remark and not line.lstrip().startswith("<"):
            quoted = not quoted
    return found


def _places(line: str, language: str) -> list[int]:
    return [k for k, alive in enumerate(live(line, language)) if alive]


T = TypeVar("T")
Made = tuple[str, int, list[str], str] | None
"""Kind of the edit, its line, all lines, and what was changed in words."""


def _random(options: Sequence[T], rng: np.random.Generator) -> T:
    return options[int(rng.integers(len(options)))]


def _with(lines: list[str], k: int, *instead: str) -> list[str]:
    return [*lines[:k], *instead, *lines[k + 1 :]]


def _counts(line: str, language: str) -> bool:
    """Return whether a line acts, and is not one of several that say the same."""
    words = WORDS[language]
    same = any(re.fullmatch(pattern, line) for pattern in words.orderless)
    idle = same or is_remark(line, words) or line.startswith("&")
    return bool(line.strip()) and not idle and any(live(line, language))


def _control(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    k = int(rng.integers(len(lines)))
    at, char = int(rng.integers(len(lines[k]) + 1)), _random(CONTROLS, rng)
    if char == "\r" and at == len(lines[k]):
        return None
    said = f"U+{ord(char):04X} in {lines[k].strip()}"
    return "control character", k, _with(lines, k, lines[k][:at] + char + lines[k][at:]), said


def _foreign(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    k = int(rng.integers(len(lines)))
    if not (places := _places(lines[k], language)):
        return None
    at, char = _random(places, rng), _random(FOREIGN, rng)
    said = f"U+{ord(char):04X} in {lines[k].strip()}"
    return "foreign character", k, _with(lines, k, lines[k][:at] + char + lines[k][at:]), said


def _alike(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    k = int(rng.integers(len(lines)))
    places = [at for at in _places(lines[k], language) if lines[k][at : at + 1] in ALIKE]
    places = [at for at in places if at < len(lines[k])]
    if not places:
        return None
    at = _random(places, rng)
    char = _random(ALIKE[lines[k][at]], rng)
    changed = _with(lines, k, lines[k][:at] + char + lines[k][at + 1 :])
    return "character like another", k, changed, f"U+{ord(char):04X} in {lines[k].strip()}"


def _number(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    k = int(rng.integers(len(lines)))
    alive = live(lines[k], language)
    numbers = [m for m in NUMBER.finditer(lines[k]) if alive[m.start()] and float(m[0])]
    if not numbers:
        return None
    m = _random(numbers, rng)
    ways = ["inf", "nan", "Infinity", "1e999", "0x10", "0b1", "'H1F'", "1/0", f"{m[0]}e1",
            f"{m[0]}_", f"--{m[0]}", f"+-{m[0]}", f"{m[0]}.0.0", f"{m[0]}f", f"({m[0]}",
            m[0].replace(".", ",") if "." in m[0] else f"{m[0]},5",
            m[0].replace(".", "..") if "." in m[0] else f"{m[0]}..0",
            re.sub(r"(\d)(?=\d)", r"\1_", m[0], count=1) if len(m[0]) > 1 else "1_0"]  # fmt: skip
    if language == "ros" and m[0].isdecimal() and int(m[0]) > 7:
        ways += [f"0{m[0]}"] * 6
    way = _random(ways, rng)
    changed = _with(lines, k, lines[k][: m.start()] + way + lines[k][m.end() :])
    return "number spelled otherwise", k, changed, f"{m[0]} to {way} in {lines[k].strip()}"


def _parts(line: str, language: str) -> tuple[str, str, str]:
    """Return what comes before the statement of a line, the statement, and its end."""
    match = re.match(LEXES[language].statement, line)
    at = match.end() if match else 0
    end = LEXES[language].end if match and match.end() else ""
    return line[:at], line[at:].removesuffix(end) if end else line[at:], end


def _out(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    k = int(rng.integers(len(lines)))
    if not _counts(lines[k], language):
        return None
    before, statement, end = _parts(lines[k], language)
    begin, close = _random(MARKS, rng)
    changed = f"{before}{begin}{statement}{close}{end}"
    if language == "fanuc" and begin == "{":
        return None
    return "commented out", k, _with(lines, k, changed), f"{begin} {lines[k].strip()}"


def _quoted(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    k = int(rng.integers(len(lines)))
    said = LEXES[language].said
    if not said or not _counts(lines[k], language) or lines[k].lstrip().startswith("<"):
        return None
    before, statement, _ = _parts(lines[k], language)
    return "made a text", k, _with(lines, k, before + said.format(statement)), lines[k].strip()


def _second(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    """Write a second statement behind one."""
    k, other = int(rng.integers(len(lines))), int(rng.integers(len(lines)))
    if k == other or not (_counts(lines[k], language) and _counts(lines[other], language)):
        return None
    before, one, end = _parts(lines[k], language)
    _, two, _ = _parts(lines[other], language)
    between = _random(
        (" ", "; ", ";", ": ", ":", ", ", "\\ ", " & ", " ! ;", "\t", "{ ", "} "), rng
    )
    behind_move = language == "inform" and two.startswith("//")  # begins a remark there
    if not two.strip() or behind_move or re.search(LEXES[language].mark, between):
        return None
    changed = f"{before}{one}{between}{two}{end}"
    return "second statement", k, _with(lines, k, changed), f"{between}{two.strip()}"


def _broken(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    """Break a line inside a word or number."""
    k = int(rng.integers(len(lines)))
    alive = live(lines[k], language)
    places = [m.start() for m in TOKEN.finditer(lines[k]) if alive[m.start()]]
    if not places:
        return None
    at, more = _random(places, rng), _random(("", "\\", "&", " _"), rng)
    begin = _random(("", "    :  ", " ", "\t"), rng)
    two = (lines[k][:at] + more, begin + lines[k][at:])
    return "line broken", k, _with(lines, k, *two), lines[k].strip()


def _joined(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    k = int(rng.integers(len(lines) - 1))
    one, two = lines[k : k + 2]
    plain = re.compile(r"\s*<|\t|.*\]\]>|[}]")
    if plain.match(one) or plain.match(two) or not _counts(two, language):
        return None
    counts = _counts(one, language)
    if not one.strip() or (counts and language == "rapid"):
        return None
    if not counts and (language not in LEXES or not re.search(LEXES[language].mark, one)):
        return None
    between = _random(("", " ", "  "), rng)
    changed = [*lines[:k], one + between + two.lstrip(), *lines[k + 2 :]]
    return "lines joined", k, changed, f"{one.strip()} {two.strip()}"


def _long(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    k = int(rng.integers(len(lines)))
    if not LEXES[language].short_lines or not _counts(lines[k], language):
        return None
    before, statement, end = _parts(lines[k], language)
    blanks = _random((" ", "\t"), rng) * int(rng.integers(250, 800))
    return "line too long", k, _with(lines, k, before + blanks + statement + end), lines[k].strip()


def _return(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    k = int(rng.integers(len(lines) - 1))
    one, two = lines[k : k + 2]
    way = _random(("alone", "doubled", "behind"), rng)
    changed = {
        "alone": [*lines[:k], f"{one}\r{two}", *lines[k + 2 :]],
        "doubled": [*lines[:k], f"{one}\r\r", *lines[k + 1 :]],
        "behind": [*lines[: k + 1], f"\r{two}", *lines[k + 2 :]],
    }[way]
    return ("carriage return", k, changed, f"{way} {one.strip()}") if two.strip() else None


def _blank(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    """Write a blank or tab inside a word or number."""
    k = int(rng.integers(len(lines)))
    alive = live(lines[k], language)
    places = [m.start() for m in TOKEN.finditer(lines[k]) if alive[m.start()]]
    if not places:
        return None
    at = _random(places, rng)
    changed = lines[k][:at] + _random((" ", "\t", "  "), rng) + lines[k][at:]
    return "blank in a word", k, _with(lines, k, changed), lines[k].strip()


def _case(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    k = int(rng.integers(len(lines)))
    if LEXES[language].caseless or re.match(r"def |\s*<|[^,]*,$", lines[k]):
        return None
    first = lines[k].find(",") if language == "csv" else -1
    places = [at for at in _places(lines[k], language) if at > first]
    places = [at for at in places if lines[k][at : at + 1].isalpha()]
    if not places:
        return None
    at = _random(places, rng)
    changed = lines[k][:at] + lines[k][at].swapcase() + lines[k][at + 1 :]
    return "case", k, _with(lines, k, changed), changed.strip()


MAKERS: tuple[Callable[[list[str], str, np.random.Generator], Made], ...] = (
    _control, _control, _foreign, _foreign, _alike, _alike, _number, _number, _out, _out, _quoted,
    _second, _broken, _joined, _long, _return, _blank, _case,
)  # fmt: skip


def character_edits(
    files: Mapping[str, str], language: str, rng: np.random.Generator
) -> Iterator[Edit]:
    """Yield edits that do harm, without end: none of them may pass."""
    yield from _edits(files, language, rng, MAKERS)


def _edits(
    files: Mapping[str, str],
    language: str,
    rng: np.random.Generator,
    makers: tuple[Callable[[list[str], str, np.random.Generator], Made], ...],
) -> Iterator[Edit]:
    sizes = np.array([len(text) for text in files.values()], dtype=float)
    while True:
        name = [*files][int(rng.choice(len(files), p=sizes / sizes.sum()))]
        end = "\r\n" if "\r\n" in files[name] else "\n"
        lines = files[name].split(end)
        made = _random(makers, rng)(lines, language, rng)
        if made is None:
            continue
        kind, line, changed, said = made
        if changed == lines and kind != OTHER_ENDS:
            continue
        harmless = makers is not MAKERS
        if kind == OTHER_ENDS:
            end = "\n" if end == "\r\n" else "\r\n"
        text = end.join(changed)
        if harmless or kind == "lines joined":
            text = numbered(text, language)
        yield Edit(
            kind=kind, file=name, line=line + 1, files={**files, name: text},
            idle=harmless, remark=harmless, said=said,
        )  # fmt: skip


# -----------------------------------------------------------------------------
# Edits that do nothing.

REMARKS = (
    "for J. Müller", "über Ecke; 2 mm", "switch off!", "DO[1]=ON", "a = b", "x, y", "it's here",
    "TODO // later", "corner #2", "(see drawing)", "PULSE OT#(1)", "50 %", "left|right \\ up", "",
)  # fmt: skip
"""What people write in remarks."""
OTHER_ENDS = "ends of lines"
REMARK = {
    "rapid": "! {}", "krl": "; {}", "fanuc": "   1:  ! {} ;", "inform": "'{}", "val3": "// {}",
    "urscript": "# {}", "ros": "# {}",
    "linuxcnc": "; {}",
}  # fmt: skip


def _is_configuration(lines: list[str], language: str) -> bool:
    """Return whether a file is no program but INI or HAL, whose remarks are lines with #."""
    return language == "linuxcnc" and lines[0].startswith("# ")


def _body(lines: list[str], language: str) -> list[int]:
    """Return the numbers of lines before which a statement may stand."""
    if _is_configuration(lines, language):
        return []
    if language == "fanuc":
        first, last = lines.index("/MN") + 1, lines.index("/POS")
        return [k for k in range(first, last + 1) if ":  P[" not in lines[k]]
    if language == "inform":
        return [*range(lines.index("NOP") + 1, lines.index("END") + 1)]
    if language == "val3":
        at = [k for k, line in enumerate(lines) if "CDATA" in line]
        return [*range(at[0] + 1, len(lines) - 4)] if at else []
    return [*range(1, len(lines) - 1)]


def _remark_line(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    body = _body(lines, language)
    if language not in REMARK or not body:
        return None
    k, text = _random(body, rng), _random(REMARKS, rng)
    indent = _random(("", "  ", "\t"), rng) if language not in ("fanuc", "inform") else ""
    line = indent + REMARK[language].format(text)
    return "remark", k, [*lines[:k], line, *lines[k:]], line


def _remark_behind(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    body = _body(lines, language)
    body = [k for k in body if lines[k].strip() and not lines[k].lstrip().startswith("<")]
    if language in ("fanuc", "csv") or not body:
        return None
    k, text = _random(body, rng), _random(REMARKS, rng)
    if language == "inform":
        if not lines[k].startswith("MOV"):
            return None
        return "remark behind", k, _with(lines, k, f"{lines[k]} //{text}"), text
    return "remark behind", k, _with(lines, k, f"{lines[k]} {REMARK[language].format(text)}"), text


def _blanks(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    """Write blanks around a sign that is no part of a word or number, or at an end of a line."""
    body = _body(lines, language)
    if language in ("csv", "ros") or not body:
        return None
    k = _random(body, rng)
    if not lines[k].strip() or lines[k].lstrip().startswith("<"):
        return None
    alive = live(lines[k], language)
    signs = [m.start() for m in re.finditer(r"[=,(\[{]", lines[k]) if alive[m.start()]]
    blanks = _random((" ", "\t", "   "), rng)
    if language == "inform" or not signs or rng.random() < 0.3:
        return "blanks", k, _with(lines, k, lines[k] + blanks), lines[k].strip()
    at = _random(signs, rng)
    if language == "fanuc" and lines[k][at] in "[(":
        at += 1
    return "blanks", k, _with(lines, k, lines[k][:at] + blanks + lines[k][at:]), lines[k].strip()


def _indented(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    body = _body(lines, language)
    if language in ("csv", "ros", "fanuc") or not body:
        return None
    k = _random(body, rng)
    if not lines[k].strip() or lines[k].lstrip().startswith("<"):
        return None
    line = _random(("\t", "\t ", "      ", ""), rng) + lines[k].lstrip()
    if language == "inform" and line[0] not in "\tM":
        return None
    return "indentation", k, _with(lines, k, line), line


def _empty(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    body = _body(lines, language)
    if language in ("csv", "inform") or not body:
        return None
    k = _random(body, rng)
    line = "   1:   ;" if language == "fanuc" else _random(("", "  ", "\t"), rng)
    return "empty line", k, [*lines[:k], line, *lines[k:]], ""


def _cases(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    k = int(rng.integers(len(lines)))
    if not LEXES[language].caseless or '"' in lines[k] or _is_configuration(lines, language):
        return None
    line = _random((str.upper, str.lower, str.swapcase), rng)(lines[k])
    return "case", k, _with(lines, k, line), line.strip()


def _shown(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    """Write a line that shows a text, or one with a timer or load, at a stop."""
    lexis, body = LEXES[language], _body(lines, language)
    if not (lexis.said or lexis.extra) or not body:
        return None
    plain = [text for text in REMARKS if not set(text) & set('\\"]')]
    said = [lexis.said.format(_random(plain, rng))] if lexis.said else []
    line = _random([*said, *lexis.extra], rng)
    k = body[0] if language == "rapid" else _random(body, rng)
    if language == "rapid":
        k = _random([n + 1 for n in body if re.match(r"\s*PROC \w+\(\)", lines[n])] or [0], rng)
    if not k:
        return None
    if language == "urscript" and not re.match(r"    (?:move|sleep)", lines[k]):
        return None
    before = "   1:  " if language == "fanuc" else ""
    return "text, timer or load", k, [*lines[:k], before + line, *lines[k:]], line


def _digits(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    """Print a number with fewer zeros."""
    k = int(rng.integers(len(lines)))
    alive = live(lines[k], language)
    ends = [m for m in re.finditer(r"(\.\d+?)0+(?![\w.])", lines[k]) if alive[m.start()]]
    exact = language in ("fanuc", "inform", "ros") or _is_configuration(lines, language)
    if not ends or exact:
        return None
    m = _random(ends, rng)
    line = lines[k][: m.start()] + m[1] + lines[k][m.end() :]
    return "digits", k, _with(lines, k, line), line.strip()


def _ends(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    """End all lines as the other systems do, or the last one not at all."""
    if rng.random() < 0.5 and not lines[-1]:
        return "no end of the last line", len(lines) - 2, lines[:-1], ""
    return OTHER_ENDS, 0, lines, ""


PENDANT = {
    "krl": ((r"&REL \d+", "&REL 57"), (r"&REL 1$", "&REL 2\r\n&COMMENT für Müller"),
            (r"&REL 1$", "&REL 1\r\n&PARAM EDITMASK = *"), (r"&ACCESS \w+", "&ACCESS RVO1")),
    "fanuc": ((r"^OWNER.*", "OWNER\t\t= OPERATOR;"), (r"^COMMENT.*", 'COMMENT\t\t= "für Müller";'),
              (r"TIME \d\d:\d\d:\d\d", "TIME 11:12:13"), (r"^PROG_SIZE.*", "PROG_SIZE\t= 4711;"),
              (r"^MEMORY_SIZE.*", "MEMORY_SIZE\t= 5012;"), (r"P\[(\d+)\]", r"P[\1:corner]"),
              (r"DO\[(\d+)\]", r"DO[\1:out > 1]"), (r"WAIT  +", "WAIT   "),
              (r"(CNT\d+|FINE) ( *;)", r"\1 ACC100\2"), (r"^/MN", "/APPL\r\n/MN")),
    "inform": ((r"///DATE.*", "///DATE 2026/11/28 10:07"), (r"^NOP", "NOP\r\n'x"),
               (r"^///DATE", "///COMM first part\r\n///DATE"), (r"SC,RW", "RW,SC"),
               (r"^///GROUP1 RB1$", "///GROUP1 RB1\r\n///LVARS 0,0,0,0,0,0,0,0"),
               (r"(V=\d+)\.0", r"\1")),
    "val3": ((r'stackSize="\d+"', 'stackSize="9000"'), (r"^<\?xml", "<?xml"),
             (r'name="(\w+)" access="public"', r'access="public" name="\1"'),
             (r"<Datas>", "<Datas><!-- by hand -->")),
    "rapid": ((r"^MODULE", "%%%\n  VERSION:1\n  LANGUAGE:ENGLISH\n%%%\nMODULE"),
              (r"9E9", "9E+09"), (r"9E9", "9e9"), (r"\[-1,\[0,0,0\]", "[12,[1,0,90.5]"),
              (r"TRUE", "true")),
    "urscript": ((r"^(\s+)def (\w+)\(\):", r'\1$ 3 "\2"\n\1def \2():'),),
}  # fmt: skip
"""What pendants and editors change by themselves."""


def _pendant(lines: list[str], language: str, rng: np.random.Generator) -> Made:
    old, new = _random(PENDANT.get(language, (("(?!)", ""),)), rng)
    found = [k for k, line in enumerate(lines) if re.search(old, line)]
    found = [k for k in found if all(_places(lines[k], language)[:1]) or "=" in lines[k]]
    if not found:
        return None
    k = _random(found, rng)
    line = re.sub(old, new, lines[k], count=1)
    return "by the pendant", k, _with(lines, k, line), line.strip()


HARMLESS: tuple[Callable[[list[str], str, np.random.Generator], Made], ...] = (
    _remark_line, _remark_line, _remark_behind, _remark_behind, _blanks, _blanks, _indented, _empty,
    _cases, _shown, _shown, _digits, _ends, _pendant, _pendant,
)  # fmt: skip


def harmless_edits(
    files: Mapping[str, str], language: str, rng: np.random.Generator
) -> Iterator[Edit]:
    """Yield edits that change nothing of what a program does, without end: all must pass."""
    yield from _edits(files, language, rng, HARMLESS)
