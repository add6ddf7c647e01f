#!/usr/bin/python3
"""Drive LinuxCNC through one program without a screen: it runs this file as its display.

It runs in the Python of the system, which has the module `linuxcnc`, and imports nothing of this
package. The environment names the program, the file of the record, and the longest time (s).
"""

import os
import subprocess
import sys
import time
from pathlib import Path

import linuxcnc

POLL = 0.02
"""Time (s) between looks at the state."""
LONGEST_HOMING = 10.0
"""s"""


def main() -> None:
    """Switch on, home, run the program to its end, and stop the record."""
    state, command, said = linuxcnc.stat(), linuxcnc.command(), linuxcnc.error_channel()
    end = time.monotonic() + float(os.environ["KERFPATH_LONGEST"])

    def require_no_error() -> None:
        if message := said.poll():
            sys.exit(f"LinuxCNC: {' '.join(str(message[1]).split())}")

    def wait_until(done, latest: float, what: str) -> None:  # type: ignore[no-untyped-def]
        while True:
            state.poll()
            require_no_error()
            if done():
                return
            if time.monotonic() > latest:
                sys.exit(f"LinuxCNC: {what}")
            time.sleep(POLL)

    command.state(linuxcnc.STATE_ESTOP_RESET)
    command.wait_complete()
    command.state(linuxcnc.STATE_ON)
    command.wait_complete()
    state.poll()
    joints = state.joints
    command.home(-1)
    latest = time.monotonic() + LONGEST_HOMING
    wait_until(lambda: all(state.homed[:joints]), latest, "the joints were not homed")
    command.mode(linuxcnc.MODE_AUTO)
    command.wait_complete()
    command.program_open(os.environ["KERFPATH_PROGRAM"])
    command.wait_complete()
    with Path(os.environ["KERFPATH_RECORD"]).open("w") as record:
        sampler = subprocess.Popen(["halsampler", "-t"], stdout=record)
        try:
            command.auto(linuxcnc.AUTO_RUN, 0)
            command.wait_complete()
            wait_until(
                lambda: state.interp_state == linuxcnc.INTERP_IDLE and state.inpos,
                end,
                "the program did not end in time",
            )
            time.sleep(10 * POLL)
        finally:
            sampler.terminate()
            sampler.wait()


if __name__ == "__main__":
    main()
