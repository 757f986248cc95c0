"""Control over HTTP: several real clients on one server with the demo robot. Those that are not at
the cell come as through a proxy, which says where from."""

import csv
import io
import json
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import httpx
import pytest

from app.web.caller import COOKIE
from tests.cell.session.test_several_robots import entry, panel_file
from tests.support.parts import REFERENCE, ROOT, Server, http_client, until
from tests.support.servers import ready

pytestmark = pytest.mark.promise("control")

FAST_S = 2.0
PROXY = "127.0.0.1"  # through which those who are not at the cell come


def control_panel(folder: Path, more: str = "", panel: str | None = None) -> Path:
    """The shipped panel, which needs control to press."""
    text = panel or REFERENCE.read_text()
    path = folder / "control.toml"
    path.write_text(
        text.replace("[[interlock]]", f"[control]\nrequired = true\n{more}\n[[interlock]]", 1)
    )
    return path


class Client:
    """A browser without scripts, or a program: it keeps its cookie."""

    def __init__(self, server: Server, address: str = "", base: str = "") -> None:
        headers = {"x-forwarded-for": address} if address else {}
        self.http = http_client(server.url + base, headers=headers)
        self.http.get("/pages/operation")

    def control(self, act: str, **body: object) -> httpx.Response:
        return self.http.post(f"/control/{act}", json=body)

    def take(self) -> bool:
        return bool(self.control("take").json()["done"])

    def press(self, widget: str = "operation") -> httpx.Response:
        return self.http.post(f"/widgets/{widget}", json={"inputs": {"message": "hello"}})

    @property
    def id(self) -> str:
        match = re.search(r'data-me="([0-9a-f]*)"', self.http.get("/pages/operation").text)
        assert match
        return match[1]


@contextmanager
def started(folder: Path, app: str = "app.main:app") -> Iterator[Server]:
    path = control_panel(folder, f"takeover_after_s = {FAST_S}")
    with ready(Server(ROOT, app=app, KIOSK_PANEL=str(path), KIOSK_PROXIES=PROXY)) as mine:
        yield mine


@contextmanager
def clients_of(server: Server) -> Iterator[Callable[..., Client]]:
    """Makes clients that are closed at the end."""
    made: list[Client] = []

    def make(address: str = "", base: str = "") -> Client:
        made.append(Client(server, address, base))
        return made[-1]

    yield make
    for client in made:
        if server.process.running:
            client.control("release")
        client.http.close()


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """That of all tests for which it does not matter what clients were there before."""
    with started(tmp_path_factory.mktemp("control")) as mine:
        yield mine


@pytest.fixture
def client(kiosk: Server) -> Iterator[Callable[..., Client]]:
    """Makes clients of the shared server, where no client has control before and after the test."""
    with clients_of(kiosk) as make:
        assert kiosk.snapshot()["control"]["holder"] == ""
        yield make


@pytest.fixture
def own_kiosk(tmp_path: Path) -> Iterator[Server]:
    """A server of the test's own, which has seen no client."""
    with started(tmp_path) as mine:
        yield mine


@pytest.fixture
def own_client(own_kiosk: Server) -> Iterator[Callable[..., Client]]:
    """Makes clients of the test's own server."""
    with clients_of(own_kiosk) as make:
        yield make


def test_a_press_needs_control(own_client: Callable[..., Client], own_kiosk: Server) -> None:
    ann, bob = own_client("192.0.2.1"), own_client("192.0.2.2")
    free = ann.press()
    assert (free.status_code, free.json()["outcome"], free.json()["code"]) == (
        409, "refused", "control_free",
    )  # fmt: skip
    assert ann.take()
    assert ann.press().json()["outcome"] == "published"
    refused = bob.press()
    assert (refused.status_code, refused.json()["code"]) == (409, "control_held")
    assert "Panel 1 (192.0.2.1)" in refused.json()["reason"]
    assert own_kiosk.press("operation", "no cookie at all").status_code == 409
    assert own_kiosk.by("socket").press("operation", "no cookie at all").status_code == 409
    address = {"x-forwarded-for": "192.0.2.1"}
    for token, status in ((ann.http.cookies[COOKIE], 200), (bob.http.cookies[COOKIE], 409)):
        with own_kiosk.socket(cookie=f"{COOKIE}={token}", **address) as socket:
            answer = socket.press(widget="operation", inputs={"message": "by socket"})
            assert answer.status_code == status, answer.json()
    names = ("Panel 1 (192.0.2.1)", "Panel 2 (192.0.2.2)", "a program (127.0.0.1)")
    until(lambda: all(f"by {n} with" in own_kiosk.process.text for n in names), "the log names each")


