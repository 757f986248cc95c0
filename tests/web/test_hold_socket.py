"""The WebSocket of a hold, with the demo robot: who may open it, and what it answers.

Where nothing depends on when a lease ends, the server has leases that a busy machine keeps.
"""

import csv
import io
import json
import signal
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from socket import create_connection
from typing import Any, Final

import httpx
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from app.records.database import NAME
from app.web.caller import COOKIE
from tests.support.holds import PANEL, PATIENT, TRIES, jogging, permit
from tests.support.parts import ENOUGH_S, Bridge, RosNode, Server, events_in, http_client, until
from tests.support.servers import demo_server
from tests.support.users import Browsers, add_user, command

pytestmark = pytest.mark.promise("hold")


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server whose demo robot can be jogged."""
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL, app=PATIENT) as mine:
        yield mine


@pytest.fixture(scope="module")
def prompt(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server whose leases are as short as they are."""
    with demo_server(tmp_path_factory.mktemp("prompt"), PANEL) as mine:
        yield mine


class Socket:
    """One hold, spoken by hand."""

    def __init__(self, connection: ClientConnection, event_id: str) -> None:
        self._connection = connection
        self.event_id = event_id
        self.number = 0
        self.lease = ""
        self.hear()

    def hear(self) -> dict[str, Any]:
        said: dict[str, Any] = json.loads(self._connection.recv(timeout=ENOUGH_S))
        self.stamp, self.at = said["stamp"], time.monotonic()
        return said

    def say(self, **fields: Any) -> None:
        after = 1000 * (time.monotonic() - self.at)
        self._connection.send(json.dumps({"stamp": self.stamp, "after": after, **fields}))

    def begin(self, **more: Any) -> dict[str, Any]:
        self.say(do="begin", **{"inputs": {"speed": 0.5}, "seen": self.event_id, **more})
        said = self.hear()
        self.lease = said.get("lease", "")
        return said

    def beat(self, **more: Any) -> dict[str, Any]:
        self.number += 1
        self.say(do="beat", **{"number": self.number, "lease": self.lease, **more})
        return self.hear()

    def beat_until_it_ends(self) -> dict[str, Any]:
        """As a browser does, which sends on until it gets the answer."""
        while (said := self.beat())["state"] == "held":
            time.sleep(0.05)
        return said

    def closed(self) -> int:
        """The code that the server closes with, after what it still says."""
        with suppress(ConnectionClosed):
            while True:
                self.hear()
        assert self._connection.close_code is not None
        return self._connection.close_code


@contextmanager
def opened(server: Server, **headers: str) -> Iterator[Socket]:
    def snapshot() -> Any:
        text = server.http.get(f"{server.base}/events?once=1", headers=headers).text
        return json.loads(events_in(text)[0][1])

    until(lambda: snapshot()["widgets"]["jog"]["enabled"], "the demo robot permits", within_s=40)
    event_id = snapshot()["id"]
    url = f"ws://127.0.0.1:{server.port}{server.base}/widgets/jog/hold"
    with connect(url, additional_headers=headers) as connection:
        yield Socket(connection, event_id)


@contextmanager
def held(server: Server) -> Iterator[Socket]:
    """A hold that has begun; on a busy machine the time from press to hold may be too long."""
    for _ in range(TRIES):
        with opened(server) as socket:
            if socket.begin()["state"] == "held":
                yield socket
                return
    raise AssertionError("no hold began")


def test_a_hold_is_begun_kept_and_let_go(demo: Server) -> None:
    with held(demo) as socket:
        assert socket.beat()["state"] == "held"
        assert demo.widget("jog")["held"] is True
        socket.say(do="end", why="released", lease=socket.lease)
        said = socket.hear()
        assert (said["state"], said["widget"], said["id"]) == ("ended", "jog", socket.lease)
        until(lambda: not demo.widget("jog")["held"], "no longer held")
    log = csv.DictReader(io.StringIO(demo.http.get("/log.csv?every=true").text.removeprefix("\ufeff")))
    assert {"pressed", "closed"} == {entry["kind"] for entry in log if entry["press"] == said["id"]}


