"""A station that speaks the published protocol of RoboDK, without RoboDK.

It follows `robolink.py` of the `robodk` package: a command is a line, numbers are big-endian, poses
and matrices go column by column, and each answer ends with a status. Units are mm and deg.
"""

import socket
import struct
import threading
from contextlib import contextmanager, suppress

import numpy as np

ROBOT, FRAME, TOOL, OBJECT, TARGET, PROGRAM, MACHINING = 2, 3, 4, 5, 6, 8, 11
EYE = np.eye(4)


def ur10e(q_deg, a3=-571.55):
    """Flange of a UR10e in its base, mm, by the parameters that its maker publishes."""
    T = EYE
    alpha, a, d = (
        (90, 0, 0, 90, -90, 0),
        (0, -612.7, a3, 0, 0, 0),
        (180.7, 0, 0, 174.15, 119.85, 116.55),
    )
    for q, al, ai, di in zip(np.radians(q_deg), np.radians(alpha), a, d, strict=True):
        c, s, ca, sa = np.cos(q), np.sin(q), np.cos(al), np.sin(al)
        T = T @ [
            [c, -s * ca, s * sa, ai * c],
            [s, c * ca, -c * sa, ai * s],
            [0, sa, ca, di],
            [0, 0, 0, 1],
        ]
    return T


class Item:
    def __init__(self, kind, name, **more):
        self.kind, self.name, self.links, self.parent = kind, name, {}, None
        self.pose = self.absolute = self.geometry = self.tool = EYE
        self.curves, self.said, self.joints, self.joint_target = [], [], [], False
        vars(self).update(more)


class Station:
    """Items by their numbers from 1, and what was asked.

    `drop_at`: the connection ends at this command, when it comes for the n-th time.
    `fail_at`: this command is answered with an error.
    """

    def __init__(self, *items):
        self.items = dict(enumerate(items, 1))
        self.commands, self.messages = [], []
        self.drop_at, self.fail_at = (None, 1), None
        self.check = ("", "0", 0)  # message, bits of the last step, status or 0: number of moves

    def add(self, item):
        self.items[max(self.items, default=0) + 1] = item
        return item

    def of(self, kind):
        return [item for item in self.items.values() if item.kind == kind]

    @contextmanager
    def served(self):
        """Serve on a port of this machine, which is given."""
        with socket.create_server(("127.0.0.1", 0)) as server:
            threading.Thread(target=self._accept, args=(server,), daemon=True).start()
            yield server.getsockname()[1]

    def _accept(self, server):
        with suppress(OSError):
            while True:
                threading.Thread(target=_Wire(self, server.accept()[0]).answer, daemon=True).start()


