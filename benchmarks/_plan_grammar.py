"""A grammar of edits over plan.json, and an oracle, apart from the audit, of which are harmful.

Every value of the file can be edited by every rule that fits it. The oracle does not look at what
the audit does; it says of an edit whether what is left still is a plan of the job, within what no
robot shows, or differs in words alone that say nothing of the motion.
"""

from __future__ import annotations

import copy
import json
import random
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

__all__ = ["GROUPS", "HARMLESS", "Edit", "edits", "is_harmless"]

WITHIN = 1e-6
"""A number changed by less than this (relative, or absolute below 1; m, rad, s) is the same: a
micrometre and a microradian are a hundredth of what a robot repeats."""
HARMLESS = {
    r"kerfpath$": "which version wrote the file",
    r"contours/\d+/(proof|optimal|grid_cost)$": "a claim about other motions: not repeated as fact",
    r"contours/\d+/counts(/|$)": "how many poses were dropped for what reason: a record",
    r"contours/\d+/audit/checks/\d+/(title|advice|node)$": "words, and a place, of an old audit",
    r"sequence/(optimal|at_least_s)$": "a claim about other orders: not repeated as fact",
    r"limits/acceleration_source$": "free text",
    r"limits/couplings/\d+/note$": "free text",
}
"""Places (from the top, `/` between) at which another value of the same type does no harm, and why.
"""
TURN = 2 * 3.141592653589793


@dataclass(frozen=True)
class Edit:
    """One edited plan.json: what kind of edit, where, the text, and whether it is harmless."""

    kind: str
    where: str
    text: str
    harmless: bool


class Raw(str):
    """A piece of text that JSON has no value for: a number too large, NaN."""


Path = tuple[str | int, ...]


