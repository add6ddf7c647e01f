"""`kerfpath studio`: open a job or a drawing in the browser."""

from __future__ import annotations

import json
import signal
import sys
from importlib.resources import as_file, files
from pathlib import Path
from threading import Thread

from rich.markup import escape

from kerfpath import __version__
from kerfpath.cad import SUFFIXES
from kerfpath.cli.drawing_output import first_job
from kerfpath.cli.show import out
from kerfpath.errors import InputError
from kerfpath.extras import require_extra
from kerfpath.files import write_whole

SHIPPED = ("b_pillar.toml", "b_pillar.step")
"""The demo job and its part; the studio copies them, so that they can be changed."""


def open_studio(
    job: Path | None, *, host: str, port: int, browser: bool, for_program: bool = False
) -> None:
    """Serve a job to the browser until the command is stopped.

    Without a job, a copy of the demo job is served. For a drawing, the job beside it with the same
    name is served, and written if there is none. A program that has started the studio gets a line
    of JSON, and the studio ends with it: once standard input ends.

    Raises
    ------
    InputError
        The packages for the studio are not installed, there is no job, or the port is in use.
    """
    require_extra("studio", "the studio")
    if job is None:
        path = _copy_of_demo()
    elif job.suffix.lower() in SUFFIXES:
        path = first_job(job)
    else:
        path = job
    from kerfpath.studio import serve

    def show(address: str) -> None:
        if for_program:
            said = {"job": str(path), "address": address, "version": __version__}
            print(json.dumps(said), flush=True)
            Thread(target=_end_with_input, daemon=True).start()
            return
        out.print(f"{escape(str(path))} at [bold]{escape(address)}[/] (stop with Ctrl-C)")

    serve(path, host=host, port=port, browser=browser, show=show)


def _end_with_input() -> None:
    """Stop this process, as SIGTERM does, once standard input ends."""
    sys.stdin.read()
    signal.raise_signal(signal.SIGTERM)


def _copy_of_demo() -> Path:
    """Return the demo job in a subfolder of the current folder, copied there if it is missing."""
    folder = Path("kerfpath-studio")
    absent = [name for name in SHIPPED if not (folder / name).exists()]
    with as_file(files("kerfpath").joinpath("demo")) as source:
        texts = {folder / name: (source / name).read_bytes() for name in absent}
    try:
        folder.mkdir(exist_ok=True)
        write_whole(texts)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot copy the demo job there ({error.strerror}); run kerfpath studio in "
            "a writable folder, or name a job"
        ) from None
    return folder / SHIPPED[0]
