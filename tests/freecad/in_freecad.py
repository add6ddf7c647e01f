"""The workbench in a running FreeCAD, run by `test_workbench.py`: results and pictures.

Each scenario is a generator, which yields seconds to wait. FreeCAD runs this file with its own
Python: nothing of kerfpath is imported but the workbench.
"""

import json
import math
import os
import sys
import time
import traceback

import FreeCAD as App
import FreeCADGui as Gui
import ImportGui
import Part
import pivy.coin  # noqa: F401  # FreeCAD 1.0 gives the camera of a view only after it
from PySide import QtCore, QtGui

OUT, PART = os.environ["KERFPATH_TEST_OUT"], os.environ["KERFPATH_TEST_PART"]
LONGEST = 150
"""s until a step of a scenario has failed."""
results = {}


def picture(name):
    """Photograph the window, without what FreeCAD says of itself."""
    dock = Gui.getMainWindow().findChild(QtGui.QWidget, "Report view")
    if dock is not None:
        dock.hide()
    for _ in range(5):
        Gui.updateGui()
    QtGui.QApplication.primaryScreen().grabWindow(0).save(os.path.join(OUT, name + ".png"))


def until(fits, what):
    """Wait until something is so."""
    begun = time.time()
    while not fits():
        if time.time() - begun > LONGEST:
            raise AssertionError("waited in vain until " + what)
        yield 0.1


def workbench():
    from freecad.kerfpath_wb import commands, panel, session

    return commands, panel, session


def plate(holes, thickness=3):
    """A new document with a plate, and holes (x, y, radius); return document and plate."""
    document = App.newDocument("Plate")
    document.UndoMode = 1
    shape = Part.makeBox(200, 120, thickness)
    last = document.addObject("Part::Feature", "Box")
    last.Shape = shape
    for x, y, radius in holes:
        last = drilled(document, last, x, y, radius)
    document.recompute()
    Gui.SendMsgToActiveView("ViewFit")
    return document, last


def drilled(document, plate, x, y, radius):
    """A plate with one more hole."""
    tool = document.addObject("Part::Cylinder", "Drill")
    tool.Radius, tool.Height, tool.Placement.Base = radius, 90, App.Vector(x, y, -5)
    cut = document.addObject("Part::Cut", "Cut")
    cut.Base, cut.Tool = plate, tool
    return cut


def rim(obj, x, y, top=True):
    """The name of the edge of a hole that is on top."""
    height = obj.Shape.BoundBox.ZMax if top else obj.Shape.BoundBox.ZMin
    for i, edge in enumerate(obj.Shape.Edges):
        if isinstance(edge.Curve, Part.Circle):
            c = edge.Curve.Center
            if math.dist(c, (x, y, height)) < 0.1 and len(edge.Vertexes) == 1:
                return "Edge{}".format(i + 1)
    raise AssertionError("no rim there")


def cut(document, obj, *names):
    """Pick by name, and cut; return the session."""
    _, _, session = workbench()
    Gui.Selection.clearSelection()
    for name in names:
        Gui.Selection.addSelection(document.Name, obj.Name, name)
    Gui.runCommand("Kerfpath_Cut")
    return session.running(document)


def passed(at_work):
    """Whether the newest job is planned, with a program."""
    outcome = at_work.outcome
    return outcome and outcome["revision"] == at_work.revision and outcome["passed"]


def fitted():
    """Show the robot and all else."""
    Gui.activeDocument().activeView().viewIsometric()
    Gui.SendMsgToActiveView("ViewFit")
    yield 1.0


def quick(at_work):
    """Make the job quick to plan, once it is there."""
    yield from until(lambda: at_work.job is not None, "the job is there")
    at_work.edit("Quick", [(["sequence"], None), (["plan", "certify"], False),
                           (["plan", "gamma_step_deg"], 5), (["plan", "posture"], "front/up/plus"),
                           (["contour", 0, "spacing_mm"], 4)])  # fmt: skip
    yield from until(lambda: at_work.value("plan.certify") is False, "it is quick")


def alive(pid):
    try:
        os.kill(pid, 0)
    except OSError:
        return False
    return True


