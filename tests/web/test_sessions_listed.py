"""The lists of all sign-ins and of the own ones, and their end from afar, as JSON and as a form."""

import re
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any, Final
from unittest.mock import ANY

import httpx
import pytest

from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready
from tests.support.users import Browsers, add_user, log_rows

pytestmark = pytest.mark.promise("users")

PANEL: Final = """
title = "Cell"
mode = "demo"
[access]
max_sessions = 2
[[page]]
id = "a"
title = "A"
"""
PASSWORD: Final = "long enough"
FORM: Final = {"accept": "text/html"}


@pytest.fixture
def kiosk(tmp_path: Path) -> Iterator[Server]:
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    panel = tmp_path / "cell.toml"
    panel.write_text(PANEL)
    add_user(data, "J. Brandt", "engineer", password=PASSWORD)
    add_user(data, "M. Sato", "operator", pin="2580")
    add_user(data, "A. Viewer", "viewer", pin="1379")
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_PANEL=str(panel))) as mine:
        yield mine


@pytest.fixture
def engineer(browsers: Browsers, kiosk: Server) -> httpx.Client:
    return browsers.signed_in(kiosk.url, "J. Brandt", password=PASSWORD)


def sign_ins(client: httpx.Client, user: str) -> list[dict[str, Any]]:
    listed = client.get("/users").raise_for_status().json()["sessions"]
    return [row for row in listed if row["user"] == user]


def user_of(client: httpx.Client) -> str:
    return str(client.get("/session").json()["user"])


def test_an_engineer_ends_a_sign_in_from_afar(
    browsers: Browsers, kiosk: Server, engineer: httpx.Client
) -> None:
    ended, kept = (browsers.signed_in(kiosk.url, "M. Sato", pin="2580") for _ in range(2))
    first, second = sign_ins(engineer, "M. Sato")
    assert (first["role"], first["address"]) == ("operator", "127.0.0.1")
    assert datetime.fromisoformat(first["since"]) <= datetime.fromisoformat(second["touched"])
    answer = engineer.post("/users/end", json={"name": first["id"]})
    assert (answer.status_code, answer.json()["code"]) == (200, "")
    assert (user_of(ended), user_of(kept)) == ("", "M. Sato")
    assert "You were signed out by J. Brandt." in ended.get("/signin", headers=FORM).text
    again = engineer.post("/users/end", json={"name": first["id"]})
    assert (again.status_code, again.json()["code"]) == (409, "users_session_gone")
    rows = [row for row in log_rows(engineer) if row["action"] in ("sign_out", "access_end")]
    told = [(row["who"], row["outcome"]) for row in rows]
    assert ("M. Sato", "accepted") in told
    assert told.count(("J. Brandt", "succeeded")) == told.count(("J. Brandt", "refused")) == 1
    (out,) = (row for row in rows if row["who"] == "M. Sato")
    assert out["reason"] == "M. Sato was signed out by J. Brandt."


def test_the_page_lists_them_and_its_form_ends_one(
    browsers: Browsers, kiosk: Server, engineer: httpx.Client
) -> None:
    tablet = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    (row,) = sign_ins(engineer, "M. Sato")
    page = engineer.get("/users", params={"sessions": "true", "name": row["id"]}, headers=FORM).text
    assert f'data-row="{row["id"]}"' in page
    assert '<h2 id="user-title">M. Sato</h2>' in page
    assert tablet.cookies
    assert not any(cookie.value and cookie.value in page for cookie in tablet.cookies.jar)
    form = {"id": "e" * 16, "name": row["id"], "version": "0"}
    answer = engineer.post("/users/end", data=form, headers=FORM, follow_redirects=True)
    assert answer.status_code == 200
    assert "M. Sato is signed out at 127.0.0.1." in answer.text
    assert user_of(tablet) == ""


# Own sign-ins.


def own_sign_ins(client: httpx.Client) -> list[dict[str, Any]]:
    listed: list[dict[str, Any]] = client.get("/sessions").raise_for_status().json()["sessions"]
    return listed


def test_a_user_sees_the_own_sign_ins_only_and_ends_another(
    browsers: Browsers, kiosk: Server, engineer: httpx.Client
) -> None:
    tablet, viewer = (browsers.signed_in(kiosk.url, "A. Viewer", pin="1379") for _ in range(2))
    listed = own_sign_ins(viewer)
    assert [(row["user"], row["role"], row["here"]) for row in listed] == [
        ("A. Viewer", "viewer", False),
        ("A. Viewer", "viewer", True),
    ]
    every = engineer.get("/users").json()["sessions"]
    assert [row for row in every if row["user"] == "A. Viewer"] == [
        {**row, "here": False, "touched": ANY, "since": ANY} for row in listed
    ]
    answer = viewer.post("/sessions/end", json={"name": listed[0]["id"]})
    assert (answer.status_code, answer.json()["act"], answer.json()["code"]) == (200, "end", "")
    assert (user_of(tablet), user_of(viewer)) == ("", "A. Viewer")
    assert "You were signed out by A. Viewer." in tablet.get("/signin", headers=FORM).text
    again = viewer.post("/sessions/end", json={"name": listed[0]["id"]})
    assert (again.status_code, again.json()["code"]) == (409, "users_session_gone")
    ends = [row for row in log_rows(engineer) if row["action"] == "access_end"]
    assert [(row["who"], row["outcome"]) for row in ends] == [
        ("A. Viewer", "succeeded"),
        ("A. Viewer", "refused"),
    ]
    out = [row["reason"] for row in log_rows(engineer) if row["action"] == "sign_out"]
    assert out == ["A. Viewer was signed out by A. Viewer."]