@pytest.mark.parametrize(
    "deflection", [{"x": 1.1, "y": 0}, {"x": float("nan"), "y": 0}, {"x": "far", "y": 0}]
)
def test_a_deflection_out_of_its_limits_is_nonsense(demo: Server, deflection: dict[str, Any]) -> None:
    with held(demo) as socket:
        said = socket.beat(**deflection)
        assert (said["state"], said["code"]) == ("ended", "hold_by_invalid_message")


STICK: Final = """
id = "jog"
kind = "joystick"
label = "Jog"
topic = "/jog"
type = "geometry_msgs/msg/Twist"
interlock = "operation"
"""


@pytest.mark.parametrize("kind", ["hold", "joystick"])
def test_a_hold_ends_when_another_panel_takes_control(tmp_path: Path, kind: str) -> None:
    text = PANEL if kind == "hold" else PANEL[: PANEL.index('id = "jog"')] + STICK
    panel = text.replace("[[interlock]]", "[control]\nrequired = true\n[[interlock]]", 1)
    with demo_server(tmp_path, panel, app=PATIENT, KIOSK_PROXIES="127.0.0.1") as mine:
        far = {"x-forwarded-for": "192.0.2.1"}
        with http_client(mine.url, headers=far) as first, http_client(mine.url) as cell:
            for client in (first, cell):
                client.get("/pages/one")
            assert first.post("/control/take", json={}).json()["done"]
            cookie = f"{COOKIE}={first.cookies[COOKIE]}"
            with opened(mine, **far, cookie=cookie) as socket:
                moves = {} if kind == "hold" else {"x": 1.0, "y": 0.0}
                assert socket.begin(**({} if kind == "hold" else {"inputs": {}}))["state"] == "held"
                assert socket.beat(**moves)["state"] == "held"
                assert cell.post("/control/take", json={}).json()["done"]
                said = socket.hear()
                assert (said["state"], said["outcome"]) == ("ended", "aborted")
                assert "The panel at the cell has control of the robot." in said["reason"]


def signed_out(client: httpx.Client, _: Path) -> None:
    client.delete("/session").raise_for_status()


def disabled(_: httpx.Client, data: Path) -> None:
    command(data, "disable", "M. Sato")


def handed_over(client: httpx.Client, _: Path) -> None:
    client.post("/session", json={"user": "A. Weber", "pin": "2580"}).raise_for_status()


@pytest.mark.long("table")
@pytest.mark.parametrize("change", [signed_out, disabled, handed_over])
def test_a_hold_ends_with_the_sign_in_of_who_holds(
    tmp_path: Path, change: Callable[[httpx.Client, Path], None]
) -> None:
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    for user in ("M. Sato", "A. Weber"):
        add_user(data, user, "operator", pin="2580")
    with demo_server(tmp_path, PANEL, app=PATIENT, KIOSK_DATA=str(data)) as mine:
        every = Browsers()
        client = every.signed_in(mine.url, "M. Sato", pin="2580")
        cookie = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
        with opened(mine, cookie=cookie) as socket:
            assert socket.begin()["state"] == "held"
            assert socket.beat()["state"] == "held"
            change(client, data)
            said = socket.hear()
            assert (said["state"], said["outcome"]) == ("ended", "aborted")
            assert "no longer signed in" in said["reason"]
        every.close()


def test_an_input_with_a_default_may_be_left_out(demo: Server) -> None:
    with opened(demo) as socket:
        said = socket.begin(inputs={})
        assert said["state"] == "held"
    log = csv.DictReader(io.StringIO(demo.http.get("/log.csv?every=true").text.removeprefix("\ufeff")))
    values = {row["values"] for row in log if row["press"] == said["lease"]}
    assert values - {""} == {'{"speed": 0.5}'}