def click(position, button=QtCore.Qt.LeftButton):
    """Click into the 3-D view at pixels from below left."""
    view = Gui.activeDocument().activeView()
    port = view.graphicsView().viewport()
    place = QtCore.QPointF(position[0], port.height() - 1 - position[1])
    none = QtCore.Qt.NoButton
    for kind, pressed, held in (
        (QtCore.QEvent.MouseMove, none, none),
        (QtCore.QEvent.MouseButtonPress, button, button),
        (QtCore.QEvent.MouseButtonRelease, button, none),
    ):
        event = QtGui.QMouseEvent(kind, place, port.mapToGlobal(place.toPoint()), pressed, held,
                                  QtCore.Qt.NoModifier)  # fmt: skip
        QtCore.QCoreApplication.postEvent(port, event)


def pixel_of(view, edge, component):
    """A pixel at which an edge is seen."""
    for point in edge.discretize(Number=9)[2:-2]:  # not its vertex
        x, y = view.getPointOnScreen(point)
        for dx, dy in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (2, 0), (-2, 0), (0, 2), (0, -2)):
            info = view.getObjectInfo((x + dx, y + dy))
            if info and info.get("Component") == component:
                return x + dx, y + dy
    raise AssertionError("{} is not seen".format(component))


# -----------------------------------------------------------------------------


def the_shipped_part():
    """From the opened file to a program: clicks are counted, and only the speed is typed."""
    _, panel, session = workbench()
    # As the dialog of File, Open does, which remembers the folder.
    general = App.ParamGet("User parameter:BaseApp/Preferences/General")
    general.SetString("FileOpenSavePath", os.path.dirname(PART))
    ImportGui.open(PART)
    document = App.ActiveDocument
    document.UndoMode = 1
    clicks = 0
    Gui.activateWorkbench("KerfpathWorkbench")
    clicks += 2  # the list of workbenches, and its line
    view = Gui.activeDocument().activeView()
    view.viewTop()
    Gui.SendMsgToActiveView("ViewFit")
    (obj,) = document.Objects
    top = obj.Shape.Faces[53]
    holes = [w for w in top.Wires if not w.isSame(top.OuterWire)]
    hole = sorted((w for w in holes if len(w.Edges) == 1), key=lambda w: w.Length)[-1]
    edges = obj.Shape.Edges
    name = next("Edge{}".format(i + 1) for i, e in enumerate(edges) if e.isSame(hole.Edges[0]))
    camera = view.getCameraNode()
    middle = hole.BoundBox.Center
    camera.position.setValue(middle.x, middle.y, camera.position.getValue()[2])
    camera.height.setValue(140)
    yield 0.8
    place = pixel_of(view, hole.Edges[0], name)
    click(place)
    clicks += 1
    yield from until(Gui.Selection.getSelectionEx, "something is selected")
    found = [list(each.SubElementNames) for each in Gui.Selection.getSelectionEx()]
    assert found == [[name]], (found, name, place, view.getSize())
    picture("picked")
    Gui.runCommand("Kerfpath_Cut")
    clicks += 1
    at_work = session.running(document)
    yield from until(lambda: at_work.job is not None and at_work.values, "the job is there")
    assert [c.Loop for c in at_work.job.Contours] == [t["pick"] for t in at_work.values["contour"]]
    shown = panel.shown
    shown.speed.setValue(2.0)  # typed
    clicks += 1  # into the field
    yield from until(
        lambda: (
            at_work.value("contour.speed_m_min") == 2.0 and "speed_m_min = 2.0" in at_work.job.Job
        ),
        "the speed is in the document",
    )
    view.viewIsometric()
    Gui.SendMsgToActiveView("ViewFit")
    yield from until(lambda: at_work.progress["busy"] and at_work.progress["total"], "it plans")
    picture("planning")
    yield from until(lambda: passed(at_work), "there is a plan")
    scene = at_work.scene
    from freecad.kerfpath_wb import motion

    tip = motion.frames(scene["robot"], scene["sample"]["q"])[-1]
    assert max(abs(a - b) for a, b in zip(tip, scene["sample"]["T"])) < 1e-12
    yield from until(lambda: at_work.maps, "the map is there")
    shown.play.click()
    begun = at_work.t
    yield 1.0
    assert at_work.playing or at_work.t == at_work.timeline.total
    assert at_work.t > begun
    at_work.play(False)
    # In the middle of the cut the tip is on the contour, as it stands in the document.
    (plan,) = (each for held in at_work.plans.values() for each in held.values())
    node = len(plan["time"]) // 2
    at_work.seek(at_work.timeline.when(plan["name"], node))
    T = motion.frames(scene["robot"], at_work.moment()[0])[-1]
    base = at_work.job.Robot.Placement
    point = base.multVec(App.Vector(*(1e3 * T[i] for i in (3, 7, 11))))
    near = Part.Vertex(point).distToShape(at_work.job.Contours[0].Shape)[0]
    assert near < 0.05, near
    picture("playing")
    clicks += 1
    shown.write.click()
    clicks += 1
    yield from until(lambda: at_work.exported, "the program is written")
    picture("program")
    results["exported"] = at_work.exported
    results["clicks"] = clicks
    assert clicks <= 12
    tabs = shown.settings.parent().parent()
    tabs.setCurrentWidget(shown.settings)
    shown.settings.group.setCurrentIndex(0)
    picture("settings")
    # Saved, closed and opened again: the same job, and it plans again.
    file = os.path.join(OUT, "part.FCStd")
    document.saveAs(file)
    text, pid = at_work.job.Job, at_work.studio.pid
    App.closeDocument(document.Name)
    yield from until(lambda: not alive(pid), "the process has ended")
    document = App.openDocument(file)
    job = session.job_of(document)
    assert job.Job == text
    assert job.Contours[0].Proxy.__class__.__name__ == "Contour"
    commands, _, _ = workbench()
    again = commands.open_panel(job)
    yield from until(lambda: again.values and again._loops, "it is read again")
    assert again.job.Job == text, again.job.Job
    App.closeDocument(document.Name)