STOP_AND_START: Final = """
title = "Cell"
mode = "demo"
[[interlock]]
id = "unused"
topic = "/operation_enabled"
[[page]]
id = "operation"
title = "Operation"
[[page.widget]]
id = "stop"
kind = "publish"
role = "stop"
label = "Stop"
topic = "/stop"
type = "std_msgs/msg/Empty"
message = {}
[[page.widget]]
id = "start"
kind = "publish"
role = "start"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Empty"
message = {}
"""


@pytest.fixture
def stop_client(tmp_path: Path) -> Iterator[Callable[..., Client]]:
    """Makes clients of a panel with a stop and a start."""
    path = control_panel(tmp_path, panel=STOP_AND_START)
    server = Server(ROOT, KIOSK_PANEL=str(path), KIOSK_PROXIES=PROXY)
    with ready(server) as mine, clients_of(mine) as make:
        yield make


def test_every_client_may_stop_and_the_log_says_that_it_had_no_control(
    stop_client: Callable[..., Client],
) -> None:
    ann, bob = stop_client("192.0.2.1"), stop_client("192.0.2.2")
    ann.take()

    def press(client: Client, widget: str) -> httpx.Response:
        return client.http.post(f"/widgets/{widget}", json={"inputs": {}})

    until(lambda: press(ann, "start").status_code == 200, "the robot's nodes are known")
    stopped, started = press(bob, "stop"), press(bob, "start")
    assert (stopped.status_code, stopped.json()["outcome"]) == (200, "published")
    assert (started.status_code, started.json()["code"]) == (409, "control_held")
    snapshot = re.search(r"event: snapshot\ndata: (.*)\n", bob.http.get("/events?once=1").text)
    assert snapshot
    widgets = json.loads(snapshot[1])["widgets"]
    assert (widgets["stop"]["enabled"], widgets["start"]["enabled"]) == (True, False)
    assert press(ann, "stop").status_code == 200
    assert press(ann, "start").status_code == 200  # the stop of another took no control
    rows = list(csv.DictReader(io.StringIO(ann.http.get("/log.csv").text.removeprefix("\ufeff"))))
    closed = [row for row in reversed(rows) if row["kind"] == "closed" and row["widget"] == "stop"]
    assert [(row["browser"], row["verdict"]) for row in closed] == [
        (bob.id, "permitted_without_control"),
        (ann.id, "permitted"),
    ]
    html = ann.http.get("/log").text
    assert html.count("<small>without control</small>") == 1


def test_only_one_of_many_clients_gets_control(client: Callable[..., Client]) -> None:
    clients = [client(f"192.0.2.{n}") for n in range(1, 9)]
    assert [client.take() for client in clients] == [True] + [False] * 7
    assert [client.press().status_code for client in clients] == [200] + [409] * 7


def test_asking_granting_and_giving_up(own_client: Callable[..., Client], own_kiosk: Server) -> None:
    ann, bob = own_client("192.0.2.1"), own_client("192.0.2.2")
    of_bob = bob.id
    ann.take()
    assert bob.control("ask").json()["done"]  # goes through in `FAST_S`
    control = own_kiosk.snapshot()["control"]
    assert (control["asker"], control["asker_name"]) == (of_bob, "Panel 1 (192.0.2.2)")
    assert bob.control("give", to=of_bob).status_code == 409
    granted = ann.control("give", to=of_bob)
    assert granted.json()["control"]["holder"] == of_bob
    assert (ann.press().status_code, bob.press().status_code) == (409, 200)
    assert bob.control("release").json()["done"]
    assert own_kiosk.snapshot()["control"]["holder"] == ""
    assert bob.press().status_code == 409


@pytest.mark.parametrize(
    ("body", "fault"),
    [
        (b'{"to": NaN}', "the body is not JSON: NaN is not a number of JSON"),
        (b'{"at": -Infinity}', "the body is not JSON: -Infinity is not a number of JSON"),
        (rb'{"\ud800": 1}', "the body has half of a surrogate pair, which is not Unicode text"),
        (rb'{"to": "\ud800"}', "the body has half of a surrogate pair, which is not Unicode text"),
        ('{"to": ""}'.encode("utf-16"), "the body is not JSON: "),
        (b"[]", "the body must be an object"),
        (b"[" * 30_000, "the body is not JSON: "),
    ],
)
@pytest.mark.parametrize("act", ["take", "here"])
def test_json_is_read_as_that_of_a_press_is(
    client: Callable[..., Client], act: str, body: bytes, fault: str
) -> None:
    answer = client().http.post(
        f"/control/{act}", content=body, headers={"content-type": "application/json"}
    )
    assert (answer.status_code, answer.json()["error"][: len(fault)]) == (422, fault)


