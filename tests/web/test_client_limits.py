"""What one client takes, others still have: requests, pictures and connections, while a hold goes on.

Another machine is another loopback address here: the kiosk's own is 127.0.0.1 and no other.
"""

import json
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

import httpx
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.protocol import State
from websockets.sync.client import ClientConnection, connect

from app.cell.permission.client_limits import RATE_LIMITS, VIEWERS
from app.system.texts import render, say
from app.web.caller import COOKIE
from tests.cell.commands.test_press_limits import FREE
from tests.support.apps.small import PRESSES
from tests.support.holds import PANEL
from tests.support.parts import ENOUGH_S, ROOT, Server, until
from tests.support.servers import demo_server
from tests.support.users import token_of
from tests.web.test_hold_socket import Socket, held

pytestmark = pytest.mark.promise("security")

READ_QUOTA: Final = RATE_LIMITS["reads"].quota
KIOSK: Final = "127.0.0.1"
OTHER: Final = "127.0.0.2"
ANOTHER: Final = "127.0.0.3"
SILENT: Final = "127.0.0.5"  # no test before has taken what it may ask for
ATTACK_S: Final = 3.0
CONNECTIONS: Final = 100
# As many widgets as a large page has, and a camera.
LARGE: Final = (
    PANEL
    + "".join(
        f"""
[[page.widget]]
id = "value_{number}"
kind = "readout"
label = "Value {number}"
topic = "/value_{number}"
type = "std_msgs/msg/Float64"
field = "data"
"""
        for number in range(150)
    )
    + """
[[page.widget]]
id = "view"
kind = "camera"
label = "View"
topic = "/view"
type = "sensor_msgs/msg/CompressedImage"
"""
)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(
        tmp_path_factory.mktemp("cell"), LARGE, app="tests.support.apps.permitted:app"
    ) as mine:
        yield mine


def client(server: Server, address: str) -> httpx.Client:
    """An HTTP client at an address."""
    transport = httpx.HTTPTransport(local_address=address)
    return httpx.Client(base_url=server.url, transport=transport, timeout=ENOUGH_S)


@contextmanager
def flooding(server: Server, address: str, path: str, connections: int) -> Iterator[dict[str, int]]:
    """A client asks as fast as it can for `ATTACK_S`; the answers by status are there at the end. It
    takes no processor from the server and the hold, as another machine does not."""
    words = ["-m", "tests.support.flood", str(server.port), address, path, str(connections)]
    command = ["nice", "-n", "19", sys.executable, *words, str(ATTACK_S)]
    answers: dict[str, int] = {}
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as attacker:
        yield answers
        assert attacker.stdout is not None
        answers.update(json.loads(attacker.stdout.read()))
    assert attacker.returncode == 0


@contextmanager
def a_hold_that_lasts(server: Server) -> Iterator[None]:
    """A hold that is kept, from another process's point of view by a browser, during the block."""
    with held(server) as hold:
        ends: list[str] = []
        over = threading.Event()

        def keep() -> None:
            while not over.wait(0.08):
                said = hold.beat()
                if said["state"] != "held":
                    ends.append(said["code"])
                    return

        keeping = threading.Thread(target=keep)
        keeping.start()
        try:
            yield
        finally:
            over.set()
            keeping.join()
        assert ends == []
        assert server.widget("jog")["held"] is True
        release(hold)


def release(hold: Socket) -> None:
    hold.say(do="end", why="released", lease=hold.lease)
    assert hold.hear()["state"] == "ended"


def page_s(server: Server, address: str = KIOSK) -> float:
    """How long a page takes."""
    began = time.monotonic()
    with client(server, address) as browser:
        answer = browser.get("/", headers={"accept": "text/html"})
    assert (answer.status_code, "Value 149" in answer.text) == (200, True)
    return time.monotonic() - began