def steps_of_undo():
    """Every command is one step; the process follows."""
    _, panel, session = workbench()
    document, obj = plate([(60, 60, 15), (140, 60, 12)])
    at_work = cut(document, obj, rim(obj, 60, 60))
    yield from until(lambda: at_work.job is not None, "the job is there")
    assert document.UndoNames == ["Kerfpath: Cut"]
    cut(document, obj, rim(obj, 140, 60))
    yield from until(lambda: len(at_work.job.Contours) == 2, "there are two")
    panel.shown._speed(1.5)
    yield from until(lambda: at_work.job.Job.count("speed_m_min = 1.5") == 2, "both are slower")
    assert document.UndoNames == ["Kerfpath: Speed", "Kerfpath: Cut", "Kerfpath: Cut"]
    document.undo()
    assert "speed_m_min = 1.5" not in at_work.job.Job
    yield from until(lambda: at_work.text == at_work.job.Job, "the process knows")
    document.undo()
    assert len(at_work.job.Contours) == 1
    yield from until(lambda: at_work.text == at_work.job.Job, "the process knows")
    document.redo()
    document.redo()
    assert len(at_work.job.Contours) == 2
    yield from until(lambda: at_work.text == at_work.job.Job, "the process knows")
    assert at_work.job.Job.count("speed_m_min = 1.5") == 2
    # A setting of the form, by its control.
    settings = panel.shown.settings
    settings.refresh()
    settings._set(next(f for g in at_work.options["groups"] for f in g["fields"]
                       if f["key"] == "plan.gamma_step_deg"), 3)  # fmt: skip
    yield from until(lambda: "gamma_step_deg = 3" in at_work.job.Job, "the step is in the job")
    # A contour less.
    workbench()[0].remove_contours([at_work.job.Contours[0]])
    yield from until(lambda: len(at_work.job.Contours) == 1, "one is gone")
    assert at_work.job.Job.count("[[contour]]") == 1
    assert document.UndoNames[0] == "Kerfpath: Remove contours"
    while document.UndoCount:
        document.undo()
    assert session.job_of(document) is None
    yield 0.3
    assert session.running(document) is None
    assert not Gui.Control.activeDialog()
    App.closeDocument(document.Name)


