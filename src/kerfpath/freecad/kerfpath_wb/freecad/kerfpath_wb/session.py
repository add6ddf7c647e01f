"""A job of a document at work: a kerfpath process beside it, each kept as the other is.

The document is what counts. The text of its job goes to the process whenever it differs from what
the process has, also after undo. What the process makes of an edit comes back as a new text, and
becomes one step of undo of the document, with the contours that it has.
"""

import os
import re
import shutil
import tempfile
import time
from contextlib import contextmanager
from struct import unpack_from

import FreeCAD as App
from PySide import QtCore

from . import VERSION, WRITTEN, geometry, motion, objects, tr
from .process import ProcessError, Studio, find

PREFERENCES = "User parameter:BaseApp/Preferences/Mod/Kerfpath"
LAST_FOLDER = "User parameter:BaseApp/Preferences/General"
TICK, FRAME = 40, 30
"""ms between two looks at what the process has said, and between two frames of the motion."""
QUIET = 0.4
"""s without a move of robot, part or fixture, after which it is sent."""
DIGITS = 6
NEAR = 1e-4
"""mm and deg: placements that differ less are the same."""
HEAD, ROBOT = (0.25, 0.28, 0.33), (0.75, 0.75, 0.78)
NEAR_MISS = 5
"""mm between any two bodies in a cell that begins with a fixture of the document."""

UNNAMED = ("drawing", "place")
"""Edits that follow what the user has done in the document, and are no steps of undo."""

_sessions = {}


def own_environment():
    """Return the folder of the environment that the workbench installs."""
    return os.path.join(App.getUserAppDataDir(), "kerfpath", "environment")


def command():
    """Return the command of kerfpath; see `process.find`."""
    preference = App.ParamGet(PREFERENCES).GetString("Kerfpath", "")
    return find(preference=preference, written=WRITTEN, own=own_environment())


def session_of(document, part=None):
    """Return the session of a document, started if it has none; `part` is for a new job.

    Raises
    ------
    ProcessError
        kerfpath is not found.
    """
    known = _sessions.get(document.Name)
    if known is None:
        job = job_of(document)
        known = Session(document, job, job.Part if job else part)
    known.start()
    _sessions[document.Name] = known
    return known


def running(document):
    """Return the session of a document, or None."""
    return _sessions.get(document.Name)


def job_of(document):
    """Return the job of a document, or None."""
    for each in document.Objects:
        if isinstance(getattr(each, "Proxy", None), objects.Job):
            return each
    return None


class _Watch:
    """What happens in documents, for their sessions."""

    def slotDeletedDocument(self, document):
        session = _sessions.get(document.Name)
        if session:
            session.close()

    def slotDeletedObject(self, obj):
        session = _sessions.get(obj.Document.Name)
        if session and session.job is not None and session.job.Name == obj.Name:
            session.close()

    def slotChangedObject(self, obj, name):
        session = _sessions.get(obj.Document.Name) if obj.Document else None
        if session and name in ("Placement", "Shape", "Fixtures"):
            session.moved = time.monotonic()


_watch = _Watch()
App.addDocumentObserver(_watch)


