"""The workbench in FreeCAD's list of workbenches; run once when FreeCAD starts."""

import FreeCADGui as Gui
from freecad.kerfpath_wb import icon


class KerfpathWorkbench(Gui.Workbench):
    """Cuts by laser robots, planned by kerfpath."""

    MenuText = "Kerfpath"
    ToolTip = "Plan laser cuts of robots: pick edges, plan, play, write the program"
    Icon = icon("kerfpath")

    def Initialize(self):
        from freecad.kerfpath_wb import commands

        commands.add_languages()
        commands.add_commands()
        self.appendToolbar("Kerfpath", commands.TOOLBAR)
        self.appendMenu("Kerfpath", commands.TOOLBAR)

    def GetClassName(self):
        return "Gui::PythonWorkbench"


Gui.addWorkbench(KerfpathWorkbench())