def a_robot_that_is_moved():
    """The places of the document are those of the job; a fixture makes a cell."""
    commands, _, session = workbench()
    document, obj = plate([(60, 60, 15)])
    at_work = cut(document, obj, rim(obj, 60, 60))
    yield from quick(at_work)
    yield from until(lambda: passed(at_work), "it is planned")
    job, before = at_work.job, at_work.values["part"]["xyz_mm"]
    place = job.Robot.Placement
    job.Robot.Placement = App.Placement(place.Base + App.Vector(0, 0, -40), place.Rotation)
    yield from until(
        lambda: math.dist(at_work.values["part"]["xyz_mm"], before) > 1, "the job has the move"
    )
    moved = [b - a for a, b in zip(before, at_work.values["part"]["xyz_mm"])]
    turned = place.Rotation.inverted().multVec(App.Vector(0, 0, 40))
    assert math.dist(moved, turned) < 1e-3, moved
    block = document.addObject("Part::Box", "Block")
    block.Placement.Base = App.Vector(60, 200, -60)
    document.recompute()
    Gui.Selection.clearSelection()
    Gui.Selection.addSelection(document.Name, block.Name)
    Gui.runCommand("Kerfpath_Fixture")
    yield from until(lambda: (at_work.values or {}).get("cell"), "there is a cell")
    (fixture,) = at_work.values["cell"]["fixture"]
    there = job.Robot.Placement.inverse().multVec(block.Placement.Base)
    assert math.dist(fixture["xyz_mm"], there) < 1e-3, fixture
    yield from until(lambda: passed(at_work) or at_work.faults or at_work.none, "it is judged")
    assert passed(at_work), (at_work.faults, at_work.none)
    yield from fitted()
    picture("fixture")
    App.closeDocument(document.Name)


def faces_and_lines():
    """A face picks all of its loops; edges alone are open lines, on the side of a face."""
    commands, _, session = workbench()
    document, obj = plate([(60, 60, 15)])
    shape = obj.Shape
    top = next(
        i for i, face in enumerate(shape.Faces)
        if face.normalAt(0, 0).z > 0.9 and face.CenterOfMass.z > 2.9
    )  # fmt: skip
    face = "Face{}".format(top + 1)
    by_x = {
        "Edge{}".format(i + 1): edge.CenterOfMass.x
        for i, edge in enumerate(shape.Edges)
        if all(abs(v.Z - 3) < 1e-6 for v in edge.Vertexes) and len(edge.Vertexes) == 2
    }
    right, left = max(by_x, key=by_x.get), min(by_x, key=by_x.get)
    front = next(
        name for name in by_x
        if abs(shape.Edges[int(name[4:]) - 1].CenterOfMass.y) < 1e-6
    )  # fmt: skip
    # The side of a lone edge is not known; two edges of one face are on that.
    Gui.Selection.addSelection(document.Name, obj.Name, right)
    Gui.runCommand("Kerfpath_Line")
    assert right + ": its side is not clear" in commands.boxes[-1].text()
    assert session.running(document) is None
    Gui.Selection.addSelection(document.Name, obj.Name, right)
    Gui.Selection.addSelection(document.Name, obj.Name, front)
    Gui.runCommand("Kerfpath_Line")
    at_work = session.running(document)
    yield from until(lambda: at_work.job is not None, "the job is there")
    (line,) = at_work.job.Contours
    assert (line.Loop, sorted(line.Edges[1])) == ("line1", sorted([right, front]))
    assert document.UndoNames == ["Kerfpath: Cut"]
    assert abs(line.Shape.Length - 320) < 1e-6
    yield from quick(at_work)
    yield from until(lambda: passed(at_work) or at_work.faults or at_work.none, "it is judged")
    assert passed(at_work), (at_work.faults, at_work.none, at_work.outcome)
    # A second line, whose side is that of the face that is picked with it.
    Gui.Selection.addSelection(document.Name, obj.Name, left)
    Gui.Selection.addSelection(document.Name, obj.Name, face)
    Gui.runCommand("Kerfpath_Line")
    yield from until(lambda: len(at_work.job.Contours) == 2, "there are two")
    assert [c.Loop for c in at_work.job.Contours] == ["line1", "line2"]
    # The face alone: its outline, and its hole.
    cut(document, obj, face)
    yield from until(lambda: len(at_work.job.Contours) == 4, "there are four")
    loops = [c.Shape.Length for c in at_work.job.Contours]
    assert abs(sorted(loops)[-1] - 640) < 1e-6, loops
    assert abs(sorted(loops)[0] - 30 * math.pi) < 1e-3, loops
    yield from fitted()
    picture("lines")
    # Longer by another hole and a wider plate: numbers and points follow.
    before = at_work.value("part.lines")
    base = obj
    while base.Name != "Box":
        base = base.Base
    base.Shape = Part.makeBox(200, 130, 3)
    document.recompute()
    lost = [c.Label for c in at_work.job.Contours if c.Problem]
    assert "line1" in lost, lost  # the right edge is another one now
    base.Shape = Part.makeBox(200, 120, 3)
    document.recompute()
    assert not at_work.lost()
    assert at_work.value("part.lines") == before
    App.closeDocument(document.Name)