def leaves(data: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield every value of a document that is neither an object nor an array, and its place."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from leaves(value, (*path, key))
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield from leaves(value, (*path, i))
    else:
        yield path, data


def containers(data: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield every object and array of a document, and its place."""
    if isinstance(data, dict | list):
        yield path, data
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from containers(value, (*path, key))


def said(path: Path) -> str:
    """Return a place as one word."""
    return "/".join(str(step) for step in path)


def is_harmless(before: Any, after: Any) -> bool:
    """Say whether an edited document differs only where that is harmless."""
    return not any(True for _ in _harm(before, after, ()))


def _harm(one: Any, two: Any, path: Path) -> Iterator[str]:
    if isinstance(one, dict) and isinstance(two, dict):
        if one.keys() != two.keys() and not _is_free(path):
            yield said(path)
        for key in one.keys() & two.keys():
            yield from _harm(one[key], two[key], (*path, key))
    elif isinstance(one, list) and isinstance(two, list):
        if len(one) != len(two):
            yield said(path)
        for i, (a, b) in enumerate(zip(one, two, strict=False)):
            yield from _harm(a, b, (*path, i))
    elif _number(one) and _number(two):
        off = abs(two - one)
        if off and "gamma_rad" in path:
            off = min(off % TURN, TURN - off % TURN)
        # A number may become a whole one of the same value, as JSON knows but one kind.
        if off > WITHIN * max(1.0, abs(one)) and not _is_free(path):
            yield said(path)
    elif type(one) is not type(two):
        if not (all(each is None or _number(each) for each in (one, two)) and _is_free(path)):
            yield said(path)
    elif one != two and not _is_free(path):
        yield said(path)


def _is_free(path: Path) -> bool:
    """Say whether any value does at a place."""
    where = said(path)
    return any(re.match(pattern, where) for pattern in HARMLESS)


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _put(data: Any, path: Path, value: Any) -> Any:
    """Return a copy of a document with another value at a place."""
    data = copy.deepcopy(data)
    holder = data
    for step in path[:-1]:
        holder = holder[step]
    holder[path[-1]] = value
    return data


def _drop(data: Any, path: Path) -> Any:
    data = copy.deepcopy(data)
    holder = data
    for step in path[:-1]:
        holder = holder[step]
    del holder[path[-1]]
    return data


def _at(data: Any, path: Path) -> Any:
    for step in path:
        data = data[step]
    return data


# ---- edits of one value


def number(value: Any, rng: random.Random) -> tuple[str, Any]:
    """Return a number scaled, shifted, turned in sign, exchanged for an odd one."""
    way = rng.choice(["scaled", "scaled", "shifted", "shifted", "sign", "zero", "nudged"])
    if way == "scaled":
        return "number scaled", value * rng.choice([0.1, 0.5, 0.99, 1.001, 1.01, 1.1, 2, 10, 100])
    if way == "shifted":
        return "number shifted", value + rng.choice([-1, 1]) * rng.choice([1e-4, 1e-3, 0.1, 1, 5])
    if way == "sign":
        return "number's sign", -value
    if way == "zero":
        return "number zero", type(value)(0)
    return "number nudged", value * (1 + 1e-5) + 1e-5


ODD: list[Any] = [
    True, False, None, "1.0", "nan", [], {}, [1.0], Raw("NaN"), Raw("Infinity"), Raw("-Infinity"),
    Raw("1e400"), Raw("1e300"), Raw("-1e18"), Raw("1" + "0" * 400), Raw("1" + "0" * 5000),
]  # fmt: skip


def typed(value: Any, rng: random.Random) -> tuple[str, Any]:
    """Return something of another type in place of a value."""
    if _number(value) and rng.random() < 0.3:
        return "typed otherwise", rng.choice([str(value), bool(value), [value]])
    return "typed otherwise", rng.choice(ODD)


def word(value: str, rng: random.Random) -> tuple[str, Any]:
    """Return another text."""
    return "text", rng.choice(
        [value + "x", "", value[1:], "cut", "micro joint", "lead-out", "exact"]
    )


def leaf_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Edit one value anywhere, each place as likely as any other of its kind."""
    path, value = _anywhere(data, rng)
    if not path:
        return None
    if rng.random() < 0.12:
        holder = _at(data, path[:-1])
        if isinstance(holder, list) and rng.random() < 0.5:
            return "element removed", said(path), _drop(data, path)
        if isinstance(holder, dict):
            return "key removed", said(path), _drop(data, path)
    if rng.random() < 0.15:
        kind, new = typed(value, rng)
    elif isinstance(value, bool):
        kind, new = "flag", not value
    elif _number(value):
        kind, new = number(value, rng)
    elif isinstance(value, str):
        kind, new = word(value, rng)
    else:
        kind, new = "null filled", rng.choice([0.5, 1, "x", [0.1, 0.2], {"a": 1}])
    return kind, said(path), _put(data, path, new)


def _anywhere(data: Any, rng: random.Random) -> tuple[Path, Any]:
    """Go down from the top, each branch as likely as the next, large or small."""
    path: Path = ()
    while isinstance(data, dict | list) and data:
        step = rng.choice(list(data) if isinstance(data, dict) else range(len(data)))
        path, data = (*path, step), data[step]
    return path, data


def array_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Shorten, turn round, rotate, empty an array, or double or swap elements of it."""
    arrays = [(path, array) for path, array in containers(data) if isinstance(array, list)]
    columns = [
        (path, array) for path, array in arrays
        if (len(path) < 6 and (not array or not isinstance(array[0], float)))
        or "nodes" in path or "moves" in path
    ]  # fmt: skip
    path, array = rng.choice(rng.choice([arrays, columns]))
    if len(array) < 2:
        return None
    array = copy.deepcopy(array)
    way = rng.randrange(6)
    i, j = rng.sample(range(len(array)), 2)
    if way == 0:
        kind, array = "array shortened", array[:-1] if rng.random() < 0.5 else array[1:]
    elif way == 1:
        kind, array = "array rotated", array[1:] + array[:1]
    elif way == 2:
        kind, array = "array reversed", array[::-1]
    elif way == 3:
        kind = "element doubled"
        array.insert(i, copy.deepcopy(array[i]))
    elif way == 4:
        kind = "elements swapped"
        array[i], array[j] = array[j], array[i]
    else:
        kind, array = "array emptied", []
    return kind, said(path), _put(data, path, array)


def key_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Add a key that nobody knows, remove one with all below it, or exchange two values."""
    path, table = rng.choice([(p, c) for p, c in containers(data) if isinstance(c, dict) and c])
    way = rng.randrange(3)
    if way == 0:
        return "key unknown", said(path), _put(data, (*path, "extra"), 1)
    key = rng.choice(list(table))
    if way == 1:
        return "key removed", said((*path, key)), _drop(data, (*path, key))
    other = rng.choice(list(table))
    if table[key] == table[other]:
        return None
    data = _put(data, (*path, key), table[other])
    return "values swapped", said((*path, key)), _put(data, (*path, other), table[key])


# ---- edits that mean something


def contour_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Remove, double, reorder or rename contours; leave none."""
    data = copy.deepcopy(data)
    contours = data["contours"]
    i = rng.randrange(len(contours))
    where = f"contours/{i}"
    way = rng.randrange(6)
    if way == 0:
        del contours[i]
        return "contour removed", where, data
    if way == 1:
        contours.insert(rng.randrange(len(contours) + 1), copy.deepcopy(contours[i]))
        return "contour doubled", where, data
    if way == 2 and len(contours) > 1:
        contours.append(contours.pop(i))
        return "contours reordered", where, data
    if way == 3:
        contours[i]["contour"] = rng.choice(["other", contours[i - 1]["contour"] + " "])
        return "contour renamed", where, data
    if way == 4:
        data["contours"] = []
        return "contours all removed", "contours", data
    contours[i] = {"name": contours[i]["name"], "feasible": False}
    return "contour declared infeasible", where, data


def time_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Scale all times, put in a dwell, or shift one node; dt follows, as a careful hand would."""
    data = copy.deepcopy(data)
    i = rng.randrange(len(data["contours"]))
    entry = data["contours"][i]
    time = entry["nodes"]["time_s"]
    way, k = rng.randrange(4), rng.randrange(1, len(time))
    if way == 0:
        share = rng.choice([0.5, 0.9, 1.02, 2, 100])
        time[:] = [t * share for t in time]
        kind = "times scaled"
    elif way == 1:
        wait = rng.choice([0.05, 1, 5])
        time[k:] = [t + wait for t in time[k:]]
        kind = "dwell between nodes"
    elif way == 2:
        time[k] += rng.choice([-0.3, 0.3]) * (time[k] - time[k - 1])
        kind = "time of a node shifted"
    else:
        time[:] = [t + 1.0 for t in time]
        kind = "times begin late"
    if rng.random() < 0.5:
        entry["dt"] = (time[-1] - time[0]) / (len(time) - 1)
    return kind, f"contours/{i}/nodes/time_s", data


def kind_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Call nodes something else, or ask for another share of the speed."""
    data = copy.deepcopy(data)
    i = rng.randrange(len(data["contours"]))
    nodes = data["contours"][i]["nodes"]
    K = len(nodes["kind"])
    a = rng.randrange(K)
    some = range(a, min(K, a + rng.choice([1, 3, K])))
    if rng.random() < 0.5:
        new = rng.choice(["cut", "micro joint", "lead-in", "lead-out", "overlap", "loop"])
        for k in some:
            nodes["kind"][k] = new
        return "kinds changed", f"contours/{i}/nodes/kind", data
    share = rng.choice([0.1, 0.5, 0.95])
    for k in some:
        nodes["speed_share"][k] = share
    return "speed shares changed", f"contours/{i}/nodes/speed_share", data


def column_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Change posture, turn, gamma, arc length or joints of many nodes alike."""
    data = copy.deepcopy(data)
    i = rng.randrange(len(data["contours"]))
    nodes = data["contours"][i]["nodes"]
    name = rng.choice(["posture", "turn", "gamma_rad", "s_m", "q_rad", "points_m", "axes"])
    K = len(nodes["posture"])
    a = rng.randrange(K)
    some = range(a, min(K, a + rng.choice([1, 3, K])))
    j = rng.randrange(3)
    by = rng.choice([-1, 1]) * rng.choice([1e-4, 0.01, 1])
    for k in some:
        row = nodes[name][k]
        if name == "posture":
            nodes[name][k] = (row + 1) % 8
        elif name == "turn":
            row[rng.choice([3, 5])] += rng.choice([-1, 1])
        elif isinstance(row, list):
            row[j] += by
        else:
            nodes[name][k] = row + by
    return f"column {name}", f"contours/{i}/nodes/{name}", data


def limit_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Widen or narrow limits together with eta, or say which joints are endless."""
    data = copy.deepcopy(data)
    limits, share = data["limits"], rng.choice([0.5, 1.2, 2, 10])
    way = rng.randrange(4)
    if way == 0:
        for name in ("velocity_rad_s", "acceleration_rad_s2"):
            limits[name] = [v * share for v in limits[name]]
        kind = "limits widened together"
    elif way == 1:
        for entry in data["contours"]:
            entry["eta_v"], entry["eta_a"] = entry["eta_v"] * share, entry["eta_a"] * share
        kind = "eta changed together"
    elif way == 2:
        for name in ("lower_rad", "upper_rad"):
            limits[name] = [v * share for v in limits[name]]
        kind = "joint ranges widened"
    else:
        j = rng.randrange(6)
        limits["endless"][j] = not limits["endless"][j]
        kind = "endless flag"
    return kind, "limits", data


def faster_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Cut faster, with limits and the record of the audit changed so that all of it agrees."""
    data = copy.deepcopy(data)
    share = rng.choice([1.05, 2, 10])
    limits = data["limits"]
    limits["velocity_rad_s"] = [v * share for v in limits["velocity_rad_s"]]
    limits["acceleration_rad_s2"] = [v * share**2 for v in limits["acceleration_rad_s2"]]
    for entry in data["contours"]:
        entry["nodes"]["time_s"] = [t / share for t in entry["nodes"]["time_s"]]
        entry["dt"] /= share
    if data["sequence"] is not None:
        for move in data["sequence"]["moves"]:
            move["time_s"] = [t / share for t in move["time_s"]]
    for table in data["job"]["contour"]:
        table["speed_m_min"] *= share
    speeds = [share**2 * v for v in data["job"]["robot"]["acceleration_deg_s2"]]
    data["job"]["robot"]["acceleration_deg_s2"] = speeds
    return "all of it faster", "limits, times, job", data


def job_copy_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Change a value of the job that the plan repeats, and what repeats it in turn."""
    data = copy.deepcopy(data)
    path, value = rng.choice(list(leaves(data["job"])))
    if _number(value):
        new = value * rng.choice([0.5, 1.01, 2]) + rng.choice([0, 1])
    elif isinstance(value, str):
        new = value + "x"
    else:
        new = not value
    data = _put(data, ("job", *path), new)
    if path[-1] == "eta_velocity":
        for entry in data["contours"]:
            entry["eta_v"] = new
    return "job's copy", said(("job", *path)), data


def move_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Change the moves through the air: corners, times, how many, all of them."""
    data = copy.deepcopy(data)
    sequence = data["sequence"]
    if sequence is None:
        data["sequence"] = {"moves": []}
        return "sequence invented", "sequence", data
    moves = sequence["moves"]
    i = rng.randrange(len(moves))
    move = moves[i]
    where, way = f"sequence/moves/{i}", rng.randrange(8)
    if way == 0:
        corner, j = rng.choice(move["q_rad"]), rng.randrange(6)
        corner[j] += rng.choice([-1, 1]) * rng.choice([1e-4, 0.17, 1.5])
        return "corner of a move shifted", where, data
    if way == 1:
        share = rng.choice([0.01, 0.9, 1.1, 100])
        move["time_s"] = [t * share for t in move["time_s"]]
        return "times of a move scaled", where, data
    if way == 2:
        a, b = move["q_rad"][0], move["q_rad"][-1]
        middle = [(x + y) / 2 for x, y in zip(a, b, strict=True)]
        middle[1] += rng.choice([-1, 1]) * rng.choice([0.3, 1.2])
        move["q_rad"].insert(1, middle)
        move["time_s"].insert(1, move["time_s"][1] / 2)
        return "move led elsewhere", where, data
    if way == 3:
        del moves[i]
        return "move removed", where, data
    if way == 4:
        moves.insert(i, copy.deepcopy(move))
        return "move doubled", where, data
    if way == 5:
        data["sequence"] = None
        return "sequence removed", "sequence", data
    if way == 6:
        sequence["moves"] = []
        return "moves all removed", "sequence/moves", data
    move["q_rad"].reverse()
    return "move reversed", where, data


GROUPS: dict[str, Callable[[Any, random.Random], tuple[str, str, Any] | None]] = {
    "value": leaf_edit,
    "array": array_edit,
    "key": key_edit,
    "contours": contour_edit,
    "times": time_edit,
    "kinds": kind_edit,
    "columns": column_edit,
    "limits": limit_edit,
    "faster": faster_edit,
    "job's copy": job_copy_edit,
    "moves": move_edit,
    "text": lambda data, rng: ("key twice", "", data),
}
"""The rules of the grammar by name."""
SHARE = {"value": 8, "array": 3, "key": 2}
"""How often a rule is taken against the others."""


def edits(text: str, count: int, seed: int) -> Iterator[Edit]:
    """Yield so many edits of the text of a plan.json; the same seed gives the same ones."""
    data, rng = json.loads(text), random.Random(seed)
    names = [name for name in GROUPS for _ in range(SHARE.get(name, 1))]
    while count:
        found = GROUPS[rng.choice(names)](data, rng)
        if found is None:
            continue
        kind, where, after = found
        harmless = is_harmless(data, after)
        written = _written(after)
        if kind == "key twice":
            keys = list(re.finditer(r'\n *"(\w+)":', text))
            at = rng.choice(keys)
            where, harmless = at[1], False
            written = f'{text[: at.start()]}\n "{at[1]}": 0.5,{text[at.start() :]}'
        elif after == data and not kind.startswith("typed"):
            continue
        count -= 1
        yield Edit(kind, where, written, harmless)


def _written(data: Any) -> str:
    """Return a document as text, pieces that JSON has no value for as they are."""
    raws: list[str] = []

    def known(value: Any) -> Any:
        if isinstance(value, Raw):
            raws.append(str(value))
            return f"@raw{len(raws) - 1}@"
        if isinstance(value, dict):
            return {key: known(each) for key, each in value.items()}
        return [known(each) for each in value] if isinstance(value, list) else value

    text = json.dumps(known(data), indent=1)
    return re.sub(r'"@raw(\d+)@"', lambda found: raws[int(found[1])], text)
