"""A kerfpath process: found or installed, started, and spoken to over the studio's protocol.

Only the standard library: FreeCAD's Python need not hold kerfpath. Nothing here needs FreeCAD.
"""

import base64
import hashlib
import http.client
import json
import os
import queue
import shutil
import socket
import struct
import subprocess
import sys
import threading
from collections import deque
from urllib.parse import parse_qs, urlsplit

from . import tr

FOREIGN = ("PYTHON", "LD_LIBRARY_PATH", "QT_", "SSL_CERT", "FONTCONFIG_")
"""Beginnings of the variables by which FreeCAD would lead another Python astray."""
LAST_LINES = 30
"""Lines of the errors of a process that a message may quote from."""
START = 300.0
"""s: the longest time in which a process says where it listens; the first start compiles."""
QUIET = {"creationflags": 0x08000000} if sys.platform == "win32" else {}
"""On Windows: no console window."""
PYTHON = ("Scripts", "python.exe") if os.name == "nt" else ("bin", "python")
"""Where an environment has its Python."""
OLDEST = (3, 11)
"""The oldest Python that kerfpath runs in."""


class ProcessError(Exception):
    """kerfpath is not found, does not start, or has ended; the text says what to do."""


class NotFound(ProcessError):
    """kerfpath is in none of the places where it is looked for; it may be installed."""


# -----------------------------------------------------------------------------
# Find kerfpath, or install it.


def clean_environment(variables=None):
    """Return variables (default: those of this process) without what belongs to FreeCAD."""
    given = os.environ if variables is None else variables
    kept = {k: v for k, v in given.items() if not k.startswith(FOREIGN)}
    kept["PATH"] = clean_path(given.get("PATH", ""))
    kept["PYTHONUTF8"] = "1"
    return kept


def clean_path(path):
    """Return a PATH without the folders of FreeCAD's add-ons, which it puts in front."""
    folders = [each for each in path.split(os.pathsep) if each]
    return os.pathsep.join(f for f in folders if "Mod" not in f.replace("\\", "/").split("/"))


def command_of(path):
    """Return the command of a kerfpath, by its path, by its Python's, or by its environment's."""
    if os.path.isdir(path):
        path = os.path.join(path, *PYTHON)
    if not os.path.isfile(path):
        raise ProcessError(tr("there is no kerfpath at {}").format(path))
    if os.path.basename(path).lower().startswith("python"):
        return [path, "-I", "-m", "kerfpath"]
    return [path]


def find(preference="", written="", own="", variables=None):
    """Return the command of kerfpath.

    Parameters
    ----------
    preference : str
        Path in the preferences of the workbench: of kerfpath, of a Python, or of an environment.
    written : str
        File beside the workbench with such a path, which `kerfpath freecad` writes.
    own : str
        Folder of the environment that the workbench installs.
    variables : mapping, optional
        Instead of `os.environ`.

    Raises
    ------
    ProcessError
        There is none. A path that somebody has given is taken or refused, never passed over.
    """
    given = os.environ if variables is None else variables
    recorded = ""
    if written and os.path.isfile(written):
        with open(written, encoding="utf-8") as file:
            recorded = file.read().strip()
    named = (
        (preference, tr("the preference of the workbench names")),
        (given.get("KERFPATH", ""), tr("the variable KERFPATH names")),
        (recorded, tr("`kerfpath freecad` has written")),
    )
    for path, who in named:
        if path:
            try:
                return command_of(path)
            except ProcessError as error:
                raise ProcessError(tr("{}, which {}; correct it").format(error, who)) from None
    home = os.path.expanduser("~")
    on_path = shutil.which("kerfpath", path=clean_path(given.get("PATH", "")))
    guesses = [on_path, os.path.join(home, ".local", "bin", "kerfpath")]
    guesses += [guesses[-1] + ".exe", own]
    for path in filter(None, guesses):
        if os.path.exists(path):
            return command_of(path)
    raise NotFound(
        tr(
            "kerfpath is not found on PATH, in ~/.local/bin or in the workbench's own environment; "
            "install it with the button, or run `kerfpath freecad` in the environment that has it"
        )
    )


