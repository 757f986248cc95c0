"""The contract over HTTP, with the demo robot: the server as users start it."""

import json
import re
import secrets
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from urllib.parse import urlencode

import httpx
import pytest
import zenoh
from websockets.exceptions import ConnectionClosed, InvalidStatus

from app.web.assets import script_hash
from tests.support.parts import (
    ENOUGH_S,
    REFERENCE,
    ROOT,
    Bridge,
    Process,
    RosNode,
    Server,
    free_port,
    http_client,
    live,
    publish_and_go,
    until,
)
from tests.support.servers import ready

pytestmark = pytest.mark.promise("scripts")

PANEL = REFERENCE.read_text()
FORM = {"content-type": "application/x-www-form-urlencoded"}


def client_of(bridge: Bridge) -> zenoh.Config:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{bridge.endpoint}"]')
    return config


@pytest.fixture(scope="module")
def demo() -> Iterator[Server]:
    with ready(Server(ROOT)) as mine:
        until(lambda: mine.widget("operation1")["enabled"], "the demo robot permits", within_s=40)
        yield mine


def test_demo_mode_shows_its_banner_on_every_page(demo: Server) -> None:
    for path in ("/", "/pages/operation", "/log", "/nothing"):
        assert "SIMULATED ROBOT" in demo.http.get(path, headers={"accept": "text/html"}).text
    assert demo.snapshot()["notice"]["banner"] == "SIMULATED ROBOT"


def test_demo_robot_publishes_the_text_that_it_received(demo: Server) -> None:
    assert demo.press("operation", "hello <b>").json()["outcome"] == "published"
    until(lambda: "hello <b>" in demo.widget("last_heard")["text"], "it is shown")
    html = demo.http.get("/").text
    assert "hello &lt;b&gt;" in html
    assert "hello <b>" not in html


@pytest.mark.long("real time")
def test_every_connection_starts_with_a_snapshot_and_then_beats(demo: Server) -> None:
    with demo.stream() as stream:
        name, data, event_id = stream.next("snapshot", "update", "link", "beat")
        assert name == "snapshot"
        assert set(data["widgets"]) == set(re.findall(r'^id = "(\w+)"\nkind', PANEL, re.MULTILINE))
        assert re.fullmatch(r"[0-9a-f]+-\d+", event_id)
        assert data["id"] == event_id
        first = time.monotonic()
        stream.next("beat")
        stream.next("beat")
        assert time.monotonic() - first < 1.75


def test_the_stream_is_not_stored(demo: Server) -> None:
    with demo.http.stream("GET", "/events") as response:
        assert response.headers["content-type"].startswith("text/event-stream")
        assert response.headers["cache-control"] == "no-store"
        assert "content-encoding" not in response.headers


def test_a_change_comes_as_an_update(demo: Server) -> None:
    with demo.stream() as stream:
        _, _, before = stream.next("snapshot")
        demo.press("operation", "for the update")
        _, data, after = stream.next("update")
        while "for the update" not in data.get("last_heard", {}).get("text", ""):
            _, data, after = stream.next("update")
        boot, version = before.split("-")
        assert after.split("-")[0] == boot
        assert int(after.split("-")[1]) > int(version)


def test_a_press_without_an_id_gets_one(demo: Server) -> None:
    receipt = demo.press("operation", "x").json()
    assert set(receipt) == {"id", "widget", "outcome", "code", "reason", "at"}
    assert receipt["id"]
    assert receipt["widget"] == "operation"


def test_press_id_is_shared_by_all_ways(demo: Server) -> None:
    ways = ("post", "socket", "post", "socket")
    presses = [demo.by(w).press("operation", "once only", id="one-press").json() for w in ways]
    assert presses == [presses[0]] * len(ways)
    assert demo.process.count("press one-press of") == 1


def test_version_seen_before_a_restart_does_not_count(demo: Server, way: str) -> None:
    demo, own_id = demo.by(way), f"old-page-{way}"
    refused = demo.press("operation", "from an old page", seen="deadbeef-7", id=own_id)
    again = demo.press("operation", "from an old page", seen="deadbeef-7", id=own_id)
    assert again.json() == refused.json()
    assert (refused.status_code, refused.json()["outcome"]) == (409, "refused")
    assert "panel server restarted" in refused.json()["reason"]
    assert refused.json()["code"] == "press_seen_before_restart"
    assert demo.press("operation", "x", seen=demo.snapshot()["id"]).status_code == 200


