"""`kerfpath studio`: a job in the browser, as a process of its own."""

import re
import signal
import socket
import subprocess
import sys
import urllib.request

import numpy as np
import pytest

from commands import assert_refused, run
from kerfpath.cli.drawing_output import first_job
from kerfpath.job import foresee, prepare, read_job, run_prepared
from studio.talk import write_job


def _hears():
    """Let a process hear Ctrl-C even if the tests run in the background, where it is ignored."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def started(tmp_path):
    """Start the command, and return its process and the address that it prints."""
    processes = []

    def start(*arguments):
        command = [sys.executable, "-m", "kerfpath", "studio", *map(str, arguments)]
        process = subprocess.Popen(
            [*command, "--no-browser"], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, cwd=tmp_path, preexec_fn=_hears,
        )  # fmt: skip
        processes.append(process)
        line = process.stdout.readline()
        return process, re.search(r"http://\S+", line)[0], line

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def get(address, path=""):
    """What is at a path, once the address with its token has been opened."""
    opener = urllib.request.build_opener(
        urllib.request.ProxyHandler({}), urllib.request.HTTPCookieProcessor()
    )
    with opener.open(address, timeout=30) as answer:
        page = answer.read().decode()
    if not path:
        return page
    with opener.open(address.partition("?")[0] + path, timeout=30) as answer:
        return answer.read().decode()


@pytest.mark.slow
def test_a_job_is_served_until_ctrl_c(started, tmp_path):
    job = write_job(tmp_path)
    process, address, line = started(job, "--port", 0)
    assert line.startswith(f"{job} at http://127.0.0.1:")
    assert "<html" in get(address)
    assert get(address, "export/job") == job.read_text()
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=30) == 130
    assert process.stderr.read() == "kerfpath: stopped\n"


@pytest.mark.slow
def test_without_a_job_a_copy_of_the_demo_is_opened_and_found_again(started, tmp_path):
    process, address, _ = started("--port", 0)
    copied = tmp_path / "kerfpath-studio" / "b_pillar.toml"
    assert get(address, "export/job") == copied.read_text()
    assert (copied.parent / "b_pillar.step").exists()
    process.kill()
    process.wait()
    copied.write_text("# mine\n" + copied.read_text())
    _, address, _ = started("--port", 0)
    assert get(address, "export/job").startswith("# mine")


@pytest.mark.slow
@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_every_studio_needs_the_token_that_it_prints(started, tmp_path, host):
    _, address, _ = started(write_job(tmp_path), "--port", 0, "--host", host)
    found = re.fullmatch(r"http://[^/]+:(\d+)/\?token=([\w-]{32})", address)
    port, token = found.groups()
    with pytest.raises(urllib.error.HTTPError, match="403"):
        get(f"http://127.0.0.1:{port}/")
    assert "<html" in get(f"http://127.0.0.1:{port}/?token={token}")


def test_a_port_in_use_is_refused(tmp_path):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        result = run("studio", write_job(tmp_path), "--port", port, "--no-browser")
    assert_refused(result, f"port {port}", "--port")


def test_what_is_no_job_is_refused(tmp_path):
    none = tmp_path / "none.toml"
    assert_refused(run("studio", none, "--port", 0, "--no-browser"), "no such file")


def test_what_is_not_installed_is_said_in_one_line(tmp_path, monkeypatch):
    for name in ("starlette", "uvicorn", "websockets"):
        monkeypatch.setitem(sys.modules, name, None)
    result = run("studio", write_job(tmp_path), "--no-browser")
    assert_refused(result, "starlette, uvicorn, websockets", "pip install 'kerfpath[studio]'")


@pytest.mark.slow
def test_a_drawing_gets_a_job_to_begin_with_that_can_be_planned(started, tmp_path):
    write_job(tmp_path)  # the part beside it
    _, address, line = started(tmp_path / "b_pillar.step", "--port", 0)
    written = tmp_path / "b_pillar.toml"
    assert line.startswith(str(written))
    text = get(address, "export/job")
    assert text == written.read_text()
    written.write_text("# mine\n" + text)
    assert first_job(tmp_path / "b_pillar.step").read_text().startswith("# mine")
    prepared = prepare(read_job(written))
    holes = (f"skin/hole{k}" for k in range(1, 25))
    assert {request.task.name for request in prepared.contours} == {"skin/outer", *holes}
    assert not foresee(prepared)
    up = prepared.job.placement[:3, :3] @ prepared.contours[0].loop.axes.mean(axis=0)
    assert up[2] < -0.5  # the beam comes from above
    low = prepared.job.placement @ np.append(prepared.part.bounding_box.mean(axis=0), 1.0)
    assert low[:2] == pytest.approx([1.3, 0.0], abs=1e-4)  # to a tenth of a millimetre
    made = run_prepared(prepared.with_contours(prepared.contours[:1]))
    assert made.passed


def test_a_drawing_without_a_closed_loop_gets_none(tmp_path):
    lines = tmp_path / "lines.csv"
    lines.write_text("x,y,z,nx,ny,nz\n" + "".join(f"{i},0,0,0,0,1\n" for i in range(9)))
    result = run("studio", lines, "--no-browser")
    assert_refused(result, "lines.csv")
    assert not lines.with_suffix(".toml").exists()
