"""A panel with users behind the real nginx and the real Caddy of Debian, with the configurations of
docs/how-to/service.md: TLS ends there, and the panel is below a path."""

import json
import re
import socket
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import httpx
import pytest
from websockets.sync.client import connect

from app.tools.cli.command import main
from tests.support.holds import PANEL, PATIENT, TRIES
from tests.support.parts import ENOUGH_S, ROOT, Process, Server, Stream, events_in, free_port, until
from tests.support.servers import demo_server
from tests.support.users import OPENED, add_user, log_rows, token_of
from tests.web.test_hold_socket import Socket

pytestmark = pytest.mark.promise("neighbours")

PATH: Final = "/cell1"
CLIENT: Final = "127.0.0.5"
FORGED: Final = "203.0.113.66"
BUTTON: Final = """
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Bool"
message = { data = true }
"""
NGINX: Final = """
daemon off;
pid {folder}/nginx.pid;
error_log stderr;
events {{}}
http {{
    access_log off;
    client_body_temp_path {folder}/body;
    proxy_temp_path {folder}/proxy;
    fastcgi_temp_path {folder}/fastcgi;
    uwsgi_temp_path {folder}/uwsgi;
    scgi_temp_path {folder}/scgi;
    {recipe}
}}
"""
CADDY: Final = """
{{
    admin off
    auto_https disable_redirects
}}
{recipe}
"""


class Panel(NamedTuple):
    """A panel's server, the place of its proxy, and a token of an engineer."""

    server: Server
    url: str
    token: str

    def browser(self, **headers: str) -> httpx.Client:
        """A client at `CLIENT`."""
        way = httpx.HTTPTransport(local_address=CLIENT, verify=False)
        return httpx.Client(base_url=self.url, transport=way, timeout=ENOUGH_S, headers=headers)


def recipe(language: str, folder: Path, port: int, target: int) -> str:
    """A block of the documentation, with these files and ports."""
    text = (ROOT / "docs/how-to/service.md").read_text()
    block: str
    (block,) = re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)
    for old, new in {
        "/etc/ssl/panel.pem": str(folder / "tls/panel.pem"),
        "/etc/ssl/private/panel.key": str(folder / "tls/panel.key"),
        "127.0.0.1:8000": f"127.0.0.1:{target}",
        "listen 443": f"listen {port}",
        "plant.example {": f"localhost:{port} {{",
        "plant.example": "localhost",
    }.items():
        block = block.replace(old, new)
    assert str(port) in block
    return block


def started(kind: str, folder: Path, port: int, target: int) -> Process:
    block = recipe(kind, folder, port, target)
    file = folder / "config"
    file.write_text((NGINX if kind == "nginx" else CADDY).format(folder=folder, recipe=block))
    if kind == "nginx":
        return Process(["/usr/sbin/nginx", "-c", str(file)], {})
    own = {"HOME": str(folder), "XDG_DATA_HOME": str(folder), "XDG_CONFIG_HOME": str(folder)}
    return Process(["caddy", "run", "--config", str(file), "--adapter", "caddyfile"], own)


@pytest.fixture(scope="module", params=["nginx", "caddy"])
def panel(
    request: pytest.FixtureRequest, proxies: None, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Panel]:
    folder = tmp_path_factory.mktemp("proxied")
    assert main(["certificate", str(folder / "tls"), "--host", "localhost"]) == 0
    add_user(folder / "data", "M. Sato", "operator", pin="2580")
    token = token_of(folder / "data", "reports", "engineer")
    port = free_port()
    more = {"KIOSK_DATA": str(folder / "data"), "KIOSK_PROXIES": "127.0.0.1", "KIOSK_ROOT_PATH": PATH}
    with demo_server(folder, PANEL + BUTTON, app=PATIENT, **more) as server:
        proxy = started(request.param, folder, port, server.port)
        try:
            until(lambda: listens(port) or not proxy.running, "the proxy listens")
            assert proxy.running, proxy.text
            yield Panel(server, f"https://localhost:{port}{PATH}", token)
        finally:
            proxy.end()


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@contextmanager
def signed_in(panel: Panel, **headers: str) -> Iterator[httpx.Client]:
    with panel.browser(**headers) as browser:
        page = browser.get("/", headers=OPENED)
        assert page.status_code == 200
        assert page.headers["strict-transport-security"]
        browser.post("/session", json={"user": "M. Sato", "pin": "2580"}).raise_for_status()
        yield browser


def pressed_by(panel: Panel, press: str) -> tuple[str, str]:
    """The user and the address of a press in the operator's log."""
    with panel.browser(authorization=f"Bearer {panel.token}") as program:
        (row,) = [row for row in log_rows(program) if row["press"] == press]
    return row["who"], row["address"]


def test_one_signs_in_and_presses_while_events_come(panel: Panel) -> None:
    """Each event comes when it is sent: nothing is kept back by the proxy."""
    with signed_in(panel) as browser, browser.stream("GET", "/events") as response:
        stream = Stream(response)
        for _ in range(3):
            stream.next("beat")
        names = set(browser.cookies)
        assert {"__Secure-panel_browser", "__Secure-panel_session"} <= names
        pressed = browser.post("/widgets/go", json={"id": "through-a-proxy", "inputs": {}})
        assert pressed.json()["outcome"] == "published", pressed.text
        stream.next("beat")
    assert pressed_by(panel, "through-a-proxy") == ("M. Sato", CLIENT)


def test_a_hold_goes_through_a_websocket(panel: Panel) -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    with signed_in(panel) as browser:

        def snapshot() -> dict[str, Any]:
            content: dict[str, Any] = json.loads(events_in(browser.get("/events?once=1").text)[0][1])
            return content

        until(lambda: snapshot()["widgets"]["jog"]["enabled"], "the robot permits")
        cookie = "; ".join(f"{name}={value}" for name, value in browser.cookies.items())
        url = f"{panel.url.replace('https', 'wss')}/widgets/jog/hold"
        for _ in range(TRIES):
            with connect(url, ssl=context, additional_headers={"cookie": cookie}) as connection:
                held = Socket(connection, str(snapshot()["id"]))
                if held.begin()["state"] != "held":
                    continue
                assert held.beat()["state"] == "held"
                held.say(do="end", why="released", lease=held.lease)
                assert held.hear()["state"] == "ended"
                return
    raise AssertionError("no hold began")


def test_an_address_that_a_client_names_does_not_count(panel: Panel) -> None:
    """Through the proxy, which adds the client's own, and beside it from one that is not named."""
    with signed_in(panel, **{"x-forwarded-for": FORGED}) as browser:
        pressed = browser.post("/widgets/go", json={"id": "forged-through", "inputs": {}})
        assert pressed.json()["outcome"] == "published", pressed.text
    way = httpx.HTTPTransport(local_address="127.0.0.9")
    forged = {"x-forwarded-for": FORGED, "x-forwarded-proto": "https"}
    beside = f"{panel.server.url}{PATH}"
    with httpx.Client(base_url=beside, transport=way, headers=forged, timeout=ENOUGH_S) as browser:
        assert "strict-transport-security" not in browser.get("/", headers=OPENED).headers
        browser.post("/session", json={"user": "M. Sato", "pin": "2580"}).raise_for_status()
        pressed = browser.post("/widgets/go", json={"id": "forged-beside", "inputs": {}})
        assert pressed.json()["outcome"] == "published", pressed.text
    assert pressed_by(panel, "forged-through") == ("M. Sato", CLIENT)
    assert pressed_by(panel, "forged-beside") == ("M. Sato", "127.0.0.9")
