"""What a new panel file and a further page are started from."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest

from bench.over_zenoh import OverZenoh
from tests.support.editor import PANEL, EditorServer
from tests.support.parts import SHIPPED, until, zenoh_file

OTHER: Final = """\
title = "Other"

[[interlock]]
id = "closed"
label = "Closed"
topic = "/closed"
type = "std_msgs/msg/Bool"
field = "data"

[[page]]
id = "press"
title = "Press"

# Starts it.
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = { data = true }
interlock = "closed"
"""


@pytest.fixture
def editor(tmp_path: Path) -> Iterator[EditorServer]:
    """The editor of a file that is not there, beside another one."""
    (tmp_path / "other.toml").write_text(OTHER)
    (tmp_path / "no-panel.toml").write_text("a = 1")
    mine = EditorServer(tmp_path / "new_cell.toml")
    yield mine
    mine.end()


def start(editor: EditorServer, source: str, **more: str) -> httpx.Response:
    known = {"revision": editor.state()["revision"], "source": source}
    return editor.http.post("/start", json=known | more)


def written(editor: EditorServer) -> dict[str, Any]:
    editor.http.post("/save", json={}).raise_for_status()
    return tomllib.loads(editor.file.read_text())


def test_a_file_that_is_not_there_is_offered_starts(editor: EditorServer) -> None:
    assert editor.state()["new"]
    offers = editor.part("start")
    for offer in ("The robot that is there", "other.toml: Press", "The example"):
        assert offer in offers
    assert "no-panel.toml" not in offers


def test_an_empty_page_is_added_to_the_one_that_is_begun(editor: EditorServer) -> None:
    assert start(editor, "empty").json()["page"] == "page_2"
    assert not editor.state()["new"]
    tables = written(editor)
    assert tables["title"] == "New cell"
    assert [page["title"] for page in tables["page"]] == ["New cell", "Page 2"]
    assert not editor.state()["faults"]
    for source in ("robot", "file"):
        refused = start(editor, source, file="palletizer")
        assert refused.status_code == 422
        assert refused.json()["message"] == "The file is not new any more"


@pytest.mark.parametrize("name", ["palletizer", "mobile-robot"])
def test_an_example_has_no_fault(editor: EditorServer, name: str) -> None:
    start(editor, "file", file=name).raise_for_status()
    until(lambda: editor.state()["live"] > 0, "it runs")
    assert not editor.state()["faults"]
    if name == "palletizer":
        written(editor)
        assert editor.file.read_bytes() == SHIPPED.read_bytes()


def test_a_page_of_another_file_comes_with_what_it_names(editor: EditorServer) -> None:
    assert start(editor, "page", file="other.toml", page="press").json()["page"] == "press"
    assert start(editor, "page", file="other.toml", page="press").json()["page"] == "press_2"
    tables = written(editor)
    assert [lock["id"] for lock in tables["interlock"]] == ["closed"]
    assert [page["id"] for page in tables["page"]] == ["press", "press_2"]
    assert "# Starts it." in editor.file.read_text()
    assert not editor.state()["faults"]
    for gone in ({"file": "../other.toml"}, {"file": "other.toml", "page": "none"}):
        assert start(editor, "page", **gone).status_code == 404


def test_the_scaffold_of_the_robot_that_is_there(tmp_path: Path) -> None:
    robot = OverZenoh()
    robot.offer("/state")
    zenoh = zenoh_file(tmp_path, robot.locator)
    editor = EditorServer(tmp_path / "new.toml", KIOSK_ZENOH=str(zenoh))
    try:
        start(editor, "robot").raise_for_status()
        pages = tomllib.loads(editor.http.get("/text").text)["page"]
        widgets = [widget for page in pages for widget in page["widget"]]
        assert {"/state", "/operation_enabled"} <= {widget["topic"] for widget in widgets}
        editor.http.post("/undo", json={}).raise_for_status()
        robot.close()
        refused = start(editor, "robot")
        assert refused.status_code >= 400
        assert robot.locator in refused.json()["message"]
    finally:
        robot.close()
        editor.end()


def test_a_file_that_came_meanwhile_is_not_overwritten(editor: EditorServer) -> None:
    start(editor, "empty").raise_for_status()
    editor.file.write_text(PANEL)
    until(lambda: editor.state()["conflicts"], "both have a title")
    assert editor.http.post("/save", json={}).status_code == 409
    assert editor.file.read_text() == PANEL
