"""What a role sees and may do, asked of a running server: pages, streams, presses, acts, routes."""

import importlib
import json
import pkgutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest
from fastapi.routing import APIRoute, APIWebSocketRoute

import app.web.routes
from app.panel.roles import ANYBODY, ROLES
from app.web.route_needs import LOCAL_ONLY, OF_WALL, ROUTE_NEEDS
from tests.support.parts import ROOT, Server, events_in, until
from tests.support.servers import ready
from tests.support.users import Browsers, add_user, token_of

pytestmark = pytest.mark.promise("users")

PANEL: Final = """
title = "Cell"
mode = "demo"

[access]
groups = ["tooling"]

[[alarm]]
id = "air"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Air"
low = -1000.0

[[frame.widget]]
id = "halt"
kind = "publish"
label = "Halt"
role = "stop"
topic = "/halt"
type = "std_msgs/msg/Bool"
message = { data = true }

[[page]]
id = "work"
title = "Work"

[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Bool"
message = { data = true }

[[page.widget]]
id = "grip"
kind = "publish"
label = "Grip"
needs = "tooling"
topic = "/grip"
type = "std_msgs/msg/Bool"
message = { data = true }

[[page]]
id = "setup"
title = "Setup"
needs = "maintenance"

[[page.widget]]
id = "secret"
kind = "readout"
label = "Secret"
topic = "/secret"
type = "std_msgs/msg/String"

[[page.widget]]
id = "past"
kind = "trend"
label = "Past"
disk = false

[[page.widget.pen]]
label = "Air"
topic = "/air"
type = "std_msgs/msg/Float64"
"""
PIN: Final = "2580"


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    file = data / "cell.toml"
    file.write_text(PANEL)
    for role in ROLES:
        add_user(data, role, role, pin=PIN)
    add_user(data, "fitter", "operator", pin=PIN, groups=("tooling",))
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_PANEL=str(file))) as mine:
        yield mine


@pytest.fixture(scope="module")
def browsers(kiosk: Server) -> Iterator[dict[str, httpx.Client]]:
    """A browser for nobody ("") and for each user."""
    every = Browsers()
    signed = {name: every.signed_in(kiosk.url, name, pin=PIN) for name in (*ROLES, "fitter")}
    yield {"": every.opened(kiosk.url), **signed}
    every.close()


def snapshot(client: httpx.Client, page: str = "") -> dict[str, Any]:
    answer = client.get("/events", params={"once": True, "page": page})
    return next(json.loads(data) for name, data, _ in events_in(answer.text) if name == "snapshot")


def enabled(client: httpx.Client) -> dict[str, bool]:
    widgets = snapshot(client)["widgets"]
    return {name: shown["enabled"] for name, shown in widgets.items() if "enabled" in shown}


SEEN: Final = {
    "": ({"halt"}, False),
    "viewer": ({"halt"}, False),
    "operator": ({"halt", "go"}, False),
    "fitter": ({"halt", "go", "grip"}, False),
    "maintenance": ({"halt", "go"}, True),
    "engineer": ({"halt", "go", "grip"}, True),
}


@pytest.mark.parametrize("name", SEEN)
def test_a_role_has_its_page_its_events_and_its_presses(
    browsers: dict[str, httpx.Client], name: str
) -> None:
    client, (pressed, sees_setup) = browsers[name], SEEN[name]
    until(lambda: enabled(client)["halt"], "the robot is there")
    assert {widget for widget, free in enabled(client).items() if free} == pressed
    for page in ("", "setup", "work"):
        assert ("secret" in snapshot(client, page)["widgets"]) == (sees_setup and page != "work")
    html = client.get("/pages/work", headers={"accept": "text/html"}).text
    assert ("/pages/setup" in html) == sees_setup
    assert client.get("/pages/setup").status_code == (200 if sees_setup else 403)
    assert (client.get("/widgets/past/trend").status_code == 403) == (not sees_setup)
    for widget in ("halt", "go", "grip"):
        answer = client.post(f"/widgets/{widget}", json={"inputs": {}})
        assert (answer.status_code, answer.json()["outcome"]) == (
            (200, "published") if widget in pressed else (403, "refused")
        )


def test_a_lock_says_in_each_language_what_to_do(browsers: dict[str, httpx.Client]) -> None:
    reasons = [
        browsers[""]
        .post("/widgets/grip", json={"inputs": {}}, headers={"accept-language": language})
        .json()["reason"]
        for language in ("en", "de", "ja")
    ]
    said = ("Sign in as tooling.", "Als tooling anmelden.", "サインイン: tooling。")
    assert [reason.endswith(sentence) for reason, sentence in zip(reasons, said, strict=True)] == [
        True
    ] * 3, reasons