def installation(folder, requirement, variables=None):
    """Return the commands that make an environment in a folder and install kerfpath there.

    Raises
    ------
    ProcessError
        There is neither uv nor a Python that is new enough.
    """
    path = clean_path((os.environ if variables is None else variables).get("PATH", ""))
    local = os.path.join(os.path.expanduser("~"), ".local", "bin")
    path = os.pathsep.join([path, local])
    python, oldest = os.path.join(folder, *PYTHON), ".".join(map(str, OLDEST))
    uv = shutil.which("uv", path=path)
    if uv:
        return [
            [uv, "venv", "--clear", "--python", ">=" + oldest, folder],
            [uv, "pip", "install", "--python", python, requirement],
        ]
    test = "import sys, venv, ensurepip; sys.exit(sys.version_info < {!r})".format(OLDEST)
    for name in ("python3", "python", *("python3.{}".format(k) for k in range(20, 10, -1))):
        found = shutil.which(name, path=path)
        if found and not _run([found, "-I", "-c", test]).returncode:
            return [
                [found, "-I", "-m", "venv", "--clear", folder],
                [python, "-I", "-m", "pip", "install", requirement],
            ]
    raise ProcessError(
        tr(
            "to install kerfpath, uv or a Python of version {} or newer with venv is needed, and "
            "none is on PATH; install uv (https://docs.astral.sh/uv) and try again"
        ).format(oldest)
    )


def _run(command):
    return subprocess.run(
        command, env=clean_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, encoding="utf-8", errors="replace", **QUIET
    )  # fmt: skip


def install(folder, requirement):
    """Make an environment in a folder, and install kerfpath there; this takes minutes.

    Raises
    ------
    ProcessError
        With the last lines of the command that failed.
    """
    for command in installation(folder, requirement):
        done = _run(command)
        if done.returncode:
            said = " ".join(done.stdout.strip().splitlines()[-3:])
            shutil.rmtree(folder, ignore_errors=True)
            raise ProcessError(
                tr("{} has failed: {}").format(
                    os.path.basename(command[0]) + " " + command[1], said
                )
            )


# -----------------------------------------------------------------------------
# A process that serves one job.