BAD_BODIES = pytest.mark.parametrize(
    ("body", "names"),
    [
        (b"", "not JSON"),
        (b"[1]", "body"),
        (b'{"inputs": {"message": NaN}}', "NaN"),
        (b'{"inputs": {"message": "x"}, "extra": 1}', "extra"),
        (b'{"inputs": {"message": "x"}, "id": "a b"}', "id"),
        (b'{"inputs": {"message": "x"}, "seen": "later"}', "seen"),
        (b'{"inputs": {"message": "x"}, "at": "yesterday"}', "at"),
        (b"\xff\xfe", "not JSON"),
        (b"[" * 5000, "not JSON"),
        (b'{"inputs": {}}', "message"),
        (b'{"inputs": {"message": 5}}', "Message"),
        (b'{"inputs": {"message": "\\ud800"}}', "Unicode"),
        (b'{"inputs": {"message": "a\\u0000b"}}', "NUL"),
        (b'{"inputs": {"\\ud800": "x"}}', "Unicode"),
        (b'{"inputs": {"message": "x", "nothing": "y"}}', "nothing"),
        (b'{"inputs": {"message": "' + b"x" * 81 + b'"}}', "81 characters"),
    ],
)


@BAD_BODIES
def test_bad_input_is_refused_and_named(demo: Server, body: bytes, names: str) -> None:
    headers = {"content-type": "application/json"}
    answer = demo.http.post("/widgets/operation", content=body, headers=headers)
    assert answer.status_code == 422, answer.text
    assert names in answer.text


@BAD_BODIES
def test_bad_input_on_a_socket_is_named_too_and_loses_nothing(
    demo: Server, body: bytes, names: str
) -> None:
    with demo.socket() as socket:
        start = f'{{"widget": "operation", "id": "{secrets.token_hex(8)}", "inputs"'.encode()
        named = body.replace(b'{"inputs"', start, 1)
        socket.say(named if body == b"\xff\xfe" else named.decode())
        said = socket.hear()
        assert said["status"] == 422, said
        assert names.replace("body", "message").removeprefix("not JSON") in json.dumps(said)

        def comes_through() -> bool:
            """A machine that does much else may have locked it for a moment."""
            return socket.press(widget="operation", inputs={"message": "x"}).status_code == 200

        until(comes_through, "a press comes through", every_s=0.2)


def test_only_command_widgets_can_be_pressed(demo: Server) -> None:
    for widget in ("nothing", "message", "last_heard"):
        assert demo.press(widget).status_code == 404
        assert demo.by("socket").press(widget).status_code == 404
    assert demo.http.get("/pages/nothing").status_code == 404
    assert demo.http.get("/nothing").status_code == 404
    assert demo.http.get("/widgets/operation").status_code == 405


def test_a_form_post_goes_back_to_the_page_with_its_receipt(demo: Server) -> None:
    form = urlencode({"message": "from a form 日本語", "_id": "f00d"})
    answer = demo.http.post("/widgets/operation", content=form, headers=FORM)
    assert answer.status_code == 303
    html = demo.http.get(answer.headers["location"]).text
    assert "Sent at" in html
    assert 'value="from a form 日本語"' in html
    again = demo.http.post("/widgets/operation", content=form, headers=FORM)
    assert again.headers["location"] == answer.headers["location"]
    assert demo.process.count("press f00d.operation of") == 1


def test_other_kinds_of_body_are_named(demo: Server) -> None:
    answer = demo.http.post("/widgets/operation", content=b"x", headers={"content-type": "text/plain"})
    assert answer.status_code == 422
    assert "application/json" in answer.json()["error"]


def test_a_large_body_is_refused(demo: Server) -> None:
    body = b'{"inputs": {"message": "' + b"x" * 70_000 + b'"}}'
    headers = {"content-type": "application/json"}
    assert demo.http.post("/widgets/operation", content=body, headers=headers).status_code == 413

    def chunks() -> Iterator[bytes]:
        for _ in range(70):
            yield b"x" * 1000

    answer = demo.http.post("/widgets/operation", content=chunks(), headers=headers)
    assert answer.status_code == 413
    with demo.socket() as press_socket:
        press_socket.say(json.dumps({"widget": "operation", "inputs": {"message": "x" * 66_000}}))
        assert press_socket.closed() == 1009