def test_a_page_that_is_not_seen_leads_to_the_sign_in(browsers: dict[str, httpx.Client]) -> None:
    answer = browsers["operator"].get("/pages/setup", headers={"accept": "text/html"})
    assert answer.status_code == 403
    assert "Sign in as Maintenance" in answer.text
    assert 'href="/signin"' in answer.text


def test_a_stream_follows_the_sign_out(kiosk: Server) -> None:
    """Without a new page: what a stolen tablet still shows locks when its user is signed out."""
    own = Browsers()
    client = own.signed_in(kiosk.url, "operator", pin=PIN)
    until(lambda: enabled(client)["go"], "the robot is there")
    with client.stream("GET", "/events", params={"page": "work"}) as stream:
        lines = stream.iter_lines()

        def shown() -> Iterator[bool]:
            """Each time that the stream says whether "go" may be pressed."""
            ends = time.monotonic() + 40
            for line in lines:
                assert time.monotonic() < ends
                if line.startswith("data: {"):
                    told = json.loads(line.removeprefix("data: "))
                    attributes = told.get("widgets", told).get("go", {})
                    if isinstance(attributes, dict) and "enabled" in attributes:
                        yield attributes["enabled"]

        told = shown()
        assert next(told) is True
        client.delete("/session").raise_for_status()
        assert next(told) is False
    own.close()


def test_acts_need_their_role(browsers: dict[str, httpx.Client]) -> None:
    """Refused for the role before it is asked whether the alarm is there to be acted on."""
    acts = {"acknowledge": "operator", "reset": "operator", "shelve": "maintenance"}
    for act, needed in acts.items():
        for name in ROLES:
            body = {"occurrence": 1, "for_s": 60, "reason": "test"} if act == "shelve" else {}
            answer = browsers[name].post(f"/alarms/air/{act}", json=body | {"occurrence": 1})
            refused = answer.json().get("code") == "role_needed"
            assert refused == (ROLES.index(name) < ROLES.index(needed)), (act, name, answer.text)
            assert (answer.status_code == 403) == refused


def routes() -> Iterator[APIRoute | APIWebSocketRoute]:
    """The routes of all modules."""
    modules = pkgutil.iter_modules(app.web.routes.__path__)
    for name in (*(f"app.web.routes.{module.name}" for module in modules), "tests.gallery.page"):
        router = getattr(importlib.import_module(name), "router", None)
        for route in router.routes if router else ():
            assert isinstance(route, APIRoute | APIWebSocketRoute)
            yield route


def test_every_route_has_a_row() -> None:
    assert {route.path for route in routes()} == {*ROUTE_NEEDS, *OF_WALL}


FILLED: Final = {
    "{page}": "work", "{widget}": "go", "{set}": "none", "{act}": "none", "{alarm:path}": "air",
    "{revision}": "r", "{name:path}": "n",
}  # fmt: skip


def asked(path: str) -> str:
    for part, value in FILLED.items():
        path = path.replace(part, value)
    return path


@pytest.mark.parametrize("path", sorted(path for path in ROUTE_NEEDS if "gallery" not in path))
def test_every_route_answers_each_role_as_its_row_says(
    kiosk: Server, browsers: dict[str, httpx.Client], path: str
) -> None:
    """Reads and forms that are refused for the role have the status 403; all others have another."""
    need = ROUTE_NEEDS[path]
    methods = {m for route in routes() if route.path == path for m in getattr(route, "methods", ())}
    for name in ("", *ROLES):
        may = need in (ANYBODY, LOCAL_ONLY) or (name and ROLES.index(name) >= ROLES.index(need))
        for method in methods - {"DELETE"}:
            if path in ("/session", "/session/end", "/events") or "press" in path:
                continue
            judged = method == "POST" and need == ANYBODY  # refused by a receipt, if at all
            answer = browsers[name].request(method, asked(path))
            if not judged:
                assert (answer.status_code == 403) == (not may), (name, method, answer.text[:200])


def test_a_program_has_the_role_of_its_token(kiosk: Server, tmp_path: Path) -> None:
    data = kiosk.data
    headers = {"authorization": f"Bearer {token_of(data, 'cell', 'operator')}"}
    with httpx.Client(base_url=kiosk.url, trust_env=False, headers=headers) as program:
        until(lambda: program.get("/log.csv").status_code == 200, "the token is known")
        assert program.post("/widgets/go", json={"inputs": {}}).status_code == 200
        assert program.post("/widgets/grip", json={"inputs": {}}).status_code == 403
        assert program.get("/diagnostics").status_code == 403
