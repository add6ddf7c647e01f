"""A page of the studio without a browser: what it says, and what it is answered."""

import json
import shutil
from contextlib import contextmanager

from starlette.testclient import TestClient

from jobs import DEMO, SMALL
from kerfpath.studio.app import application
from kerfpath.studio.document import Document

HOST = "127.0.0.1:8087"
TOKEN = "a" * 32
SOCKET = f"ws://{HOST}/ws?token={TOKEN}"
QUICK = SMALL.replace("[plan]", "[plan]\ncertify = false")
"""Two small contours, of which nothing is proved: that takes seconds."""


def write_job(folder, text=QUICK, name="job.toml"):
    """Write a job beside the part of the demo, and return its path."""
    if not (folder / "b_pillar.step").exists():
        shutil.copy(DEMO / "b_pillar.step", folder)
    path = folder / name
    path.write_text(text)
    return path


@contextmanager
def serving(path, **more):
    """A client of the studio at work on a job."""
    with client_of(path, **more) as client:
        yield client


def client_of(path, **more):
    """A client with the token, of the studio of a job that is not at work."""
    app = application(Document(path), hosts=[HOST], token=TOKEN, **more)
    client = TestClient(app, base_url=f"http://{HOST}")
    client.get(f"/?token={TOKEN}")
    return client


class Talk:
    """One page: everything that it has heard, in order."""

    def __init__(self, socket):
        self._socket, self.heard = socket, []

    def say(self, kind, **rest):
        self._socket.send_text(json.dumps({"type": kind, **rest}))

    def hear(self):
        message = json.loads(self._socket.receive_text())
        self.heard.append(message)
        return message

    def until(self, kind, fits=lambda message: True, **keys):
        """The next message of a kind that fits, and that has these values."""
        while True:
            message = self.hear()
            if message["type"] == kind and keys.items() <= message.items() and fits(message):
                return message

    def done(self, revision):
        """The outcome of a revision, once nothing more is computed."""
        self.until("outcome", revision=revision)
        self.until("progress", busy=False)
        return [m for m in self.heard if m["type"] == "outcome"][-1]


@contextmanager
def talking(client):
    """A page that is open."""
    with client.websocket_connect(SOCKET, headers={"origin": f"http://{HOST}"}) as socket:
        yield Talk(socket)