class _Wire:
    def __init__(self, station, link):
        self.station, self.link = station, link
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.read = link.makefile("rb")

    # What comes in.

    def line(self):
        return self.read.readline().decode().removesuffix("\n")

    def numbers(self, form):
        return struct.unpack(f">{form}", self.read.read(struct.calcsize(f">{form}")))

    def int(self):
        return self.numbers("i")[0]

    def item(self):
        return self.station.items.get(self.numbers("Q")[0])

    def array(self):
        return list(self.numbers(f"{self.int()}d"))

    # What goes out.

    def send(self, form, *values):
        self.link.sendall(struct.pack(f">{form}", *values))

    def send_line(self, text):
        self.link.sendall(text.encode() + b"\n")

    def send_item(self, item):
        number = next((k for k, one in self.station.items.items() if one is item), 0)
        self.send("Qi", number, item.kind if number else -1)

    def send_array(self, values):
        self.send(f"i{len(values)}d", len(values), *values)

    def send_pose(self, T):
        self.send("16d", *np.asarray(T).T.ravel())

    def send_matrix(self, matrix):
        matrix = np.asarray(matrix, float)
        self.send(f"2i{matrix.size}d", *matrix.shape, *matrix.T.ravel())

    def answer(self):
        station, times = self.station, {}
        with suppress(OSError, struct.error), self.link, self.read:
            while command := self.line():
                times[command] = times.get(command, 0) + 1
                station.commands.append(command)
                if (command, times[command]) == station.drop_at:
                    self.link.shutdown(socket.SHUT_RDWR)
                    return
                getattr(self, command)()
                if command == station.fail_at:
                    self.send("i", 3)
                    self.send_line("the station says no")
                else:
                    self.send("i", 0)

    # The commands, by their names.

    def RDK_API(self):
        self.array()
        self.send_line("RDK_API")
        self.send("2i", 1, 26000)

    def PickItem(self):
        self.line()
        kind = self.int()
        self.send_item(next(iter(self.station.of(kind)), None))

    def G_Name(self):
        self.send_line(self.item().name)

    def G_LinkType(self):
        item, kind = self.item(), self.int()
        self.send_item(item.links.get(kind))

    def G_Parent(self):
        self.send_item(self.item().parent)

    def G_Tool(self):
        self.send_pose(self.item().tool)

    def G_Hlocal(self):
        self.send_pose(self.item().pose)

    def G_Hlocal_Abs(self):
        self.send_pose(self.item().absolute)

    def G_Hgeom(self):
        self.send_pose(self.item().geometry)

    def G_ObjPoint(self):
        item, _, number = self.item(), self.int(), self.int()
        name, rows = item.curves[number] if number < len(item.curves) else ("", np.zeros((0, 0)))
        self.send_matrix(np.asarray(rows).T)
        self.send_line(name)

    def G_RobLimits(self):
        item = self.item()
        self.send_array(item.lower)
        self.send_array(item.upper)
        self.send("i", 0)

    def G_Thetas(self):
        self.send_array(self.item().joints)

    def G_FK(self):
        q, item = self.array(), self.item()
        self.send_pose(item.forward(q))

    def ICMD(self):
        item, key, _ = self.item(), self.line(), self.line()
        self.send_line(item.params[key])

    def Render(self):
        self.int()

    def ShowMessage(self):
        self.station.messages.append(self.line())

    ShowMessageStatus = ShowMessage

    def Add_PROG(self):
        self.send_item(self.station.add(Item(PROGRAM, self.line(), robot=self.item())))

    def Add_TARGET(self):
        name, frame, robot = self.line(), self.item(), self.item()
        self.send_item(self.station.add(Item(TARGET, name, parent=frame, robot=robot)))

    def Remove(self):
        item = self.item()
        self.station.items = {k: one for k, one in self.station.items.items() if one is not item}

    def Prog_ShowIns(self):
        item = self.item()
        item.shown = self.int()

    def S_Link_ptr(self):
        frame, item = self.item(), self.item()
        item.said.append(("frame", frame))

    def S_Tool_ptr(self):
        tool, item = self.item(), self.item()
        item.said.append(("tool", tool))

    def S_Tool(self):
        T, item = np.reshape(self.numbers("16d"), (4, 4)).T, self.item()
        item.said.append(("tool", T))

    def S_Speed4(self):
        item = self.item()
        item.said.append(("speed", self.array()))

    def S_ZoneData(self):
        value, item = self.int(), self.item()
        item.said.append(("rounding", value / 1000))

    def S_Target_As_JT(self):
        self.item().joint_target = True

    def S_Thetas(self):
        q, item = self.array(), self.item()
        item.joints = q

    def Add_INSMOVE(self):
        target, program, kind = self.item(), self.item(), self.int()
        program.said.append(({1: "MoveJ", 2: "MoveL"}[kind], target))

    def G_ProgJointList(self):
        program = self.item()
        program.asked = self.array()
        self.line()
        message, bits, status = self.station.check
        moves = [one.joints for kind, one in program.said if kind in ("MoveJ", "MoveL")]
        steps = [[*q, 0, 1, 1, k, 0.1] for k, q in enumerate(moves)]
        steps[-1][len(moves[-1])] = int(bits)
        self.send_matrix(np.array(steps).T)
        self.send("i", status or len(moves))
        self.send_line(message)
