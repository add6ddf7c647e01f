"""The commands of the workbench."""

import os
import threading

import FreeCAD as App
import FreeCADGui as Gui
from PySide import QtCore, QtGui

try:
    from PySide import QtWidgets
except ImportError:  # FreeCAD 0.20 and 0.21 have them all in QtGui
    QtWidgets = QtGui

from . import VERSION, geometry, icon, objects, panel, process, session, tr

TOOLBAR = [
    "Kerfpath_Cut",
    "Kerfpath_Line",
    "Kerfpath_Remove",
    "Kerfpath_Fixture",
    "Kerfpath_Plan",
    "Kerfpath_Program",
]
"""The commands, in the order of toolbar and menu."""
WITH_STUDIO = "kerfpath[studio]=={}".format(VERSION)
"""What the workbench installs, unless its preference `Requirement` says something else."""

boxes = []
"""Open messages; they wait for nobody."""


def tell(text, install=False):
    """Show a message, which may offer to install kerfpath; it does not wait for an answer."""
    App.Console.PrintWarning("kerfpath: {}\n".format(text))
    box = QtWidgets.QMessageBox(Gui.getMainWindow())
    box.setWindowTitle(tr("Kerfpath"))
    box.setText(text)
    box.setModal(False)
    box.setAttribute(QtCore.Qt.WA_DeleteOnClose)
    box.addButton(QtWidgets.QMessageBox.Close)
    if install:
        button = box.addButton(tr("Install kerfpath"), QtWidgets.QMessageBox.AcceptRole)
        button.clicked.connect(install_kerfpath)
    boxes[:] = [box]
    box.show()


# -----------------------------------------------------------------------------
# Install kerfpath.


class _Installation(QtCore.QObject):
    """The installation of kerfpath in a thread."""

    done = QtCore.Signal(str)

    def __init__(self):
        super().__init__()
        self.done.connect(lambda said: tell(said or tr("kerfpath is installed; go on")))
        threading.Thread(target=self._work, daemon=True).start()

    def _work(self):
        wanted = App.ParamGet(session.PREFERENCES).GetString("Requirement", WITH_STUDIO)
        try:
            process.install(session.own_environment(), wanted)
            self.done.emit("")
        except process.ProcessError as error:
            self.done.emit(str(error))


def install_kerfpath():
    """Install kerfpath in an environment of the workbench, which takes some minutes."""
    global installation
    tell(tr("Installing kerfpath; this takes some minutes. A message says when it is done."))
    installation = _Installation()


installation = None


# -----------------------------------------------------------------------------
# What is picked.


def picked():
    """Return the object whose edges or faces are selected, and their names.

    Raises
    ------
    PickError
        Nothing of the kind is selected, or parts of several objects are.
    """
    found, picks = [], []
    for each in Gui.Selection.getSelectionEx():
        if isinstance(getattr(each.Object, "Proxy", None), objects.Contour):
            continue
        names = [name.rsplit(".", 1)[-1] for name in each.SubElementNames]
        names = [name for name in names if name.startswith(("Edge", "Face"))]
        if not names:
            continue
        found.append(each.Object)
        picks += names
    if not found:
        raise geometry.PickError(
            tr("nothing to cut is picked: pick edges or faces of the part first")
        )
    if len(found) > 1:
        labels = " and ".join(each.Label for each in found)
        raise geometry.PickError(tr("edges of one part are cut at a time, got those of ") + labels)
    return found[0], picks


def groups_of(part, names):
    """Return edges and faces of an object as `geometry.loops_of` takes them."""
    shape, groups = objects.own_shape(part), {}
    for name in names:
        number = int(name[4:]) - 1
        if name.startswith("Edge"):
            groups[name] = [[shape.Edges[number]]]
        else:
            groups[name] = [wire.Edges for wire in shape.Faces[number].Wires]
    return groups


def contours_picked():
    """Return the contours that are selected."""
    return [
        each for each in Gui.Selection.getSelection()
        if isinstance(getattr(each, "Proxy", None), objects.Contour)
    ]  # fmt: skip


def open_panel(job):
    """Start the process of a job, and show its panel; return the session, or None."""
    return _at_work(job.Document, job.Part)


def remove_contours(contours):
    """Take contours out of the job."""
    at_work = _at_work(contours[0].Document, None)
    if at_work is not None:
        at_work.remove(contours)