def test_server_listens_on_loopback_only(demo: Server) -> None:
    socket.create_connection(("127.0.0.1", demo.port)).close()
    for other in ("127.0.0.2", "::1"):
        with pytest.raises(OSError, match=r"refused|assign"):
            socket.create_connection((other, demo.port))


@pytest.mark.parametrize("path", ["/widgets/operation", "/events", "/presses"])
@pytest.mark.parametrize(
    "headers",
    [
        {"host": "evil.example"},
        {"origin": "https://evil.example"},
        {"origin": "null"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ],
)
def test_other_sites_are_shut_out(demo: Server, path: str, headers: dict[str, str]) -> None:
    if path == "/presses":
        with pytest.raises(InvalidStatus) as refused, demo.socket(**headers):
            raise AssertionError("it opened")
        assert refused.value.response.status_code == 403
        return
    if path == "/events":
        answer = demo.http.get("/events?once=1", headers=headers)
    else:
        answer = demo.http.post(path, json={"inputs": {"message": "x"}}, headers=headers)
    assert answer.status_code == 403


def test_pages_have_a_policy_for_their_one_inline_script_and_no_inline_style(demo: Server) -> None:
    answer = demo.http.get("/")
    policy = answer.headers["content-security-policy"]
    assert "unsafe-inline" not in policy
    assert "default-src 'none'" in policy
    assert "<style" not in answer.text
    assert " style=" not in answer.text
    data, *inline = re.findall(r"<script(?![^>]* src=)([^>]*)>(.*?)</script>", answer.text, re.DOTALL)
    assert data[0] == ' type="application/json" id="page"'  # not executed
    assert len(inline) == 1
    assert f"script-src 'self' {script_hash(inline[0][1])};" in policy
    assert not re.search(r"\bon\w+=", answer.text)
    assert answer.headers["cache-control"] == "no-store"


def test_static_files_are_kept_for_ever_under_their_revision(demo: Server) -> None:
    sheet = re.search(r'href="(/static/[^"]+\.css)"', demo.http.get("/").text)
    assert sheet
    answer = demo.http.get(sheet[1])
    assert answer.status_code == 200
    assert "immutable" in answer.headers["cache-control"]
    assert answer.headers["content-encoding"] == "gzip"
    plain = demo.http.get(sheet[1], headers={"accept-encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert plain.text == answer.text
    assert {response.headers["vary"] for response in (answer, plain)} == {"Accept-Encoding"}
    assert demo.http.get("/static/x/../../pyproject.toml").status_code == 404


def test_health_and_metrics(demo: Server) -> None:
    assert demo.http.get("/healthz").json() == {"status": "ok"}
    assert demo.http.get("/readyz").json() == {"status": "ready"}
    text = demo.http.get("/metrics").text
    assert 'kiosk_link_up{robot=""} 1.0' in text
    assert 'kiosk_presses_total{outcome="published"}' in text


def test_openapi_describes_the_paths(demo: Server) -> None:
    paths = demo.http.get("/openapi.json").json()["paths"]
    assert {"/", "/pages/{page}", "/events", "/widgets/{widget}", "/healthz"} <= set(paths)
    assert "409" in paths["/widgets/{widget}"]["post"]["responses"]


@pytest.mark.long("real time")
def test_server_stops_soon_with_fifty_open_streams_and_sockets(
    servers: Callable[[Server], Server],
) -> None:
    mine = servers(Server(ROOT))
    until(mine.ready, "ready")
    limits = httpx.Limits(max_connections=60)
    with ExitStack() as opened:
        many = opened.enter_context(http_client(mine.url, 10, limits=limits))
        sockets = [opened.enter_context(mine.socket()) for _ in range(50)]
        assert sockets[-1].press(widget="operation", inputs={"message": "x"}).status_code == 200
        streams = [many.send(many.build_request("GET", "/events"), stream=True) for _ in range(50)]
        until(lambda: "kiosk_streams 50.0" in mine.http.get("/metrics").text, "50 streams")
        signalled_at = time.monotonic()
        mine.process.send(signal.SIGTERM)
        for stream in streams:
            stream.read()  # to its end, which is in order
        assert time.monotonic() - signalled_at < 1.0
        mine.process.wait(3)
        for socket in sockets:
            with pytest.raises(ConnectionClosed):
                socket.hear()
    assert "Traceback" not in mine.process.text


@pytest.mark.long("real time")
def test_silent_peer_does_not_delay_shutdown(tmp_path: Path) -> None:
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen()
        mine = live(f"tcp/127.0.0.1:{deaf.getsockname()[1]}", tmp_path)
        taken, _ = deaf.accept()
        began = time.monotonic()
        mine.end(signal.SIGTERM)
        assert time.monotonic() - began < 6  # Zenoh's own time is 10 s
        taken.close()


@pytest.mark.long("detail")
def test_shutdown_abandons_hung_threads_and_logs_where() -> None:
    mine = Server(ROOT, app="tests.support.apps.standing:app")
    assert mine.end(signal.SIGTERM, timeout_s=ENOUGH_S) == 1
    assert "Timeout (0:00:05)!" in mine.process.text
    assert "tests/support/apps/standing.py" in mine.process.text


@contextmanager
def reads_nothing(server: Server) -> Iterator[None]:
    """A client that asks for much and takes none of it."""
    sheet = re.search(r'href="(/static/[^"]+\.css)"', server.http.get("/").text)
    assert sheet
    with socket.socket() as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.connect(("127.0.0.1", server.port))
        deaf.sendall(f"GET {sheet[1]} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode() * 100)
        yield


def test_unread_response_does_not_delay_shutdown() -> None:
    mine = Server(ROOT)
    with reads_nothing(mine):
        until(mine.answers, "it has begun to answer")
        mine.end(signal.SIGTERM)


@pytest.mark.parametrize(
    "path",
    ["/", "/pages/operation", "/healthz", "/readyz", "/log", "/openapi.json", "/pages/none", "/none"],
)
@pytest.mark.parametrize("packed", ["gzip", "identity"])
def test_head_answers_as_get_without_a_body(demo: Server, path: str, packed: str) -> None:
    def answer_to(method: str) -> httpx.Response:
        return demo.http.request(method, path, headers={"accept-encoding": packed})

    def lengths() -> list[str]:
        return [answer_to(method).headers["content-length"] for method in ("HEAD", "GET")]

    head, got = answer_to("HEAD"), answer_to("GET")
    assert (head.status_code, head.content) == (got.status_code, b"")
    for name in set(got.headers) - {"date", "set-cookie", "content-length"}:
        assert head.headers[name] == got.headers[name]
    until(lambda: len(set(lengths())) == 1, "both have the length of what is shown at that moment")
    assert int(head.headers["content-length"]) > 0


def test_head_of_a_static_file_says_its_length(demo: Server) -> None:
    match = re.search(r"/static/\w+/kiosk\.css", demo.http.get("/").text)
    assert match
    head, got = demo.http.head(match[0]), demo.http.get(match[0])
    assert {**got.headers, "date": head.headers["date"]} == dict(head.headers)
    assert head.content == b""


@pytest.mark.parametrize("path", ["/events", "/events?once=1", "/log.csv", "/metrics"])
def test_head_request_of_a_stream_ends_at_once(demo: Server, path: str) -> None:
    until(lambda: "kiosk_streams 0.0" in demo.http.get("/metrics").text, "no stream")
    assert (demo.http.head(path).status_code, demo.http.head(path).content) == (200, b"")
    until(lambda: "kiosk_streams 0.0" in demo.http.get("/metrics").text, "the stream is gone")
    assert "Traceback" not in demo.process.text


def test_wrong_method_gets_405_with_the_allowed_methods(demo: Server) -> None:
    for method, path, allowed in (
        ("HEAD", "/widgets/operation", "POST"),
        ("POST", "/", "GET, HEAD"),
        ("OPTIONS", "/session", "DELETE, GET, HEAD, POST"),
        ("OPTIONS", "/alarms/report", "GET, HEAD, POST"),
        ("OPTIONS", "/recipes/boxes/import", "GET, HEAD, POST"),
        # Another template has the method, but is not the path's.
        ("POST", "/diagnostics/look", "GET, HEAD"),
        ("POST", "/alarms/drive_hot/shelve/confirm", "GET, HEAD"),
    ):
        answer = demo.http.request(method, path)
        assert (answer.status_code, answer.headers["allow"]) == (405, allowed)


def test_a_client_that_reads_nothing_delays_no_other(demo: Server) -> None:
    with demo.http.stream("GET", "/events", timeout=30) as stalled:
        assert stalled.status_code == 200
        with demo.stream() as stream:
            stream.next("snapshot")
            for number in range(60):
                demo.press("operation", f"number {number}")
            until(lambda: "number 59" in demo.widget("last_heard")["text"], "the last one is shown")
            _, data, _ = stream.next("update")
            while "number 59" not in data.get("last_heard", {}).get("text", ""):
                _, data, _ = stream.next("update")


def test_a_faulty_panel_stops_the_start_with_its_places(tmp_path: Path) -> None:
    panel = tmp_path / "bad.toml"
    panel.write_text(REFERENCE.read_text().replace('kind = "text"', 'kind = "txt"'))
    done = subprocess.run(
        [sys.executable, "-m", "uvicorn", "app.main:app", "--port", str(free_port())],
        cwd=ROOT,
        env={"KIOSK_PANEL": str(panel), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    assert done.returncode != 0
    assert 'page[0].group[0].widget[2].kind "message", line 50: unknown kind "txt"' in done.stderr
    assert "Traceback" not in done.stderr


def test_a_wrong_setting_is_named() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "uvicorn", "app.main:app"],
        cwd=ROOT,
        env={"KIOSK_MODE": "simulated", "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    assert done.returncode != 0
    assert 'KIOSK_MODE is "simulated"' in done.stderr


def test_separate_demo_robot_is_marked_as_simulated(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    robot = Process([sys.executable, "-m", "app.simulator", endpoint], {}, cwd=ROOT)
    try:
        kiosk = servers(live(endpoint, tmp_path))
        until(lambda: kiosk.widget("operation1")["enabled"], "the demo robot permits")
        assert kiosk.snapshot()["notice"]["banner"] == "SIMULATED ROBOT"
        assert kiosk.press("operation1", "apart").json()["outcome"] == "published"
        until(lambda: "apart" in kiosk.widget("last_heard")["text"], "heard")
        robot.end()
        until(lambda: not kiosk.widget("operation1")["enabled"], "locked")
    finally:
        robot.end()


def test_a_killed_demo_server_leaves_nothing_but_its_data(tmp_path: Path) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    kiosk = Server(ROOT, TMPDIR=str(temporary), KIOSK_DATA=str(tmp_path / "data"))
    try:
        until(kiosk.ready, "ready")
        shared = Path(f"/proc/{kiosk.process.pid}/maps").read_text()
    finally:
        kiosk.end(signal.SIGKILL)
    assert list(temporary.iterdir()) == []
    assert "/dev/shm/" not in shared  # a file there stays too


def test_bytes_that_are_no_message_lock_and_are_counted(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(live(own_bridge.endpoint, tmp_path))
    until(kiosk.ready, "ready")

    def permit() -> None:
        topic, is_known = "/operation_enabled", lambda: kiosk.widget("operation1")["enabled"]
        publish_and_go(own_node, topic, "std_msgs/msg/Bool", {"data": True}, is_known)

    permit()
    with zenoh.open(client_of(own_bridge)) as peer:

        def locked() -> bool:
            for bad in (b"", b"\0", b"\0\1\0\0", b"\xff" * 100, b"\0\1\0\0" + b"\1" * 100):
                peer.put("operation_enabled", bad)
                peer.put("last_heard", bad)
            return "cannot be read" in (kiosk.widget("operation1")["reason"] or "")

        until(locked, "locked once the peer is connected")
        until(lambda: kiosk.widget("last_heard")["state"] == "unreadable", "shown")
        for _ in range(1000):
            peer.put("operation_enabled", b"\xff" * 50)
    assert kiosk.widget("operation1")["enabled"] is False
    assert (
        'kiosk_undecodable_total{key="operation_enabled",robot=""}' in kiosk.http.get("/metrics").text
    )
    assert kiosk.process.text.count("[ERROR]") <= 2  # a line per topic and minute
    permit()  # a message opens again


def test_no_thread_or_task_is_left_behind_by_a_hundred_streams(demo: Server) -> None:
    def threads() -> int:
        return len(list(Path(f"/proc/{demo.process.pid}/task").iterdir()))

    before = threads()

    def stream() -> None:
        with demo.http.stream("GET", "/events") as response, demo.socket() as socket:
            next(response.iter_text())
            socket.say("junk")

    workers = [threading.Thread(target=stream) for _ in range(100)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    until(lambda: "kiosk_streams 0.0" in demo.http.get("/metrics").text, "all streams are gone")
    assert threads() <= before + 1
