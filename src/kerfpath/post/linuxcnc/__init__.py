"""G code of LinuxCNC, with a robot's joints as its axes."""

from kerfpath.post.languages import Language, no_settings_needed
from kerfpath.post.linuxcnc.checks import check, without_leads
from kerfpath.post.linuxcnc.controller import LinuxcncSettings as LinuxcncSettings
from kerfpath.post.linuxcnc.controller import inherited, rules
from kerfpath.post.linuxcnc.motion import Stretch as Stretch
from kerfpath.post.linuxcnc.motion import run_moves
from kerfpath.post.linuxcnc.motion import stretches_of as stretches_of
from kerfpath.post.linuxcnc.reader import read
from kerfpath.post.linuxcnc.recorder import Record as Record
from kerfpath.post.linuxcnc.recorder import record as record
from kerfpath.post.linuxcnc.recorder import require_linuxcnc as require_linuxcnc
from kerfpath.post.linuxcnc.writer import Linuxcnc as Linuxcnc

LINUXCNC = Language(
    name="linuxcnc",
    title="LinuxCNC",
    manufacturers=(),
    families=(),
    suffix=".ngc",
    settings=LinuxcncSettings,
    rules=rules,
    formatter=Linuxcnc,
    check=check,
    sayable=without_leads,
    ahead=False,
    zones=False,
    assumed={"laser_output": 0},
    externals=no_settings_needed,
    inherited=inherited,
    motion=run_moves,
    read=read,
)
"""The language as registered."""
