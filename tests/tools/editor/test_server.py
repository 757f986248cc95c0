"""The editor's server: who is let in, edits, panes, and the preview."""

import json
import re
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest

from tests.support.editor import PANEL, EditorServer, editing
from tests.support.parts import ROOT, until
from tests.support.processes import command
from tests.support.processes.command import COMMAND

LABEL: Final = ["page", 0, "group", 0, "widget", 0, "label"]


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EditorServer]:
    with editing(tmp_path_factory.mktemp("editor")) as mine:
        yield mine


@pytest.fixture
def editor(running: EditorServer) -> EditorServer:
    """The editor with the text as it was opened."""
    running.edit({"op": "text", "path": [], "text": PANEL}).raise_for_status()
    running.http.post("/save", json={}).raise_for_status()
    return running


def test_without_the_token_no_one_is_let_in(editor: EditorServer) -> None:
    with httpx.Client(base_url=editor.url) as stranger:
        for path in (
            "/",
            "/?token=wrong",
            "/state",
            "/parts/outline",
            "/preview/",
            "/events?browser=1",
        ):
            assert stranger.get(path).status_code == 403, path
        assert stranger.post("/edits", json={}).status_code == 403
        entered = stranger.get(editor.address)
        assert entered.headers["location"] == "/"
        assert "HttpOnly" in entered.headers["set-cookie"]
        assert "SameSite=strict" in entered.headers["set-cookie"]
        assert stranger.get("/").status_code == 200


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"host": "evil.example"}, 403),
        ({"origin": "http://evil.example"}, 403),
        ({"sec-fetch-site": "cross-site"}, 403),
        ({"sec-fetch-site": "same-origin"}, 200),
    ],
)
def test_other_sites_change_nothing(editor: EditorServer, headers: dict[str, str], status: int) -> None:
    posted = {"revision": editor.state()["revision"], "edits": [], "label": ""}
    assert editor.http.post("/edits", json=posted, headers=headers).status_code == status


def test_its_page_may_show_only_itself_in_a_frame(editor: EditorServer) -> None:
    policy = editor.http.get("/").headers["content-security-policy"]
    assert "frame-src 'self'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "frame-ancestors 'self'" in editor.http.get("/preview/").headers["content-security-policy"]


def test_an_edit_is_a_step_with_a_new_revision(editor: EditorServer) -> None:
    before = editor.state()
    answer = editor.edit({"op": "set", "path": LABEL, "value": "Belt speed"}).json()
    after = editor.state()
    assert answer["revision"] == after["revision"] == before["revision"] + 1
    assert answer["drawn"] == after["drawn"] > before["drawn"]
    assert (after["saved"], after["undo"]) == (False, True)
    assert editor.http.post("/undo", json={}).status_code == 200
    assert editor.state()["saved"]
    assert editor.http.post("/redo", json={}).status_code == 200
    assert not editor.state()["saved"]
    assert editor.http.post("/redo", json={}).status_code == 422


def test_a_typed_type_is_made_whole_and_filled_in_as_one_step(editor: EditorServer) -> None:
    added = {"op": "insert", "path": ["page", 1, "widget", 0]}
    lamp = {"id": "door", "kind": "indicator", "label": "Door", "topic": "/door_closed"}
    editor.edit({**added, "value": lamp}).raise_for_status()
    assert editor.state()["faults"] > 0
    at = [*added["path"], "type"]
    editor.edit({"op": "set", "path": at, "value": "Bool"}).raise_for_status()
    assert editor.state()["faults"] == 0
    door = tomllib.loads(editor.http.get("/text").text)["page"][1]["widget"][0]
    assert door["type"] == "std_msgs/msg/Bool"
    assert [state["value"] for state in door["states"]] == [True, False]
    editor.http.post("/undo", json={}).raise_for_status()
    assert tomllib.loads(editor.http.get("/text").text)["page"][1]["widget"][0] == lamp


def test_an_edit_of_an_older_revision_follows_its_table(editor: EditorServer) -> None:
    known = editor.state()["revision"]
    moved = {"op": "move", "path": LABEL[:-1], "to": [*LABEL[:-2], 1]}
    assert editor.edit(moved, revision=known).status_code == 200
    edit = {"op": "set", "path": LABEL, "value": "Belt speed"}
    assert editor.edit(edit, revision=known).status_code == 200
    assert editor.http.get("/text").text.count('label = "Belt speed"') == 1
    behind = editor.edit({**edit, "value": "Speed of the belt"}, revision=known)
    assert behind.status_code == 409
    assert behind.json()["revision"] == known + 2


