"""Patterns of the RAPID lines that are read, by their kind, and where each kind may occur."""

from __future__ import annotations

from kerfpath.post._line_reader import only, patterns
from kerfpath.post.rapid._write import FIRST

__all__ = ["DECLARED", "IN_MAIN", "IN_PART", "IN_ROUTINE", "MODULE", "OUTSIDE"]

_NAME = r"([A-Za-z]\w*)"
_POSE = r"(\[\[.*?9E9\]\])"
_TRIGGERS = r"([A-Za-z]\w*(?:\\T\d:=[A-Za-z]\w*)*)"
_FRAMES = rf"{_NAME}\\WObj:={_NAME}"
_LINES = patterns(
    {
        "module": rf"MODULE {_NAME}",
        "end_module": "ENDMODULE",
        "tool": rf"PERS tooldata {_NAME}:=(\[.*\]);",
        "work_object": rf"PERS wobjdata {_NAME}:=(\[.*\]);",
        "speed": rf"CONST speeddata {_NAME}:=(\[.*\]);",
        "zone": rf"CONST zonedata {_NAME}:=(\[.*\]);",
        "trigger": rf"VAR triggdata {_NAME};",
        "routine": rf"PROC {_NAME}\(\)",
        "end_routine": "ENDPROC",
        "first": rf"PERS num {FIRST}:=(\d+);",
        "request": rf"SetDO {_NAME},([01]);",
        "wait_for": rf"WaitDI {_NAME},1\\MaxTime:=([\d.]+);",
        "set_trigger": rf"TriggIO {_NAME},([\d.]+)\\Time\\DOp:={_NAME},([01]);",
        "wait": r"WaitTime ([\d.]+);",
        "load": r'Load \\Dynamic,"([^"]*)/([^"/]*)";',
        "activate": rf"(Act|Deact)Unit {_NAME};",
        "condition": rf"IF {FIRST}<=(\d+) THEN",
        "late_call": rf'%"{_NAME}"%;',
        "unload": r'UnLoad "([^"]*)/([^"/]*)";',
        "call": rf"IF {FIRST}<=(\d+) {_NAME};",
        "joint_move": rf"MoveAbsJ (\[.*\]),{_NAME}(?:\\T:=(\d+\.\d+))?,{_NAME},{_FRAMES};",
        "linear_move": rf"MoveL (\[.*\]),{_NAME},{_NAME},{_FRAMES};",
        "circular_move": rf"MoveC {_POSE},{_POSE},{_NAME},{_NAME},{_FRAMES};",
        "switching_move": rf"TriggL (\[.*\]),{_NAME},{_TRIGGERS},{_NAME},{_FRAMES};",
        "switching_arc": rf"TriggC {_POSE},{_POSE},{_NAME},{_TRIGGERS},{_NAME},{_FRAMES};",
    }
)
DECLARED = ("tool", "work_object", "speed", "zone", "trigger", "first")

MODULE = only(_LINES, "module")
OUTSIDE = only(_LINES, *DECLARED, "routine", "end_module")
IN_PART = only(_LINES, "routine", "end_module")
IN_MAIN = only(
    _LINES,
    "activate",
    "set_trigger",
    "load",
    "condition",
    "late_call",
    "unload",
    "call",
    "end_routine",
)
IN_ROUTINE = only(
    _LINES,
    "joint_move", "linear_move", "circular_move", "switching_move", "switching_arc", "wait",
    "request", "wait_for", "end_routine",
)  # fmt: skip
