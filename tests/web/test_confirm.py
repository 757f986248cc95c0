"""Presses that a person confirms: the PIN, password or badge again, or that of a second person."""

import html
import re
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.system.texts import render, say
from tests.support.confirmed import PANEL, add_users
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.support.users import Browsers, add_user, command, log_rows, says, token_of

pytestmark = pytest.mark.promise("users")

HEAT = {"heat": 300}


def permitted(server: Server) -> None:
    """Waits until the robot permits."""
    until(lambda: server.snapshot()["interlocks"]["operation"]["enabled"], "the robot permits")


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_users(data)
    token_of(data, "line", "engineer")
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL, KIOSK_DATA=str(data)) as mine:
        permitted(mine)
        yield mine


def confirm(client: httpx.Client, widget: str, **body: Any) -> httpx.Response:
    return client.post(f"/widgets/{widget}/confirm", json=body)


def press(client: httpx.Client, widget: str, token: str = "", **more: Any) -> httpx.Response:
    body = {"inputs": HEAT if widget == "start" else {}, "confirmation": token} | more
    return client.post(f"/widgets/{widget}", json=body)


def form_fields(page: str) -> dict[str, str]:
    """The hidden fields of a page that asks."""
    pattern = r'<input type="hidden" name="([^"]*)" value="([^"]*)"'
    return {name: html.unescape(value) for name, value in re.findall(pattern, page)}


def test_a_press_without_a_pin_is_refused_and_with_it_is_sent_once(
    browsers: Browsers, kiosk: Server
) -> None:
    client = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    refused = press(client, "start")
    assert (refused.status_code, refused.json()["code"]) == (403, "confirm_needed_pin")
    answer = confirm(client, "start", inputs=HEAT, pin="2580")
    assert answer.status_code == 200, answer.text
    token = answer.json()["confirmation"]
    sent = press(client, "start", token, id=(first := secrets.token_hex(8)))
    assert (sent.status_code, sent.json()["outcome"]) == (200, "published"), sent.text
    assert "Confirmed by M. Sato with the PIN." in sent.json()["reason"]
    assert press(client, "start", token, id=first).json() == sent.json()  # the same press again
    assert press(client, "start", token).json()["code"] == "confirm_needed_pin"


@pytest.mark.parametrize(
    "pressed",
    [
        {"inputs": {"heat": 900}},
        {"widget": "light", "inputs": {"light": True}},
    ],
)
def test_a_confirmation_is_of_one_widget_and_its_values(
    browsers: Browsers, kiosk: Server, pressed: dict[str, Any]
) -> None:
    client = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    token = confirm(client, "start", inputs=HEAT, pin="2580").json()["confirmation"]
    name = pressed.get("widget", "start")
    answer = client.post(f"/widgets/{name}", json={"inputs": pressed["inputs"], "confirmation": token})
    assert answer.json()["code"] == "confirm_needed_pin"


def test_a_confirmation_is_of_no_use_to_another_browser_or_user(
    browsers: Browsers, kiosk: Server
) -> None:
    client = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    other = browsers.signed_in(kiosk.url, "J. Brandt", pin="3691")
    token = confirm(client, "start", inputs=HEAT, pin="2580").json()["confirmation"]
    assert press(other, "start", token).json()["code"] == "confirm_needed_pin"
    token = confirm(client, "start", inputs=HEAT, pin="2580").json()["confirmation"]
    client.post("/session", json={"user": "J. Brandt", "pin": "3691"})
    assert press(client, "start", token).json()["code"] == "confirm_needed_pin"


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ({"pin": "2581"}, "confirm_wrong_pin"),
        ({"badge": "04A2B3C5"}, "confirm_wrong_badge"),
        ({"badge": "77AA88BB"}, "confirm_wrong_badge"),  # another user's
        ({"user": "J. Brandt", "pin": "3691"}, "confirm_wrong_pin"),  # nobody else confirms
    ],
)
def test_what_is_not_that_of_the_signed_in_user_confirms_nothing(
    browsers: Browsers, kiosk: Server, body: dict[str, str], code: str
) -> None:
    client = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    answer = confirm(client, "start", inputs=HEAT, **body)
    assert (answer.status_code, answer.json()["code"]) == (401, code)
    assert answer.json()["tries_left"] >= 1
    assert confirm(client, "start", inputs=HEAT, badge="04A2B3C4").status_code == 200