def test_an_edit_that_can_not_be_made_names_its_path(editor: EditorServer) -> None:
    refused = editor.edit({"op": "delete", "path": ["page", 7]})
    assert refused.status_code == 422
    assert refused.json()["path"] == ["page", 7]
    assert editor.edit({"op": "none", "path": []}).status_code == 422
    assert editor.http.get("/parts/form?path=nothing").status_code == 422


def test_save_writes_the_changed_line_only(editor: EditorServer) -> None:
    editor.edit({"op": "set", "path": LABEL, "value": "Belt speed"}).raise_for_status()
    assert "−" in editor.part("diff")
    assert editor.file.read_text() == PANEL
    editor.http.post("/save", json={}).raise_for_status()
    changed = [
        (old, new)
        for old, new in zip(PANEL.splitlines(), editor.file.read_text().splitlines(), strict=True)
        if old != new
    ]
    assert [new for _, new in changed] == ['label = "Belt speed"      # shown large']
    assert "−" not in editor.part("diff")


def test_a_saved_file_has_the_commands_that_serve_it(editor: EditorServer) -> None:
    def commands() -> list[str]:
        return re.findall(r"<code>(.*?)</code>", editor.part("diff"))

    run = f"operator-panel run {editor.file}"
    assert 'data-part="outline"' in editor.http.get("/").text
    assert commands() == [run, f"KIOSK_MODE=demo {run}"]  # its robot is real, and simulated here
    editor.edit({"op": "set", "path": ["mode"], "value": "demo"}).raise_for_status()
    assert commands() == []
    editor.http.post("/save", json={}).raise_for_status()
    assert commands() == [run]
    editor.edit({"op": "set", "path": ["mode"], "value": "none"}).raise_for_status()
    editor.http.post("/save", json={}).raise_for_status()
    assert commands() == []  # the panel server does not start with a fault


def test_what_others_write_is_merged_where_it_is_another_table(editor: EditorServer) -> None:
    editor.edit({"op": "set", "path": LABEL, "value": "Belt speed"}).raise_for_status()
    editor.file.write_text(PANEL.replace("Gripper", "Claw"))
    until(lambda: "Claw" in editor.http.get("/text").text, "it is taken")
    editor.http.post("/save", json={}).raise_for_status()
    both = PANEL.replace("Gripper", "Claw").replace('label = "Speed" ', 'label = "Belt speed" ')
    assert editor.file.read_text() == both


def test_a_half_written_file_is_taken_when_it_is_whole(editor: EditorServer) -> None:
    editor.edit({"op": "set", "path": LABEL, "value": "Belt speed"}).raise_for_status()
    editor.file.write_text("")
    until(lambda: editor.state()["conflicts"], "the half of it is a conflict")
    editor.file.write_text(PANEL.replace("Gripper", "Claw"))
    until(lambda: "Claw" in editor.http.get("/text").text, "the whole is taken")
    assert editor.state()["conflicts"] == 0
    assert 'label = "Belt speed"' in editor.http.get("/text").text


def test_what_both_have_changed_is_chosen(editor: EditorServer) -> None:
    editor.edit({"op": "set", "path": LABEL, "value": "Belt speed"}).raise_for_status()
    by_another = PANEL.replace('label = "Speed"', 'label = "Velocity"')
    editor.file.write_text(by_another)
    assert editor.http.post("/save", json={}).status_code == 409
    assert editor.file.read_text() == by_another
    assert editor.state()["conflicts"] == 1
    page = editor.part("merge")
    assert "Belt speed" in page
    assert "Velocity" in page
    name = page.partition('data-conflict="')[2].partition('"')[0]
    editor.http.post("/resolve", json={"name": name, "side": "theirs"}).raise_for_status()
    editor.http.post("/save", json={}).raise_for_status()
    assert editor.file.read_text() == by_another
    assert editor.part("merge").strip() == ""


def test_unsaved_work_is_there_again_after_a_crash(tmp_path: Path) -> None:
    with editing(tmp_path) as first:
        first.edit({"op": "set", "path": LABEL, "value": "Belt speed"}).raise_for_status()
        first.kill()
    with editing(tmp_path) as second:
        assert second.state()["recovered"]
        assert "Belt speed" in second.part("recovered")
        second.http.post("/recovered", json={"take": True}).raise_for_status()
        assert "Belt speed" in second.http.get("/text").text
        assert not second.state()["recovered"]


def test_a_page_is_drawn_with_the_edit_before_its_sessions_run(editor: EditorServer) -> None:
    drawn = editor.edit({"op": "set", "path": LABEL, "value": "Belt speed"}).json()["drawn"]
    page = editor.http.get(f"/preview/pages/cell?drawn={drawn}").text
    assert "Belt speed" in page
    until(lambda: editor.state()["live"] == drawn, "its sessions run")
    assert "Belt speed" in editor.http.get("/preview/pages/cell").text


