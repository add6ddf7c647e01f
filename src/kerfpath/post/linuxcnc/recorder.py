"""Run a program on LinuxCNC without a screen, with simulated joints, and record it at 1 kHz."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.errors import InputError
from kerfpath.post.build import from_controller_units
from kerfpath.post.languages import handshakes
from kerfpath.post.linuxcnc.controller import LinuxcncSettings
from kerfpath.robots import Robot

PERIOD = 1e-3
"""Time (s) between samples: the servo period of the INI."""
COMMANDS = ("linuxcnc", "halsampler")
"""What of LinuxCNC must be installed."""
LOCK = Path("/tmp/linuxcnc.lock")
"""File that is there while LinuxCNC runs: it runs once on a machine."""
STARTUP = 60.0
"""Time (s) beyond that of the program after which the run is given up."""
NOBODY = "65534"
"""User as whom LinuxCNC runs if it is begun by root, as in a container."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Record:
    """What LinuxCNC commanded, from the first motion to the end of the program.

    Parameters
    ----------
    time : (M,) s
    q : (M, n) rad
        Joints; m for linear external axes.
    line : (M,) int
        Line of the program that moves the joints; 0: none.
    laser, gas : (M,) bool
        Their outputs.
    """

    time: Array
    q: Array
    line: Ints
    laser: Bools
    gas: Bools

    __repr__ = short_repr


def require_linuxcnc() -> None:
    """Raise InputError if LinuxCNC is not installed, or runs already."""
    missing = [name for name in COMMANDS if shutil.which(name) is None]
    if missing:
        raise InputError(
            f"running a program on LinuxCNC: {', '.join(missing)} is needed and not installed; on "
            "Debian run apt-get install linuxcnc-uspace"
        )
    if LOCK.exists():
        raise InputError(
            f"running a program on LinuxCNC: {LOCK} is there, so LinuxCNC runs already, or was "
            "ended by force; end it, or remove the file"
        )


def record(program: Path, robot: Robot, settings: LinuxcncSettings, *, longest: float) -> Record:
    """Run a program, with the INI and HAL beside it, and return what LinuxCNC commanded.

    Parameters
    ----------
    program : Path
    robot : Robot
    settings : LinuxcncSettings
    longest : float s
        Time in which the program ends.

    Raises
    ------
    InputError
        LinuxCNC is not installed, runs already, reports an error, or does not come to the end of
        the program.
    """
    require_linuxcnc()
    with TemporaryDirectory(prefix="kerfpath-linuxcnc-") as name:
        folder = Path(name)
        _prepare(folder, program, robot, settings)
        said = _run(folder, program, longest + STARTUP)
        if said:
            raise InputError(f"{program}: {said}")
        return _read(folder / "record.txt", robot)


def _prepare(folder: Path, program: Path, robot: Robot, settings: LinuxcncSettings) -> None:
    """Copy program, INI and HAL, and add what drives and records the run."""
    for end in (program.suffix, ".hal"):
        shutil.copy(program.with_suffix(end), folder)
    ini = program.with_suffix(".ini").read_text(encoding="utf-8")
    ini = re.sub(r"(?m)^[ \t]*DISPLAY[ \t]*=.*", "DISPLAY = ./driver.py", ini)
    ini = re.sub(r"(?m)^[ \t]*HALFILE[ \t]*=.*", r"\g<0>\nHALFILE = record.hal", ini)
    (folder / "run.ini").write_text(ini)
    (folder / "record.hal").write_text("\n".join([*_sampler(robot, settings), ""]))
    driver = folder / "driver.py"
    shutil.copy(Path(__file__).with_name("driver.py"), driver)
    for file in ("linuxcnc.var", "tool.tbl"):
        (folder / file).touch()
    driver.chmod(0o755)
    if os.geteuid() == 0:
        for each in (folder, *folder.iterdir()):
            shutil.chown(each, int(NOBODY))


def _sampler(robot: Robot, settings: LinuxcncSettings) -> list[str]:
    """Return the lines of the HAL that record joints, line, laser and gas in each period.

    Partners of handshakes answer at once: their inputs are on.
    """
    asked = [port for (_, way), port in handshakes(settings).items() if way == "input"]
    n = robot.joints
    pins = [f"net position-{k} joint.{k}.pos-cmd => sampler.0.pin.{k}" for k in range(n)]
    pins.append(f"net line motion.program-line => sampler.0.pin.{n}")
    for k, port in enumerate((settings.laser_output, settings.gas_output)):
        if port is not None:
            pins.append(f"net output-{port} => sampler.0.pin.{n + 1 + k}")
    return [
        f"loadrt sampler depth=100000 cfg={'f' * n}sbb",
        *pins,
        "addf sampler.0 servo-thread",
        *(f"setp motion.digital-in-{port:02d} 1" for port in asked if port is not None),
    ]


def _run(folder: Path, program: Path, longest: float) -> str:
    """Run LinuxCNC and return why it failed; empty if it did not."""
    environment = {
        **os.environ,
        "HOME": str(folder),
        "KERFPATH_PROGRAM": str(folder / program.name),
        "KERFPATH_RECORD": str(folder / "record.txt"),
        "KERFPATH_LONGEST": f"{longest:.3f}",
    }
    if os.geteuid() == 0:
        environment["RTAPI_UID"] = NOBODY
    process = subprocess.Popen(
        ["linuxcnc", "-r", "run.ini"], cwd=folder, env=environment, text=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        start_new_session=True,
    )  # fmt: skip
    try:
        said, _ = process.communicate(timeout=longest + STARTUP)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGTERM)
        process.communicate()
        return f"LinuxCNC did not end after {longest:.0f} s"
    found = [line for line in said.splitlines() if line.startswith("LinuxCNC: ")]
    if not found and not (folder / "record.txt").exists():
        found = [f"LinuxCNC did not start: {line}" for line in said.splitlines() if line.strip()]
        return found[-1] if found else "LinuxCNC did not start"
    return found[0] if found else ""


def _read(path: Path, robot: Robot) -> Record:
    """Return the record, without standing still before the first motion and after the last."""
    rows = path.read_text().splitlines()[:-1]  # the last one may be cut off
    values = np.array([row.split() for row in rows if row != "overrun"], dtype=float)
    if len(values) < len(rows) or (np.diff(values[:, 0]) != 1).any():
        raise InputError("the record of LinuxCNC has gaps: the machine is too slow; run it again")
    n, arm = robot.joints, robot.family.joints
    words = values[:, 1 : n + 1]
    q = np.hstack([np.radians(words[:, :arm]), from_controller_units(robot, words[:, arm:])])
    line = values[:, n + 1].astype(np.int64)
    laser, gas = (values[:, n + 2 :] != 0).T
    active = np.flatnonzero(line > 0)
    if not active.size:
        raise InputError("the record of LinuxCNC has no motion: the program moved nothing")
    kept = slice(max(active[0] - 1, 0), active[-1] + 2)
    time = PERIOD * np.arange(len(q[kept]), dtype=np.float64)
    return Record(
        time=freeze(time), q=freeze(q[kept]), line=line[kept], laser=laser[kept], gas=gas[kept]
    )