def test_a_second_person_with_the_role_confirms_and_both_are_named(
    browsers: Browsers, kiosk: Server
) -> None:
    client = browsers.signed_in(kiosk.url, "K. Novak", pin="1470")
    assert press(client, "bypass").json()["code"] == "confirm_needed_two"
    for body, status, code in (
        ({"user": "k. novak", "pin": "1470"}, 403, "confirm_same_person"),
        ({"user": "M. Sato", "pin": "2580"}, 403, "confirm_second_role"),
        ({"badge": "04A2B3C4"}, 403, "confirm_second_role"),
        ({"user": "J. Brandt", "pin": "3690"}, 401, "confirm_wrong_pin"),
    ):
        answer = confirm(client, "bypass", **body)
        assert (answer.status_code, answer.json()["code"]) == (status, code)
    for body, by in (
        ({"user": "J. Brandt", "pin": "3691"}, "PIN"),
        ({"badge": "77AA88BB"}, "badge"),
        ({"user": "L. Rossi", "password": "long enough"}, "password"),
    ):
        token = confirm(client, "bypass", **body).json()["confirmation"]
        said = press(client, "bypass", token).json()
        assert said["outcome"] == "succeeded"
        assert f"Confirmed by K. Novak and {body.get('user', 'J. Brandt')} ({by})." in said["reason"]
    rows = [row for row in log_rows(client) if row["widget"] == "bypass"]
    done = [row for row in rows if row["outcome"] == "succeeded"]
    assert {row["who"] for row in done} == {"K. Novak"}
    assert all("Confirmed by K. Novak and" in row["reason"] for row in done)
    refused = [row for row in rows if row["action"] == "confirm"]
    assert {row["outcome"] for row in refused} == {"refused"}
    assert not says(rows, "1470")


def test_who_is_not_signed_in_or_a_program_confirms_nothing(browsers: Browsers, kiosk: Server) -> None:
    nobody = browsers.opened(kiosk.url)
    answer = confirm(nobody, "start", inputs=HEAT, pin="2580")
    assert (answer.status_code, answer.json()["code"]) == (403, "confirm_sign_in")
    assert press(nobody, "start").json()["code"] == "role_needed"
    operator = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    answer = confirm(operator, "bypass", user="J. Brandt", pin="3691")
    assert (answer.status_code, answer.json()["code"]) == (403, "role_needed")
    assert confirm(operator, "halt", pin="2580").status_code == 404
    assert confirm(operator, "start", pin="2580", badge="04A2B3C4").status_code == 422


def test_a_program_is_told_that_a_person_has_to_confirm(browsers: Browsers, tmp_path: Path) -> None:
    add_users(tmp_path)
    token = token_of(tmp_path, "line", "engineer")
    with demo_server(tmp_path, PANEL, KIOSK_DATA=str(tmp_path)) as server:
        permitted(server)
        headers = {"authorization": f"Bearer {token}"}
        body = {"inputs": HEAT}
        said = server.http.post("/widgets/start", json=body, headers=headers)
        assert (said.status_code, said.json()["code"]) == (403, "confirm_by_program")
        said = server.http.post("/widgets/start/confirm", json={"pin": "2580"}, headers=headers)
        assert (said.status_code, said.json()["code"]) == (403, "confirm_by_program")


