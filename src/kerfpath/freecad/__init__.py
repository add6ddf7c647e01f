"""The workbench for FreeCAD, and its installation.

The workbench is the folder `kerfpath_wb`: an add-on of FreeCAD, which needs nothing but FreeCAD's
own Python and speaks to a process of kerfpath. Nothing here imports it.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

from kerfpath.errors import InputError
from kerfpath.extras import require_extra

WORKBENCH = Path(__file__).parent / "kerfpath_wb"
"""The add-on."""
WRITTEN = "python.txt"
"""The file of the installed add-on with the path of the Python that has kerfpath."""


def mod_folders() -> list[Path]:
    """Return the folders in which installed versions of FreeCAD look for add-ons.

    Sources: `App.getUserAppDataDir()` of FreeCAD 0.20, 1.0 and 1.1; 1.1 and newer have a folder for
    each version (`src/App/ApplicationDirectories.cpp` of FreeCAD).
    """
    if sys.platform == "win32":
        base = Path(os.environ.get("APPDATA", Path.home() / "AppData" / "Roaming")) / "FreeCAD"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Application Support" / "FreeCAD"
    else:
        data = os.environ.get("XDG_DATA_HOME")
        base = (Path(data) if data else Path.home() / ".local" / "share") / "FreeCAD"
    versions = [each / "Mod" for each in sorted(base.glob("v*-*")) if each.is_dir()]
    shared = base / "Mod"
    return [shared, *versions] if shared.is_dir() or not versions else versions


def install(folder: Path | None = None) -> list[Path]:
    """Copy the workbench to where FreeCAD looks for add-ons, in place of an older one.

    The copy knows the Python that runs here.

    Parameters
    ----------
    folder : Path, optional
        A folder for add-ons. Default: those of all versions of FreeCAD, as `mod_folders`.

    Returns
    -------
    list of Path
        The folders of the installed workbench.

    Raises
    ------
    InputError
        The packages of the studio are not installed, or a folder is not writable.
    """
    require_extra("studio", "the workbench for FreeCAD")
    return [_copied(mod) for mod in ([folder] if folder is not None else mod_folders())]


def _copied(mod: Path) -> Path:
    target = mod / WORKBENCH.name
    try:
        mod.mkdir(parents=True, exist_ok=True)
        new = Path(tempfile.mkdtemp(prefix=".kerfpath", dir=mod))
        try:
            whole = shutil.copytree(
                WORKBENCH, new / target.name, ignore=shutil.ignore_patterns("__pycache__", WRITTEN)
            )
            (whole / WRITTEN).write_text(f"{sys.executable}\n", encoding="utf-8")
            if target.is_symlink():
                target.unlink()
            elif target.exists():
                target.rename(new / "before")
            whole.rename(target)
        finally:
            shutil.rmtree(new, ignore_errors=True)
    except OSError as error:
        raise InputError(
            f"{target}: cannot be written ({error.strerror}); give the Mod folder of your FreeCAD "
            "with --to"
        ) from None
    return target