def test_hold_can_be_released_before_the_first_response(demo: Server) -> None:
    with opened(demo) as socket:
        socket.begin()
        socket.say(do="end", why="released")
        said = socket.hear()
        assert (said["state"], said["outcome"]) == ("ended", "published")
        assert said["code"] == "hold_released"


def test_release_before_a_hold_begins_is_answered_with_not_started(demo: Server) -> None:
    with opened(demo) as socket:
        socket.say(do="end", why="released")
        said = socket.hear()
        assert (said["state"], said["status"], said["outcome"]) == ("refused", 409, "refused")
        assert said["code"] == "hold_released_early"
        assert socket.closed() == 4409


@pytest.mark.long("real time")
def test_a_heartbeat_for_a_hold_that_is_over_gets_that_answer_and_revives_nothing(
    prompt: Server,
) -> None:
    with held(prompt) as socket:
        said = socket.hear()
        assert (said["state"], said["outcome"]) == ("ended", "aborted")
        for _ in range(3):
            again = socket.beat()
            assert (again["state"], again["reason"]) == ("ended", said["reason"])
        assert prompt.widget("jog")["held"] is False
        assert socket.closed() == 1000


def test_a_second_holder_is_refused(demo: Server) -> None:
    with held(demo) as first, opened(demo) as second:
        first.beat()
        said = second.begin()
        assert first.beat()["state"] == "held"
        assert (said["state"], said["status"], said["outcome"]) == ("refused", 409, "refused")
        assert said["code"] == "hold_elsewhere"
        assert second.closed() == 4409


@pytest.mark.parametrize(
    ("more", "status", "code"),
    [
        (
            {"stamp": 0, "after": 0, "do": "beat", "lease": "x", "number": 1},
            409,
            "hold_by_invalid_message",
        ),
        ({"seen": "abc-1"}, 409, "press_seen_before_restart"),
        ({"inputs": {"speed": 7}}, 422, "input_outside_limits"),
        ({"inputs": []}, 409, "hold_by_invalid_message"),
        ({"stamp": 1e9}, 409, "hold_press_too_late"),
    ],
)
def test_hold_that_cannot_begin_is_refused(
    demo: Server, more: dict[str, Any], status: int, code: str
) -> None:
    with opened(demo) as socket:
        if more.get("do") == "beat":
            socket.say(**more)
            said = socket.hear()
        else:
            said = socket.begin(**more)
        assert (said["state"], said["status"], said["code"]) == ("refused", status, code)
        assert socket.closed() == 4000 + status


def test_each_refused_hold_is_in_the_log(demo: Server) -> None:
    """One that was judged has two entries, what could not be judged has one."""

    def refused() -> list[dict[str, str]]:
        text = demo.http.get("/log.csv?outcome=refused&widget=jog&every=true").text
        return list(csv.DictReader(io.StringIO(text.removeprefix("\ufeff"))))

    before = len(refused())
    with opened(demo) as socket:
        socket.begin(inputs={"speed": 7})
    with opened(demo) as socket:
        socket.say(do="beat", lease="x", number=1)
        socket.hear()
    new = refused()[: len(refused()) - before]
    assert [(entry["kind"], entry["action"], entry["outcome"]) for entry in new] == [
        ("refused", "hold", "refused"),
        ("closed", "hold", "refused"),
    ]
    nonsense, judged = new
    assert "sent an invalid message" in nonsense["reason"]
    assert "Speed is 7" in judged["reason"]
    assert (judged["values"], judged["verdict"]) == ('{"speed": 7}', "input")
    assert judged["of"] != ""
    assert nonsense["of"] == ""


