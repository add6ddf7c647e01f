"""Plan the selected machining project with kerfpath, and write the program to the station."""

import json
import os
import struct
import sys
from contextlib import suppress

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)

from _station import Settings, StationError, connect, plan_project  # noqa: E402
from robodk import robolink  # noqa: E402


def runmain():
    """Do what the button of the add-in is for; return the exit code."""
    rdk, said = None, ""
    try:
        with open(os.path.join(HERE, "settings.json"), encoding="utf-8") as file:
            settings = Settings(**json.load(file))
        rdk = connect()
        kind = robolink.ITEM_TYPE_MACHINING
        project = rdk.ItemUserPick("Plan a machining project with kerfpath", kind)
        if not project.Valid():
            raise StationError("there is no machining project, or none was chosen")
        rdk.ShowMessage("kerfpath plans {} ...".format(project.Name()), False)
        said = plan_project(rdk, project, settings).message
        return 0
    except StationError as error:
        said = "kerfpath: {}".format(error)
        return 1
    finally:  # whatever happens is shown to the user
        said = said or "kerfpath: {}".format(sys.exc_info()[1])
        sys.stdout.write(said + "\n")
        if rdk is not None:
            with suppress(OSError, struct.error):  # the connection may be what was lost
                rdk.ShowMessage(said.replace("\n", "<br>"))


if __name__ == "__main__":
    sys.exit(runmain())
