"""A server that only pretends: the page's files, and whatever messages a test sends to it."""

import base64
import hashlib
import json
import mimetypes
import re
from pathlib import Path

ROOT = Path(__file__).parents[3]

CLIENT = ROOT / "src" / "kerfpath" / "studio" / "client"
ORIGIN = "http://studio.invalid"
SAMPLE = ROOT / "tests" / "studio" / "sample.json"


def policy():
    """The policy under which the page must work: nothing inline but its import map."""
    (text,) = re.findall(
        rb'<script type="importmap">(.*?)</script>', (CLIENT / "index.html").read_bytes(), re.DOTALL
    )
    digest = base64.b64encode(hashlib.sha256(text).digest()).decode()
    return (
        f"default-src 'none'; script-src 'self' 'sha256-{digest}'; style-src 'self'; "
        "img-src 'self' data: blob:; connect-src 'self'; font-src 'self'; base-uri 'none'; "
        "form-action 'none'; frame-ancestors 'none'"
    )


class Pretend:
    """Answers a page with files, meshes, and the messages of a test."""

    def __init__(self, page, *, files=None):
        self.page, self.sent, self.socket, self.refusing = page, [], None, False
        self.files, self.tries = files or {}, 0
        self.elsewhere, self.errors = [], []
        page.on("console", lambda m: m.type in ("error", "warning") and self.errors.append(m.text))
        page.on("pageerror", lambda fault: self.errors.append(str(fault)))
        page.route("**/*", self._answer)
        page.route_web_socket("**/ws*", self._connect)
        self.first, self.react = [], lambda message: None

    def _answer(self, route):
        url = route.request.url
        if not url.startswith(ORIGIN):
            self.elsewhere.append(url)
            route.abort()
            return
        path = url.removeprefix(ORIGIN).split("?")[0].lstrip("/")
        headers = {"content-security-policy": policy()}
        if path in self.files:
            route.fulfill(body=self.files[path], content_type="application/octet-stream")
        elif path == "":
            body = (CLIENT / "index.html").read_bytes()
            route.fulfill(body=body, content_type="text/html", headers=headers)
        elif (file := CLIENT / path.removeprefix("client/")).is_file():
            kind = mimetypes.guess_type(file.name)[0] or "text/plain"
            route.fulfill(body=file.read_bytes(), content_type=kind)
        else:
            route.fulfill(status=404, body=b"")

    def _connect(self, socket):
        self.tries += 1
        if self.refusing:
            socket.close()
            return
        self.socket = socket
        socket.on_message(self._heard)
        for message in self.first:
            self.say(message)

    def _heard(self, text):
        message = json.loads(text)
        self.sent.append(message)
        self.react(message)

    def say(self, message):
        """Send one message to the page."""
        self.socket.send(json.dumps(message))

    def open(self, *first):
        """Open the page; these messages greet it."""
        self.first = list(first)
        self.page.goto(ORIGIN + "/")
