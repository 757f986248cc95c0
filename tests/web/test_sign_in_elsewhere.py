"""PINs from other machines, the panel's own alarms of its users, and users that vanish."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest

from tests.support.confirmed import PANEL
from tests.support.parts import ROOT, Server, until
from tests.support.servers import demo_server, ready
from tests.support.users import Browsers, add_user, command, log_rows

FAR: Final = {"x-forwarded-for": "192.0.2.7"}
PASSWORD: Final = "long enough"


def server_of(data: Path, **more: Any) -> Server:
    return ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_MODE="demo", **more))


def own_alarms(server: Server) -> dict[str, Any]:
    return {alarm["id"]: alarm for alarm in server.http.get("/alarms").json()["alarms"]}


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_user(data, "M. Sato", "operator", pin="2580", password=PASSWORD)
    with server_of(data, KIOSK_PROXIES="127.0.0.1") as mine:
        yield mine


def far(browsers: Browsers, server: Server) -> httpx.Client:
    client = browsers.opened(server.url)
    client.headers.update(FAR)
    return client


def test_a_pin_is_taken_at_the_panel_itself_and_a_password_elsewhere_too(
    browsers: Browsers, kiosk: Server
) -> None:
    client = far(browsers, kiosk)
    answer = client.post("/session", json={"user": "M. Sato", "pin": "2580"})
    assert (answer.status_code, answer.json()["code"]) == (403, "sign_in_pin_here")
    page = client.get("/signin?user=M.+Sato&password=0").text
    assert 'name="password"' in page
    assert 'name="pin"' not in page
    entered = client.post("/session", data={"user": "M. Sato", "pin": "2580"})
    assert entered.status_code == 303
    assert "A PIN works only at the panel" in client.get(entered.headers["location"]).text
    assert client.post("/session", json={"user": "M. Sato", "password": PASSWORD}).status_code == 200
    here = browsers.opened(kiosk.url)
    assert here.post("/session", json={"user": "M. Sato", "pin": "2580"}).status_code == 200


def test_elsewhere_too_the_page_of_sign_in_leads_to_the_own_sign_ins(
    browsers: Browsers, kiosk: Server
) -> None:
    here, client = browsers.opened(kiosk.url), far(browsers, kiosk)
    for browser, secret in ((here, {"pin": "2580"}), (client, {"password": PASSWORD})):
        assert 'href="/sessions"' not in browser.get("/signin").text
        browser.post("/session", json={"user": "M. Sato", **secret}).raise_for_status()
        assert browser.get("/signin").text.count('href="/sessions"') == 1
    addresses = [row["address"] for row in client.get("/sessions").json()["sessions"]]
    assert addresses[-2:] == ["127.0.0.1", "192.0.2.7"]


def test_at_the_panel_one_who_errs_delays_nobody_else(browsers: Browsers, tmp_path: Path) -> None:
    add_user(tmp_path, "M. Sato", "operator", pin="2580")
    add_user(tmp_path, "J. Brandt", "engineer", pin="1470", badge="04A2B3")
    with server_of(tmp_path) as server:
        client = browsers.opened(server.url)
        for _ in range(5):
            client.post("/session", json={"user": "M. Sato", "pin": "0000"})
            client.post("/session", json={"badge": "FFFFFFFF"})
        sato = client.post("/session", json={"user": "M. Sato", "pin": "2580"})
        assert (sato.status_code, sato.json()["code"]) == (429, "sign_in_wait")
        brandt = client.post("/session", json={"user": "J. Brandt", "pin": "1470"})
        assert brandt.status_code == 200

        def badge() -> bool:
            return client.post("/session", json={"badge": "04A2B3"}).status_code == 200

        until(badge, "the next badge is taken within seconds", 12)


@pytest.mark.long("detail")
def test_users_that_vanish_lock_the_panel_which_says_so_until_it_is_opened(
    browsers: Browsers, tmp_path: Path
) -> None:
    add_user(tmp_path, "J. Brandt", "engineer", pin="1470")
    with server_of(tmp_path) as server:
        client = browsers.signed_in(server.url, "J. Brandt", pin="1470")
        (tmp_path / "users.json").unlink()
        until(lambda: client.get("/session").json()["role"] == "viewer", "it locks")
        until(lambda: "panel_users" in own_alarms(server), "the alarm")
        answer = client.post("/session", json={"user": "J. Brandt", "pin": "1470"})
        assert (answer.status_code, answer.json()["code"]) == (503, "users_unreadable")
        assert "users.json is gone" in server.process.text
    with server_of(tmp_path) as server:
        anybody = browsers.opened(server.url)
        assert anybody.get("/session").json()["role"] == "viewer"
        until(lambda: "panel_users" in own_alarms(server), "the alarm")
        command(tmp_path, "open")
        until(lambda: anybody.get("/session").json()["role"] == "engineer", "it opens")
        until(lambda: own_alarms(server)["panel_users"]["state"] == "returned", "the alarm returns")
        rows = [(row["action"], row["outcome"]) for row in log_rows(anybody) if row["kind"] == "access"]
        for action in ("users_locked", "users_open"):
            assert action in [name for name, _ in rows], rows


def test_a_press_is_confirmed_elsewhere_by_the_password_where_a_pin_is_not_taken(
    browsers: Browsers, tmp_path: Path
) -> None:
    data = tmp_path / "data"
    add_user(data, "M. Sato", "operator", pin="2580", password=PASSWORD)
    with demo_server(tmp_path, PANEL, KIOSK_DATA=str(data), KIOSK_PROXIES="127.0.0.1") as server:
        here = browsers.signed_in(server.url, "M. Sato", pin="2580")
        assert 'name="_pin"' in here.get("/widgets/start/confirm").text
        client = far(browsers, server)
        client.post("/session", json={"user": "M. Sato", "password": PASSWORD}).raise_for_status()
        sheet = client.get("/widgets/start/confirm").text
        assert ('name="_password"' in sheet, 'name="_pin"' in sheet) == (True, False)
        body: dict[str, Any] = {"inputs": {"heat": 300}}
        refused = client.post("/widgets/start/confirm", json=body | {"pin": "2580"})
        assert (refused.status_code, refused.json()["code"]) == (403, "sign_in_pin_here")
        confirmed = client.post("/widgets/start/confirm", json=body | {"password": PASSWORD})
        assert confirmed.status_code == 200