def _at_work(document, part):
    try:
        found = session.session_of(document, part)
    except process.ProcessError as error:
        tell(str(error), install=isinstance(error, process.NotFound))
        return None
    panel.show(found)
    return found


# -----------------------------------------------------------------------------
# The commands.


class _Command:
    """A command; `NAME` is that of its icon."""

    NAME = MENU = TIP = KEYS = ""

    def GetResources(self):
        return {
            "Pixmap": icon(self.NAME),
            "MenuText": tr(self.MENU),
            "ToolTip": tr(self.TIP),
            "Accel": self.KEYS,
        }

    def IsActive(self):
        return App.ActiveDocument is not None

    def Activated(self):
        try:
            self.run()
        except (geometry.PickError, process.ProcessError) as error:
            tell(str(error))


class Cut(_Command):
    """Contours of what is picked."""

    NAME, KEYS = "contour", "K, C"
    MENU = "Cut what is picked"
    TIP = "Cut the loops of the picked edges or faces: plans at once, and shows the panel"

    def run(self):
        part, names = picked()
        groups = groups_of(part, names)
        self.begin(part, lambda at_work: at_work.cut(groups))

    def begin(self, part, cut):
        """Call `cut` with the session of the part."""
        job = session.job_of(part.Document)
        if job is not None and job.Part != part:
            raise geometry.PickError(
                tr(
                    "the job of this document cuts {}, picked is {}; pick an edge of the first, or "
                    "delete the job"
                ).format(job.Part.Label, part.Label)
            )
        Gui.Selection.clearSelection()
        found = _at_work(part.Document, part)
        if found is not None:
            found.problem = ""
            cut(found)


class Line(Cut):
    """Open lines of the picked edges."""

    NAME, KEYS = "line", "K, L"
    MENU = "Cut these edges only"
    TIP = "Cut the picked edges from end to end; a face that is picked, too, says from which side"

    def run(self):
        part, names = picked()
        lines = objects.lines_in(part, names)
        self.begin(part, lambda at_work: at_work.cut_lines(lines))


class Remove(_Command):
    """Contours taken out of the job."""

    NAME, KEYS = "remove", "K, R"
    MENU = "Do not cut"
    TIP = "Take the selected contours out of the job"

    def IsActive(self):
        return bool(App.ActiveDocument and contours_picked())

    def run(self):
        remove_contours(contours_picked())


class _JobCommand(_Command):
    """A command for a document with a job."""

    def IsActive(self):
        return bool(App.ActiveDocument and session.job_of(App.ActiveDocument))


class Fixture(_JobCommand):
    """What the robot keeps clear of."""

    NAME, KEYS = "fixture", "K, F"
    MENU = "Keep clear of it"
    TIP = "The selected solids become fixtures, or no fixtures any more: the plan avoids collisions"

    def run(self):
        job = session.job_of(App.ActiveDocument)
        chosen = [
            each for each in Gui.Selection.getSelection()
            if hasattr(each, "Shape") and each.Shape.Solids and each != job.Part
        ]  # fmt: skip
        if not chosen:
            raise geometry.PickError(tr("select solids other than the part first"))
        left = [each for each in job.Fixtures if each not in chosen]
        new = [each for each in chosen if each not in job.Fixtures]
        job.Document.openTransaction(tr("Kerfpath: Fixtures"))
        job.Fixtures = left + new
        job.Document.commitTransaction()
        _at_work(job.Document, job.Part)


class Plan(_JobCommand):
    """The panel of the job."""

    NAME, KEYS = "kerfpath", "K, P"
    MENU = "Plan and play"
    TIP = "Show the panel of the job: plan, play, settings, program"

    def run(self):
        open_panel(session.job_of(App.ActiveDocument))


class Program(_Command):
    """The program, written."""

    NAME, KEYS = "program", "K, W"
    MENU = "Write the program"
    TIP = "Write the audited program, the job and the drawing"

    def IsActive(self):
        found = session.running(App.ActiveDocument) if App.ActiveDocument else None
        return bool(found and found.outcome)

    def run(self):
        session.running(App.ActiveDocument).export()


def add_commands():
    """Add the commands to FreeCAD."""
    for command in (Cut, Line, Remove, Fixture, Plan, Program):
        Gui.addCommand("Kerfpath_" + command.__name__, command())


def add_languages():
    """Tell FreeCAD where the translations are."""
    Gui.addLanguagePath(os.path.join(os.path.dirname(icon("")), "..", "translations"))
    Gui.updateLocale()