@pytest.mark.long("real time")
@pytest.mark.parametrize(
    ("address", "path"),
    [
        pytest.param(KIOSK, "/", id="pages at the kiosk"),
        pytest.param(KIOSK, "/log", id="the log at the kiosk"),
        pytest.param(OTHER, "/", id="pages elsewhere"),
        pytest.param(OTHER, "/openapi.json", id="the description elsewhere"),
        pytest.param(OTHER, "POST /widgets/none", id="presses elsewhere"),
    ],
)
def test_a_hold_lives_through_many_connections_that_ask_without_a_pause(
    cell: Server, address: str, path: str
) -> None:
    """A page takes 15 ms of the event loop or more: all of them in a row, longer than a lease. A page
    waits for two requests of each connection at most, however busy the machine is."""
    in_turn_s = 2 * CONNECTIONS * statistics.median(page_s(cell) for _ in range(5))
    with a_hold_that_lasts(cell), flooding(cell, address, path, CONNECTIONS) as answers:
        time.sleep(ATTACK_S / 4)
        assert page_s(cell) < max(5, in_turn_s)
        assert page_s(cell, ANOTHER) < max(5, in_turn_s)
    assert sum(answers.values()) > 10, answers


def refusal(program: httpx.Client, **headers: str) -> httpx.Response:
    """The first answer 429 to a client that asks again and again."""
    most = int(READ_QUOTA.burst + 20 * READ_QUOTA.per_s)
    with ThreadPoolExecutor(16) as pool:  # in parallel: a busy machine answers few in a row
        answers = pool.map(lambda _: program.get("/healthz", headers=headers), range(most))
        refused = [answer for answer in answers if answer.status_code == 429]
    assert refused, "it was never refused"
    return refused[0]


@pytest.mark.long("real time")
def test_a_client_with_too_many_requests_is_told_when_to_ask_again(cell: Server) -> None:
    with client(cell, OTHER) as program, client(cell, ANOTHER) as another:
        answer = refusal(program)
        assert answer.headers["retry-after"] == "1"
        assert answer.json()["error"].startswith("Too many requests from this device")
        assert answer.headers["x-content-type-options"] == "nosniff"
        page = refusal(program, accept="text/html")
        assert page.headers["refresh"] == "2"
        assert page.text.startswith("Too many requests")
        assert another.get("/healthz").status_code == 200
        assert cell.http.get("/healthz").status_code == 200
        assert cell.process.count(f"too many requests from {OTHER}: answered 429") == 1
        until(lambda: program.get("/healthz").status_code == 200, "it may ask again")


def test_the_kiosks_own_requests_have_no_rate(cell: Server) -> None:
    statuses = {cell.http.get("/healthz").status_code for _ in range(int(READ_QUOTA.burst) + 100)}
    assert statuses == {200}


def test_a_press_over_the_limit_has_a_receipt_not_this_answer(cell: Server) -> None:
    """The limit of presses is reached first."""
    with client(cell, OTHER) as program:
        answers = [program.post("/widgets/none") for _ in range(50)]
    assert {answer.status_code for answer in answers} == {404}


# Viewers of a camera.


@contextmanager
def looking(server: Server, address: str, count: int) -> Iterator[list[ClientConnection]]:
    """Open sockets for pictures that ask for none; those that were refused are not among them."""
    url = f"ws://127.0.0.1:{server.port}/widgets/view/frames"
    with ExitStack() as stack:
        sockets = []
        for _ in range(count):
            way = socket.create_connection(("127.0.0.1", server.port), 10, (address, 0))
            sockets.append(stack.enter_context(connect(url, sock=way, open_timeout=ENOUGH_S)))
        yield [socket for socket in sockets if not refused(socket)]


def refused(socket: ClientConnection) -> bool:
    """Whether the server has closed the socket at once."""
    with suppress(ConnectionClosed):
        socket.ping().wait(ENOUGH_S)
    if socket.protocol.state is State.OPEN:
        return False
    assert socket.close_code == 4429
    return True


@pytest.mark.long("real time")
def test_silent_viewers_leave_places_for_the_kiosk_and_for_others(cell: Server) -> None:
    with a_hold_that_lasts(cell), looking(cell, SILENT, 40) as silent:
        assert len(silent) == VIEWERS.client
        with looking(cell, ANOTHER, 40) as more, looking(cell, "127.0.0.4", 40) as most:
            assert len(silent) + len(more) + len(most) == VIEWERS.others
            with looking(cell, KIOSK, 1) as own:
                assert len(own) == 1
                own[0].send('{"next": true}')
                assert json.loads(own[0].recv(ENOUGH_S))["number"] >= 1
            with client(cell, SILENT) as program:
                answer = program.get("/widgets/view/frame")
                assert (answer.status_code, answer.headers["retry-after"]) == (429, "5")
        with looking(cell, ANOTHER, 1) as own:
            assert len(own) == 1


