"""Each start in the operator's log: what ran, what had changed, and which panel was shown when."""

import hashlib
import json
import os
import stat
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from app.cell.people.access_log import read_rights
from app.cell.people.users import ApiToken, User
from app.cell.people.users_file import UsersFile
from app.panel import load_panel
from app.records import Entry, new_entry
from app.records.database import Filter, rows
from app.records.shown_panel import Run, read_panel, runs, shown_at
from app.records.starts import (
    FOLDER,
    MORE,
    MOST_ENTRIES,
    FileChanged,
    FileNotKept,
    KeptFiles,
    Manifest,
    StartRecord,
    changed_keys,
    changes,
    flat,
    in_entries,
    parse_manifest,
    read_start_files,
    settings_text,
    sha256,
)
from app.records.store import Store
from app.records.verify import verify
from app.records.writer import start_entries
from app.system.errors import LogError
from app.system.settings import PREFIX, VARIABLES, Settings
from app.tools.cli.log import main
from tests.support.parts import ROOT
from tests.support.servers import demo_server

PANEL = """
title = "Cell 1"
mode = "demo"
pictures = "pictures"
[[font]]
regular = "own.ttf"
bold = "own.ttf"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = { data = true }
"""
FONT = b"\0\1\0\0 letters"
ENV = {"PATH": os.environ["PATH"], "TZ": "UTC"}


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures/plan.svg").write_text("<svg/>")
    (tmp_path / "cell1.toml").write_text(PANEL)
    (tmp_path / "zenoh.json5").write_text('{ transport: { auth: { usrpwd: { password: "canary" } } } }')
    (tmp_path / "own.ttf").write_bytes(FONT)
    return Settings(
        panel=tmp_path / "cell1.toml", zenoh=tmp_path / "zenoh.json5", data=tmp_path / "data"
    )


def start(settings: Settings) -> list[Entry]:
    """The entries of a start with these settings, and of its end, the oldest first."""
    data = settings.data_folder("demo")
    data.mkdir(mode=0o700, exist_ok=True)
    panel = load_panel(settings.panel)
    read = partial(read_start_files, settings, panel, "demo", partial(read_rights, data))
    record = StartRecord(KeptFiles(data), read, panel.revision)
    boot = os.urandom(4).hex()
    store = Store(data, boot)
    for entry in (written := store.append(start_entries(store, "demo", record))):
        if entry.kind == "began":
            store.mark_start(entry.seq)
    store.close()
    return written


def values(entry: Entry) -> dict[str, Any]:
    about: dict[str, Any] = json.loads(entry.values)
    return about


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_a_start_has_the_hashes_of_all_that_it_runs_with(settings: Settings) -> None:
    (began,) = start(settings)
    about = values(began)
    assert about["panel"] == hashlib.sha256(settings.panel.read_bytes()).hexdigest()
    assert about["zenoh"] == hashlib.sha256(settings.zenoh.read_bytes()).hexdigest()
    picture = hashlib.sha256(b"<svg/>").hexdigest()
    assert about["pictures"] == hashlib.sha256(f"{picture}  plan.svg\n".encode()).hexdigest()
    font = hashlib.sha256(FONT).hexdigest()
    assert about["fonts"] == hashlib.sha256(f"{font}  own.ttf\n".encode()).hexdigest()
    assert {"version", "settings", "catalogues", "program", "files"} <= about.keys()
    assert "changes" not in about  # there is no start before


def test_a_start_without_a_change_says_so(settings: Settings) -> None:
    start(settings)
    (began,) = start(settings)
    assert values(began)["changes"] == 0


def test_what_changed_is_named_by_key_with_old_and_new_value(settings: Settings) -> None:
    start(settings)
    edit(settings.panel, 'label = "Start"', 'label = "Go"\nconsequence = "Starts the cycle"')
    edit(settings.panel, 'title = "Cell 1"\n', 'title = "Cell 1"\ntheme = "dark"\n')
    (settings.panel.parent / "pictures/plan.svg").write_text("<svg></svg>")
    began, changed = start(replace(settings, hosts=("127.0.0.1", "panel.plant")))
    names = values(changed)
    assert names["page.main.widget.start.label"] == '"Start" → "Go"'
    assert names["page.main.widget.start.consequence"] == '– → "Starts the cycle"'
    assert names["theme"] == '– → "dark"'
    assert names["KIOSK_HOSTS"] == "127.0.0.1,localhost,[::1] → 127.0.0.1,panel.plant"
    assert names["pictures: plan.svg"].startswith(sha256(b"<svg/>")[:12])
    assert values(began)["changes"] == len(names) == 5
    assert changed.reason == "Changed since the last start: 5."


def test_a_change_without_a_key_is_one_too(settings: Settings) -> None:
    start(settings)
    settings.panel.write_text(PANEL + "# a remark\n")
    _, changed = start(settings)
    assert values(changed) == {"panel file": "changed, but no key: comments or its form"}


