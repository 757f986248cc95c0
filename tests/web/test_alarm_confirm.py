"""Acts on alarms that a person confirms: the PIN again, or that of a second person."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, quote, urlsplit

import httpx
import pytest

from tests.support.confirmed import ALARMS, PANEL, add_users
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.support.users import Browsers, log_rows, says, token_of

SHELF = {"reason": "Sensor", "for_s": "900"}


def rows(client: httpx.Client) -> dict[str, Any]:
    listed = client.get("/alarms").raise_for_status().json()["alarms"]
    return {row["id"].partition("/")[0].partition(":")[0]: row for row in listed}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    add_users(folder)
    return folder


@pytest.fixture(scope="module")
def kiosk(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL + ALARMS, KIOSK_DATA=str(data)) as mine:
        until(lambda: len(rows(mine.http)) == 3, "the alarms are raised")
        yield mine


def path(client: httpx.Client, alarm: str, act: str) -> str:
    return f"/alarms/{quote(rows(client)[alarm]['id'], safe='')}/{act}"


def sent(client: httpx.Client, alarm: str, act: str, **fields: str) -> str:
    """Where the form of an act leads."""
    occurrence = {"occurrence": str(rows(client)[alarm]["occurrence"])} if act == "acknowledge" else {}
    answer = client.post(path(client, alarm, act), data={"page": "/alarms", **occurrence, **fields})
    assert answer.status_code == 303, answer.text
    return str(answer.headers["location"])


def refused(location: str) -> str:
    """The code with which the page asks again."""
    assert urlsplit(location).path.endswith("/confirm"), location
    return parse_qs(urlsplit(location).query).get("refused", [""])[0]


def entry(client: httpx.Client, action: str) -> dict[str, str]:
    return next(row for row in reversed(log_rows(client)) if row["action"] == action)


@pytest.mark.parametrize("act", ["acknowledge", "shelve", "out_of_service"])
def test_an_act_without_a_pin_is_refused_with_a_code(
    browsers: Browsers, kiosk: Server, act: str
) -> None:
    client = browsers.signed_in(kiosk.url, "K. Novak", pin="1470")
    body: dict[str, Any] = {"occurrence": rows(client)["hot"]["occurrence"]}
    if act != "acknowledge":
        body = {"reason": "Sensor"} | ({"for_s": 900} if act == "shelve" else {})
    answer = client.post(path(client, "hot", act), json=body)
    assert (answer.status_code, answer.json()["code"]) == (403, "confirm_needed_pin")
    row = rows(client)["hot"]
    assert (row["acknowledged"], row["shelf"], row["out_of_service"]) == (False, None, None)


def test_the_form_asks_and_a_wrong_pin_does_nothing(browsers: Browsers, kiosk: Server) -> None:
    client = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    asking = sent(client, "hot", "acknowledge")
    assert refused(asking) == ""
    page = client.get(asking, headers={"accept": "text/html"})
    assert page.status_code == 200
    assert "Oven hot" in page.text
    assert 'role="stop"' in page.text or 'data-widget="halt"' in page.text  # Stop stays in view
    asking = sent(client, "hot", "acknowledge", _enter="yes", _pin="9999")
    assert refused(asking) == "confirm_wrong_pin"
    assert not says(asking, "9999")
    shown = client.get(asking, headers={"accept": "text/html"}).text
    assert "Tries left:" in shown
    assert rows(client)["hot"]["acknowledged"] is False
    assert refused(sent(client, "hot", "acknowledge", _enter="yes")) == "confirm_empty"


def test_with_the_pin_it_is_done_once_and_the_log_says_by_whom(
    browsers: Browsers, kiosk: Server
) -> None:
    client = browsers.signed_in(kiosk.url, "K. Novak", pin="1470")
    back = sent(client, "hot", "shelve", **SHELF, _enter="yes", _pin="1470")
    assert back.startswith("/alarms?act="), back
    assert rows(client)["hot"]["shelf"]["who"].startswith("K. Novak")
    row = entry(client, "alarm_shelve")
    assert (row["who"], row["outcome"]) == ("K. Novak", "succeeded")
    assert "Confirmed by K. Novak with the PIN." in row["reason"]
    assert "Confirmed by K. Novak" in client.get(back, headers={"accept": "text/html"}).text
    assert sent(client, "hot", "unshelve") == "/alarms"  # brings it back: asks for nothing
    assert rows(client)["hot"]["shelf"] is None


@pytest.mark.parametrize(
    ("entered", "code"),
    [
        ({"_pin": "1470"}, "confirm_who"),
        ({"_user": "K. Novak", "_pin": "1470"}, "confirm_same_person"),
        ({"_user": "M. Sato", "_pin": "2580"}, "confirm_second_role"),
        ({"_user": "J. Brandt", "_pin": "1470"}, "confirm_wrong_pin"),
    ],
)
def test_the_second_person_is_another_one_with_the_role(
    browsers: Browsers, kiosk: Server, entered: dict[str, str], code: str
) -> None:
    client = browsers.signed_in(kiosk.url, "K. Novak", pin="1470")
    asking = sent(client, "guard", "out_of_service", reason="Repair", _enter="yes", **entered)
    assert refused(asking) == code
    assert client.get(asking, headers={"accept": "text/html"}).status_code == 200
    assert rows(client)["guard"]["out_of_service"] is None


def test_two_persons_do_it_and_the_log_names_both(browsers: Browsers, kiosk: Server) -> None:
    client = browsers.signed_in(kiosk.url, "K. Novak", pin="1470")
    entered = {"_enter": "yes", "_user": "J. Brandt", "_pin": "3691"}
    assert sent(client, "guard", "acknowledge", **entered).startswith("/alarms?act=")
    assert rows(client)["guard"]["acknowledged"] is True
    reason = entry(client, "alarm_acknowledge")["reason"]
    assert "K. Novak" in reason
    assert "J. Brandt" in reason
    assert not says(log_rows(client), "3691")


def test_other_alarms_and_all_shown_ask_for_nothing(browsers: Browsers, kiosk: Server) -> None:
    client = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    shown = {row["id"]: row["occurrence"] for row in rows(client).values()}
    answer = client.post("/alarms/acknowledge", json={"alarms": shown})
    codes = {receipt["alarm"]: receipt["code"] for receipt in answer.json()["receipts"]}
    listed = rows(client)
    assert codes[listed["plain"]["id"]] == ""
    assert codes[listed["hot"]["id"]] == "confirm_needed_pin"
    assert listed["plain"]["acknowledged"] is True
    assert listed["hot"]["acknowledged"] is False


def test_nobody_a_viewer_and_a_program_are_refused(
    browsers: Browsers, kiosk: Server, data: Path
) -> None:
    bearer = token_of(data, "line", "engineer")
    body = {"occurrence": rows(kiosk.http)["hot"]["occurrence"]}
    nobody = browsers.opened(kiosk.url)
    assert nobody.post(path(nobody, "hot", "acknowledge"), json=body).json()["code"] == "role_needed"
    program = browsers.new(kiosk.url)
    program.headers["authorization"] = f"Bearer {bearer}"
    until(lambda: program.get("/log.csv").status_code == 200, "the token is known")
    answer = program.post(path(program, "hot", "acknowledge"), json=body)
    assert answer.json()["code"] == "confirm_by_program"


def test_there_is_no_page_for_what_nobody_confirms(browsers: Browsers, kiosk: Server) -> None:
    client = browsers.signed_in(kiosk.url, "K. Novak", pin="1470")
    for alarm, act in (("plain", "acknowledge"), ("hot", "unshelve")):
        assert client.get(f"{path(client, alarm, act)}/confirm").status_code == 404


def test_without_users_the_act_is_locked(tmp_path: Path, browsers: Browsers) -> None:
    with demo_server(tmp_path, PANEL + ALARMS) as server:
        until(lambda: len(rows(server.http)) == 3, "the alarms are raised")
        client = browsers.opened(server.url)
        body = {"occurrence": rows(client)["hot"]["occurrence"]}
        answer = client.post(path(client, "hot", "acknowledge"), json=body)
        assert answer.json()["code"] == "confirm_without_users"