@pytest.mark.long("real time")
def test_release_while_the_entry_is_written_starts_no_hold(prompt: Server) -> None:
    """The disk takes the entry only after the finger was lifted."""
    for _ in range(TRIES):
        with opened(prompt) as socket:
            db = sqlite3.connect(prompt.data / NAME, isolation_level=None)
            db.execute("BEGIN IMMEDIATE")
            socket.say(do="begin", inputs={"speed": 0.5}, seen=socket.event_id)
            socket.say(do="end", why="released", lease="")
            # Its answer comes after the server got both.
            assert prompt.widget("jog")["held"] is False
            db.execute("ROLLBACK")
            db.close()
            said = socket.hear()
            assert (said["state"], said["status"]) == ("refused", 409)
            assert said["code"] == "hold_released_early"
            assert socket.closed() == 4409
        assert prompt.widget("jog")["held"] is False


@pytest.mark.long("real time")
def test_a_begin_that_was_long_on_its_way_is_refused(prompt: Server) -> None:
    with opened(prompt) as socket:
        time.sleep(0.3)
        said = socket.begin(after=0.0)
        assert (said["state"], said["code"]) == ("refused", "hold_press_too_late")


@pytest.mark.parametrize("text", ["", "[]", "{", '{"do":"dance"}', '"\ud800"'])
def test_nonsense_ends_a_hold(demo: Server, text: str) -> None:
    with held(demo) as socket:
        socket._connection.send(text.encode("utf-8", "replace").decode())
        said = socket.hear()
        assert (said["state"], said["outcome"]) == ("ended", "aborted")


def test_a_message_that_is_too_large_closes_a_hold_at_once(demo: Server) -> None:
    with held(demo) as socket:
        with suppress(ConnectionClosed):  # before the last piece has left
            socket._connection.send(["9" * 60_000, "9" * 6_000])
        assert socket.closed() == 1009
    until(lambda: not demo.widget("jog")["held"], "it is over")


@pytest.mark.parametrize("header", ["Origin: http://evil.example", "Sec-Fetch-Site: cross-site"])
def test_the_doors_are_shut_for_other_sites(demo: Server, header: str) -> None:
    name, _, value = header.partition(": ")
    url = f"ws://127.0.0.1:{demo.port}/widgets/jog/hold"
    with pytest.raises(InvalidStatus) as refused, connect(url, additional_headers={name: value}):
        raise AssertionError("it opened")
    assert refused.value.response.status_code == 403


def test_the_doors_are_shut_under_other_names(demo: Server) -> None:
    way = create_connection(("127.0.0.1", demo.port))
    url = f"ws://evil.example:{demo.port}/widgets/jog/hold"
    with pytest.raises(InvalidStatus) as refused, connect(url, sock=way):
        raise AssertionError("it opened")
    assert refused.value.response.status_code == 403


def test_widget_that_is_not_a_hold_is_not_found(demo: Server) -> None:
    url = f"ws://127.0.0.1:{demo.port}/widgets/speed/hold"
    with pytest.raises(InvalidStatus) as refused, connect(url):
        raise AssertionError("it opened")
    assert refused.value.response.status_code == 404
    assert b"can be held" in (refused.value.response.body or b"")


def test_each_of_several_robots_is_held_on_its_own(tmp_path: Path) -> None:
    robots = "".join(
        f'[[robot]]\nid = "{robot}"\nname = "{robot}"\nnamespace = "/{robot}"\n'
        for robot in ("r1", "r2")
    )
    panel = PANEL.replace("[[interlock]]", robots + "[[interlock]]")
    with demo_server(tmp_path, panel, app=PATIENT) as server:
        with held(server.robot("r2")) as socket:
            assert server.robot("r1").widget("jog")["held"] is False
            assert server.robot("r2").widget("jog")["held"] is True
            socket.say(do="end", why="released", lease=socket.lease)
            assert socket.hear()["state"] == "ended"
        for path in ("/robots/r3/widgets/jog/hold", "/widgets/jog/hold"):
            with pytest.raises(InvalidStatus), connect(f"ws://127.0.0.1:{server.port}{path}"):
                raise AssertionError("it opened")


