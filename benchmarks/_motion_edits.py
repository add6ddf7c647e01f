"""Meaningful edits of a plan.json: of its contours, times, limits, moves and so on."""

from __future__ import annotations

import copy
import random
from typing import Any

from benchmarks._document import is_number, leaves, put, said

__all__ = [
    "column_edit",
    "contour_edit",
    "faster_edit",
    "job_copy_edit",
    "kind_edit",
    "limit_edit",
    "move_edit",
    "time_edit",
]


def contour_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Remove, double, reorder or rename contours, or remove all."""
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
    """Scale all times, insert a dwell, or shift one node; dt is changed to match."""
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
    """Change the kind of nodes, or their share of the speed."""
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
    """Change posture, turn, gamma, arc length or joints of many nodes in the same way."""
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
    """Widen or narrow limits together with eta, or change which joints are endless."""
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
    """Cut faster, with limits and audit record changed so that everything agrees."""
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
    """Change a value of the job that the plan repeats, and the other copies of it."""
    data = copy.deepcopy(data)
    path, value = rng.choice(list(leaves(data["job"])))
    if is_number(value):
        new = value * rng.choice([0.5, 1.01, 2]) + rng.choice([0, 1])
    elif isinstance(value, str):
        new = value + "x"
    else:
        new = not value
    data = put(data, ("job", *path), new)
    if path[-1] == "eta_velocity":
        for entry in data["contours"]:
            entry["eta_v"] = new
    return "job's copy", said(("job", *path)), data


def move_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Change the transfer moves: their corners, times or number, or all of them."""
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