@pytest.mark.long("detail")
def test_a_viewer_that_asks_for_nothing_is_closed(cell: Server) -> None:
    with looking(cell, SILENT, 1) as silent:
        with pytest.raises(ConnectionClosed):
            silent[0].recv(ENOUGH_S)
        assert silent[0].close_code == 4408


# Each rate of the table, over HTTP. The test is a proxy, which says the addresses of the clients.


def post(server: Server, path: str, address: str, body: object, **headers: str) -> httpx.Response:
    """`address` is "" for the kiosk's own machine."""
    way = {"x-forwarded-for": address} if address else {}
    return httpx.post(f"{server.url}{path}", json=body, headers=way | headers, timeout=ENOUGH_S)


def pressed(server: Server, address: str, **headers: str) -> httpx.Response:
    return post(server, "/widgets/free", address, {"inputs": {}}, **headers)


def canceled(server: Server, press_id: str) -> httpx.Response:
    return post(server, "/widgets/count/cancel", "", {"press": press_id})


def read(server: Server, address: str) -> httpx.Response:
    headers = {"x-forwarded-for": address}
    return httpx.get(f"{server.url}/healthz", headers=headers, timeout=ENOUGH_S)


def by_token(server: Server, name: str) -> httpx.Response:
    bearer = (server.data / f"{name}.token").read_text()
    return server.http.get("/healthz", headers={"authorization": f"Bearer {bearer}"})


def signed_in(server: Server, address: str, number: int) -> httpx.Response:
    return post(server, "/session", address, {"user": f"nobody {number}", "password": "none"})


# The request of a client, by its number, and that of another one.
Ask = Callable[[Server, int], httpx.Response]
FAR, FARTHER, AT_THE_CELL = "192.0.2.7", "192.0.2.8", ""
ASKS: Final[dict[str, tuple[Ask, Ask]]] = {
    "presses": (lambda s, _: pressed(s, FAR), lambda s, _: pressed(s, FARTHER)),
    "address_presses": (
        lambda s, n: pressed(s, FAR, cookie=f"{COOKIE}={n:032x}"),
        lambda s, _: pressed(s, FARTHER),
    ),
    "other_presses": (
        lambda s, n: pressed(s, f"198.51.100.{n + 1}"),
        lambda s, _: pressed(s, AT_THE_CELL),
    ),
    "cancels": (lambda s, _: canceled(s, "p1"), lambda s, _: canceled(s, "p2")),
    "reads": (lambda s, _: read(s, FAR), lambda s, _: read(s, FARTHER)),
    "commands": (
        lambda s, _: post(s, "/session/here", FAR, {}),
        lambda s, _: post(s, "/session/here", FARTHER, {}),
    ),
    "token_requests": (lambda s, _: by_token(s, "line"), lambda s, _: by_token(s, "cell")),
    "sign_ins": (
        lambda s, n: signed_in(s, f"198.51.100.{n + 1}", n),
        lambda s, n: signed_in(s, AT_THE_CELL, n),
    ),
}


@pytest.mark.long("table")
@pytest.mark.parametrize("name", ASKS)
def test_over_a_rate_a_client_is_told_so_and_no_one_else_is(name: str, tmp_path: Path) -> None:
    assert {*ASKS, "provider_sign_ins"} == {*RATE_LIMITS}  # that one needs a provider
    for token in ("line", "cell"):
        (tmp_path / f"{token}.token").write_text(token_of(tmp_path, token, "operator"))
    more = {"STRICT_LIMIT": name, "KIOSK_DATA": str(tmp_path), "KIOSK_PROXIES": KIOSK}
    ask, another = ASKS[name]
    with demo_server(tmp_path, PANEL + FREE, app="tests.support.apps.strict:app", **more) as server:
        answers = (ask(server, number) for number in range(5 * PRESSES))
        refused = next(answer for answer in answers if answer.status_code == 429)
        assert another(server, 0).status_code != 429
    limit, said = RATE_LIMITS[name], refused.json()
    assert refused.headers["retry-after"] == str(limit.retry_after_s)
    assert render(say(limit.sentence)) in (said.get("error") or said["reason"])