def test_wrong_pins_delay_the_sign_in_too(browsers: Browsers, tmp_path: Path) -> None:
    add_users(tmp_path)
    with demo_server(tmp_path, PANEL, KIOSK_DATA=str(tmp_path)) as server:
        client = browsers.signed_in(server.url, "M. Sato", pin="2580")
        left = [
            confirm(client, "start", inputs=HEAT, pin="0000").json()["tries_left"] for _ in range(5)
        ]
        assert left == [4, 3, 2, 1, 0]
        answer = confirm(client, "start", inputs=HEAT, pin="2580")
        assert (answer.status_code, answer.json()["code"]) == (429, "sign_in_wait")
        assert int(answer.headers["retry-after"]) >= 25
        other = browsers.opened(server.url)
        assert other.post("/session", json={"user": "M. Sato", "pin": "2580"}).status_code == 429
        rows = [row for row in log_rows(client) if row["action"] == "confirm"]
        assert [row["widget"] for row in rows] == ["start"] * len(rows) != []


def test_without_enough_users_the_button_is_locked_and_says_what_to_do(
    browsers: Browsers, tmp_path: Path
) -> None:
    with demo_server(tmp_path, PANEL, KIOSK_DATA=str(tmp_path)) as server:
        until(lambda: "users" in str(server.widget("start")["reason"]), "locked for want of users")
        assert press(server.http, "start").json()["code"] == "confirm_without_users"
        assert "confirm_without_users" not in server.process.text
        assert 'widget "start" is locked' in server.process.text
        assert "no users: everyone at this panel may do everything" in server.process.text
        assert '"operator-panel users add" adds users' in server.process.text
        add_user(tmp_path, "K. Novak", "maintenance", pin="1470")
        until(lambda: server.widget("start")["reason"] == "Sign in as Operator.", "there is a user")
        client = browsers.signed_in(server.url, "K. Novak", pin="1470")
        permitted(server)
        assert client.get("/widgets/start/lock").status_code == 204
        assert "two users" in client.get("/widgets/bypass/lock").text
        assert press(client, "bypass").json()["code"] == "confirm_without_second"
        add_user(tmp_path, "J. Brandt", "engineer", pin="3691")
        until(lambda: client.get("/widgets/bypass/lock").status_code == 204, "there is a second")
        command(tmp_path, "disable", "J. Brandt")
        until(lambda: client.get("/widgets/bypass/lock").status_code == 200, "and then not")


def test_a_confirmation_ends_with_the_rights_of_who_gave_it(browsers: Browsers, tmp_path: Path) -> None:
    add_users(tmp_path)
    with demo_server(tmp_path, PANEL, KIOSK_DATA=str(tmp_path)) as server:
        permitted(server)
        client = browsers.signed_in(server.url, "K. Novak", pin="1470")
        token = confirm(client, "bypass", user="J. Brandt", pin="3691").json()["confirmation"]
        command(tmp_path, "role", "J. Brandt", "--role", "operator")
        waiting = confirm(client, "bypass", user="J. Brandt", pin="3691")
        until(
            lambda: confirm(client, "bypass", user="J. Brandt", pin="3691").status_code == 403,
            "the role is known",
        )
        assert waiting.status_code in (200, 403)
        assert press(client, "bypass", token).json()["code"] == "confirm_needed_two"


@pytest.mark.parametrize(
    ("language", "widget", "code"),
    [
        ("en", "start", "confirm_needed_pin"),
        ("ja", "start", "confirm_needed_pin"),
        ("de", "bypass", "confirm_needed_two"),
    ],
)
def test_without_scripts_it_is_locked_and_a_form_is_refused(
    browsers: Browsers, kiosk: Server, language: str, widget: str, code: str
) -> None:
    client = browsers.signed_in(kiosk.url, "K. Novak", pin="1470")
    shown = client.get("/pages/main", headers={"accept-language": language}).text
    (button,) = re.findall(rf'<button[^>]*formaction="/widgets/{widget}"[^>]*>', shown)
    assert button.endswith(" disabled>")
    assert render(say("confirm_needs_javascript"), language) in shown
    press_id = secrets.token_hex(8)
    fields = {"heat": "300", "_page": "main", "_id": press_id, "_enter": "yes", "_pin": "1470"}
    answer = client.post(f"/widgets/{widget}", data=fields)
    assert answer.status_code == 303
    rows = [row for row in log_rows(client) if row["press"] == f"{press_id}.{widget}"]
    assert {row["outcome"] for row in rows} == {"refused"}
    assert code in {row["verdict"] for row in rows}