def a_model_that_changes():
    """An edge with another number is found again; one that is another edge is refused, by name."""
    _, panel, _ = workbench()
    document, obj = plate([(60, 60, 15)])
    # The plate that is cut comes from a hole before: its number changes.
    base = obj.Base
    name = rim(obj, 60, 60)
    at_work = cut(document, obj, name)
    yield from quick(at_work)
    yield from until(lambda: passed(at_work), "it is planned")
    contour = at_work.job.Contours[0]
    before = list(contour.Edges[1])
    revision = at_work.revision
    obj.Base = drilled(document, base, 140, 60, 12)
    document.recompute()
    assert contour.Problem == "", contour.Problem
    x = contour.Shape.BoundBox.Center
    assert math.dist((x.x, x.y), (60, 60)) < 0.1, x  # boxes are not tight
    yield from until(lambda: at_work.revision > revision, "the drawing is another one")
    yield from until(lambda: passed(at_work), "it is planned again")
    (plan,) = (each for held in at_work.plans.values() for each in held.values())
    results["edges"] = [before, list(contour.Edges[1]), contour.Loop, plan["contour"]]
    # The same hole, larger: it is another edge.
    obj.Tool.Radius = 16
    document.recompute()
    assert "Edge" in contour.Problem, contour.Problem
    assert "pick the contour again" in contour.Problem, contour.Problem
    panel.shown.refresh()
    assert contour.Problem in panel.shown.verdict.text()
    assert not panel.shown.write.isEnabled()
    panel.shown._write()
    assert contour.Problem in at_work.problem
    picture("changed")
    obj.Tool.Radius = 15
    document.recompute()
    assert contour.Problem == ""
    App.closeDocument(document.Name)
    yield 0.1


def nothing_to_cut():
    """What cannot be cut is refused in words."""
    commands, _, session = workbench()
    document, obj = plate([(60, 60, 15)], thickness=60)  # a block: each face has loops of its own
    other = document.addObject("Part::Box", "Other")
    document.recompute()
    assert cut(document, obj) is None
    assert "nothing to cut is picked" in commands.boxes[-1].text()
    Gui.Selection.addSelection(document.Name, other.Name, "Edge1")
    Gui.Selection.addSelection(document.Name, obj.Name, "Edge1")
    Gui.runCommand("Kerfpath_Cut")
    assert "edges of one part" in commands.boxes[-1].text()
    # An edge between two faces: which of them is not known.
    outline = next(
        "Edge{}".format(i + 1) for i, e in enumerate(obj.Shape.Edges) if abs(e.Length - 200) < 1e-6
    )
    at_work = cut(document, obj, outline)
    yield from until(lambda: at_work.problem, "it is refused")
    results["ambiguous"] = at_work.problem
    assert outline in at_work.problem
    assert session.job_of(document) is None
    App.closeDocument(document.Name)