class Studio:
    """A `kerfpath studio` of one job, and the messages that it sends.

    Nothing here waits, except `get`: a thread starts the process and listens.

    Parameters
    ----------
    command : list of str
        As `find` returns it.
    job : str
        Path of the job, or of a drawing, for which a first job is written beside it.
    version : str
        The version of kerfpath that is expected.
    """

    def __init__(self, command, job, version):
        self._version, self._heard = version, queue.Queue()
        self._waiting, self._lock = [], threading.Lock()
        self._socket = self._stream = self._address = self._cookie = None
        self._closed, self._said = False, deque(maxlen=LAST_LINES)
        self._command = [*command, "studio", job, "--port", "0", "--no-browser", "--json"]
        try:
            self._process = subprocess.Popen(
                self._command, env=clean_environment(), cwd=os.path.dirname(job) or None,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                encoding="utf-8", errors="replace", **QUIET
            )  # fmt: skip
        except OSError as error:
            raise ProcessError(
                tr("{} cannot be started ({})").format(command[0], error.strerror)
            ) from None
        self._errors = threading.Thread(target=self._collect, daemon=True)
        self._errors.start()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    @property
    def pid(self):
        """The number of the process."""
        return self._process.pid

    def heard(self):
        """Return the messages since the last call; one of type "ended" is the last of all."""
        found = []
        while True:
            try:
                found.append(self._heard.get_nowait())
            except queue.Empty:
                return found

    def send(self, kind, **keys):
        """Send a message, now or as soon as the process listens."""
        text = json.dumps({"type": kind, **keys})
        with self._lock:
            if self._socket is None:
                self._waiting.append(text)
            else:
                self._write(0x1, text.encode())

    def get(self, path):
        """Return the content of a file, as "/mesh/ID", (bytes).

        Raises
        ------
        ProcessError
            It is refused, with the reason; or the process does not answer.
        """
        try:
            answer, content = self._request(path, {"Cookie": self._cookie})
        except (OSError, http.client.HTTPException) as error:
            raise ProcessError(tr("kerfpath does not answer ({})").format(error)) from None
        if answer.status != 200:
            raise ProcessError(content.decode("utf-8", "replace").strip())
        return content

    def close(self):
        """End the process and what it has started."""
        self._closed = True
        if self._process.poll() is None:
            self._process.kill() if os.name == "nt" else self._process.terminate()
            try:
                self._process.wait(5)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._thread.join(5)
        for each in (self._stream, self._socket, self._process.stdin, self._process.stdout):
            if each is not None:
                each.close()

    # The threads.

    def _collect(self):
        with self._process.stderr as stream:
            for line in stream:
                if line.strip():
                    self._said.append(line.strip())

    def _listen(self):
        why = None
        timer = threading.Timer(START, self._give_up)
        timer.daemon = True
        timer.start()
        try:
            started = self._process.stdout.readline()
            timer.cancel()
            if started:
                self._connect(json.loads(started))
                while True:
                    self._heard.put(json.loads(self._message()))
        except ProcessError as error:
            why = str(error)
        except (OSError, ValueError, EOFError):
            pass  # it has ended, see below
        finally:
            timer.cancel()
        if self._closed:
            return
        if why is None:
            try:
                self._process.wait(3)
            except subprocess.TimeoutExpired:
                pass
            self._errors.join(3)
            why = self._last_words()
        self._process.kill()
        self._heard.put({"type": "ended", "message": why})

    def _give_up(self):
        self._said.append("error: it did not start within {:g} s".format(START))
        self._process.kill()

    def _last_words(self):
        text = " ".join(self._said)
        if "No such option" in text and "--json" in text:
            return self._other_version("an older version")
        if "No module named kerfpath" in text:
            return tr("the Python {} has no kerfpath; install it there").format(self._command[0])
        said = self._said[-1] if self._said else tr("it said nothing")
        for line in self._said:
            if "error:" in line:
                said = line.partition("error:")[2].strip()
        return tr("kerfpath has ended: {}").format(said)

    def _other_version(self, found):
        return tr(
            "this workbench belongs to kerfpath {}, and {} is {}; run `kerfpath freecad` in the "
            "environment that you want, which installs its workbench, and start FreeCAD again"
        ).format(self._version, self._command[0], found)

    def _connect(self, started):
        if started["version"] != self._version:
            raise ProcessError(self._other_version(started["version"]))
        self._heard.put({"type": "started", "job": started["job"]})
        self._address = urlsplit(started["address"])
        token = parse_qs(self._address.query)["token"][0]
        answer, _ = self._request("/?token=" + token, {})
        self._cookie = (answer.getheader("Set-Cookie") or "").partition(";")[0]
        host = (self._address.hostname, self._address.port)
        connection = socket.create_connection(host, timeout=START)
        key = base64.b64encode(os.urandom(16)).decode()
        connection.sendall(
            "GET /ws?token={} HTTP/1.1\r\nHost: {}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Key: {}\r\nSec-WebSocket-Version: 13\r\n\r\n".format(
                token, self._address.netloc, key
            ).encode()
        )
        self._stream = connection.makefile("rb")
        status = self._stream.readline()
        accept = b""
        while True:
            line = self._stream.readline().strip()
            if not line:
                break
            name, _, value = line.partition(b":")
            if name.lower() == b"sec-websocket-accept":
                accept = value.strip()
        magic = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"  # RFC 6455, section 1.3
        expected = base64.b64encode(hashlib.sha1((key + magic).encode()).digest())
        if b" 101 " not in status or accept != expected:
            raise ProcessError(
                tr("kerfpath has refused the connection: {}").format(status.decode())
            )
        connection.settimeout(None)
        with self._lock:
            self._socket = connection
            for text in self._waiting:
                self._write(0x1, text.encode())
            self._waiting = []

    def _request(self, path, headers):
        connection = http.client.HTTPConnection(
            self._address.hostname, self._address.port, timeout=START
        )
        try:
            connection.request("GET", path, headers=headers)
            answer = connection.getresponse()
            return answer, answer.read()
        finally:
            connection.close()

    # Frames of a WebSocket, RFC 6455, section 5.2.

    def _write(self, kind, data):
        size, mask = len(data), os.urandom(4)
        if size < 126:
            head = struct.pack("!BB", 0x80 | kind, 0x80 | size)
        elif size < 65536:
            head = struct.pack("!BBH", 0x80 | kind, 0x80 | 126, size)
        else:
            head = struct.pack("!BBQ", 0x80 | kind, 0x80 | 127, size)
        key = int.from_bytes(mask * (size // 4 + 1), "big") >> 8 * (4 - size % 4)
        masked = (int.from_bytes(data, "big") ^ key).to_bytes(size, "big")
        try:
            self._socket.sendall(head + mask + masked)
        except OSError:
            pass  # the thread that listens says that it has ended

    def _message(self):
        """Return the text of the next message."""
        parts = []
        while True:
            first, second = self._exactly(2)
            size = second & 0x7F
            if size == 126:
                (size,) = struct.unpack("!H", self._exactly(2))
            elif size == 127:
                (size,) = struct.unpack("!Q", self._exactly(8))
            data, kind = self._exactly(size), first & 0x0F
            if kind == 0x8:
                raise EOFError
            if kind == 0x9:
                with self._lock:
                    self._write(0xA, data)
            elif kind in (0x0, 0x1):
                parts.append(data)
                if first & 0x80:
                    return b"".join(parts).decode()

    def _exactly(self, size):
        data = self._stream.read(size)
        if len(data) < size:
            raise EOFError
        return data
