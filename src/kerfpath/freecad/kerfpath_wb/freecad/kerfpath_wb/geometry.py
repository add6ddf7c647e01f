"""Edges of the model: fingerprints, by which they are known again, and the loops that they are on.

Lengths are in mm. Nothing here needs FreeCAD; edges are its edges, or anything alike.
"""

import math

from . import tr

NEAR = 1e-3
"""mm: places and lengths this near are the same, for `same`; beside a millionth of the length."""
SAMPLES = 9
"""Points of an edge that must be on a loop."""
OFF = 0.1
"""mm: distance of such a point from the drawn line of its loop, beside twice the chord error."""
CHORD = 2e-3, 0.02, 0.2
"""Chord error of the drawn lines: its share of the length, and its least and largest value, mm."""
WHOLE = 0.99
"""Share of the length of a loop that its edges must have together."""


class PickError(Exception):
    """What is picked is no loop to cut; the text names it and says what to do."""


# -----------------------------------------------------------------------------
# Fingerprints.


def fingerprint(edge):
    """Return what an edge is known again by: kind of curve, length, middle, ends, radius."""
    curve = type(edge.Curve).__name__
    found = {
        "curve": curve,
        "length": round(edge.Length, 6),
        "middle": [round(value, 6) for value in edge.CenterOfMass],
        "ends": sorted([round(value, 6) for value in v.Point] for v in edge.Vertexes),
    }
    if hasattr(edge.Curve, "Radius"):
        found["radius"] = round(edge.Curve.Radius, 6)
    return found


def same(one, other):
    """Return whether two fingerprints are of the same edge."""
    if one["curve"] != other["curve"] or len(one["ends"]) != len(other["ends"]):
        return False
    near = NEAR + 1e-6 * one["length"]
    pairs = [(one["length"], other["length"]), (one.get("radius", 0), other.get("radius", 0))]
    if any(abs(a - b) > near for a, b in pairs):
        return False
    places = [(one["middle"], other["middle"]), *zip(one["ends"], other["ends"])]
    return all(math.dist(a, b) <= near for a, b in places)


def said(print_):
    """Return a fingerprint in words."""
    if "radius" in print_:
        what = "{} of radius {:.3g}".format(print_["curve"].lower(), print_["radius"])
    else:
        what = "{} of length {:.4g}".format(print_["curve"].lower(), print_["length"])
    return "{} mm at ({})".format(what, ", ".join("{:.1f}".format(x) for x in print_["middle"]))


def found_again(names, prints, edges):
    """Return the names of edges after a change of the model.

    Parameters
    ----------
    names : list of str
        Names of the edges before, as "Edge10".
    prints : list of dict
        Their fingerprints.
    edges : list
        Edges of the changed model, in its order.

    Raises
    ------
    PickError
        An edge is gone, or several look like it.
    """
    now = [fingerprint(edge) for edge in edges]
    found = []
    for name, before in zip(names, prints):
        index = int(name[4:]) - 1 if name[4:].isdigit() else -1
        if 0 <= index < len(now) and same(before, now[index]):
            found.append(name)
            continue
        alike = [i for i, each in enumerate(now) if same(before, each)]
        if len(alike) != 1:
            gone = index < 0 or index >= len(now)
            other = tr("it is gone") if gone else tr("it is now a {}").format(said(now[index]))
            many = tr("several edges are as it was") if alike else tr("no edge is as it was")
            raise PickError(
                tr("the model has changed: {} was a {}, {}, and {}; pick the contour again").format(
                    name, said(before), other, many
                )
            )
        found.append("Edge{}".format(alike[0] + 1))
    return found


# -----------------------------------------------------------------------------
# Open lines of edges.


def chains(names, ends):
    """Return the open lines that edges make up, as lists of (index, whether it runs backwards).

    Parameters
    ----------
    names : list of str
    ends : list of (first, last)
        The ends of each edge, mm.

    Raises
    ------
    PickError
        Edges branch, or make up a whole loop.
    """

    def at(point, among):
        return [
            (i, bool(end)) for i in among for end in (0, 1) if math.dist(ends[i][end], point) < NEAR
        ]

    every = range(len(ends))
    for i in every:
        for point in ends[i]:
            if len(at(point, every)) > 2:
                beside = sorted({names[k] for k, _ in at(point, every)})
                raise PickError(
                    tr("{} meet at one point; cut one line at a time").format(", ".join(beside))
                )
    found, left = [], list(every)
    while left:
        free = [(i, bool(end)) for i in left for end in (0, 1) if len(at(ends[i][end], every)) == 1]
        if not free:
            raise PickError(
                tr("{} are a whole loop; take Cut what is picked").format(
                    ", ".join(names[i] for i in left)
                )
            )
        line, step = [], free[0]
        while step is not None:
            i, backwards = step
            line.append(step)
            left.remove(i)
            step = next(iter(at(ends[i][0 if backwards else 1], left)), None)
        found.append(line)
    return found


