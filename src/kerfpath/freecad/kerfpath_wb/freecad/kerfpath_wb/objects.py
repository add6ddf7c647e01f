"""The objects in a document: the job, its robot and its contours.

A document keeps them by the name of this module and of these classes: neither may ever change.
"""

import json

import FreeCAD as App
import Part

from . import geometry, icon, tr

SCALE = 1000.0
"""mm in a metre."""
CONTOUR_COLOUR, WIDTH = (0.93, 0.33, 0.0), 4.0
FAULT_COLOUR = (0.86, 0.08, 0.24)


class _Proxy:
    """The proxy of an object with `PROPERTIES`, of which a document keeps nothing more."""

    PROPERTIES = ()

    def __init__(self, obj):
        obj.Proxy = self
        for kind, name, about in self.PROPERTIES:
            obj.addProperty(kind, name, "Kerfpath", about)

    def execute(self, obj):
        """Nothing follows from the properties."""

    def dumps(self):
        return None

    def loads(self, state):
        return None

    __getstate__, __setstate__ = dumps, loads  # FreeCAD 0.20 and 0.21


class _View(_Proxy):
    """How an object is shown; `NAME` is its icon."""

    NAME = "kerfpath"

    def attach(self, view):
        self.Object = view.Object

    def getIcon(self):
        return icon(self.NAME)


# -----------------------------------------------------------------------------
# The job.


class Job(_Proxy):
    """A job: its text as TOML, the object that is cut, and what belongs to it."""

    PROPERTIES = (
        ("App::PropertyString", "Job", "The job file, TOML"),
        ("App::PropertyLinkGlobal", "Part", "What is cut"),
        ("App::PropertyLink", "Robot", "Its place is that of the robot base"),
        ("App::PropertyLinkList", "Contours", "What is cut of the part"),
        ("App::PropertyLinkListGlobal", "Fixtures", "What the robot keeps clear of"),
        ("App::PropertyPath", "Folder", "Where programs are written; empty: by the document"),
    )


class JobView(_View):
    """The job in the tree, with robot and contours below it."""

    NAME = "job"

    def claimChildren(self):
        return [each for each in (self.Object.Robot, *self.Object.Contours) if each]

    def doubleClicked(self, view):
        from . import commands

        commands.open_panel(self.Object)
        return True


# -----------------------------------------------------------------------------
# Contours.


class Contour(_Proxy):
    """A loop or an open line that is cut: its edges by name, with a fingerprint of each.

    The fingerprints of a line also have the normal of the side that it is on.
    """

    PROPERTIES = (
        ("App::PropertyLinkSubGlobal", "Edges", "The edges of the loop"),
        ("App::PropertyString", "Fingerprints", "What these edges look like, JSON"),
        ("App::PropertyString", "Loop", "Its name in kerfpath"),
        ("App::PropertyString", "Problem", "Why it cannot be cut"),
    )

    def __init__(self, obj):
        super().__init__(obj)
        obj.setEditorMode("Fingerprints", 2)  # hidden
        for name in ("Loop", "Problem"):
            obj.setEditorMode(name, 1)  # read only

    def execute(self, obj):
        """Find the edges again after a change of the model, or say which one is lost."""
        if obj.Edges is None:
            obj.Problem = "the object of its edges is gone; remove the contour"
            raise ValueError(obj.Problem)
        source, _ = obj.Edges
        names = names_of(obj)
        own, prints, problem = own_shape(source), json.loads(obj.Fingerprints), ""
        edges = own.Edges
        try:
            found = geometry.found_again(names, prints, edges)
            if found != names:
                App.Console.PrintMessage(
                    "{}: {} is now {}\n".format(obj.Label, ", ".join(names), ", ".join(found))
                )
                obj.Edges = (source, found)
            if is_line(obj):
                line_of(own, found, normals_of(obj))
            shape = Part.Compound([edges[int(name[4:]) - 1] for name in found])
            shape.Placement = source.getGlobalPlacement()
            obj.Shape = shape
        except geometry.PickError as error:
            problem = str(error)
        if obj.Problem != problem:
            obj.Problem = problem
        if App.GuiUp:
            obj.ViewObject.LineColor = FAULT_COLOUR if problem else CONTOUR_COLOUR
        if problem:
            raise ValueError("{}: {}".format(obj.Label, problem))

    def pick(self, obj, source, names, loop, normals=None):
        """Take the edges of a loop of an object, or of a line on the side with these normals."""
        edges = edges_of(source)
        prints = [geometry.fingerprint(edges[int(name[4:]) - 1]) for name in names]
        for each, normal in zip(prints, normals or ()):
            each["normal"] = normal
        obj.Edges, obj.Fingerprints, obj.Loop = (source, names), json.dumps(prints), loop