@pytest.mark.parametrize("body", [b"to=%ff", b"to=1&to=2", b"\xff", b"a=1&" * 9])
def test_a_form_is_read_as_that_of_a_press_is(client: Callable[..., Client], body: bytes) -> None:
    kind = {"content-type": "application/x-www-form-urlencoded"}
    answer = client().http.post("/control/take", content=body, headers=kind)
    assert answer.status_code == 422


def test_act_touched_long_ago_is_refused(client: Callable[..., Client]) -> None:
    """A server that stood still takes in later what was touched in the meantime."""
    late = client()
    long_ago = (datetime.now(UTC) - timedelta(seconds=4)).isoformat()
    answer = late.control("take", at=long_ago)
    assert (answer.status_code, answer.json()["done"]) == (409, False)
    assert answer.json()["code"] == "late"
    assert answer.json()["control"]["holder"] == ""

    def taken_now() -> bool:
        return bool(late.control("take", at=datetime.now(UTC).isoformat()).json()["done"])

    until(taken_now, "what is touched now is done")
    assert late.control("release", at=long_ago).json()["done"]
    assert late.control("take", at="yesterday").status_code == 422


def test_lost_holder_frees_control(own_client: Callable[..., Client], own_kiosk: Server) -> None:
    ann = own_client("192.0.2.1")
    with own_kiosk.stream() as stream:
        stream.next("snapshot")
        ann.take()
        assert stream.next("control")[1]["holder"] == ann.id
        began = time.monotonic()
        ann.control("here")
        assert stream.next("control")[1]["holder"] == ""
        assert time.monotonic() - began > 4.5
    assert ann.press().status_code == 409


def test_the_panel_at_the_cell_takes_over(own_client: Callable[..., Client]) -> None:
    ann, cell = own_client("192.0.2.1"), own_client()
    ann.take()
    assert cell.take()
    refused = ann.press().json()
    assert refused["code"] == "control_held"
    assert "The panel at the cell" in refused["reason"]


def test_an_address_that_a_client_makes_up_is_not_the_cell(client: Callable[..., Client]) -> None:
    ann = client("192.0.2.1")
    ann.take()
    forged = client("127.0.0.1, 192.0.2.66")
    assert not forged.take()


def test_the_first_page_of_the_panel_at_the_cell_takes_control(
    own_client: Callable[..., Client], own_kiosk: Server
) -> None:
    cell = own_client()
    assert own_kiosk.snapshot()["control"]["holder"] == ""  # by a program nothing is taken
    html = cell.http.get("/pages/operation", headers={"sec-fetch-dest": "document"}).text
    assert "This panel has control of the robot." in html
    assert own_kiosk.snapshot()["control"]["holder"] == cell.id


def test_the_page_is_right_for_each_before_any_script(own_client: Callable[..., Client]) -> None:
    ann, bob = own_client("192.0.2.1"), own_client("192.0.2.2")
    ann.take()
    until(lambda: ann.press().status_code == 200, "pressed")
    locked = re.compile(r'aria-describedby="why-operation receipt-operation" disabled')
    assert not locked.search(ann.http.get("/pages/operation").text)
    html = bob.http.get("/pages/operation").text
    assert locked.search(html)
    assert "Panel 1 (192.0.2.1) has control of the robot." in html


def test_the_cookie_is_the_browsers_own(client: Callable[..., Client], kiosk: Server) -> None:
    answer = httpx.get(f"{kiosk.url}/", headers={"x-forwarded-for": "192.0.2.1"}, trust_env=False)
    cookie = answer.headers["set-cookie"]
    assert {"HttpOnly", "Path=/", "SameSite=strict"} <= set(cookie.split("; "))
    token = answer.cookies["panel_browser"]
    assert token not in answer.text
    ann = client("192.0.2.1")
    assert "set-cookie" not in ann.http.get("/").headers
    ann.take()
    with kiosk.stream() as stream:
        snapshot = str(stream.next("snapshot")[1])
    for secret in ann.http.cookies.values():
        assert secret not in snapshot
        assert secret not in kiosk.process.text


