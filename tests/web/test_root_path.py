"""Paths with and without the root path, as proxies and servers give them."""

import asyncio
import json
import re
from pathlib import Path

import pytest
from starlette.types import Message, Receive, Scope, Send

from app.system.errors import SettingsError
from app.system.settings import LOOPBACK_HOSTS, Settings, parse_root_path
from app.web.root_path import OWN_PATHS, RootPath, path_of, root_path_of
from app.web.security import RequestGuard
from docs._generate import places
from tests.support.holds import PANEL
from tests.support.parts import ROOT
from tests.support.servers import demo_server

ROBOTS = """
[[robot]]
id = "r1"
name = "R1"
namespace = "/r1"
[[robot]]
id = "r2"
name = "R2"
namespace = "/r2"
"""


def scope_of(root: str, of_server: str, path: str) -> Scope:
    """The scope behind the layer; the server puts its own root path before each path, as uvicorn."""
    scopes: list[Scope] = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        scopes.append(scope)

    path = of_server + path
    scope = {"type": "http", "root_path": of_server, "path": path, "raw_path": path.encode()}
    queue: asyncio.Queue[Message] = asyncio.Queue()
    asyncio.run(RootPath(app, root)(scope, queue.get, queue.put))
    return scopes[0]


@pytest.mark.parametrize("of_server", ["", "/cell1", "/other"])
@pytest.mark.parametrize("root", ["/cell1"])
@pytest.mark.parametrize(
    ("path", "bare"),
    [
        ("/", "/"),
        ("/events", "/events"),
        ("/cell1", "/"),
        ("/cell1/", "/"),
        ("/cell1/events", "/events"),
        ("/cell12/events", "/cell12/events"),
    ],
)
def test_the_root_path_is_there_once(of_server: str, root: str, path: str, bare: str) -> None:
    scope = scope_of(root, of_server, path)
    assert (scope["root_path"], scope["path"]) == (root, root + bare)
    assert scope["raw_path"] == scope["path"].encode()
    assert path_of(scope) == bare


def test_without_a_root_path_nothing_changes() -> None:
    assert scope_of("", "", "/cell1/events")["path"] == "/cell1/events"


@pytest.mark.parametrize(
    ("written", "parsed"), [("", ""), ("/", ""), ("/a", "/a"), ("/a/b-1.x/", "/a/b-1.x")]
)
def test_a_root_path_is_read(written: str, parsed: str) -> None:
    assert parse_root_path(written) == parsed


@pytest.mark.parametrize(
    "written", ["a", "//a", "/a//b", "/a b", "/..", "/a/../b", "/ä", '/"', "http://a"]
)
def test_another_root_path_is_refused(written: str) -> None:
    with pytest.raises(SettingsError, match="must be a path such as /cell1"):
        Settings.from_environment({"KIOSK_ROOT_PATH": written})


@pytest.mark.parametrize("written", ["/pages", "/static/x", "/log.csv"])
def test_a_path_that_the_panel_has_itself_is_refused(written: str) -> None:
    with pytest.raises(SettingsError, match="the panel has a path like this itself"):
        root_path_of(Settings.from_environment({"KIOSK_ROOT_PATH": written}), None)


def test_all_own_paths_are_known() -> None:
    paths = {row.split("`")[1].split()[-1] for row in places.paths_table().splitlines()[2:]}
    first = {re.split("/", path)[1] for path in paths} - {""}
    assert first <= OWN_PATHS


def test_the_guard_knows_its_paths_below_a_root_path() -> None:
    """Another site's page may not read the events, whatever stands before their path."""

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        raise AssertionError("it is not let in")

    sent: list[Message] = []

    async def send(message: Message) -> None:
        sent.append(message)

    scope = {
        "type": "http",
        "method": "GET",
        "root_path": "/cell1",
        "path": "/cell1/events",
        "headers": [(b"host", b"localhost"), (b"sec-fetch-site", b"cross-site")],
    }
    queue: asyncio.Queue[Message] = asyncio.Queue()
    asyncio.run(RequestGuard(app, LOOPBACK_HOSTS)(scope, queue.get, send))
    assert sent[0]["status"] == 403


def test_pages_of_several_robots_are_below_the_root_path(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL + ROBOTS, KIOSK_ROOT_PATH="/cell1") as mine:
        answer = mine.http.get("/")
        assert (answer.status_code, answer.headers["location"]) == (303, "/cell1/robots/r1/")
        text = mine.http.get("/cell1/robots/r1/").text
        assert 'href="/cell1/robots/r2/pages/one"' in text
        assert '"base":"/cell1/robots/r1"' in text
        assert json.loads(mine.http.get("/openapi.json").text)["servers"] == [{"url": "/cell1"}]


def test_no_page_has_a_path_without_the_root_path() -> None:
    files = [*(ROOT / "templates").rglob("*.html"), *(ROOT / "static").rglob("*.js")]
    absolute = re.compile(
        r"""(?:href|src|action)="/|(?<!indexOf\()["'`]/(?:static|pages|events|widgets|log)"""
    )
    of_panels = [file for file in files if file.parent.name != "editor"]
    assert [file.name for file in of_panels if absolute.search(file.read_text())] == []
