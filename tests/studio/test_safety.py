"""Who is answered, and with which files: no other host, no other site, nobody without the token."""

import json

import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from kerfpath.studio.app import LONGEST, POLICY, application
from kerfpath.studio.document import Document
from studio.talk import HOST, SOCKET, TOKEN, client_of, talking, write_job

TICKET = "b" * 32


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    return write_job(tmp_path_factory.mktemp("job"))


@pytest.fixture
def client(job):
    """A client of a studio that is not at work."""
    return client_of(job)


@pytest.fixture
def guarded(job):
    """The same without the token."""
    app = application(Document(job), hosts=[HOST], token=TOKEN, ticket=TICKET)
    return TestClient(app, base_url=f"http://{HOST}", follow_redirects=False)


EVERYWHERE = ["/", "/client/main.js", "/export/job", "/export/program", "/report", "/mesh/0"]


@pytest.mark.parametrize("path", EVERYWHERE)
@pytest.mark.parametrize(
    "headers",
    [
        {"host": "evil.example"},
        {"host": "127.0.0.1"},
        {"host": "127.0.0.1:9999"},
        {"host": ""},
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": f"https://{HOST}"},
        {"origin": "http://localhost:8087"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ],
    ids=str,
)
def test_another_host_and_another_site_are_refused(client, path, headers):
    answer = client.get(path, headers=headers)
    assert answer.status_code == 403
    assert answer.text.startswith("kerfpath: ")
    assert answer.headers["content-security-policy"] == POLICY


@pytest.mark.parametrize("headers", [{}, {"origin": f"http://{HOST}"}, {"sec-fetch-site": "none"}])
def test_the_page_itself_is_answered(client, headers):
    answer = client.get("/", headers=headers)
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert answer.headers["content-security-policy"] == POLICY
    assert answer.headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize("headers", [{"origin": "http://evil.example"}, {"host": "evil.example"}])
def test_a_socket_for_another_site_is_refused(client, headers):
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(SOCKET, headers=headers):
        pass


def test_nothing_inline_or_evaluated_is_allowed():
    assert "default-src 'none'" in POLICY
    assert "unsafe" not in POLICY


@pytest.mark.parametrize(
    "path",
    [*EVERYWHERE, "/?token=", "/?token=wrong", "/client/?token=a", "/?token=%ff%00", "/?%ff",
     f"/?token={'9' * 5000}", f"/client/main.js?token={TOKEN}"],
)  # fmt: skip
def test_without_the_token_nothing_is_served(guarded, path):
    answer = guarded.get(path)
    assert answer.status_code == 403
    assert "open the whole address that kerfpath studio has printed" in answer.text
    assert answer.text.count("\n") == 1


@pytest.mark.parametrize("query", ["", "?token=", "?token=wrong", f"?token={TICKET}"])
def test_without_the_token_no_socket_opens(guarded, query):
    url = SOCKET.partition("?")[0] + query
    with pytest.raises(WebSocketDisconnect), guarded.websocket_connect(url):
        pass


def test_a_ticket_opens_the_page_once(guarded):
    assert guarded.get(f"/?token={TICKET}").status_code == 303
    assert guarded.get("/").status_code == 200
    guarded.cookies.clear()
    assert guarded.get(f"/?token={TICKET}").status_code == 403
    assert guarded.get("/?token=").status_code == 403


def test_the_address_with_the_token_opens_the_page_and_is_forgotten(guarded):
    answer = guarded.get(f"/?token={TOKEN}")
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"]
    assert TOKEN not in cookie.partition("=")[0]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert guarded.get("/").status_code == 200
    wrong = {"cookie": cookie.partition("=")[0] + "=wrong"}
    guarded.cookies.clear()
    assert guarded.get("/", headers=wrong).status_code == 403
    guarded.get(f"/?token={TOKEN}")
    assert guarded.get("/").status_code == 200
    assert guarded.get("/", headers={"origin": "http://evil.example"}).status_code == 403


def test_a_token_in_the_address_of_anything_else_does_not_open_it(guarded):
    assert guarded.get(f"/export/job?token={TOKEN}").status_code == 403


@pytest.mark.parametrize(
    "name",
    [
        "../_app.py",
        "..%2f_app.py",
        "%2e%2e/_app.py",
        "..\\_app.py",
        "/etc/passwd",
        "//etc/passwd",
        "vendor/../../_app.py",
        "vendor",
        "",
        ".",
        "nothing.js",
        "main.js%00.css",
    ],
)
def test_no_file_outside_of_the_page_is_served(client, name):
    assert client.get(f"/client/{name}").status_code == 404


def test_only_kinds_of_files_that_pages_have_are_served(client, tmp_path, monkeypatch):
    (tmp_path / "a.js").write_text("1")
    (tmp_path / "a.py").write_text("1")
    (tmp_path / "b.js").symlink_to("/etc/hostname")
    monkeypatch.setattr("kerfpath.studio.app.CLIENT", tmp_path)
    assert client.get("/client/a.js").status_code == 200
    assert client.get("/client/a.py").status_code == 404
    assert client.get("/client/b.js").status_code == 404


@pytest.mark.parametrize(
    "path",
    ["/mesh/0", "/mesh/../job", "/export/passwd", "/nothing", "/kept/1", f"/kept/{'9' * 5000}",
     "/kept/%D9%A3", "/kept/-1", f"/mesh/{'9' * 5000}", f"/export/{'9' * 5000}"],
)  # fmt: skip
def test_what_there_is_not_is_not_found(client, path):
    answer = client.get(path)
    assert answer.status_code == 404
    assert len(answer.text) < 100


@pytest.mark.parametrize("path", ["/export/program", "/export/plan.json", "/report"])
def test_what_is_not_planned_yet_cannot_be_taken_along(client, path):
    answer = client.get(path)
    assert answer.status_code == 409
    assert answer.text.count("\n") == 1


def test_the_job_can_be_taken_along_at_once(client, job):
    answer = client.get("/export/job")
    assert answer.text == job.read_text()
    assert "job.toml" in answer.headers["content-disposition"]


@pytest.mark.parametrize(
    "text",
    [
        *("nonsense", "{}", '{"type": "edit"}', '{"type": "<b>"}', "[" * 50_000, '"\\ud800"'),
        '{"type": "forget", "id": %s}' % ("9" * 5000),
        '{"type": "reason", "contour": "a", "node": 1e999, "gamma": 0, "posture": 0}',
    ],
    ids=lambda text: text[:20],
)
def test_a_message_that_is_not_understood_is_answered_in_one_line(client, text):
    with talking(client) as page:
        page._socket.send_text(text)
        said = page.until("error")
        assert "\n" not in said["message"]
        assert "<b>" not in said["message"]
        page.say("save")  # it goes on
        page.until("job")


def test_bytes_close_the_connection(client):
    with talking(client) as page:
        page._socket.send_bytes(b"\0")
        assert page._socket.receive()["type"] == "websocket.close"


def test_an_edit_says_what_it_cannot_do(client):
    with talking(client) as page:
        page.say("edit", path=["plan", "metric", "x"], value=1)
        assert page.until("error", about="edit")["message"].startswith("job: expected a key")
        page.say("relax", contour="slot", index=0)
        assert "no relaxation" in page.until("error", about="relax")["message"]
        page.say("map", contour="slot")
        assert "not planned yet" in page.until("error", about="map")["message"]
        page.say("program")
        assert "not planned yet" in page.until("error", about="program")["message"]
        page.say("fastest", contour="x" * 100)
        assert "not known" in page.until("error", about="fastest")["message"]


def test_a_message_of_the_largest_job_fits():
    job = "#" * 10_000_000
    assert len(json.dumps({"type": "text", "text": job})) < LONGEST
