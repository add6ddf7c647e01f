"""The motion of a program: joints at each time, and the frames of the robot from its joints.

Frames are numbered as the studio's protocol says; poses are 16 numbers, row-major, in m. Nothing
here needs FreeCAD.
"""

import math

IDENTITY = [1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0]


def product(one, other):
    """Return the product of two poses."""
    return [
        sum(one[4 * i + k] * other[4 * k + j] for k in range(4))
        for i in range(4)
        for j in range(4)
    ]  # fmt: skip


def inverse(T):
    """Return the inverse of a pose."""
    turned = [[T[4 * k + i] for k in range(3)] for i in range(3)]
    rows = [[*row, -sum(r * T[4 * k + 3] for k, r in enumerate(row))] for row in turned]
    return [value for row in [*rows, [0.0, 0.0, 0.0, 1.0]] for value in row]


def rotation(axis, angle):
    """Return the rotation by an angle (rad) about a unit vector, as a pose."""
    (x, y, z), c, s = axis, math.cos(angle), math.sin(angle)
    t = 1 - c
    return [
        t * x * x + c, t * x * y - s * z, t * x * z + s * y, 0.0,
        t * x * y + s * z, t * y * y + c, t * y * z - s * x, 0.0,
        t * x * z - s * y, t * y * z + s * x, t * z * z + c, 0.0,
        0.0, 0.0, 0.0, 1.0,
    ]  # fmt: skip


def _carried(joint, value):
    """Return the pose by which an external axis has moved what it carries."""
    T, axis = joint["T"], joint["axis"]
    if joint["unit"] == "m":
        point, turn = [v * value for v in axis], IDENTITY
        return [1.0, 0, 0, point[0], 0, 1.0, 0, point[1], 0, 0, 1.0, point[2], 0, 0, 0, 1.0]
    place = [1.0, 0, 0, T[3], 0, 1.0, 0, T[7], 0, 0, 1.0, T[11], 0, 0, 0, 1.0]
    turn = rotation(axis, value)
    return product(product(place, turn), inverse(place))


def frames(robot, q):
    """Return the frames of the robot, from the part to the tip, as seen from the part.

    Parameters
    ----------
    robot : dict
        As in the message `scene`.
    q : list of float
        Its joints, then its external axes, rad or m.
    """
    found = {"part": [IDENTITY], "robot": [IDENTITY]}
    for joint, value in zip(robot["joints"], q):
        if joint["carries"]:
            row = found[joint["carries"]]
            row.append(product(row[-1], _carried(joint, value)))
    row = [*reversed(found["part"]), *found["robot"][1:]]
    for joint, value in zip(robot["joints"], q):
        if not joint["carries"]:
            row.append(product(product(row[-1], joint["T"]), rotation(joint["axis"], value)))
    row.append(product(product(row[-1], robot["T_flange"]), robot["T_tool"]))
    if len(found["part"]) == 1:
        return row
    still = inverse(row[0])  # the part stands where it is in the document; all else turns about it
    return [product(still, T) for T in row]


class Timeline:
    """The motion of a program.

    Parameters
    ----------
    program : dict or None
        The message `program`.
    plans : list of dict
        The messages `plan`, in the order of the job.
    """

    def __init__(self, program, plans):
        named = {plan["name"]: plan for plan in plans}
        segments = program["segments"] if program else []
        self.whole = bool(segments) and all(
            segment["plan"] is None or segment["plan"] in named for segment in segments
        )
        self.spans = []  # (begin, end, contour, times, q)
        if self.whole:
            for each in segments:
                motion = named[each["plan"]] if each["plan"] else each
                span = (each["begin"], each["end"], each["contour"], motion["time"], motion["q"])
                self.spans.append((*span, each["plan"]))
        else:  # the cuts alone, one after the other
            begin = 0.0
            for plan in plans:
                end = begin + plan["time"][-1]
                self.spans.append(
                    (begin, end, plan["contour"], plan["time"], plan["q"], plan["name"])
                )
                begin = end
        self.total = self.spans[-1][1] if self.spans else 0.0

    def at(self, t):
        """Return the joints at a time, the contour that is cut then, its plan, and the node.

        Contour and plan are None between the cuts; the node is that which comes last before `t`.
        """
        t = min(max(t, 0.0), self.total)
        span = next(each for each in reversed(self.spans) if each[0] <= t)
        begin, _, contour, times, q, plan = span
        n = len(q) // len(times)
        local = t - begin
        low, high = 0, max(len(times) - 1, 1)
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if times[middle] <= local else (low, middle)
        if len(times) == 1:
            return q[:n], contour, plan, 0
        step = times[low + 1] - times[low]
        u = min(1.0, max(0.0, (local - times[low]) / step)) if step > 0 else 1.0
        a, b = q[n * low : n * low + n], q[n * low + n : n * low + 2 * n]
        return [x + u * (y - x) for x, y in zip(a, b)], contour, plan, low

    def when(self, plan, node):
        """Return when a node of a plan is cut; None if it is not in the motion."""
        for begin, _, _, times, _, name in self.spans:
            if name == plan:
                return begin + times[min(node, len(times) - 1)]
        return None
