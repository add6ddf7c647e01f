"""Read the data of a project that `Val3` writes: frames, targets, speeds and outputs."""

from __future__ import annotations

import re

import numpy as np

from kerfpath._arrays import Array
from kerfpath.post._frames import from_euler
from kerfpath.post.val3._axes import SAME, joints_from_axes
from kerfpath.post.val3._settings import Val3Settings
from kerfpath.post.val3._write import ANGLES, FIRST, OUTPUTS, PORTS, TYPES, links
from kerfpath.post.val3._xml import Element
from kerfpath.robots import Robot

__all__ = ["Val3Data"]

_NUMBER = re.compile(r"-?\d+(?:\.\d+)?", re.ASCII)
_POSE = ("x", "y", "z", "rx", "ry", "rz")
_WORDS = {
    "shoulder": ("lefty", "righty", SAME[0]),
    "elbow": ("epositive", "enegative", SAME[1]),
    "wrist": ("wpositive", "wnegative", SAME[2]),
}
_JOINTS = tuple(f"j{i}" for i in range(1, 7))
_BOUNDS = {"accel": "100", "decel": "100", "rmax": "99999"}


class Val3Data:
    """The data that a .dtx declares; each kind of datum has a method.

    They are `frames` by name; `q` (K, 6) rad; `T` (K, 4, 4) m in the part with their `words`; and
    `motions` by name, with speed (m/s or share of the full speed) and zone (m).
    """

    def __init__(self, root: Element, robot: Robot, settings: Val3Settings) -> None:
        self.robot, self.settings = robot, settings
        self.said_at: dict[str, list[str]] = {}
        self.frames: dict[str, Array] = {}
        self.first: int | None = None
        self.q, self.T = np.empty((0, 6)), np.empty((0, 4, 4))
        self.words: list[tuple[str, ...]] = []
        self.motions: dict[str, list[tuple[float, float]]] = {"mAir": [], "mPath": []}
        seen = set()
        for datum in root.only("Datas")[0].each("Data"):
            name = datum.attributes.get("name", "")
            if name not in _DATA or name in seen:
                raise datum.fault(f"not expected here: {datum.shown()}")
            seen.add(name)
            values = datum.each("Value")
            kind, reader = _DATA[name]
            datum.take(
                **{"name": name, "access": "private", "xsi:type": "array"},
                type=kind,
                size=str(len(values)),
            )
            if not values or (len(values) > 1 and name not in TYPES):
                raise datum.fault(f"expected one value of {name}, got {len(values)}")
            for key, value in enumerate(values):
                value.only()
                if value.attributes.pop("key", "") != str(key):
                    raise value.fault(f"expected the value of key {key}")
            self.said_at[name] = [f"{value.file}, line {value.line}" for value in values]
            reader(self, name, values)
        expected = links(settings)
        for name in ("fPart", "tLaser", *expected):
            if name not in seen:
                raise root.fault(f"{name} is not declared")

    def _frame(self, name: str, values: list[Element]) -> None:
        (value,) = values
        own = {} if name == "fPart" else {"ioLink": self.settings.tool_link}
        for key, link in own.items():
            if value.attributes.pop(key, "") != link:
                raise value.fault(f"expected {key} {link!r} of a tool")
        self.frames[name] = _poses(values, "world[0]" if name == "fPart" else "flange[0]")[0]

    def _first(self, name: str, values: list[Element]) -> None:
        (value,) = values
        text = value.attributes.get("value", "")
        value.take(value=text)
        if not re.fullmatch(r"[1-9]\d{0,5}", text, re.ASCII):
            raise value.fault(f"{name} must be the number of a contour, got {text[:60]!r}")
        self.first = int(text)

    def _output(self, name: str, values: list[Element]) -> None:
        (value,) = values
        link = value.attributes.get("link", "")
        if link != (expected := links(self.settings).get(name)):
            raise value.fault(f"expected the output {expected} to be switched, got {link}")
        value.take(link=link)

    def _air_targets(self, name: str, values: list[Element]) -> None:
        rows = [_numbers(value, _JOINTS) for value in values]
        for value in values:
            value.take(**{k: v for k, v in value.attributes.items() if k in _JOINTS})
        self.q = joints_from_axes(self.robot, np.radians(np.array(rows)))

    def _points(self, name: str, values: list[Element]) -> None:
        for value in values:
            words = tuple(value.attributes.pop(what, "") for what in _WORDS)
            for (what, known), word in zip(_WORDS.items(), words, strict=True):
                if word not in known:
                    raise value.fault(f"expected {what} {' or '.join(known)}, got {word!r}")
            self.words.append(words)
        self.T = _poses(values, "fPart[0]")

    def _descriptors(self, name: str, values: list[Element]) -> None:
        path = name == "mPath"
        for value in values:
            (speed,) = _numbers(value, ("tmax" if path else "vel",))
            free = {"vel": "100"} if path else {"tmax": "99999"}
            zone, corner = 0.0, {"blend": "off"}
            if value.attributes.get("blend") != "off":
                (zone,) = _numbers(value, ("leave",))
                said = value.attributes["leave"]
                corner = {"blend": "Cartesian" if path else "joint", "leave": said, "reach": said}
            value.take(**{**value.attributes, **_BOUNDS, **free, **corner})
            if set(value.attributes) != {*_BOUNDS, *corner, "vel", "tmax"}:
                raise value.fault(f"expected a speed and a corner, got {value.shown()}")
            self.motions[name].append((speed * (1e-3 if path else 1e-2), zone * 1e-3))


_DATA = {
    "fPart": ("frame", Val3Data._frame),
    "tLaser": ("tool", Val3Data._frame),
    **{name: ("dio", Val3Data._output) for name in (*OUTPUTS.values(), *PORTS.values())},
    FIRST: ("num", Val3Data._first),
    "jAir": ("jointRx", Val3Data._air_targets),
    "mAir": ("mdesc", Val3Data._descriptors),
    "pPath": ("pointRx", Val3Data._points),
    "mPath": ("mdesc", Val3Data._descriptors),
}
"""Type of each datum, and how its values are read."""


def _numbers(value: Element, names: tuple[str, ...]) -> list[float]:
    """Return attributes as numbers."""
    found = []
    for name in names:
        text = value.attributes.get(name, "")
        if not _NUMBER.fullmatch(text):
            raise value.fault(f"expected a number as {name}, got {text[:60]!r}")
        found.append(float(text))
    return found


def _poses(values: list[Element], father: str) -> Array:
    """Return poses (K, 4, 4) m of x, y, z in mm and rx, ry, rz in deg, in the frame `father`."""
    rows = np.array([_numbers(value, _POSE) for value in values])
    for value in values:
        if value.attributes.keys() != {*_POSE, "fatherId"}:
            raise value.fault(f"expected a pose, got {value.shown()}")
        if value.attributes["fatherId"] != father:
            raise value.fault(f"expected it in {father}, got {value.attributes['fatherId'][:60]!r}")
    return from_euler(rows, ANGLES)
