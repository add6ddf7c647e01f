"""Read programs of Universal Robots (URScript) as paths."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array
from kerfpath.cad.programs import (
    Beam,
    Frame,
    Language,
    Place,
    Statement,
    compact,
    pose_of,
    shown,
    split,
    value,
)
from kerfpath.errors import InputError

NAME = r"[A-Za-z_]\w*"
DEF = re.compile(rf"def\s+({NAME})\s*\((.*)\)\s*:", re.ASCII)
CALL = re.compile(rf"({NAME})\s*\((.*)\)", re.ASCII)
ASSIGNED = re.compile(rf"(?:(?:global|local)\s+)?({NAME})\s*=(?!=)\s*(.*)", re.ASCII)
SET = re.compile(r"set_(standard_|tool_|configurable_)?digital_out")
PATHS = {"movel": 1, "movep": 1, "movec": 2, "movej": 1}
WHERE = ("pose", "q", "pose_via", "pose_to", "a", "v")


class URScript(Language):
    """A script."""

    unit = "m"
    base = "base"
    opens = re.compile(r"(def|thread|while|if)\b.*:", re.ASCII)
    closes = re.compile(r"end", re.ASCII)
    endless = re.compile(r"while\s*\(?\s*True\s*\)?\s*:", re.ASCII)
    harmless = re.compile(
        r"(set_tcp|set_payload\w*|set_gravity|set_target_payload|set_tool_voltage|sleep|sync|textmsg|popup"
        r"|stop[jl]|halt|end_force_mode|end_freedrive_mode|set_runstate_\w+|set_analog_out\w*"
        r"|set_standard_analog_\w+|set_tool_analog_\w+|set_tool_output_mode|set_tool_digital_output_mode"
        r"|set_safety_mode_transition_hardness|set_baselight\w*|set_\w+_input_action\w*|set_input_actions_to_default"
        r"|set_tool_communication|write_\w+|rtde_\w+|socket_\w+|modbus_\w+|zero_ftsensor"
        r"|reset_world_model)\s*\(.*\)"
        r"|(enter_critical|exit_critical|kill|join|elif|else|break|continue|return)\b.*|halt|\$.*",
        re.ASCII,
    )  # fmt: skip
    state = ("speed", "values")

    def __init__(
        self, path: Path, text: Callable[[Path], Sequence[str] | None], beam: Beam | None
    ) -> None:
        super().__init__(path, text, beam)
        self.values: dict[str, Place | None] = {}
        """Poses by their names; None for another value."""
        self.frames: dict[str, str] = {}
        """Names of poses as frames: another for another value."""
        self.parameters: dict[str, list[str]] = {}
        self.words: dict[str, str] = {}
        """The arguments of the routine that runs, by their names."""

    def start(self) -> None:
        rows = [(n, line.partition("#")[0].strip()) for n, line in enumerate(
            self.text(self.path) or (), 1)]  # fmt: skip
        statements = [Statement(n, row) for n, row in rows if row]
        defined = [DEF.fullmatch(each.text) for each in statements]
        if not any(defined):
            raise InputError("expected def NAME(): ... end, got none")
        self.routines[""] = statements
        self.run("")
        if not self.ran.moves:  # the controller runs the last definition that is sent
            names = list(self.parameters)
            self.run(names[-1])

    def leaves(self, text: str) -> bool:
        return text == "return" or text.startswith("return ")

    def run_block(self, head: Statement, body: Sequence[Statement]) -> None:
        if found := DEF.fullmatch(head.text):
            self.routines[found[1]] = list(body)
            self.parameters[found[1]] = [
                each.partition("=")[0].strip() for each in split(found[2]) if each
            ]
        elif not head.text.startswith("thread"):
            super().run_block(head, body)

    def take(self, line: int | str, text: str) -> None:
        if found := CALL.fullmatch(text):
            self._call(line, text, found[1], [each for each in split(found[2]) if each])
        elif found := ASSIGNED.fullmatch(text):
            self._assign(line, found[1], found[2].strip())
        else:
            raise self.refusal(line, text)

    def _assign(self, line: int | str, name: str, said: str) -> None:
        called = CALL.fullmatch(said)
        is_pose = said.startswith("p[") or said in self.values
        if called and called[1] in (*self.parameters, *PATHS):
            raise InputError(f"line {line}: {shown(said)}: a value from a routine; not supported")
        if is_pose or (called and called[1] == "pose_trans"):
            self.frames[name] = f"{name} of line {line}" if name in self.values else name
            self.values = {**self.values, name: self._place(line, said)}
        elif name in self.values:
            self.values = {**self.values, name: None}

    def _call(self, line: int | str, text: str, name: str, said: list[str]) -> None:
        if name in PATHS:
            self._motion(line, name, said)
        elif SET.fullmatch(name) and len(said) == 2:
            prefix = name.removeprefix("set_")
            state = self.words.get(said[1], said[1])
            self.switch(line, f"{prefix}[{self.words.get(said[0], said[0])}]",
                        on=state not in ("False", "0"))  # fmt: skip
        elif (key := compact(f"{name}()")) in self.switching:
            self.switch(line, "beam", on=self.switching[key])
        elif name in self.parameters:
            if len(said) > len(self.parameters[name]):
                raise InputError(f"line {line}: {shown(text)}: too many arguments")
            kept = self.words
            self.words = dict(zip(self.parameters[name], said, strict=False))
            self.run(name)
            self.words = kept
        else:
            raise self.refusal(line, text)

    def _motion(self, line: int | str, name: str, said: list[str]) -> None:
        targets, speed = [], None
        for k, each in enumerate(said):
            key, is_named, rest = each.partition("=")
            if not is_named and k < PATHS[name]:
                targets.append(each)
            elif is_named and key.strip() in WHERE[:4]:
                targets.append(rest.strip())
            elif (is_named and key.strip() == "v") or (not is_named and k == PATHS[name] + 1):
                speed = rest if is_named else each
        if len(targets) != PATHS[name]:
            raise InputError(f"line {line}: {name}: expected {PATHS[name]} targets")
        is_free = name == "movej"
        places = [self._place(line, each, joints=True) for each in targets]
        found: float | None = None
        if not is_free and speed is not None and re.fullmatch(r"[-+\d.eE]+", speed.strip()):
            found = 1000 * value(speed, line, "the speed")
        self.move(
            line, places[-1], on_path=not is_free, speed=found,
            via=places[0] if len(places) == 2 else None,
        )  # fmt: skip

    def _place(self, line: int | str, said: str, *, joints: bool = False) -> Place | None:
        """Return a pose of the tip; None for a list of joints, if they may be given."""
        said = said.strip()
        said = self.words.get(said, said)
        if said.startswith("[") and joints:
            return None
        if found := re.fullmatch(r"p\[(.*)\]", said, re.ASCII | re.DOTALL):
            numbers = [value(each, line, "a pose") for each in split(found[1])]
            if len(numbers) != 6:
                raise InputError(f"line {line}: a pose of {len(numbers)} numbers, expected 6")
            T = pose_of(numbers[:3], Rotation.from_rotvec(numbers[3:]))
            return Place(T, Frame(name=self.base, T=np.eye(4)))
        if found := CALL.fullmatch(said):
            inner = split(found[2])
            if found[1] == "get_inverse_kin" and joints:
                return self._place(line, inner[0])
            if found[1] == "pose_trans" and len(inner) == 2:
                return self._composed(line, inner[0], inner[1])
        if said in self.values and (known := self.values[said]) is not None:
            return known
        raise InputError(
            f"line {line}: {shown(said)}: where it is is not said in the script; write p[...]"
        )

    def _composed(self, line: int | str, one: str, other: str) -> Place:
        """Return the pose `other` in a frame, `one`."""
        frame, place = self._place(line, one), self._place(line, other)
        assert frame is not None
        assert place is not None
        if place.frame.name != self.base or frame.frame.name != self.base:
            raise InputError(f"line {line}: a frame in a frame; give each pose in one frame")
        if re.fullmatch(NAME, one):
            return Place(place.T, Frame(name=self.frames.get(one, one), T=frame.T))
        return Place(_product(frame.T, place.T), place.frame)


def _product(one: Array, other: Array) -> Array:
    return np.asarray(one @ other)
