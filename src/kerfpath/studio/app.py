"""The web application: one WebSocket, the files of the page, meshes, and downloads."""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import os
import re
from base64 import b64encode
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import asynccontextmanager, suppress
from hashlib import sha256
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, quote

from pydantic import ValidationError
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import (
    FileResponse,
    HTMLResponse,
    JSONResponse,
    PlainTextResponse,
    RedirectResponse,
    Response,
)
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from kerfpath.errors import KerfpathError
from kerfpath.studio.document import Document
from kerfpath.studio.hub import Page
from kerfpath.studio.messages import (
    CandidateRequest,
    ContourRequest,
    ErrorMessage,
    PoseRequest,
    ProgramRequest,
    parse,
)
from kerfpath.studio.program import File

# -----------------------------------------------------------------------------
# Access to the server: allowed hosts, allowed origins, and the token.

PAGE = Path(__file__).parent / "client" / "index.html"


def _import_map(page: bytes) -> str:
    """Return the hash of a page's import map, its only inline script."""
    (text,) = re.findall(rb'<script type="importmap">(.*?)</script>', page, re.DOTALL)
    return f"'sha256-{b64encode(sha256(text).digest()).decode()}'"


POLICY = (
    f"default-src 'none'; script-src 'self' {_import_map(PAGE.read_bytes())}; "
    "style-src 'self'; img-src 'self' data: blob:; "
    "font-src 'self'; connect-src 'self'; media-src blob:; worker-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
"""What a page may load: only files of this server, no other inline code, and no eval."""
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}
REFUSED = 4403
"""Close code of a refused WebSocket."""
NO_TOKEN = (
    "this studio opens only with its token: open the whole address that kerfpath studio has "
    "printed in its terminal, with ?token= and what follows; every start has a new one"
)


def _same(text: str, secret: str) -> bool:
    """Return whether a text is the secret, in a time that does not tell how much of it is right."""
    return hmac.compare_digest(text.encode(), secret.encode())


class Guard:
    """Refuses requests for another host, from other sites, and without the token.

    A page of another site cannot read the answers of this server, but a browser would still send
    its requests and open a WebSocket for it.

    Parameters
    ----------
    app : ASGI application
    hosts : iterable of str
        Allowed values of the Host header, with ports.
    token : str
        Token that the first request, or that for a WebSocket, has in its query, and later ones
        in a cookie.
    ticket : str
        It opens the page once, instead of the token.
    """

    def __init__(self, app: ASGIApp, *, hosts: Iterable[str], token: str, ticket: str) -> None:
        self._app, self._hosts = app, frozenset(hosts)
        self._token, self._ticket = token, ticket
        # Cookies do not distinguish ports: each server needs a name of its own.
        own = hashlib.sha256(token.encode()).hexdigest()[:8]
        self._cookie = f"kerfpath-studio-{own}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if why := self._refusal(headers):
            await self._refuse(scope, receive, send, why)
            return
        if not self._knows_token(headers):
            asked = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
            if scope["type"] == "http":
                if scope["path"] == "/" and (_same(asked, self._token) or self._takes(asked)):
                    # The cookie now holds the token, so that the address no longer shows it.
                    answer = RedirectResponse("/", status_code=303, headers=HEADERS)
                    answer.set_cookie(self._cookie, self._token, httponly=True, samesite="strict")
                    await answer(scope, receive, send)
                else:
                    await self._refuse(scope, receive, send, NO_TOKEN)
                return
            if not _same(asked, self._token):
                await self._refuse(scope, receive, send, NO_TOKEN)
                return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    own.setdefault(name, value)
            await send(message)

        await self._app(scope, receive, send_with_headers)

    def _refusal(self, headers: Headers) -> str:
        """Return the reason to refuse a request by its headers, or ""."""
        host = headers.get("host", "")
        if host not in self._hosts:
            return f"{host!r:.60} is not a name of this server"
        origin = headers.get("origin")
        if origin is not None and origin != f"http://{host}":
            return f"requests from {origin!r:.60} are not answered"
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return "requests from other sites are not answered"
        return ""

    def _knows_token(self, headers: Headers) -> bool:
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return False
        return cookie is not None and _same(cookie.value, self._token)

    def _takes(self, text: str) -> bool:
        """Return whether a text is the ticket; it is not valid any more then."""
        is_ticket = bool(self._ticket) and _same(text, self._ticket)
        if is_ticket:
            self._ticket = ""
        return is_ticket

    async def _refuse(self, scope: Scope, receive: Receive, send: Send, why: str) -> None:
        if scope["type"] == "websocket":
            await receive()  # the connection request
            await send({"type": "websocket.close", "code": REFUSED, "reason": why})
            return
        answer = PlainTextResponse(f"kerfpath: {why}\n", status_code=403, headers=HEADERS)
        await answer(scope, receive, send)