class ContourView(_View):
    """A contour as a thick line."""

    NAME = "contour"

    def __init__(self, view):
        super().__init__(view)
        view.LineColor, view.LineWidth = CONTOUR_COLOUR, WIDTH
        view.PointSize = 1.0

    def onDelete(self, view, names):
        """Take the contour out of the job, which deletes this object."""
        from . import commands

        commands.remove_contours([view.Object])
        return False


def own_shape(source):
    """Return the shape of an object in its own coordinates, wherever it is placed."""
    shape = source.Shape.copy()
    shape.Placement = App.Placement()
    return shape


def edges_of(source):
    """Return the edges of an object in its own coordinates."""
    return own_shape(source).Edges


def names_of(contour):
    """Return the names of a contour's edges, without what newer versions put before them."""
    return [name.rsplit(".", 1)[-1].lstrip("?") for name in contour.Edges[1]]


# -----------------------------------------------------------------------------
# Open lines: edges with the faces from whose side they are cut.

STEP, DEFLECTION, SQUARE = 1.0, 0.005, 0.999
"""mm between points of a line and of its chords from the edge, and the least cosine between the
normals of a side before and after a change of the model."""


def is_line(contour):
    """Return whether a contour is an open line."""
    return '"normal"' in contour.Fingerprints


def normals_of(contour):
    """Return the normals of the side of an open line, one for each edge."""
    return [each["normal"] for each in json.loads(contour.Fingerprints)]


def lines_in(source, names):
    """Return the open lines that picked edges make up, as (names of edges, normals of the side).

    Parameters
    ----------
    source : object
    names : list of str
        Edges, and faces on whose side they are cut.

    Raises
    ------
    PickError
        No edges are picked, they are no open lines, or their side is not clear.
    """
    shape = own_shape(source)
    edges = [name for name in names if name.startswith("Edge")]
    sides = [shape.Faces[int(name[4:]) - 1] for name in names if name.startswith("Face")]
    if not edges:
        raise geometry.PickError(tr("no edge is picked: pick the edges of the line first"))
    every = [shape.Edges[int(name[4:]) - 1] for name in edges]
    found = []
    for line in geometry.chains(edges, [_ends(edge) for edge in every]):
        along = [every[i] for i, _ in line]
        beside = [shape.ancestorsOfType(edge, Part.Face) for edge in along]
        common = sides or [f for f in beside[0] if all(_among(f, each) for each in beside)]
        chosen = [[f for f in each if _among(f, common)] for each in beside]
        if any(len(each) != 1 for each in chosen) or not (sides or len(common) == 1):
            raise geometry.PickError(
                tr(
                    "{}: its side is not clear; pick the face from whose side it is cut, too, with "
                    "Control held"
                ).format(", ".join(edges[i] for i, _ in line))
            )
        normals = [
            [round(x, 6) for x in _normal(face, _middle(edge))]
            for edge, (face,) in zip(along, chosen)
        ]
        found.append(([edges[i] for i, _ in line], normals))
    return found


def line_of(shape, names, normals):
    """Return points (mm) and tool axes of an open line of a shape.

    Raises
    ------
    PickError
        An edge has no face any more with the normal of its side.
    """
    every = [shape.Edges[int(name[4:]) - 1] for name in names]
    (line,) = geometry.chains(names, [_ends(edge) for edge in every])
    found = []
    for i, backwards in line:
        edge, normal, middle = every[i], App.Vector(*normals[i]), _middle(every[i])
        beside = shape.ancestorsOfType(edge, Part.Face)
        alike = [face for face in beside if _normal(face, middle).dot(normal) > SQUARE]
        if len(alike) != 1:
            raise geometry.PickError(
                tr(
                    "the model has changed: the face on whose side {} is cut is another one; pick "
                    "the line again"
                ).format(names[i])
            )
        points = _points(edge)
        rows = [(tuple(p), tuple(-x for x in _normal(alike[0], p))) for p in points]
        rows = rows[::-1] if backwards else rows
        found += rows[1:] if found else rows
    return found


