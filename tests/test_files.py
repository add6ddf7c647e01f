"""Folders for temporary files: none stays, whatever happens to the process."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from kerfpath.files import SCRATCH, scratch_folder

KEEPS_ONE = """
import time
from kerfpath.files import scratch_folder
with scratch_folder() as folder:
    (folder / "file").write_text("text")
    print(folder, flush=True)
    time.sleep(600)
"""


@pytest.fixture
def there(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_a_folder_goes_at_the_end_and_those_of_killed_processes_with_the_next(there):
    environment = {**os.environ, "TMPDIR": str(there)}
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", KEEPS_ONE], env=environment, stdout=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    killed, used = (Path(process.stdout.readline().strip()) for process in processes)
    old = time.time() - 3600
    for folder in (killed, used):
        os.utime(folder, (old, old))
    mine = there / f"{SCRATCH}mine"
    mine.symlink_to(used)
    processes[0].kill()
    processes[0].wait()
    with scratch_folder() as folder:
        (folder / "file").write_text("text")
        assert set(there.iterdir()) == {folder, used, mine}
    assert set(there.iterdir()) == {used, mine}
    processes[1].kill()
    for process in processes:
        process.communicate()