# -----------------------------------------------------------------------------
# The web application: one WebSocket, the files of the page, meshes, and downloads.

if TYPE_CHECKING:
    from kerfpath.studio.session import Session


CLIENT = Path(__file__).parent / "client"
MODULES = sorted(
    file.relative_to(CLIENT).as_posix()
    for file in CLIENT.rglob("*.js")
    if file.name != "early.js"  # not a module
)
"""The modules of the page."""
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
    ".woff2": "font/woff2",
    ".txt": "text/plain; charset=utf-8",
}
"""Media types of the page's files that are served, by suffix."""
LONGEST = 12_000_000
"""Largest message in bytes: a job of the largest size, quoted as JSON."""
LARGEST_FILE = 300_000_000
"""Largest size of a file that a page sends, bytes."""
MOST_LOOKS = 8
"""Number of questions of a page that are answered at the same time; further ones wait."""
MOST_SAID = 300
"""Largest number of characters in the error about an invalid message."""
NO_TEXT = 1003
"""Close code of a connection that sends anything except text."""
REPORT_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:"
)
"""Policy of a report, which has inline scripts: a sandbox without origin and network access."""


def application(
    document: Document, *, hosts: Iterable[str], token: str, ticket: str = ""
) -> Starlette:
    """Return the application that serves one job.

    Parameters
    ----------
    document : Document
        The job.
    hosts : iterable of str
        Allowed values of the Host header, with ports.
    token : str
        Token that requests must have.
    ticket : str, optional
        Opens the page once, instead of the token.
    """
    worker = _Worker(document)

    @asynccontextmanager
    async def at_work(app: Starlette) -> AsyncIterator[None]:
        work = asyncio.create_task(worker.work())
        try:
            yield
        finally:
            work.cancel()
            with suppress(asyncio.CancelledError):
                await work

    app = Starlette(
        routes=[
            Route("/", _index),
            Route("/client/{name:path}", _client),
            Route("/mesh/{name}", _mesh),
            Route("/kept/{number}", _kept),
            Route("/robot/{name}.svg", _robot),
            Route("/part/{name}", _part, methods=["POST"]),
            Route("/solid/{name}", _solid, methods=["POST"]),
            Route("/export/{name}", _export),
            Route("/report", _report),
            WebSocketRoute("/ws", _socket),
        ],
        middleware=[Middleware(Guard, hosts=tuple(hosts), token=token, ticket=ticket)],
        lifespan=at_work,
    )
    app.state.worker = worker
    return app