def test_a_cookie_that_is_none_of_ours_is_replaced(kiosk: Server) -> None:
    for wrong in ("x", "A" * 32, "0" * 33, "<script>"):
        answer = httpx.get(f"{kiosk.url}/", headers={"cookie": f"panel_browser={wrong}"})
        assert re.fullmatch(r"[0-9a-f]{32}", answer.cookies["panel_browser"])


def test_link_from_another_site_keeps_the_identity_of_the_client(kiosk: Server) -> None:
    answer = httpx.get(f"{kiosk.url}/", headers={"sec-fetch-site": "cross-site"}, trust_env=False)
    assert answer.status_code == 200
    assert "set-cookie" not in answer.headers
    assert 'data-me=""' in answer.text


def test_without_a_cookie_control_is_not_taken_but_a_cookie_given(kiosk: Server) -> None:
    with http_client(kiosk.url) as program:
        first = program.post("/control/take", json={})
        assert (first.status_code, first.json()["done"]) == (409, False)
        assert program.post("/control/take", json={}).json()["done"]
        assert program.post("/control/release", json={}).json()["done"]


def test_pages_of_other_sites_get_no_control(kiosk: Server, client: Callable[..., Client]) -> None:
    ann = client("192.0.2.1")
    foreign = [
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
        {"host": "evil.example"},
    ]
    for act in ("take", "ask", "give", "keep", "release", "here"):
        for headers in foreign:
            path = f"/control/{act}"
            assert ann.http.post(path, headers=headers, json={}).status_code == 403
            assert ann.http.post(path, headers=headers, data={"to": ""}).status_code == 403
    assert kiosk.snapshot()["control"]["holder"] == ""


def test_unknown_control_act_is_refused_with_a_reason(client: Callable[..., Client]) -> None:
    ann = client("192.0.2.1")
    unknown = ann.control("steal")
    assert unknown.status_code == 404
    assert "there is take, ask, give, keep, release" in unknown.json()["error"]
    assert "to:" in ann.control("give", to="<script>").json()["error"]
    assert "extra" in ann.control("take", force=True).json()["error"].lower()
    for body in (b"{", b"[]", b"1", b"\xff", b"[" * 50_000):
        answer = ann.http.post("/control/take", content=body)
        assert answer.status_code == 422
        assert "the body" in answer.json()["error"]
    plain = ann.http.post("/control/take", content=b"{}", headers={"content-type": "text/plain"})
    assert plain.status_code == 422
    assert "touched" in ann.control("here", touched="yes").json()["error"]
    assert ann.http.get("/control/take").status_code == 405


def test_refused_form_returns_to_its_page_with_the_reason(client: Callable[..., Client]) -> None:
    ann, bob = client("192.0.2.1"), client("192.0.2.2")
    done = ann.http.post("/control/take", data={"to": "", "page": "operation"})
    assert (done.status_code, done.headers["location"]) == (303, "/pages/operation")
    assert "This panel has control" in ann.http.get(done.headers["location"]).text
    refused = bob.http.post("/control/take", data={"to": "", "page": "operation"})
    assert "Another panel has control" in bob.http.get(refused.headers["location"]).text
    odd = bob.http.get("/pages/operation?control=<script>").text
    assert "<script>" not in odd.split('<form class="control"')[1]


def test_an_act_is_answered_with_a_receipt_and_the_same_id_is_the_same_act(
    client: Callable[..., Client],
) -> None:
    ann, bob = client("192.0.2.1"), client("192.0.2.2")
    first = ann.control("take", id="act-1")
    assert first.status_code == 200
    receipt = first.json()
    assert {name: receipt[name] for name in ("id", "act", "outcome", "code", "reason")} == {
        "id": "act-1", "act": "take", "outcome": "succeeded", "code": "", "reason": "",
    }  # fmt: skip
    assert datetime.fromisoformat(receipt["at"]).tzinfo
    assert receipt["control"]["role"] == "holding"
    assert ann.control("release", id="act-2").json()["done"]
    again = ann.control("take", id="act-1")
    assert (again.status_code, again.json()["at"]) == (200, receipt["at"])
    assert again.json()["control"]["holder"] == ""  # it was not done again
    stolen = bob.control("take", id="act-1")
    assert (stolen.status_code, stolen.json()["code"]) == (409, "press_id_reused")
    assert ann.control("take", id="<script>").status_code == 422