def table(lines):
    """Return open lines as a table of points and tool axes, for the key `lines` of a job.

    Parameters
    ----------
    lines : dict of str to list of (point, axis)
        Points (mm) and tool axes of each line, by its name.
    """
    rows = ["contour,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z"]
    for name, line in lines.items():
        for point, axis in line:
            rows.append(",".join([name, *("{:.9g}".format(x) for x in (*point, *axis))]))
    return "\n".join(rows) + "\n"


# -----------------------------------------------------------------------------
# The loops that edges are on.


class Loop:
    """A loop of the part as kerfpath has read it, in coordinates of the part, mm.

    Parameters
    ----------
    entry : dict
        Entry of the message `part`.
    T : list of 16 numbers
        Pose of the part in the frame of the entry, m.
    """

    def __init__(self, entry, T):
        self.name, self.kind, self.face = entry["name"], entry["kind"], entry["face"]
        self.length = entry["length"] * 1e3
        flat = entry["points"]
        self.points = [
            tuple(
                sum(T[4 * i + k] * (flat[n + i] - T[4 * i + 3]) for i in range(3)) * 1e3
                for k in range(3)
            )
            for n in range(0, len(flat), 3)
        ]
        share, least, most = CHORD
        self.off = OFF + 2 * min(max(share * self.length, least), most)
        columns = list(zip(*self.points))
        self.low = [min(column) - self.off for column in columns]
        self.high = [max(column) + self.off for column in columns]

    def has(self, points):
        """Return whether all of these points are on it."""
        inside = all(
            low <= value <= high
            for point in points
            for low, value, high in zip(self.low, point, self.high)
        )
        return inside and all(self._distance(point) <= self.off for point in points)

    def _distance(self, point):
        best = math.inf
        for a, b in zip(self.points, self.points[1:]):
            along = [y - x for x, y in zip(a, b)]
            size = sum(value * value for value in along)
            share = sum(u * (p - x) for u, p, x in zip(along, point, a)) / size if size else 0.0
            share = min(1.0, max(0.0, share))
            best = min(best, math.dist(point, [x + share * u for x, u in zip(a, along)]))
        return best


def samples(edge):
    """Return points of an edge."""
    return [tuple(point) for point in edge.discretize(Number=SAMPLES)]


def edges_on(loop, edges):
    """Return the names of all edges of a model that are on a loop.

    Raises
    ------
    PickError
        They are not the whole loop.
    """
    on = {i: edge for i, edge in enumerate(edges) if edge.Length <= 1.1 * loop.length}
    on = {i: edge for i, edge in on.items() if loop.has(samples(edge))}
    length = sum(edge.Length for edge in on.values())
    if length < WHOLE * loop.length:
        raise PickError(
            tr(
                "only {:.4g} of the {:.4g} mm of loop {} are edges of the model; pick another one"
            ).format(length, loop.length, loop.name)
        )
    return ["Edge{}".format(i + 1) for i in on]


def loops_of(groups, loops):
    """Return the loops that are picked.

    Parameters
    ----------
    groups : dict of str to list of lists of edges
        What is picked, by its name: an edge alone, or the edges of each wire of a face, of which
        those that are no loop are left out, as where a face goes on in the next one.
    loops : list of Loop

    Raises
    ------
    PickError
        Something picked is on no loop, or on several that are equally likely.
    """
    on = {}
    for name, wires in groups.items():
        found = []
        for edges in wires:
            points = [samples(edge) for edge in edges]
            found.append([loop for loop in loops if all(map(loop.has, points))])
        if not any(found):
            raise PickError(
                tr(
                    "{} is on no loop that can be cut from outside; pick an edge of the outer side "
                    "of the part"
                ).format(name)
            )
        on.update(((name, i), each) for i, each in enumerate(found) if each)
    picked = {}
    for (name, _), candidates in on.items():
        # A loop with more of what is picked comes first, and the rim of a hole before its wall.
        def rank(loop):
            return sum(loop in others for others in on.values()), loop.kind == "inner"

        best = max(map(rank, candidates))
        likely = [loop for loop in candidates if rank(loop) == best]
        if len(likely) > 1:
            raise PickError(
                tr(
                    "{} is on {}; pick the face whose edge is to be cut, or another edge of the "
                    "loop, too"
                ).format(name, " and on ".join(sorted(loop.name for loop in likely)))
            )
        picked[likely[0].name] = likely[0]
    return list(picked.values())
