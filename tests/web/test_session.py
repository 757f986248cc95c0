"""Sign-in, sign-out, tokens, and changes of users while the server runs."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready
from tests.support.users import Browsers, add_user, command, log_rows, says, token_of

NOBODY = {
    "user": "",
    "role": "viewer",
    "groups": [],
    "users": True,
    "idle_s": 600.0,
    "longest_s": 43_200.0,
    "ends_by": None,
    "left_s": None,
}


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """With two users and a token, for tests that change none of them."""
    data = tmp_path_factory.mktemp("data")
    add_user(data, "M. Sato", "operator", pin="2580", badge="04A2", groups=("quality",))
    add_user(data, "J. Brandt", "engineer", password="long enough")
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_MODE="demo")) as mine:
        yield mine


def logged(browsers: Browsers, server: Server) -> list[dict[str, str]]:
    """The entries of users, the oldest first."""
    client = browsers.signed_in(server.url, "J. Brandt", password="long enough")
    return [row for row in log_rows(client) if row["kind"] == "access"]


def test_a_user_signs_in_and_out(browsers: Browsers, kiosk: Server) -> None:
    client = browsers.opened(kiosk.url)
    assert client.get("/session").json() == NOBODY
    answer = client.post("/session", json={"user": "m. sato", "pin": "2580"})
    assert answer.status_code == 200
    said = answer.json()
    assert (said["user"], said["role"], said["groups"]) == ("M. Sato", "operator", ["quality"])
    assert 590 < said["left_s"] <= 600
    (cookie,) = answer.headers.get_list("set-cookie")
    parts = {part.strip().lower() for part in cookie.split(";")}
    assert {"httponly", "samesite=strict", "path=/"} <= parts
    assert not any(part.startswith(("max-age", "expires")) for part in parts)
    assert client.get("/session").json()["user"] == "M. Sato"
    assert client.delete("/session").status_code == 204
    assert client.get("/session").json() == NOBODY


def test_a_session_is_of_no_use_in_another_browser(browsers: Browsers, kiosk: Server) -> None:
    client, other = browsers.signed_in(kiosk.url, "M. Sato", pin="2580"), browsers.opened(kiosk.url)
    other.cookies.set("panel_session", client.cookies["panel_session"])
    assert other.get("/session").json() == NOBODY
    del client.cookies["panel_browser"]
    assert client.get("/session").json() == NOBODY


def test_a_first_request_can_sign_in(browsers: Browsers, kiosk: Server) -> None:
    client = browsers.new(kiosk.url)
    assert client.post("/session", json={"badge": "04A2"}).json()["user"] == "M. Sato"
    assert client.get("/session").json()["user"] == "M. Sato"


@pytest.mark.parametrize(
    ("body", "status", "code"),
    [
        ({"user": "M. Sato", "pin": "2581"}, 401, "sign_in_wrong_pin"),
        ({"user": "Nobody", "pin": "2580"}, 401, "sign_in_wrong_pin"),
        ({"user": "J. Brandt", "password": "wrong one"}, 401, "sign_in_wrong_password"),
        ({"badge": "04A3"}, 401, "sign_in_wrong_badge"),
    ],
)
def test_a_wrong_sign_in_is_refused(
    browsers: Browsers, kiosk: Server, body: dict[str, str], status: int, code: str
) -> None:
    answer = browsers.opened(kiosk.url).post("/session", json=body)
    assert (answer.status_code, answer.json()["code"]) == (status, code)
    assert "set-cookie" not in answer.headers


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"user": "M. Sato"},
        {"pin": "2580"},
        {"user": "M. Sato", "pin": "2580", "badge": "04A2"},
        {"user": "M. Sato", "pin": 2580},
        {"user": "M. Sato", "pin": "2580", "role": "engineer"},
        {"user": "x" * 41, "pin": "2580"},
    ],
)
def test_a_malformed_sign_in_says_what_is_wrong_and_never_the_secret(
    browsers: Browsers, kiosk: Server, body: dict[str, Any]
) -> None:
    answer = browsers.opened(kiosk.url).post("/session", json=body)
    assert answer.status_code == 422
    assert not says(answer.text, "2580")
    assert "04A2" not in answer.text


def test_five_failures_delay_the_next_try_even_if_it_is_correct(
    browsers: Browsers, tmp_path: Path
) -> None:
    add_user(tmp_path, "M. Sato", "operator", pin="2580")
    with ready(Server(ROOT, KIOSK_DATA=str(tmp_path), KIOSK_MODE="demo")) as server:
        client = browsers.opened(server.url)
        left = []
        for _ in range(5):
            answer = client.post("/session", json={"user": "M. Sato", "pin": "0000"})
            left.append(answer.json()["tries_left"])
        assert left == [4, 3, 2, 1, 0]
        answer = client.post("/session", json={"user": "M. Sato", "pin": "2580"})
        assert (answer.status_code, answer.json()["code"]) == (429, "sign_in_wait")
        assert 25 <= int(answer.headers["retry-after"]) <= 30


def test_another_site_signs_nobody_in_or_out(browsers: Browsers, kiosk: Server) -> None:
    client = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    evil = {"origin": "https://evil.example", "sec-fetch-site": "cross-site"}
    assert client.delete("/session", headers=evil).status_code == 403
    body = {"user": "M. Sato", "pin": "2580"}
    assert client.post("/session", json=body, headers=evil).status_code == 403
    assert client.get("/session").json()["user"] == "M. Sato"


def test_programs_send_a_token_which_can_be_revoked(tmp_path: Path) -> None:
    add_user(tmp_path, "M. Sato", "operator", pin="2580")
    token = token_of(tmp_path, "line", "operator")
    with ready(Server(ROOT, KIOSK_DATA=str(tmp_path), KIOSK_MODE="demo")) as server:
        headers = {"authorization": f"Bearer {token}"}
        said = server.http.get("/session", headers=headers).json()
        assert (said["user"], said["role"]) == ("line", "operator")
        wrong = server.http.get("/session", headers={"authorization": "Bearer opt_wrong"})
        assert wrong.status_code == 401
        assert wrong.headers["www-authenticate"].startswith("Bearer")
        command(tmp_path, "revoke", "line")
        until(lambda: server.http.get("/session", headers=headers).status_code == 401, "revoked")


def test_a_change_of_a_user_signs_them_out_and_is_logged(browsers: Browsers, tmp_path: Path) -> None:
    add_user(tmp_path, "M. Sato", "operator", pin="2580")
    add_user(tmp_path, "J. Brandt", "engineer", password="long enough")
    with ready(Server(ROOT, KIOSK_DATA=str(tmp_path), KIOSK_MODE="demo")) as server:
        client = browsers.signed_in(server.url, "M. Sato", pin="2580")
        command(tmp_path, "disable", "M. Sato")
        until(lambda: client.get("/session").json()["user"] == "", "signed out")
        answer = client.post("/session", json={"user": "M. Sato", "pin": "2580"})
        assert answer.status_code == 401
        until(lambda: logged(browsers, server)[-2]["action"] == "sign_in", "logged")
        texts = [(row["action"], row["who"]) for row in logged(browsers, server)]
        assert texts[:2] == [("users_add", "test"), ("users_add", "test")]
        assert ("sign_in", "M. Sato") in texts
        assert "users_disable" in [action for action, _ in texts]
        assert not says(logged(browsers, server), "2580")


def test_a_press_has_the_name_of_its_user_in_the_log(browsers: Browsers, kiosk: Server) -> None:
    client = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    client.post("/widgets/operation1", json={"inputs": {"message": "hello"}})
    engineer = browsers.signed_in(kiosk.url, "J. Brandt", password="long enough")
    rows = [row for row in log_rows(engineer) if row["widget"] == "operation1"]
    assert {row["who"] for row in rows} == {"M. Sato"}


def test_a_broken_file_lets_nobody_in_and_says_why(browsers: Browsers, tmp_path: Path) -> None:
    (tmp_path / "users.json").write_text("{")
    with ready(Server(ROOT, KIOSK_DATA=str(tmp_path), KIOSK_MODE="demo")) as server:
        client = browsers.opened(server.url)
        assert client.get("/session").json() == NOBODY
        answer = client.post("/session", json={"user": "M. Sato", "pin": "2580"})
        assert (answer.status_code, answer.json()["code"]) == (503, "users_unreadable")


def test_without_users_everybody_is_an_engineer(browsers: Browsers, tmp_path: Path) -> None:
    with ready(Server(ROOT, KIOSK_DATA=str(tmp_path), KIOSK_MODE="demo")) as server:
        said = browsers.opened(server.url).get("/session").json()
        assert (said["role"], said["users"]) == ("engineer", False)
        headers = {"authorization": "Bearer anything"}
        assert server.http.get("/session", headers=headers).status_code == 200