class _Worker:
    """The session of a document; its import takes a second, in which the page already loads."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._session: Session | None = None
        self._lock = asyncio.Lock()

    async def session(self) -> Session:
        """Return the session once it is imported."""
        async with self._lock:
            if self._session is None:
                self._session = await asyncio.to_thread(_session_of, self._document)
        return self._session

    async def work(self) -> None:
        """Work on the document."""
        await (await self.session()).work()


def _session_of(document: Document) -> Session:
    from kerfpath.studio.session import Session

    return Session(document)


async def _session(app: Starlette) -> Session:
    worker: _Worker = app.state.worker
    return await worker.session()


async def _index(request: Request) -> Response:
    html = (CLIENT / "index.html").read_text()
    # Preload all modules: otherwise each is requested only after one that imports it has loaded.
    links = "".join(f'<link rel="modulepreload" href="client/{quote(each)}">\n' for each in MODULES)
    page = html.replace("</head>", f"{links}</head>")
    return HTMLResponse(page, headers={"cache-control": "no-cache"})


async def _client(request: Request) -> Response:
    return _own_file(request.path_params["name"])


def _own_file(name: str) -> Response:
    """Return a file of the page, and no other file of this machine."""
    none = PlainTextResponse("there is no such file\n", status_code=404)
    if "\0" in name:
        return none
    place = (CLIENT / name).resolve()
    kind = KINDS.get(place.suffix)
    if kind is None or not place.is_relative_to(CLIENT.resolve()) or not place.is_file():
        return none
    return FileResponse(place, media_type=kind, headers={"cache-control": "no-cache"})


async def _mesh(request: Request) -> Response:
    session = await _session(request.app)
    data = session.meshes.get(request.path_params["name"])
    if data is None:
        return PlainTextResponse("there is no such mesh\n", status_code=404)
    kept = {"cache-control": "private, max-age=31536000, immutable"}
    return Response(data, media_type="application/octet-stream", headers=kept)


async def _robot(request: Request) -> Response:
    from kerfpath.cell import picture_of
    from kerfpath.robots import robot, robot_ids

    name = request.path_params["name"]
    if name not in robot_ids():
        return PlainTextResponse("there is no such robot\n", status_code=404)
    picture = await asyncio.to_thread(lambda: picture_of(robot(name)))
    kept = {"cache-control": "private, max-age=3600"}
    return Response(picture, media_type="image/svg+xml", headers=kept)


async def _part(request: Request) -> Response:
    """Begin a new job with the drawing that a page sends."""
    asked = request.query_params

    async def begin(session: Session, name: str, data: bytes) -> Response:
        robot, unit = asked.get("robot") or None, asked.get("unit") or None
        await session.begin(name, data, robot=robot, unit=unit)
        return PlainTextResponse("")

    return await _with_file(request, begin)


async def _solid(request: Request) -> Response:
    """Write the solid that a page sends beside the job."""

    async def read(session: Session, name: str, data: bytes) -> Response:
        unit = request.query_params.get("unit") or ""
        return JSONResponse(await session.solid(name, data, unit=unit))

    return await _with_file(request, read)


async def _with_file(
    request: Request, take: Callable[[Session, str, bytes], Awaitable[Response]]
) -> Response:
    """Return the answer to a file that a page sends, or why it is refused."""
    session, data = await _session(request.app), bytearray()
    async for piece in request.stream():
        data += piece
        if len(data) > LARGEST_FILE:
            said = f"the file has more than {LARGEST_FILE // 10**6} MB; put it beside the job"
            return PlainTextResponse(said, status_code=413)
    try:
        return await take(session, request.path_params["name"], bytes(data))
    except KerfpathError as error:
        return PlainTextResponse(str(error), status_code=409)


async def _kept(request: Request) -> Response:
    session = await _session(request.app)
    number = request.path_params["number"]
    try:
        text = session.kept.plans(int(number) if re.fullmatch("[0-9]{1,9}", number) else -1)
    except KerfpathError as error:
        return PlainTextResponse(f"{error}\n", status_code=404)
    return Response(text, media_type="application/json", headers={"cache-control": "no-store"})


async def _export(request: Request) -> Response:
    session = await _session(request.app)
    name, language = request.path_params["name"], request.query_params.get("language")
    if name == "job":
        document = session.document
        return _download(File(document.path.name, "text/plain", document.text.encode()))
    if name == "script":
        try:
            return _download(await session.script())
        except KerfpathError as error:
            return PlainTextResponse(f"{error}\n", status_code=409)
    if name not in ("program", "plan.json", "trajectory.csv"):
        return PlainTextResponse("there is no export of this name\n", status_code=404)
    try:
        if name == "program":
            from kerfpath.studio.program import zipped

            result, texts = await session.program(language)
            return _download(zipped(result.job.program.name, texts))
        texts = await session.files()
    except KerfpathError as error:
        return PlainTextResponse(f"{error}\n", status_code=409)
    kind = "application/json" if name == "plan.json" else "text/csv"
    return _download(File(name, kind, texts.files[name].encode()))


async def _report(request: Request) -> Response:
    session = await _session(request.app)
    try:
        texts = await session.files()
    except KerfpathError as error:
        return PlainTextResponse(f"{error}\n", status_code=409)
    own = {"content-security-policy": REPORT_POLICY, "cache-control": "no-store"}
    return Response(texts.files["report.html"], media_type="text/html", headers=own)


def _download(file: File) -> Response:
    named = {
        "content-disposition": f"attachment; filename*=UTF-8''{quote(os.fsencode(file.name))}",
        "cache-control": "no-store",
    }
    return Response(file.content, media_type=file.kind, headers=named)


async def _socket(socket: WebSocket) -> None:
    await socket.accept()
    session = await _session(socket.app)
    page = session.hub.open()
    sending, looking = asyncio.create_task(_send(socket, page)), set[asyncio.Task[None]]()
    try:
        while (received := await socket.receive())["type"] == "websocket.receive":
            text = received.get("text")
            if text is None:
                await socket.close(NO_TEXT, "expected text")
                break
            try:
                ask = parse(text)
            except ValidationError as error:
                page.say(ErrorMessage(message=_not_understood(error)))
                continue
            if (
                isinstance(ask, ContourRequest | CandidateRequest | PoseRequest | ProgramRequest)
                and len(looking) < MOST_LOOKS
            ):
                # Slow questions that change nothing do not delay changes.
                look = asyncio.create_task(session.hear(ask, page))
                looking.add(look)
                look.add_done_callback(looking.discard)
            else:
                await session.hear(ask, page)
    finally:
        session.leave(page)
        for look in looking:
            look.cancel()
        sending.cancel()
        # Errors are expected here if the page has gone in the middle of a message.
        with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
            await sending


async def _send(socket: WebSocket, page: Page) -> None:
    while True:
        await socket.send_text(await page.next())


def _not_understood(error: ValidationError) -> str:
    """Return in one line why a message is invalid, without quoting it."""
    first = error.errors(include_url=False, include_input=False)[0]
    if first["type"].startswith("union_tag"):
        return "a message was not understood: unknown type"
    where = "".join(f"{part}: " for part in first["loc"])
    return f"a message was not understood: {where}{first['msg']}"[:MOST_SAID]
