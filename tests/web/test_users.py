"""The engineer's acts on users and tokens, as JSON and as forms, beside the command line."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest

from app.cell.people.secrets_hash import matches
from app.cell.people.users import User
from app.cell.people.users_file import UsersFile
from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready
from tests.support.users import OPENED, Browsers, add_user, command, log_rows, token_of

PANEL: Final = (
    'title = "Cell"\nmode = "demo"\n[access]\ngroups = ["quality"]\n[[page]]\nid = "a"\ntitle = "A"\n'
)
PASSWORD: Final = "long enough"
FORM: Final = {"accept": "text/html"}


def with_users(folder: Path) -> Server:
    data = folder / "data"
    data.mkdir(mode=0o700)
    panel = folder / "cell.toml"
    panel.write_text(PANEL)
    add_user(data, "J. Brandt", "engineer", password=PASSWORD)
    add_user(data, "M. Sato", "operator", pin="2580", badge="04A2")
    return ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_PANEL=str(panel)))


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One for tests that change no user."""
    with with_users(tmp_path_factory.mktemp("kiosk")) as mine:
        yield mine


@pytest.fixture
def engineer(browsers: Browsers, kiosk: Server) -> httpx.Client:
    return browsers.signed_in(kiosk.url, "J. Brandt", password=PASSWORD)


@pytest.fixture
def own_kiosk(tmp_path: Path) -> Iterator[Server]:
    with with_users(tmp_path) as mine:
        yield mine


@pytest.fixture
def own_engineer(browsers: Browsers, own_kiosk: Server) -> httpx.Client:
    return browsers.signed_in(own_kiosk.url, "J. Brandt", password=PASSWORD)


def act(client: httpx.Client, act_name: str, status: int = 200, /, **body: Any) -> dict[str, Any]:
    answer = client.post(f"/users/{act_name}", json=body)
    assert answer.status_code == status, answer.text
    receipt: dict[str, Any] = answer.json()
    assert receipt["done"] == (status == 200)
    return receipt


def user(kiosk: Server, name: str) -> User:
    known = UsersFile(kiosk.data).read().user(name)
    assert known is not None
    return known


def test_a_user_is_added_changed_and_removed(
    browsers: Browsers, own_kiosk: Server, own_engineer: httpx.Client
) -> None:
    act(own_engineer, "add", name="K. Novak", role="maintenance", groups=["quality"], pin="1470")
    novak = browsers.signed_in(own_kiosk.url, "K. Novak", pin="1470")
    assert novak.get("/session").json()["groups"] == ["quality"]
    act(own_engineer, "role", name="K. Novak", role="operator", groups=[])
    assert novak.get("/session").json()["user"] == ""  # at once
    act(own_engineer, "pin", name="K. Novak", pin="9753")
    assert matches(user(own_kiosk, "K. Novak").pin, "9753")
    act(own_engineer, "badge", name="K. Novak", badge="04A3")
    act(own_engineer, "pin", name="K. Novak", none=True)
    assert user(own_kiosk, "K. Novak").ways == ("badge",)
    again = browsers.opened(own_kiosk.url)
    again.post("/session", json={"badge": "04A3"}).raise_for_status()
    act(own_engineer, "disable", name="K. Novak")
    assert again.get("/session").json()["user"] == ""
    assert again.post("/session", json={"badge": "04A3"}).status_code == 401
    act(own_engineer, "enable", name="K. Novak")
    listed = {row["name"]: row for row in own_engineer.get("/users").json()["users"]}
    assert listed["K. Novak"]["signs_in_with"] == ["badge"]
    assert listed["K. Novak"]["last_sign_in"]
    assert listed["M. Sato"]["last_sign_in"] is None
    act(own_engineer, "remove", name="K. Novak")
    assert UsersFile(own_kiosk.data).read().user("K. Novak") is None
    rows = [row for row in log_rows(own_engineer) if row["action"].startswith("users_")]
    mine = [(row["action"].removeprefix("users_"), row["who"]) for row in rows if row["who"] != "test"]
    acts = ("add", "role", "pin", "badge", "pin", "disable", "enable", "remove")
    assert mine == [(name, "J. Brandt") for name in acts]
    assert all("K. Novak" in row["reason"] for row in rows[2:])
    assert all(row["browser"] and row["address"] == "127.0.0.1" for row in rows[2:])
    assert not {"1470", "9753", "04A3"} & {word for row in rows for word in str(row).split("'")}


REFUSED: Final[list[tuple[str, dict[str, Any], str]]] = [
    ("remove", {"name": "J. Brandt"}, "users_last_engineer"),
    ("disable", {"name": "J. Brandt"}, "users_last_engineer"),
    ("role", {"name": "J. Brandt", "role": "operator"}, "users_last_engineer"),
    ("add", {"name": "M. SATO", "role": "operator", "pin": "1470"}, "users_exists"),
    ("add", {"name": "A", "role": "operator", "pin": "147"}, "users_pin_form"),
    ("add", {"name": "A", "role": "operator"}, "users_no_way"),
    ("add", {"name": "A", "pin": "1470"}, "users_role_unknown"),
    ("pin", {"name": "M. Sato"}, "users_secret_missing"),
    ("badge", {"name": "J. Brandt", "badge": "04A2"}, "users_badge_taken"),
    ("revoke", {"name": "line"}, "users_token_unknown"),
]