def test_lost_bridge_ends_the_hold_and_sends_nothing_late(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path
) -> None:
    own_node.subscribe("/jog", "geometry_msgs/msg/Point", depth=1000)
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    server = jogging(own_bridge, own_node, tmp_path, PATIENT)
    try:
        with held(server) as socket:
            until(lambda: own_node.heard("/jog"), "it moves", every_s=0.001)
            own_bridge.kill()
            said = socket.beat_until_it_ends()
            assert said["outcome"] == "unknown"
            assert said["code"] == "hold_stop_not_sent"
        own_bridge.start()
        until(server.ready, "ready again")
        permit(server, own_node, True)
        xs = [point["x"] for point in own_node.heard("/jog")]
        assert set(xs) == {0.5}
    finally:
        server.end()


def test_a_release_that_may_not_have_reached_the_bridge_is_not_published(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    kiosk = servers(jogging(own_bridge, own_node, tmp_path, PATIENT))
    with held(kiosk) as socket:
        socket.beat()
        own_bridge.freeze()
        socket.say(do="end", why="released", lease=socket.lease)
        said = socket.hear()
        own_bridge.thaw()
    assert (said["state"], said["outcome"]) == ("ended", "unknown")
    assert said["code"] == "hold_stop_unconfirmed"
    assert said["reason"].startswith("Released at")
    assert said["reason"] in kiosk.http.get("/log.csv").text


@pytest.mark.long("real time")
def test_stalled_server_has_ended_the_hold_when_it_resumes(prompt: Server) -> None:
    with held(prompt) as socket:
        prompt.process.send(signal.SIGSTOP)
        time.sleep(0.5)
        socket.say(do="beat", number=1, lease=socket.lease)
        prompt.process.send(signal.SIGCONT)
        said = socket.hear()
        assert (said["state"], said["outcome"]) == ("ended", "aborted")
        assert said["code"] == "hold_by_stall"


@pytest.fixture
def at_a_terminal() -> Iterator[None]:
    """The tests themselves may run under nohup, which what they start would inherit."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("at_a_terminal")
def test_closed_terminal_shuts_the_server_down_cleanly(
    tmp_path: Path,
) -> None:
    with demo_server(tmp_path, PANEL, app=PATIENT) as mine, held(mine) as socket:
        mine.process.send(signal.SIGHUP)
        said = socket.beat_until_it_ends()
    assert (said["outcome"], said["code"]) == ("aborted", "hold_by_shutdown")


def test_ending_server_reports_the_end_of_a_hold_despite_a_pending_query(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    kiosk = servers(jogging(own_bridge, own_node, tmp_path, "tests.support.apps.long_stop:app"))
    with held(kiosk) as socket:
        socket.beat()
        own_bridge.freeze()
        kiosk.process.send(signal.SIGTERM)
        said = socket.beat_until_it_ends()
        own_bridge.thaw()
    assert said["outcome"] == "unknown"
    assert said["code"] == "hold_stop_unconfirmed"
    kiosk.process.wait(ENOUGH_S)


@pytest.mark.long("detail")
def test_a_server_that_ends_waits_for_no_browser_that_does_not_close(
    tmp_path: Path,
) -> None:
    with demo_server(tmp_path, PANEL, app=PATIENT) as mine, held(mine) as socket:
        mine.process.send(signal.SIGTERM)
        assert socket.beat_until_it_ends()["state"] == "ended"
        assert socket.closed() in (1000, 1012)
        mine.process.wait(15)  # it waits for nothing else, and for that 40 s


def test_a_hold_can_not_be_pressed(demo: Server) -> None:
    assert demo.http.post("/widgets/jog", json={"inputs": {"speed": 0.5}}).status_code == 404


def test_no_hold_leaves_anything_behind(demo: Server, tmp_path: Path) -> None:
    assert "Traceback" not in demo.process.text
    assert demo.http.get("/healthz").status_code == 200