def test_the_page_of_the_own_sign_ins_says_which_is_this_one_and_its_form_ends_another(
    browsers: Browsers, kiosk: Server, engineer: httpx.Client
) -> None:
    tablet, viewer = (browsers.signed_in(kiosk.url, "A. Viewer", pin="1379") for _ in range(2))
    other, here = own_sign_ins(viewer)
    page = viewer.get("/sessions", headers=FORM).text
    assert re.findall(r'data-row="(\w+)"', page) == [here["id"], other["id"]]
    assert page.count("<em>This browser</em>") == 1
    assert "J. Brandt" not in page
    assert 'action="/session/end"' in page
    assert 'action="/sessions/end"' not in page
    page = viewer.get("/sessions", params={"name": other["id"]}, headers=FORM).text
    assert 'action="/sessions/end"' in page
    form = {"id": "e" * 16, "name": other["id"]}
    answer = viewer.post("/sessions/end", data=form, headers=FORM, follow_redirects=True)
    assert answer.status_code == 200
    assert "A. Viewer is signed out at 127.0.0.1." in answer.text
    assert other["id"] not in answer.text
    assert (user_of(tablet), user_of(viewer)) == ("", "A. Viewer")


@pytest.mark.parametrize("as_form", [False, True])
def test_no_one_ends_or_sees_the_sign_in_of_another(
    browsers: Browsers, kiosk: Server, engineer: httpx.Client, as_form: bool
) -> None:
    viewer = browsers.signed_in(kiosk.url, "A. Viewer", pin="1379")
    (of_engineer,) = sign_ins(engineer, "J. Brandt")
    page = viewer.get("/sessions", params={"name": of_engineer["id"]}, headers=FORM).text
    assert "J. Brandt" not in page
    assert of_engineer["id"] not in page
    if as_form:
        form = {"id": "e" * 16, "name": of_engineer["id"]}
        said = viewer.post("/sessions/end", data=form, headers=FORM, follow_redirects=True).text
        assert "Sign in as Engineer." in said
        assert "J. Brandt" not in said
    else:
        answer = viewer.post("/sessions/end", json={"name": of_engineer["id"]})
        assert (answer.status_code, answer.json()["code"]) == (403, "role_needed")
    assert viewer.post("/users/end", json={"name": of_engineer["id"]}).status_code == 403
    assert user_of(engineer) == "J. Brandt"
    (refused,) = (row for row in log_rows(engineer) if row["action"] == "access_end")
    assert (refused["who"], refused["outcome"]) == ("A. Viewer", "refused")
    answer = engineer.post("/sessions/end", json={"name": own_sign_ins(viewer)[0]["id"]})
    assert (answer.status_code, user_of(viewer)) == (200, "")


def test_who_is_not_signed_in_has_no_sign_ins(
    browsers: Browsers, kiosk: Server, engineer: httpx.Client
) -> None:
    """A program with the name of a user is another one."""
    (of_engineer,) = sign_ins(engineer, "J. Brandt")
    token = engineer.post("/users/token", json={"name": "J. Brandt", "role": "viewer"}).json()["token"]
    browser, program = browsers.opened(kiosk.url), browsers.new(kiosk.url)
    program.headers["authorization"] = f"Bearer {token}"
    for client in (browser, program):
        assert own_sign_ins(client) == []
        answer = client.post("/sessions/end", json={"name": of_engineer["id"]})
        assert (answer.status_code, answer.json()["code"]) == (403, "role_needed")
    page = browser.get("/sessions", headers=FORM)
    assert (page.status_code, page.headers["location"]) == (303, "/signin")
    assert user_of(engineer) == "J. Brandt"


def test_a_user_is_signed_in_at_so_many_browsers_only(
    browsers: Browsers, kiosk: Server, engineer: httpx.Client
) -> None:
    first, *others = (browsers.signed_in(kiosk.url, "M. Sato", pin="2580") for _ in range(3))
    assert [user_of(client) for client in (first, *others)] == ["", "M. Sato", "M. Sato"]
    assert user_of(engineer) == "J. Brandt"


def test_who_may_not_edit_users_ends_none(browsers: Browsers, kiosk: Server) -> None:
    operator = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    assert operator.get("/users").status_code == 403
    assert operator.post("/users/end", json={"name": "0" * 16}).status_code == 403
    assert user_of(operator) == "M. Sato"


def test_the_longest_time_signs_out_and_says_so(tmp_path: Path, browsers: Browsers) -> None:
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    add_user(data, "M. Sato", "operator", pin="2580")
    add_user(data, "J. Brandt", "engineer", password=PASSWORD)
    panel = tmp_path / "cell.toml"
    panel.write_text(PANEL.replace("max_sessions = 2", "idle_s = 0\nlongest_s = 2"))
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_PANEL=str(panel))) as server:
        browser = browsers.signed_in(server.url, "M. Sato", pin="2580")

        def is_out() -> bool:
            browser.post("/session/here", json={"touched": True}).raise_for_status()
            return user_of(browser) == ""

        until(is_out, "the longest time is over")
        said = "You were signed out: the longest time of a sign-in is over."
        until(lambda: said in browser.get("/signin", headers=FORM).text, "the page says so")
        engineer = browsers.signed_in(server.url, "J. Brandt", password=PASSWORD)
        reasons = [row["reason"] for row in log_rows(engineer)]
        assert "M. Sato was signed out: the longest time of a sign-in is over." in reasons