def test_no_secret_is_logged_or_kept(settings: Settings) -> None:
    """The Zenoh file may have a password; addresses may have a user and a password."""
    start(settings)
    settings.zenoh.write_text('{ transport: { auth: { usrpwd: { password: "canary2" } } } }')
    edit(settings.panel, 'label = "Start"', 'label = "Start"\nconsequence = "rtsp://u:canary3@cam/1"')
    written = start(settings)
    assert any("zenoh" in values(entry) for entry in written[1:])
    texts = "".join(entry.values for entry in written)
    assert "rtsp://…@cam/1" in texts
    assert "canary" not in texts
    kept = (settings.data_folder("demo") / FOLDER).iterdir()
    assert not any(b"canary2" in path.read_bytes() for path in kept)


def test_users_that_changed_are_named_with_their_rights(settings: Settings) -> None:
    data = settings.data_folder("demo")
    start(settings)
    file = UsersFile(data)
    ada = User("Ada", "operator", ("shift_a",), pin="canary-pin")
    file.edit(lambda book: replace(book, users=(ada, User("Pin Lee", "viewer", badge="canary-badge"))))
    _, added = start(settings)
    assert values(added) == {
        "user Ada": "– → operator, shift_a, by pin",
        "user Pin Lee": "– → viewer, by badge",
    }
    mes = ApiToken("mes", "viewer", "canary-token")
    file.edit(lambda book: replace(book, users=(replace(ada, role="engineer"),), tokens=(mes,)))
    began, changed = start(settings)
    assert values(changed) == {
        "user Ada": "operator, shift_a, by pin → engineer, shift_a, by pin",
        "user Pin Lee": "viewer, by badge → –",
        "token mes": "– → viewer",
    }
    assert values(began)["users"] != values(added).get("users")
    file.edit(lambda book: replace(book, users=(replace(ada, role="engineer", pin="another"),)))
    (same,) = start(settings)
    assert (values(same)["changes"], values(same)["users"]) == (0, values(began)["users"])
    kept = [path.read_bytes() for path in (data / FOLDER).iterdir()]
    assert not any(b"canary" in content for content in kept)


def test_a_start_of_a_version_without_users_in_its_files_names_none_as_new(settings: Settings) -> None:
    manifest = Manifest("1", {}, {})
    assert parse_manifest(manifest.as_json()).users is None
    assert changes(manifest, replace(manifest, users={"user Ada": "operator"}), None, None) == {}


def test_users_that_can_not_be_read_are_said_to_be_so(settings: Settings) -> None:
    start(settings)
    path = settings.data_folder("demo") / "users.json"
    path.write_text("{")
    path.chmod(0o600)
    _, changed = start(settings)
    assert values(changed)["users.json"].startswith("– → unreadable: ")


def test_a_key_that_is_named_like_a_secret_shows_no_value() -> None:
    changed = changed_keys(flat({"mqtt": {"password": "a"}}), flat({"mqtt": {"password": "b"}}))
    assert changed == {"mqtt.password": "… → …"}


def test_the_order_of_widgets_counts_and_an_inserted_widget_is_no_other_order() -> None:
    def tables(*names: str) -> dict[str, str]:
        return flat({"widget": [{"id": name} for name in names]})

    assert changed_keys(tables("a", "b"), tables("b", "a")) == {"widget order": "a, b → b, a"}
    assert "widget order" not in changed_keys(tables("a", "b"), tables("a", "c", "b"))


def test_many_changes_are_bounded_and_the_rest_is_counted() -> None:
    changed = {f"page.main.widget.w{number}.label": "x" * 160 for number in range(500)}
    batches = in_entries(changed)
    assert len(batches) == MOST_ENTRIES
    assert int(batches[-1][MORE]) == 500 - sum(len(batch) for batch in batches) + 1
    assert all(len(json.dumps(batch, ensure_ascii=False)) < 2000 for batch in batches)


def test_files_are_kept_once_for_their_user_only(settings: Settings) -> None:
    start(settings)
    folder = settings.data_folder("demo") / FOLDER
    before = sorted(path.name for path in folder.iterdir())
    start(settings)
    assert sorted(path.name for path in folder.iterdir()) == before
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()} == {0o600}


def test_the_longest_unused_files_make_room(tmp_path: Path) -> None:
    kept = KeptFiles(tmp_path, most_files=3, most_bytes=1000)
    texts = [bytes([65 + number]) * 100 for number in range(5)]
    for age, data in enumerate(texts):
        kept.keep({sha256(data): data})
        path = kept.folder / sha256(data)
        if path.exists():
            os.utime(path, (age, age))
    assert {path.name for path in kept.folder.iterdir()} == {sha256(data) for data in texts[2:]}
    large = b"x" * 950
    assert kept.keep({sha256(large): large}) == []
    assert [path.name for path in kept.folder.iterdir()] == [sha256(large)]
    too_large = b"y" * 1001
    assert kept.keep({sha256(too_large): too_large}) == [sha256(too_large)]


