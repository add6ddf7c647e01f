"""The workbench of kerfpath for FreeCAD: contours picked in the view, planned by a process.

`process`, `geometry` and `motion` need neither FreeCAD nor Qt.
"""

import os

try:
    from FreeCAD import Qt
except ImportError:  # outside FreeCAD texts are as they are
    Qt = None

VERSION = "0.1.0"
"""Of this workbench and of the kerfpath that it speaks to; also in package.xml."""
HERE = os.path.dirname(os.path.abspath(__file__))
"""The folder of these modules, with `icons` and `translations`."""
WRITTEN = os.path.join(os.path.dirname(os.path.dirname(HERE)), "python.txt")
"""The file in which `kerfpath freecad` writes the Python that has kerfpath."""


def icon(name):
    """Return the path of an icon."""
    return os.path.join(HERE, "icons", name + ".svg")


def tr(text):
    """Return a text in the language of FreeCAD."""
    return text if Qt is None else Qt.translate("kerfpath", text)