def test_what_can_not_be_done_is_refused_with_its_reason(kiosk: Server, engineer: httpx.Client) -> None:
    before = UsersFile(kiosk.data).path.read_bytes()
    for name, body, code in REFUSED:
        assert act(engineer, name, 409, **body)["code"] == code
    assert UsersFile(kiosk.data).path.read_bytes() == before
    refused = [row for row in log_rows(engineer) if row["outcome"] == "refused"]
    logged = [(row["action"], row["who"]) for row in refused]
    assert logged == [(f"access_{name}", "J. Brandt") for name, _, _ in REFUSED]


def test_a_change_by_the_command_line_is_not_overwritten(
    own_kiosk: Server, own_engineer: httpx.Client
) -> None:
    version = UsersFile(own_kiosk.data).read().version("M. Sato")
    command(own_kiosk.data, "role", "M. Sato", "--role", "viewer")
    command(own_kiosk.data, "add", "A", "--role", "operator", "--pin-stdin", stdin="1470\n")
    receipt = act(own_engineer, "role", 409, name="M. Sato", role="maintenance", version=version)
    assert receipt["code"] == "users_changed_since"
    assert user(own_kiosk, "M. Sato").role == "viewer"
    act(own_engineer, "role", name="M. Sato", role="maintenance", version=version + 2)
    assert user(own_kiosk, "A").role == "operator"
    until(lambda: "users_add" in str(log_rows(own_engineer)), "the command line's change is in the log")


def test_only_an_engineer_may(browsers: Browsers, kiosk: Server) -> None:
    operator = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    nobody = browsers.opened(kiosk.url)
    for client in (operator, nobody):
        assert client.get("/users").status_code == 403
        body = {"name": "M. Sato", "role": "engineer"}
        assert client.post("/users/role", json=body).status_code == 403
        assert "/users" not in client.get("/", headers=FORM).text
    assert user(kiosk, "M. Sato").role == "operator"


def test_a_token_is_made_once_used_and_revoked(
    browsers: Browsers, own_kiosk: Server, own_engineer: httpx.Client
) -> None:
    body = {"name": "line", "role": "operator", "id": "made-once"}
    token = act(own_engineer, "token", **body)["token"]
    assert act(own_engineer, "token", **body)["token"] == ""  # the same act
    assert token not in UsersFile(own_kiosk.data).path.read_text()
    program = browsers.new(own_kiosk.url)
    program.headers["authorization"] = f"Bearer {token}"
    assert program.get("/session").json()["role"] == "operator"
    (listed,) = own_engineer.get("/users").json()["tokens"]
    assert listed["last_used"]
    act(own_engineer, "revoke", name="line")
    assert program.get("/session").status_code == 401


def test_a_form_shows_a_token_once_and_on_no_page_with_an_address(engineer: httpx.Client) -> None:
    form = {"name": "line", "role": "viewer", "id": "one"}
    answer = engineer.post("/users/token", data=form, headers=FORM)
    assert answer.status_code == 200
    assert "opt_" in answer.text
    again = engineer.post("/users/token", data=form, headers=FORM)
    assert again.status_code == 303
    page = engineer.get(again.headers["location"], headers=FORM)
    assert "opt_" not in page.text
    assert "shown before" in page.text


def test_a_refused_form_has_what_was_typed_but_no_secret(engineer: httpx.Client) -> None:
    form = {"name": "M. Sato", "role": "viewer", "way": "pin", "secret": "830461"}
    form |= {"group-quality": "true"}
    answer = engineer.post("/users/add", data=form, headers=FORM)
    assert answer.status_code == 303
    page = engineer.get(answer.headers["location"], headers=FORM).text
    assert "There is a user" in page
    assert 'value="viewer" required checked' in page
    assert 'name="group-quality" value="true" checked' in page
    assert "830461" not in page + answer.headers["location"]


def test_the_first_user_closes_the_panel_from_its_page(browsers: Browsers, tmp_path: Path) -> None:
    with ready(Server(ROOT, KIOSK_DATA=str(tmp_path), KIOSK_MODE="demo")) as server:
        client = browsers.opened(server.url)
        assert "/users" in client.get("/", headers={**OPENED, **FORM}).text
        receipt = act(client, "add", 409, name="A", role="operator", pin="1470")
        assert receipt["code"] == "users_first_engineer"
        act(client, "add", name="A", role="engineer", pin="1470")
        assert client.get("/session").json()["role"] == "viewer"
        assert client.get("/users").status_code == 403


def test_an_engineer_elsewhere_has_at_most_the_role_that_the_panel_allows(
    browsers: Browsers, tmp_path: Path
) -> None:
    panel = tmp_path / "cell.toml"
    panel.write_text(PANEL.replace("[access]\n", '[access]\nremote = "maintenance"\n'))
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    add_user(data, "J. Brandt", "engineer", password=PASSWORD)
    token = token_of(data, "far", "engineer")
    with ready(
        Server(ROOT, KIOSK_DATA=str(data), KIOSK_PANEL=str(panel), KIOSK_PROXIES="127.0.0.1")
    ) as server:
        far = browsers.new(server.url)
        far.headers.update({"authorization": f"Bearer {token}", "x-forwarded-for": "192.0.2.7"})
        assert far.get("/session").json()["role"] == "maintenance"
        assert far.get("/users").status_code == 403