class Session(QtCore.QObject):
    """The job of a document with its process.

    Attributes
    ----------
    heard : Signal
        Emitted with the type of each message once it has been taken.
    shown : Signal
        Emitted when another moment of the motion is shown.
    """

    heard = QtCore.Signal(str)
    shown = QtCore.Signal()

    def __init__(self, document, job, part):
        super().__init__()
        self.document, self.job, self.part = document, job, part
        self.values = self.options = self.scene = self.program = self.outcome = None
        self.given, self.faults, self.plans, self.none, self.maps = [], [], {}, {}, {}
        self.progress = {"busy": True, "label": tr("starting kerfpath"), "done": 0, "total": 0}
        self.problem, self.text, self.revision = "", None, 0
        self.t, self.playing, self.timeline = 0.0, False, motion.Timeline(None, [])
        self.moved, self.studio, self._folder = 0.0, None, None
        self._label, self._pending, self._picks, self._cut = "", None, None, set()
        self._new_lines = {}  # names of edges and normals, until they are contours
        self._loops, self._meshes, self._export, self.exported = [], {}, None, []
        self._timer = QtCore.QTimer(self)
        self._timer.timeout.connect(self._tick)
        self._player = QtCore.QTimer(self)
        self._player.timeout.connect(self._play)

    # The process.

    def start(self):
        """Start the process, unless it runs."""
        if self.studio is not None:
            return
        found = command()
        self._folder = tempfile.mkdtemp(prefix="kerfpath-")
        self._loops, self._files, self.scene, self.problem, self.text = [], {}, None, "", None
        drawing = self._written(self.part)
        path = os.path.join(self._folder, drawing)
        if self.job is not None:
            for each in self.job.Fixtures:
                self._written(each)
            lines = self._lines_written()
            path = os.path.join(self._folder, self._job_name())
            _write(path, self.job.Job.encode())
        self.progress = {"busy": True, "label": tr("starting kerfpath"), "done": 0, "total": 0}
        try:
            self.studio = Studio(found, path, VERSION)
        except ProcessError:
            self._end()
            raise
        if self.job is not None:
            names = {"file": drawing, "lines": lines}
            self.edit("drawing", [
                (["part", key], name) for key, name in names.items()
                if name and '"{}"'.format(name) not in self.job.Job
            ])  # fmt: skip
        self._timer.start(TICK)
        self.heard.emit("progress")

    def close(self):
        """End the process and forget the session; the document keeps its job."""
        self._timer.stop()
        self._player.stop()
        self._end()
        _sessions.pop(self.document_name, None)
        self.heard.emit("closed")

    def _end(self):
        if self.studio is not None:
            self.studio.close()
            self.studio = None
        if self._folder:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None

    @property
    def document_name(self):
        """The name of the document, also once that is closed."""
        return next((name for name, each in _sessions.items() if each is self), "")

    def edit(self, label, changes):
        """Change keys of the job, as one step of undo under a label.

        Parameters
        ----------
        label : str
        changes : list of (path, value)
            As in the message `edits`; None removes a key.
        """
        if changes and self.studio is not None:
            self._label = label if label not in UNNAMED or not self._label else self._label
            edits = [{"path": path, "value": value} for path, value in changes]
            self.studio.send("edits", edits=edits)

    def ask(self, kind, **keys):
        """Send another message."""
        if self.studio is not None:
            self.studio.send(kind, **keys)

    # What the user does.

    def cut(self, groups):
        """Make contours of what is picked: edges by name, see `geometry.loops_of`."""
        self._picks = groups
        self._resolve()

    def cut_lines(self, lines):
        """Make open lines of edges: `lines` as `objects.lines_in` returns them."""
        contours = self.job.Contours if self.job is not None else []
        cut = [sorted(objects.names_of(each)) for each in contours if objects.is_line(each)]
        taken = {each.Loop for each in contours}
        self._new_lines = {}
        for names, normals in lines:
            if sorted(names) in cut:
                self._say(tr("{} is already cut").format(", ".join(names)))
                continue
            name = next(n for n in map("line{}".format, range(1, 10**6)) if n not in taken)
            taken.add(name)
            self._new_lines[name] = names, normals
        if self._new_lines:
            self.edit("drawing", [(["part", "lines"], self._lines_written())])

    def remove(self, contours):
        """Take contours out of the job."""
        left = [each.Loop for each in self.job.Contours if each not in contours]
        if not left:
            self._say(tr("a job needs a contour: pick another one before, or delete the job"))
        elif self._loops:
            self._label = tr("Remove contours")
            self.ask("cut", loops=left, alone=True)
        else:
            self._say(
                tr("the drawing is not read yet; wait until it is, and remove the contour then")
            )

    def choose_robot(self, robot_id):
        """Put another robot of the library into the job, and a language of its controller."""
        known = {each["id"]: each for each in self.options["robots"]}
        to, before = known[robot_id], known.get(self.value("robot.model"))
        changes = {
            key: None
            for key in self.given
            if key.startswith("robot.") and key.count(".") == 1 and key != "robot.model"
        }
        changes["robot.model"] = to["id"]
        if to["ratio"]:
            changes["robot.acceleration_ratio"] = to["ratio"]
        if before is None or before["kinematics"] != to["kinematics"]:
            changes.update(
                {key: None for key in ("plan.posture", "sequence.home_deg") if key in self.given}
            )
        spoken = self.value("program.language")
        if spoken != "none" and to["languages"] and spoken not in to["languages"]:
            changes.update(self.language_changes(to["languages"][0]))
        self.edit(
            tr("Robot {}").format(to["id"]),
            [(self.path(key), value) for key, value in changes.items()],
        )

    def language_changes(self, language):
        """Return the keys that change with the language of the program, by their dotted names."""
        before = "program.{}".format(self.value("program.language"))
        changes = {before: None} if any(k.startswith(before) for k in self.given) else {}
        return {**changes, "program.language": language}

    def value(self, key, contour=0):
        """Return the value of a dotted key of the job, with its default; None without one."""
        node = self.values or {}
        for part in self.path(key, contour):
            if isinstance(node, list) and isinstance(part, int) and part < len(node):
                node = node[part]
            elif isinstance(node, dict):
                node = node.get(part)
            else:
                return None
        return node

    def path(self, key, contour=0):
        """Return a dotted key as a path; `contour.x` is of the contour with this index."""
        path = [int(part) if part.isdigit() else part for part in key.split(".")]
        if path[0] == "contour" and len(path) > 1 and not isinstance(path[1], int):
            path.insert(1, contour)
        return path

    def export(self):
        """Write program, job and drawing into the folder of the job, once the process says it."""
        self._refuse_lost()
        self._export = self.revision
        self.ask("program")

    def export_folder(self):
        """Return the folder of programs: chosen, of the document, or where files were opened."""
        if self.job is not None and self.job.Folder:
            return self.job.Folder
        if self.document.FileName:
            return os.path.dirname(self.document.FileName)
        last = App.ParamGet(LAST_FOLDER).GetString("FileOpenSavePath", "")
        last = last if os.path.isdir(last) else os.path.dirname(last)
        return last or os.path.expanduser("~")

    def relaxations(self):
        """Return the changes that would make missing paths: contour, number, and text of each."""
        return [
            (contour, index, each["label"])
            for contour, none in self.none.items()
            if none["revision"] == self.revision
            for index, each in enumerate(none["relaxations"] or [])
        ]

    def lost(self):
        """Return why contours cannot be cut as the model is now."""
        contours = self.job.Contours if self.job is not None else []
        return ["{}: {}".format(each.Label, each.Problem) for each in contours if each.Problem]

    # The motion.

    def play(self, playing=True):
        """Play the motion, or stop it where it is."""
        self.playing = playing and bool(self.timeline.spans)
        if self.playing and self.t >= self.timeline.total:
            self.t = 0.0
        self._last = time.monotonic()
        self._player.start(FRAME) if self.playing else self._player.stop()
        self.shown.emit()

    def seek(self, t):
        """Show the robot at a time of the motion, s."""
        self.t = min(max(t, 0.0), self.timeline.total)
        self._show_moment()

    def moment(self):
        """Return what `Timeline.at` returns for the time that is shown; None without a motion."""
        return self.timeline.at(self.t) if self.timeline.spans else None

    def _play(self):
        now = time.monotonic()
        self.t, self._last = self.t + now - self._last, now
        if self.t >= self.timeline.total:
            self.t = self.timeline.total
            self.play(False)
        self._show_moment()

    def _show_moment(self):
        robot = self.job.Robot if self.job is not None else None
        if robot is None or self.scene is None:
            return
        moment = self.moment()
        q = moment[0] if moment else self.scene["sample"]["q"]
        if len(q) == len(self.scene["robot"]["joints"]):
            robot.ViewObject.Proxy.show_frames(motion.frames(self.scene["robot"], q))
        self.shown.emit()

    # What comes from the process.

    def _tick(self):
        if self.studio is None or getattr(self.document, "Recomputing", False):
            return  # a recompute of FreeCAD lets timers run
        self._send_text()  # first: what the process says may be of before a change of the document
        for message in self.studio.heard():
            kind = message["type"]
            take = getattr(self, "_take_" + kind, None)
            if take is not None:
                try:
                    take(message)
                except (geometry.PickError, ProcessError) as error:
                    self._say(str(error))
            self.heard.emit(kind)
            if self.studio is None:
                return
        self._follow()

    def _send_text(self):
        """Send the text of the job if the document has changed it, as by undo."""
        if self.job is None or self.text is None:
            return
        text = self.job.Job
        if text != (self.text if self._pending is None else self._pending):
            self._pending = text
            self.studio.send("text", text=text)

    def _follow(self):
        """Send new shapes and places of the document."""
        if self.job is None or self.text is None:
            return
        if self.moved and time.monotonic() - self.moved > QUIET and self._pending is None:
            self.moved = 0.0
            names = {"file": self._written(self.part), "lines": self._lines_written()}
            self.edit("drawing", [
                (["part", key], name) for key, name in names.items()
                if name and self.value("part." + key) not in (None, name)
            ])  # fmt: skip
            self._send_places()

    def _take_ended(self, message):
        self._end()
        self._timer.stop()
        self._pending = None
        self.progress = {"busy": False, "label": "", "done": 0, "total": 0}
        self._say(message["message"])

    def _take_error(self, message):
        if message["about"] == "text":
            self.text, self._pending = self._pending, None
        if message["about"] == "program":
            self._export = None
        self._say(message["message"])

    def _take_job(self, message):
        if self._pending is not None:
            if message["text"] != self._pending:
                return  # of before what the document has now
            self._pending = None
        self.text, self.revision = message["text"], message["revision"]
        self.values, self.given = message["values"], message["given"]
        self.faults = [fault["message"] for fault in message["faults"]]
        if self.job is None:
            if self._cut and self._asked() == self._cut:
                self._make()
        elif message["text"] != self.job.Job:
            self._apply()
        else:
            self.moved = time.monotonic()  # the places of the document count, as after undo

    def _take_options(self, message):
        self.options = message

    def _take_part(self, message):
        closed = [each for each in message["loops"] if each["closed"]]
        self._loops = [geometry.Loop(each, message["T"]) for each in closed]
        self._rename()
        self._resolve()
        lines = set(self._new_lines)
        if lines and lines <= {each["name"] for each in message["loops"]} - self._asked():
            self._label, self._cut = tr("Cut"), lines
            self.ask("cut", loops=sorted(lines), alone=self.job is None)

    def _asked(self):
        """Return the loops that the job cuts."""
        return {table.get("pick") for table in (self.values or {}).get("contour", [])}

    def _take_scene(self, message):
        self.scene = message
        if message["contours"]:
            names = {each["name"] for each in message["contours"]}
            for held in (self.plans, self.none, self.maps):
                for gone in held.keys() - names:
                    del held[gone]
        self._show_robot()

    def _take_progress(self, message):
        self.progress = message

    def _take_plan(self, message):
        self.none.pop(message["contour"], None)
        held = self.plans.setdefault(message["contour"], {})
        if any(one["revision"] != message["revision"] for one in held.values()):
            held.clear()
        held[message["name"]] = message
        if message["checks"] is not None:
            self.ask("map", contour=message["contour"])
        self._new_motion()

    def _take_nopath(self, message):
        self.plans.pop(message["contour"], None)
        self.none[message["contour"]] = message
        self.ask("map", contour=message["contour"])
        self._new_motion()

    def _take_program(self, message):
        self.program = message
        self._new_motion()

    def _take_outcome(self, message):
        self.outcome = message

    def _take_map(self, message):
        self.maps[message["contour"]] = message

    def _take_program_text(self, message):
        asked, self._export = self._export, None
        if asked is None:
            return
        self._refuse_lost()
        folder = self.export_folder()
        files = {each["name"]: each["text"].encode() for each in message["files"]}
        fixtures = (self.values.get("cell") or {}).get("fixture") or []
        tables = (self.values["part"], *fixtures)
        for name in [table.get(key) for table in tables for key in ("file", "lines")]:
            if name:
                with open(os.path.join(self._folder, name), "rb") as file:
                    files[name] = file.read()
        files[self._job_name()] = self.text.encode()
        try:
            for name, content in files.items():
                _write(os.path.join(folder, name), content)
        except OSError as error:
            raise ProcessError(
                tr("{} cannot be written ({}); choose another folder").format(
                    error.filename or folder, error.strerror
                )
            ) from None
        self.exported = [os.path.join(folder, name) for name in files]
        App.Console.PrintMessage("kerfpath: wrote {}\n".format(", ".join(self.exported)))
        self.heard.emit("exported")

    # Contours.

    def _resolve(self):
        """Send which loops are to be cut, once they are known."""
        if self._picks is None or not self._loops:
            return
        picks, self._picks = self._picks, None
        picked = [loop.name for loop in geometry.loops_of(picks, self._loops)]
        for name in picked:  # all edges of the model must be there
            geometry.edges_on(self._loop(name), objects.edges_of(self.part))
        if self.job is None:
            self._cut = set(picked)
            self.ask("cut", loops=picked, alone=True)
            return
        cut = {each.Loop for each in self.job.Contours}
        new = [name for name in picked if name not in cut]
        if not new:
            self._say(tr("{} is already cut; pick another loop").format(", ".join(picked)))
            return
        self._label = tr("Cut")
        self.ask("cut", loops=new)

    def _loop(self, name):
        found = next((loop for loop in self._loops if loop.name == name), None)
        if found is None:
            raise geometry.PickError(tr("the drawing has no loop {} any more").format(name))
        return found

    def _rename(self):
        """Name the loops of the contours as the drawing does after a change of the model."""
        if self.job is None or not self.values or self.lost():
            return
        tables, changes, edges = self.values["contour"], [], objects.edges_of(self.part)
        for contour in self.job.Contours:
            if objects.is_line(contour):
                continue
            index = next((i for i, t in enumerate(tables) if t.get("pick") == contour.Loop), None)
            names = objects.names_of(contour)
            group = {contour.Label: [[edges[int(name[4:]) - 1] for name in names]]}
            (loop,) = geometry.loops_of(group, self._loops)
            if index is not None and loop.name != contour.Loop:
                changes.append((["contour", index, "pick"], loop.name))
                contour.Loop = loop.name
        self.edit("drawing", changes)

    def _apply(self):
        """Take the text of the process into the document, with its robot and contours."""
        quiet = self._label in UNNAMED
        label, self._label = self._label or tr("Change the job"), ""
        with self._transaction(None if quiet else "Kerfpath: " + label):
            self.job.Job = self.text
            self._place_robot()
            if self.values and self._loops:
                self._match_contours()

    def _make(self):
        """Make the objects of a new job, as one step of undo."""
        with self._transaction(tr("Kerfpath: Cut")):
            self.job = objects.make_job(self.document, self.part)
            self.job.Job = self.text
            self._place_robot()
            self._match_contours()
        self._label = ""
        self._show_robot()

    def _match_contours(self):
        tables = self.values["contour"]
        wanted = {table["pick"]: i for i, table in enumerate(tables) if table.get("pick")}
        for contour in list(self.job.Contours):
            if contour.Loop not in wanted:
                self.job.Contours = [each for each in self.job.Contours if each != contour]
                self.document.removeObject(contour.Name)
        known = {each.Loop for each in self.job.Contours}
        edges = objects.edges_of(self.part)
        for name, index in wanted.items():
            if name in known:
                continue
            on, normals = self._new_lines.pop(name, (None, None))
            if on is None:
                on = geometry.edges_on(self._loop(name), edges)
            label = tables[index].get("name") or name
            objects.make_contour(self.job, on, name, label, normals)

    @contextmanager
    def _transaction(self, name):
        if name:
            self.document.openTransaction(name)
        try:
            yield
            self.document.recompute()
        except BaseException:
            if name:
                self.document.abortTransaction()
            raise
        if name:
            self.document.commitTransaction()

    def _refuse_lost(self):
        if self.lost():
            raise ProcessError("; ".join(self.lost()))

    # Places.

    def _place_robot(self):
        """Put the robot where the job has it, as seen from the part."""
        if self.values is None:
            return
        place = _global(self.part).multiply(_pose(self.values["part"]).inverse())
        if not _alike(place, self.job.Robot.Placement):
            self.job.Robot.Placement = place
        self.job.Robot.Model = str(self.value("robot.model") or "")

    def _send_places(self):
        """Send where part and fixtures are, as seen from the robot."""
        if self.values is None or self.job.Robot is None:
            return
        base = self.job.Robot.Placement.inverse()
        part, changes = base.multiply(_global(self.part)), []
        if not _alike(part, _pose(self.values["part"])):
            changes += [(["part", key], value) for key, value in _keys(part).items()]
        fixtures = [self._fixture(each, base) for each in self.job.Fixtures]
        tables = (self.values.get("cell") or {}).get("fixture") or []
        now = [{k: table.get(k) for k in ("name", "file", "xyz_mm", "rpy_deg")} for table in tables]
        if [_rounded(each) for each in fixtures] != [_rounded(each) for each in now]:
            if not self.values.get("cell"):
                changes.append((["cell", "near_miss_mm"], NEAR_MISS))
            changes.append((["cell", "fixture"], fixtures or None))
        self.edit("place", changes)
        for contour in self.job.Contours:
            if not _alike(contour.Placement, _global(self.part)):
                contour.Placement = _global(self.part)

    def _fixture(self, obj, base):
        place = _keys(base.multiply(_global(obj)))
        return {"name": obj.Label, "file": self._written(obj), **place}

    def _job_name(self):
        return _safe(self.part.Label) + ".toml"

    def _written(self, obj):
        """Return the name of the file with the shape of an object; a new shape has a new file."""
        now, (before, name, number) = _signature(obj), self._files.get(obj.Name, (None, "", 0))
        if now != before:
            number, stem = number + 1, _safe(obj.Label)
            while True:
                name = "{}{}.step".format(stem, "-{}".format(number) if number > 1 else "")
                if not os.path.exists(os.path.join(self._folder, name)):
                    break
                number += 1
            shape = obj.Shape.copy()
            shape.Placement = App.Placement()
            shape.exportStep(os.path.join(self._folder, name))
            self._files[obj.Name] = now, name, number
        return name

    def _lines_written(self):
        """Return the name of the file with the open lines; other lines have a new file.

        It is None without lines, and that of the job where one of them is lost.
        """
        contours = self.job.Contours if self.job is not None else []
        lines = {
            each.Loop: (objects.names_of(each), objects.normals_of(each))
            for each in contours
            if objects.is_line(each)
        }
        lines.update(self._new_lines)
        if not lines or self.lost():
            return self.value("part.lines")
        shape = objects.own_shape(self.part)
        text = geometry.table({n: objects.line_of(shape, *each) for n, each in lines.items()})
        before, name, number = self._files.get("", (None, "", 0))
        if text != before:
            number += 1
            ending = "-{}".format(number) if number > 1 else ""
            name = "{}-lines{}.csv".format(_safe(self.part.Label), ending)
            _write(os.path.join(self._folder, name), text.encode())
            self._files[""] = text, name, number
        return name

    # The robot in the view.

    def _show_robot(self):
        if self.job is None or self.scene is None or self.job.Robot is None:
            return
        bodies = []
        for body in self.scene["bodies"]:
            if body["kind"] in ("robot", "head"):
                colour = _colour(body["colour"]) or (HEAD if body["kind"] == "head" else ROBOT)
                bodies.append((body["frame"], colour, *self._mesh(body["mesh"])))
        self.job.Robot.ViewObject.Proxy.show_bodies(bodies)
        self._show_moment()

    def _mesh(self, name):
        """Return points (m) and triangles of a mesh."""
        if name not in self._meshes:
            data = self.studio.get("/mesh/" + name)
            nv, nt = unpack_from("<II", data)
            flat = unpack_from("<{}f".format(3 * nv), data, 8)
            corners = unpack_from("<{}I".format(3 * nt), data, 8 + 12 * nv)
            points = [flat[i : i + 3] for i in range(0, len(flat), 3)]
            self._meshes[name] = points, [corners[i : i + 3] for i in range(0, len(corners), 3)]
        return self._meshes[name]

    def _new_motion(self):
        order = [each["name"] for each in (self.scene or {}).get("contours", [])]
        plans = [plan for name in order for plan in self.plans.get(name, {}).values()]
        program = self.program
        if program and any(plan["revision"] > program["revision"] for plan in plans):
            program = None
        self.timeline = motion.Timeline(program, plans)
        self.t = min(self.t, self.timeline.total)
        self._show_moment()

    def _say(self, text):
        self.problem = text
        App.Console.PrintWarning("kerfpath: {}\n".format(text))
        self.heard.emit("problem")


