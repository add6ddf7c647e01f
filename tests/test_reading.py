"""Reading a file opens files, and does nothing else: no code is run or made, nothing is sent.

In this process: another one reads some files, and is started for that. Code is compiled into the
cache of the user.
"""

import contextlib
import io
import os
import sys
from pathlib import Path

import pytest

from readers import READERS
from spoilt import complaint, spoilt

FORBIDDEN = (
    "socket.connect", "socket.bind", "socket.getaddrinfo", "urllib.Request", "os.system",
    "os.exec", "os.posix_spawn", "os.fork", "os.forkpty", "pty.spawn", "subprocess.Popen",
    "os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.chmod", "os.link", "os.symlink",
    "os.truncate", "shutil.rmtree",
)  # fmt: skip
WATCHED = {"on": False}
SEEN: list[tuple[str, object]] = []


def _hook(event, arguments):
    if not WATCHED["on"]:
        return
    if "numba-" in str(arguments):  # compiled code in the cache of the user
        return
    if event == "subprocess.Popen" and arguments[0] == sys.executable:  # that reads apart
        return
    if event in FORBIDDEN:
        SEEN.append((event, arguments))
    elif event == "open" and isinstance(arguments[2], int):
        path, _, flags = arguments
        if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC) and path != os.devnull:
            SEEN.append((event, path))


sys.addaudithook(_hook)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["dxf", "table", "mesh", "urdf", "job", "plan", "rapid", "measured"]
)
def test_reading_opens_files_to_read_them_alone(tmp_path: Path, name: str) -> None:
    reader = READERS[name]
    wholes = reader.wholes(tmp_path)
    sound = {whole.spoilt: whole.spoilt.read_bytes() for whole in wholes}
    with contextlib.redirect_stdout(io.StringIO()):
        for whole in wholes:
            reader.read(whole.main)  # whose modules are imported then
    for seed in range(30):
        whole, content = spoilt(wholes, sound, seed)
        whole.spoilt.write_bytes(content)
        SEEN.clear()
        WATCHED["on"] = True
        try:
            complaint(reader.read, whole)
        finally:
            WATCHED["on"] = False
        assert SEEN == [], f"seed {seed}"
        whole.spoilt.write_bytes(sound[whole.spoilt])


def test_the_watch_sees_what_it_is_for(tmp_path: Path) -> None:
    SEEN.clear()
    WATCHED["on"] = True
    try:
        (tmp_path / "a").write_text("b")
        (tmp_path / "a").unlink()
    finally:
        WATCHED["on"] = False
    assert [event for event, _ in SEEN] == ["open", "os.remove"]
