"""Access to the server: allowed hosts, allowed origins, and the token."""

from __future__ import annotations

import hashlib
import hmac
import re
from base64 import b64encode
from collections.abc import Iterable
from hashlib import sha256
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["POLICY", "Guard"]

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


class Guard:
    """Refuses requests for another host, from other sites, and without the token.

    A page of another site cannot read the answers of this server, but a browser would still send
    its requests and open a WebSocket for it.

    Parameters
    ----------
    app : ASGI application
    hosts : iterable of str
        Allowed values of the Host header, with ports.
    token : str or None
        Token that the first request has in its query, and later ones in a cookie; None if no token
        is required.
    """

    def __init__(self, app: ASGIApp, *, hosts: Iterable[str], token: str | None) -> None:
        self._app, self._hosts, self._token = app, frozenset(hosts), token
        # Cookies do not distinguish ports: each server needs a name of its own.
        own = "" if token is None else hashlib.sha256(token.encode()).hexdigest()[:8]
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
            if scope["type"] == "http" and scope["path"] == "/" and self._is_token(asked):
                # The cookie now holds the token, so that the address no longer shows it.
                answer = RedirectResponse("/", status_code=303, headers=HEADERS)
                answer.set_cookie(self._cookie, asked, httponly=True, samesite="strict")
                await answer(scope, receive, send)
                return
            why = "a token is needed: open the address that kerfpath studio has printed"
            await self._refuse(scope, receive, send, why)
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
        if self._token is None:
            return True
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return False
        return cookie is not None and self._is_token(cookie.value)

    def _is_token(self, text: str) -> bool:
        return self._token is not None and hmac.compare_digest(text.encode(), self._token.encode())

    async def _refuse(self, scope: Scope, receive: Receive, send: Send, why: str) -> None:
        if scope["type"] == "websocket":
            await receive()  # the connection request
            await send({"type": "websocket.close", "code": REFUSED, "reason": why})
            return
        answer = PlainTextResponse(f"kerfpath: {why}\n", status_code=403, headers=HEADERS)
        await answer(scope, receive, send)
