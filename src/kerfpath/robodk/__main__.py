"""Put the add-in into RoboDK: ``python -m kerfpath.robodk [FOLDER]``.

FOLDER is where RoboDK has its add-ins; default: those of the user. The add-in starts the Python
that runs this.
"""

from __future__ import annotations

import json
import sys
from importlib.resources import files
from pathlib import Path

from platformdirs import user_data_path

from kerfpath.files import write_whole
from kerfpath.robodk.station import Settings

SCRIPT = "PlanWithKerfpath"


def install(addins: Path) -> Path:
    """Write the add-in into a folder of add-ins; return its own folder.

    Its settings stay as they are if there are some.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    own, to = files("kerfpath.robodk"), addins / "Kerfpath"
    parts = {one.name: one.read_bytes() for one in (own / "addin").iterdir() if one.is_file()}
    parts["_station.py"] = (own / "station.py").read_bytes()
    icon = files("kerfpath.studio") / "client" / "icon.svg"
    parts[f"{SCRIPT}.svg"] = icon.read_bytes()
    if not (to / "settings.json").exists():
        said = vars(Settings(python=sys.executable))
        parts["settings.json"] = (json.dumps(said, indent=4) + "\n").encode()
    to.mkdir(parents=True, exist_ok=True)
    write_whole({to / name: content for name, content in parts.items()})
    return to


def main() -> None:
    """Install the add-in and say what is next."""
    default = user_data_path("RoboDK", appauthor=False, roaming=True) / "Addins"
    try:
        to = install(Path(sys.argv[1]) if len(sys.argv) > 1 else default)
    except OSError as error:
        sys.exit(f"kerfpath: {error}")
    said = f"{to}: enable Kerfpath in RoboDK (Tools, Add-in Manager); settings: settings.json"
    sys.stdout.write(said + "\n")


if __name__ == "__main__":
    main()