def _points(edge):
    """Return points of an edge, so close that chords hardly leave it."""
    fine = 2 * len(edge.discretize(Deflection=DEFLECTION))
    return edge.discretize(Number=max(fine, int(edge.Length / STEP)) + 1)


def _ends(edge):
    points = edge.discretize(Number=3)
    return tuple(points[0]), tuple(points[-1])


def _middle(edge):
    return edge.discretize(Number=3)[1]


def _normal(face, point):
    u, v = face.Surface.parameter(point)
    return face.normalAt(u, v)


def _among(face, faces):
    return any(face.isSame(each) for each in faces)


# -----------------------------------------------------------------------------
# The robot.


class Robot(_Proxy):
    """The robot with its head; its placement is that of its base."""

    PROPERTIES = (("App::PropertyString", "Model", "Its id in the library"),)

    def __init__(self, obj):
        super().__init__(obj)
        obj.setEditorMode("Model", 1)


class RobotView(_View):
    """The bodies of the robot, each moved with its frame."""

    NAME = "robot"

    def attach(self, view):
        from pivy import coin

        super().attach(view)
        self.root, self.moved = coin.SoSeparator(), {}
        view.addDisplayMode(self.root, "Shaded")

    def getDisplayModes(self, view):
        return ["Shaded"]

    def getDefaultDisplayMode(self):
        return "Shaded"

    def setDisplayMode(self, mode):
        return mode

    def show_bodies(self, bodies):
        """Show bodies.

        Parameters
        ----------
        bodies : list of (frame, colour, points, corners)
            Number of the frame, red, green and blue, points (m), and triangles by their points.
        """
        from pivy import coin

        self.root.removeAllChildren()
        self.moved = {}
        for frame, colour, points, corners in bodies:
            if frame not in self.moved:
                group, move = coin.SoSeparator(), coin.SoMatrixTransform()
                group.addChild(move)
                hints = coin.SoShapeHints()
                hints.vertexOrdering = coin.SoShapeHints.COUNTERCLOCKWISE
                hints.shapeType = coin.SoShapeHints.UNKNOWN_SHAPE_TYPE
                hints.creaseAngle = 0.6
                group.addChild(hints)
                self.root.addChild(group)
                self.moved[frame] = group, move
            group, _ = self.moved[frame]
            body, material = coin.SoSeparator(), coin.SoMaterial()
            material.diffuseColor = colour
            material.specularColor = (0.15, 0.15, 0.15)
            place, faces = coin.SoCoordinate3(), coin.SoIndexedFaceSet()
            place.point.setValues(0, len(points), [[SCALE * x for x in p] for p in points])
            index = [i for triangle in corners for i in (*triangle, -1)]
            faces.coordIndex.setValues(0, len(index), index)
            for node in (material, place, faces):
                body.addChild(node)
            group.addChild(body)

    def show_frames(self, frames):
        """Move the bodies to the frames of the robot, as `motion.frames` returns them."""
        from pivy import coin

        for number, (_, move) in self.moved.items():
            T = frames[number]
            rows = [T[0:4], T[4:8], T[8:12]]
            columns = [[row[k] for row in rows] for k in range(3)]
            move.matrix.setValue(
                coin.SbMatrix(
                    *columns[0], 0.0, *columns[1], 0.0, *columns[2], 0.0,
                    *(SCALE * row[3] for row in rows), 1.0
                )
            )  # fmt: skip


# -----------------------------------------------------------------------------
# Making them.


def make_job(document, part):
    """Return a new job of a part, with its robot."""
    job = document.addObject("App::FeaturePython", "KerfpathJob")
    Job(job)
    JobView(job.ViewObject)
    robot = document.addObject("App::GeometryPython", "Robot")
    Robot(robot)
    RobotView(robot.ViewObject)
    job.Label, job.Part, job.Robot = "Kerfpath job", part, robot
    return job


def make_contour(job, names, loop, label, normals=None):
    """Return a new contour of a job: edges of its part; `normals` are of a line."""
    contour = job.Document.addObject("Part::FeaturePython", "Contour")
    Contour(contour)
    ContourView(contour.ViewObject)
    contour.Label = label
    contour.Proxy.pick(contour, job.Part, names, loop, normals)
    job.Contours = [*job.Contours, contour]
    return contour