def no_path():
    """A speed that no robot holds: the answer with its reason, and a change that helps."""
    _, panel, _ = workbench()
    document, obj = plate([(60, 60, 15)])
    at_work = cut(document, obj, rim(obj, 60, 60))
    yield from quick(at_work)
    yield from until(lambda: passed(at_work), "it is planned")
    panel.shown._speed(90)
    yield from until(
        lambda: any(n["revision"] == at_work.revision for n in at_work.none.values()), "no path"
    )
    (none,) = at_work.none.values()
    assert none["statement"] in panel.shown.verdict.text()
    yield from until(lambda: not at_work.progress["busy"], "changes are tried")
    offers = at_work.relaxations()
    results["offers"] = [label for _, _, label in offers]
    yield from fitted()
    picture("no-path")
    panel.shown.remedies.linkActivated.emit("0")
    yield from until(lambda: passed(at_work), "the change has helped")
    App.closeDocument(document.Name)


def ends():
    """Stop, a process that dies, and a document that is closed while it plans."""
    commands, panel, session = workbench()
    document, obj = plate([(60, 60, 15)])
    at_work = cut(document, obj, rim(obj, 60, 60))
    yield from quick(at_work)
    yield from until(lambda: at_work.progress["busy"], "it plans")
    panel.shown.stop.click()
    yield from until(lambda: not at_work.progress["busy"], "it has stopped")
    panel.shown.stop.click()
    yield from until(lambda: passed(at_work), "it is planned after all")
    os.kill(at_work.studio.pid, 9)
    yield from until(lambda: at_work.studio is None, "it is known")
    assert "has ended" in panel.shown.verdict.text(), panel.shown.verdict.text()
    panel.shown.stop.click()
    yield from until(lambda: at_work.scene, "it is started again")
    pid = at_work.studio.pid
    App.closeDocument(document.Name)
    yield from until(lambda: not alive(pid), "it ends with the document")
    assert not Gui.Control.activeDialog()
    assert not session._sessions


def no_kerfpath():
    """None is found, or one of another version."""
    commands, _, session = workbench()
    document, obj = plate([(60, 60, 15)])
    os.environ["KERFPATH"] = "/nowhere/python"
    assert cut(document, obj, rim(obj, 60, 60)) is None
    assert "/nowhere/python" in commands.boxes[-1].text()
    old = os.path.join(OUT, "kerfpath")
    with open(old, "w") as file:
        file.write('#!/bin/sh\necho \'{"job": "x", "address": "http://127.0.0.1:1/?token=a", '
                   '"version": "0.0.1"}\'\nsleep 30\n')  # fmt: skip
    os.chmod(old, 0o755)
    os.environ["KERFPATH"] = old
    at_work = cut(document, obj, rim(obj, 60, 60))
    yield from until(lambda: at_work.studio is None, "it is refused")
    assert "0.0.1" in at_work.problem, at_work.problem
    del os.environ["KERFPATH"]
    assert session.job_of(document) is None
    App.closeDocument(document.Name)


SCENARIOS = (
    the_shipped_part, steps_of_undo, a_robot_that_is_moved, faces_and_lines, a_model_that_changes,
    nothing_to_cut, no_path, ends, no_kerfpath,
)  # fmt: skip
chosen = os.environ.get("KERFPATH_TEST_ONLY")
waiting = [each for each in SCENARIOS if chosen in (None, "", each.__name__)]
running = []


def step():
    try:
        if not running:
            if not waiting:
                end()
                return
            running.append((waiting[0].__name__, waiting.pop(0)(), time.time()))
            Gui.activateWorkbench("KerfpathWorkbench")
        name, scenario, begun = running[0]
        pause = next(scenario)
    except StopIteration:
        results[name] = "passed"
        results[name + " s"] = round(time.time() - begun, 1)
        running.clear()
        pause = 0.2
    except BaseException:
        results[running[0][0]] = traceback.format_exc()
        picture("failed-" + running[0][0])
        running.clear()
        for document in list(App.listDocuments()):
            App.closeDocument(document)
        os.environ.pop("KERFPATH", None)
        pause = 0.2
    QtCore.QTimer.singleShot(int(1000 * pause), step)


def end():
    with open(os.path.join(OUT, "results.json"), "w") as file:
        json.dump(results, file)
    for document in list(App.listDocuments()):
        App.closeDocument(document)
    Gui.getMainWindow().close()


sys.stdout.flush()
QtCore.QTimer.singleShot(1500, step)