# -----------------------------------------------------------------------------
# Placements, shapes and files.


def _pose(table):
    """Return the placement of a table with xyz_mm and rpy_deg."""
    roll, pitch, yaw = table["rpy_deg"]
    return App.Placement(App.Vector(*table["xyz_mm"]), App.Rotation(yaw, pitch, roll))


def _keys(place):
    """Return a placement as the keys xyz_mm and rpy_deg."""
    yaw, pitch, roll = place.Rotation.toEuler()
    return {
        "xyz_mm": [round(value, DIGITS) + 0.0 for value in place.Base],
        "rpy_deg": [round(value, DIGITS) + 0.0 for value in (roll, pitch, yaw)],
    }


def _alike(one, other):
    moved = one.inverse().multiply(other)
    return moved.Base.Length < NEAR and abs(moved.Rotation.Angle) < NEAR / 57.3


def _rounded(table):
    return {k: [round(x, 3) for x in v] if isinstance(v, list) else v for k, v in table.items()}


def _global(obj):
    return obj.getGlobalPlacement()


def _signature(obj):
    """Return what changes if the shape of an object does, wherever it is."""
    edges = objects.edges_of(obj)
    return tuple((round(e.Length, 5), *(round(x, 5) for x in e.CenterOfMass)) for e in edges)


def _safe(name):
    return re.sub(r"[^\w.-]+", "_", name).strip("_.") or "part"


def _colour(text):
    if not re.match(r"#[0-9a-fA-F]{6}$", text):
        return None
    return tuple(int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))


def _write(path, content):
    """Write a file under a temporary name, and rename it then."""
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path + ".tmp", "wb") as file:
        file.write(content)
    os.replace(path + ".tmp", path)
