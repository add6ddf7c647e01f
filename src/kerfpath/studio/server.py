"""Start the server on its port, and open a browser."""

from __future__ import annotations

import secrets
import socket
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread

from kerfpath.errors import InputError
from kerfpath.isolated import stand_by
from kerfpath.studio.document import Document

HERE = ("127.0.0.1", "localhost", "::1")
"""Addresses that only this machine can reach."""
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
"""Names of the local machine in URLs."""

READER = "kerfpath.cad.step"
"""Module that the process that reads drawings imports first: most drawings are STEP files."""
EVERYWHERE = ("0.0.0.0", "::")
"""Addresses that mean every address of this machine."""
WITHOUT_PORT = 80
"""Default HTTP port, which URLs leave out."""


def serve(path: Path, *, host: str, port: int, browser: bool, show: Callable[[str], None]) -> None:
    """Serve one job until the process is stopped.

    Parameters
    ----------
    path : Path
        Path of the job file.
    host : str
        Address to listen at. Requests need a token, which the shown URL contains.
    port : int
        Port to listen at; 0 takes a free one.
    browser : bool
        Whether to open a browser.
    show : callable
        Takes the URL once the server listens there.

    Raises
    ------
    InputError
        The job cannot be read, the port is in use, or the address is not of this machine.
    """
    stand_by(READER)  # the reader process starts while this process imports
    document = Document(path)
    with _listener(host, port) as listener:
        number = listener.getsockname()[1]
        alone = host in HERE
        token, ticket = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
        names = LOOPBACK if alone else (*LOOPBACK, _in_url(host), *_names_of_machine())
        hosts = [f"{name}:{number}" for name in names]
        hosts += names if number == WITHOUT_PORT else ()
        reached = socket.gethostname() if host in EVERYWHERE else host
        address = f"http://{_in_url(reached)}:{number}/?token="
        show(address + token)
        if browser:
            # The port is open already: the browser starts and waits for the page. All users of the
            # machine may see the arguments of its process, so they have a ticket for one time.
            Thread(target=webbrowser.open, args=(address + ticket,), daemon=True).start()
        _run(document, hosts, token, ticket, listener)


def _run(
    document: Document, hosts: Sequence[str], token: str, ticket: str, listener: socket.socket
) -> None:
    """Serve a document; this imports modules that take a second to load."""
    import uvicorn

    from kerfpath.studio.app import LONGEST, application

    class Server(uvicorn.Server):
        """A server that leaves Ctrl-C to the command that started it."""

        @contextmanager
        def capture_signals(self) -> Iterator[None]:
            """Capture no signals."""
            yield

    config = uvicorn.Config(
        application(document, hosts=hosts, token=token, ticket=ticket),
        log_level="warning",
        lifespan="on",
        ws="websockets-sansio",
        ws_max_size=LONGEST,
        ws_per_message_deflate=False,
        server_header=False,
        timeout_graceful_shutdown=1,
    )
    Server(config).run(sockets=[listener])


def _listener(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        raise InputError(
            f"studio: cannot listen at {host} port {port} ({error.strerror or error}); give "
            "another --port, or 0 for any that is free"
        ) from None
    return listener


def _names_of_machine() -> list[str]:
    """Return the names and addresses of this machine in URLs."""
    own = socket.gethostname()
    found = {own, socket.getfqdn()}
    with suppress(OSError):
        found |= {str(entry[4][0]) for entry in socket.getaddrinfo(own, None)}
    return [_in_url(name) for name in sorted(found)]


def _in_url(host: str) -> str:
    return f"[{host}]" if ":" in host else host