def test_values_go_on_while_a_panel_is_edited(editor: EditorServer) -> None:
    """What is drawn after an edit has the values of the sessions before."""
    snapshot = editor.http.get("/preview/events?once=1").text
    data = next(line for line in snapshot.splitlines() if line.startswith("data: {"))
    known = json.loads(data.removeprefix("data: "))["widgets"]["speed"]
    assert known["text"] != ""
    drawn = editor.edit({"op": "set", "path": LABEL, "value": "Belt speed"}).json()["drawn"]
    page = editor.http.get(f"/preview/pages/cell?drawn={drawn}").text
    assert 'data-state="stale"' not in page
    assert "link_starting" not in page
    assert '"enabled": false' not in page


def test_a_file_with_faults_keeps_the_last_good_page(editor: EditorServer) -> None:
    before = editor.state()["drawn"]
    path = ["page", 0, "group", 0, "widget", 0, "field"]
    editor.edit({"op": "set", "path": path, "value": "date"}).raise_for_status()
    after = editor.state()
    assert (after["faults"], after["drawn"]) == (1, before)
    assert editor.http.get(f"/preview/pages/cell?drawn={before}").status_code == 200
    faulty = editor.http.get("/places?page=cell").json()["faulty"]
    assert [fault["path"] for fault in faulty] == [path[:-1]]
    assert json.dumps(path[:-1]) in editor.part("faults").replace("&#34;", '"')
    line = PANEL.splitlines().index('field = "data"') + 1
    assert f"line {line}" in editor.part("faults")


def test_a_text_that_is_not_toml_changes_nothing(editor: EditorServer) -> None:
    refused = editor.edit({"op": "text", "path": [], "text": PANEL + "\nnot toml\n"})
    assert refused.status_code == 422
    assert editor.state()["faults"] == 0


def test_a_file_that_is_not_toml_is_opened_with_its_fault(tmp_path: Path) -> None:
    with editing(tmp_path, "title = \n") as editor:
        assert editor.state()["faults"] == 1
        assert "line 1" in editor.part("faults")
        assert editor.http.get("/").status_code == 200
        assert editor.http.get("/preview/").status_code == 503
        mended = editor.edit({"op": "text", "path": [], "text": PANEL})
        assert mended.status_code == 200
        until(lambda: editor.state()["live"] > 0, "the panel is shown")
        assert editor.http.get("/preview/").status_code == 200


@pytest.mark.parametrize(
    ("selector", "path"),
    [
        ("main", ["page", 0]),
        ('.group[data-group="1"]', ["page", 0, "group", 1]),
        ('[id="at-open"]', ["page", 0, "group", 1, "widget", 0]),
        ('nav.pages a[href*="/pages/watch"]', ["page", 1]),
        ("body > header", []),
    ],
)
def test_each_part_of_a_page_has_its_table(editor: EditorServer, selector: str, path: Any) -> None:
    places = editor.http.get("/places?page=cell").json()["places"]
    tables = {place["selector"]: place["path"] for place in places if place["beside"] is None}
    assert tables[selector] == path


@pytest.mark.parametrize(
    ("path", "beside"),
    [
        (["page", 0, "group", 2, "+"], ['.group[data-group="0"]', '.group[data-group="1"]']),
        (["page", 0, "group", 0, "widget", 2, "+"], ['[id="at-speed"]', '[id="at-ready"]']),
        (["page", 0, "group", 1, "widget", 1, "+"], ['[id="at-open"]']),
    ],
)
def test_the_room_that_parts_leave_is_a_place(
    editor: EditorServer, path: list[Any], beside: list[str]
) -> None:
    places = editor.http.get("/places?page=cell").json()["places"]
    assert [place["beside"] for place in places if place["path"] == path] == [beside]
    pane = editor.part("form", path=json.dumps(path))
    offered = re.findall(r'data-kind-of="(\w+)"', pane)
    assert offered == ["group"] if path[-3] == "group" else "indicator" in offered


@pytest.mark.parametrize("language", ["en", "ja", "de"])
@pytest.mark.parametrize(
    "name", ["outline", "faults", "diff", "form", "pages", "robot", "parts", "delete"]
)
def test_each_pane_comes_in_each_language(editor: EditorServer, name: str, language: str) -> None:
    headers = {"accept-language": language}
    for path in ("[]", '["page", 0]', '["page", 0, "group", 0, "widget", 0]'):
        answer = editor.http.get(f"/parts/{name}", params={"path": path}, headers=headers)
        assert answer.status_code == 200
        assert "editor_" not in answer.text