def test_a_form_that_is_sent_twice_is_one_act(client: Callable[..., Client]) -> None:
    ann = client("192.0.2.1")
    match = re.search(r'name="id" value="([0-9a-f]+)"', ann.http.get("/pages/operation").text)
    assert match
    fields = {"to": "", "page": "operation", "id": match[1]}
    assert ann.http.post("/control/take", data=fields).status_code == 303
    assert ann.control("release").json()["done"]
    assert ann.http.post("/control/take", data=fields).status_code == 303
    assert "No panel has control" in ann.http.get("/pages/operation").text


def test_acts_are_in_the_operators_log_its_page_and_its_csv(
    own_client: Callable[..., Client], own_kiosk: Server
) -> None:
    ann, bob = own_client("192.0.2.1"), own_client("192.0.2.2")
    ann.take()
    bob.control("take", id="bobs-act")
    ann.control("release")
    rows = list(csv.DictReader(io.StringIO(ann.http.get("/log.csv").text.removeprefix("\ufeff"))))
    acts = [row for row in rows if row["kind"] == "control"]
    assert [(row["action"], row["browser"], row["outcome"]) for row in reversed(acts)] == [
        ("control_take", ann.id, "succeeded"),
        ("control_take", bob.id, "refused"),
        ("control_release", ann.id, "succeeded"),
    ]
    assert acts[1]["press"] == "bobs-act"
    html = ann.http.get("/log", params={"text": "control_take"}).text
    assert html.count("<b>Take control</b>") == 2
    assert "<b>Release control</b>" not in html
    assert "Another panel has control. You can request it." in html


def test_more_acts_than_a_client_may_are_refused(tmp_path: Path) -> None:
    with started(tmp_path, "tests.support.apps.strict:app") as strict, clients_of(strict) as client:
        ann, bob = client("192.0.2.1"), client("192.0.2.2")
        ann.take()

        def limited() -> httpx.Response | None:
            answer = bob.control("give", to="0" * 12)
            return answer if answer.status_code == 429 else None

        answer: httpx.Response = until(limited, "it is one too many", every_s=0)
        assert answer.headers["retry-after"] == "1"
        assert (answer.json()["outcome"], answer.json()["code"]) == ("refused", "control_too_often")
        assert ann.press().status_code == 200


def test_each_robot_has_its_own_control(tmp_path: Path) -> None:
    robots = panel_file(tmp_path, entry(1), entry(2)).read_text()
    kiosk = Server(ROOT, KIOSK_PANEL=str(control_panel(tmp_path, panel=robots)), KIOSK_PROXIES=PROXY)
    try:
        until(kiosk.ready, "ready")
        ann = Client(kiosk, "192.0.2.1", "/robots/r1")
        bob = Client(kiosk, "192.0.2.2", "/robots/r2")
        assert ann.take()
        assert bob.take()
        assert (ann.press().status_code, bob.press().status_code) == (200, 200)
        ann.http.base_url = httpx.URL(f"{kiosk.url}/robots/r2")
        refused = ann.press().json()
        assert refused["code"] == "control_held"
        assert "Panel 2 (192.0.2.2) has control of Robot 2." in refused["reason"]
        assert kiosk.http.post("/control/take", json={}).status_code == 404
    finally:
        ann.http.close()
        bob.http.close()
        kiosk.end()


def test_no_client_has_control_after_a_restart(
    own_client: Callable[..., Client], own_kiosk: Server, tmp_path: Path
) -> None:
    ann = own_client("192.0.2.1")
    ann.take()
    own_kiosk.process.end()
    again = Server(
        ROOT, own_kiosk.port, KIOSK_PANEL=str(tmp_path / "control.toml"), KIOSK_PROXIES=PROXY
    )
    try:
        until(again.ready, "ready")
        ann.control("here", touched=True)
        assert again.snapshot()["control"]["holder"] == ""
        assert ann.press().status_code == 409
        assert ann.take()  # its cookie is as good as before
    finally:
        again.end()


def test_a_panel_without_control_is_as_it_was() -> None:
    kiosk = Server(ROOT)
    try:
        until(kiosk.ready, "ready")
        assert kiosk.press("operation", "free for all").status_code == 200
        assert kiosk.snapshot()["control"]["required"] is False
        assert 'id="control"' not in kiosk.http.get("/").text
        refused = kiosk.http.post("/control/take", json={})
        assert refused.status_code == 404
        assert "[control]" in refused.json()["error"]
        with kiosk.stream() as stream:
            assert stream.next("browser", "beat")[0] == "beat"
    finally:
        kiosk.end()