def test_a_kept_file_that_was_changed_or_removed_is_not_taken_for_the_panel(settings: Settings) -> None:
    (began,) = start(settings)
    data = settings.data_folder("demo")
    (run,) = runs(data)
    assert read_panel(data, run) == PANEL.encode()
    path = data / FOLDER / values(began)["panel"]
    path.write_text(PANEL.replace("Start", "Stop"))
    with pytest.raises(FileChanged, match="was changed"):
        read_panel(data, run)
    path.unlink()
    with pytest.raises(FileNotKept, match=r"panel file cell1.toml of entry 1 is not kept \(SHA"):
        read_panel(data, run)
    (_, changed) = start_after_edit(settings)
    assert values(changed)["panel file"].startswith("changed; one of the two is not kept")


def start_after_edit(settings: Settings) -> list[Entry]:
    edit(settings.panel, "Cell 1", "Cell 2")
    return start(settings)


RUNS = [Run(1, 1000, 2000, 0, "a"), Run(5, 3000, 4000, 0, "b"), Run(9, 5000, 6000, 0, "c")]


@pytest.mark.parametrize(
    ("starts", "at", "seq", "doubt"),
    [
        (RUNS, 1500, 1, ""),
        (RUNS, 3000, 5, ""),
        (RUNS, 2500, 1, "it may have ended before"),
        (RUNS, 5500, 9, ""),
        (RUNS, 99_000, 9, "in the future"),
        ([RUNS[0], Run(5, 500, 1800, 0, "b")], 1500, 5, "the starts in entries 1, 5 fit"),
        ([Run(1, 1000, 90_000, 88_000, "a")], 1500, 1, "the clock was set by 88 s"),
    ],
)
def test_the_panel_at_a_time_is_that_of_the_start_before(
    starts: Sequence[Run], at: int, seq: int, doubt: str
) -> None:
    shown = shown_at(starts, at, now=10_000)
    assert shown.run.seq == seq
    assert doubt in " ".join(shown.doubts)
    assert bool(doubt) == bool(shown.doubts)


def test_a_time_before_the_first_start_has_no_answer() -> None:
    with pytest.raises(LogError, match="the log begins later"):
        shown_at(RUNS, 999, now=10_000)
    with pytest.raises(LogError, match="no entry of a start"):
        shown_at([], 999, now=10_000)


def test_an_entry_of_an_earlier_version_names_no_files(tmp_path: Path) -> None:
    store = Store(tmp_path, "b1")
    store.append([new_entry("began", values={"mode": "live"})])
    store.close()
    (run,) = runs(tmp_path)
    with pytest.raises(LogError, match="entry 1 names no files"):
        read_panel(tmp_path, run)


def test_all_files_of_a_start_are_written_and_none_outside(
    settings: Settings, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start(settings)
    data, to = str(settings.data_folder("demo")), tmp_path / "then"
    assert main(["panel", "--data", data, "--to", str(to)]) == 0
    assert (to / "cell1.toml").read_text() == PANEL
    assert (to / "pictures/plan.svg").read_text() == "<svg/>"
    assert (to / "catalogues/ja.po").is_file()
    assert json.loads((to / "manifest.json").read_text())["settings"]["KIOSK_MODE"] == "demo"
    assert not (to / "zenoh").exists()
    check = ["sha256sum", "--check", "--quiet", str(to / "program/sha256sum")]
    assert subprocess.run(check, cwd=ROOT, capture_output=True).returncode == 0
    capsys.readouterr()


def test_each_setting_of_the_server_is_in_a_start(settings: Settings) -> None:
    assert set(settings_text(settings, "demo")) == {PREFIX + name for name in VARIABLES}


def test_the_panel_of_a_server_can_be_asked_for_by_its_time(tmp_path: Path) -> None:
    """Two starts of a real server, with an edit between them."""
    data = tmp_path / "data"
    text = PANEL.replace('pictures = "pictures"\n', "")
    (tmp_path / "own.ttf").write_bytes(FONT)
    with demo_server(tmp_path, text, KIOSK_DATA=str(data)) as server:
        first = time.time()
        assert server.http.get("/log").status_code == 200
    with demo_server(tmp_path, text.replace("Start", "Go"), KIOSK_DATA=str(data)):
        second = time.time()
    for at, label in ((first, "Start"), (second, "Go")):
        when = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(at))
        shown = panel_at(data, f"{when}.{int(at % 1 * 1000):03d}Z")
        assert f'label = "{label}"' in shown.stdout
        assert "the server started at" in shown.stderr
    changed = [row.entry for row in rows(data, Filter(outcome="changed"), None, 10)]
    assert [values(entry)["page.main.widget.start.label"] for entry in changed] == ['"Start" → "Go"']
    assert panel_at(data, "2020-01-01T00:00").returncode == 1
    assert panel_at(data, "yesterday").returncode == 2
    assert verify(data).fault == ""


def panel_at(data: Path, at: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "app.log", "panel", "--data", str(data), "--at", at]
    return subprocess.run(command, cwd=ROOT, env=ENV, capture_output=True, text=True)