def test_a_press_in_the_preview_reaches_the_simulated_robot(editor: EditorServer) -> None:
    until(lambda: editor.state()["live"] == editor.state()["drawn"], "its sessions run")
    pressed = editor.http.post("/preview/widgets/open", json={"inputs": {}})
    assert pressed.json()["outcome"] == "succeeded", pressed.text


def test_nothing_is_written_beside_the_file(editor: EditorServer) -> None:
    assert {file.name for file in editor.file.parent.iterdir()} == {"cell.toml", "state"}
    assert [folder.name for folder in (editor.file.parent / "state/operator-panel").iterdir()] == [
        "editor"
    ]


def test_a_live_preview_sends_nothing(tmp_path: Path) -> None:
    zenoh = tmp_path / "zenoh.json5"
    zenoh.write_text('{ mode: "peer", connect: { endpoints: ["tcp/127.0.0.1:9"] } }')
    with editing(tmp_path, PANEL, "--live", KIOSK_ZENOH=str(zenoh)) as live:
        refused = live.http.post("/preview/widgets/open", json={"inputs": {}})
        assert refused.status_code == 409
        assert live.http.get("/preview/pages/cell").status_code == 200


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--host", "0.0.0.0"], "TLS"),
        (["--ssl-certfile", "a.pem"], "together"),
        (["--port", "70000"], "port"),
    ],
)
def test_it_does_not_start_open_to_the_network(tmp_path: Path, options: list[str], says: str) -> None:
    file = tmp_path / "cell.toml"
    file.write_text(PANEL)
    done = command.run(COMMAND, "edit", str(file), *options)
    assert done.returncode != 0
    assert says in done.stderr


@pytest.mark.parametrize("name", ["none/cell.toml", "."])
def test_a_file_that_can_not_be_begun_is_named(tmp_path: Path, name: str) -> None:
    done = command.run(COMMAND, "edit", str(tmp_path / name))
    assert done.returncode == 1
    assert "there is no such file" in done.stderr
    assert [*tmp_path.iterdir()] == []


def test_a_file_that_is_not_there_is_begun_with_a_page(tmp_path: Path) -> None:
    file = tmp_path / "robot_cell.toml"
    for _ in range(2):  # what no one has written is not offered again
        editor = EditorServer(file)
        try:
            assert file.read_text() == ""
            state = editor.state()
            assert (state["faults"], state["saved"], state["recovered"]) == (0, False, False)
            text = editor.http.get("/text").text
            assert text.startswith('title = "Robot cell"\n')
            assert editor.http.get("/preview/").status_code == 200
            assert 'data-part="parts"' in editor.http.get("/").text  # what can be added
            assert "operator-panel run" not in editor.part("diff")
        finally:
            editor.end()


def test_pages_of_several_robots_are_drawn_below_their_paths(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(ROOT / "docs/examples/welding-cell", tmp_path / "cell"))
    with editing(folder, (folder / "panel.toml").read_text()) as editor:
        drawn = editor.edit({"op": "set", "path": ["title"], "value": "Another cell"}).json()["drawn"]
        page = editor.http.get(f"/preview/robots/left/pages/weld?drawn={drawn}")
        assert page.status_code == 200
        assert "Another cell" in page.text
        assert "/preview/robots/right/" in page.text


FAULTY = PANEL.replace('kind = "readout"\nlabel = "Speed"', 'kind = "reedout"\nlabel = "Speed"')


def test_a_faulty_file_is_drawn_without_the_faulty_tables(tmp_path: Path) -> None:
    assert FAULTY != PANEL
    with editing(tmp_path, FAULTY) as editor:
        assert editor.state()["faults"] == 1
        page = editor.http.get("/preview/pages/cell").raise_for_status().text
        assert 'id="at-ready"' in page
        assert 'id="at-speed"' not in page
        editor.edit({"op": "text", "path": [], "text": PANEL}).raise_for_status()
        assert 'id="at-speed"' in editor.http.get("/preview/pages/cell?drawn=2").text
        # From now on a fault leaves the last whole panel.
        editor.edit({"op": "text", "path": [], "text": FAULTY}).raise_for_status()
        assert 'id="at-speed"' in editor.http.get("/preview/pages/cell?drawn=2").text


def test_a_form_has_the_names_and_values_of_the_robot(tmp_path: Path) -> None:
    with editing(tmp_path) as editor:
        path = '["page", 0, "group", 0, "widget", 0]'
        until(lambda: "now" in editor.part("form", path=path), "the newest value of /speed")
        html = editor.part("form", path=path)
        assert 'value="/gripper/open"' not in html
        assert 'value="/load"' in html
