"""`operator-panel backup` and `restore`: a round trip beside a running server, and every fault."""

import hashlib
import json
import signal
import sqlite3
import stat
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from app.records.data_dir import DataDir
from app.records.database import NAME, Filter, rows
from app.records.verify import verify
from app.tools.cli.command import main
from tests.support.parts import ROOT, Server, until

pytestmark = pytest.mark.promise("log")

Run = Callable[..., tuple[int, str]]


def demo(data: Path) -> Server:
    panel = str(ROOT / "app/panel.toml")
    return Server(ROOT, KIOSK_PANEL=panel, KIOSK_DATA=str(data), KIOSK_MODE="demo")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A backup of the demo's data and of its panel, made while its server ran."""
    folder = tmp_path_factory.mktemp("made")
    server = demo(folder / "data")
    try:
        until(server.ready, "ready", within_s=60)
        (folder / "data/recordings").mkdir(exist_ok=True)
        (folder / "data/recordings/old.mcap").write_bytes(b"recording")
        (folder / "data/stop-views").mkdir(exist_ok=True)
        for name in ("1800000000000.json.gz", "1800000000001.json.gz.new"):
            (folder / "data/stop-views" / name).write_bytes(b"view")
        assert main(["backup", "--data", str(folder / "data"), str(folder / "a.zip")]) == 0
        assert main(["restore", "--data", str(folder / "data"), str(folder / "a.zip")]) == 1
    finally:
        server.end(signal.SIGTERM)
    return folder


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def command(*words: object) -> tuple[int, str]:
        capsys.readouterr()
        status = main([str(word) for word in words])
        output = capsys.readouterr()
        return status, output.out + output.err

    return command


def content(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != "server.lock")
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def rewritten(source: Path, target: Path, change: Callable[[dict[str, bytes]], Any]) -> Path:
    """A backup with other files."""
    with zipfile.ZipFile(source) as old:
        files = {name: old.read(name) for name in old.namelist()}
    change(files)
    with zipfile.ZipFile(target, "w") as new:
        for name, data in files.items():
            new.writestr(name, data)
    return target


def manifest_with(**keys: Any) -> Callable[[dict[str, bytes]], None]:
    def change(files: dict[str, bytes]) -> None:
        files["manifest.json"] = json.dumps(json.loads(files["manifest.json"]) | keys).encode()

    return change


def listed(files: dict[str, bytes], name: str, data: bytes) -> None:
    """Puts a file in, with its right hash."""
    manifest = json.loads(files["manifest.json"])
    digest = hashlib.sha256(data).hexdigest()
    manifest["files"][name] = {"sha256": digest, "size": len(data), "modified": 0.0}
    files["manifest.json"], files[name] = json.dumps(manifest).encode(), data


def forged(files: dict[str, bytes], folder: Path) -> None:
    """An entry of the log is changed, and the list of hashes fits that."""
    path = folder / "forged.sqlite3"
    path.write_bytes(files[f"data/{NAME}"])
    with sqlite3.connect(path) as db:
        db.execute("UPDATE entry SET reason = 'nothing' WHERE seq = 1")
    db.close()
    listed(files, f"data/{NAME}", path.read_bytes())


def test_a_backup_beside_a_server_is_restored_and_the_log_says_so(
    made: Path, run: Run, tmp_path: Path
) -> None:
    file, data = made / "a.zip", tmp_path / "data"
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    with zipfile.ZipFile(file) as packed:
        names = set(packed.namelist())
    assert {f"data/{NAME}", "data/log-key.pem", "data/alarms.sqlite3", "panel/panel.toml"} <= names
    assert [name for name in sorted(names) if "stop-views" in name] == [
        "data/stop-views/1800000000000.json.gz"
    ]
    assert not any("recordings" in name or "lock" in name for name in names)
    data.mkdir()
    (data / "recordings").mkdir()
    (data / "recordings/mine.mcap").write_bytes(b"mine")
    (data / NAME).write_bytes(b"the old one")
    status, text = run("restore", "--data", data, file)
    assert status == 0, text
    (aside,) = tmp_path.glob("data.before-*")
    assert (aside / NAME).read_bytes() == b"the old one"
    assert (data / "recordings/mine.mcap").read_bytes() == b"mine"
    assert stat.S_IMODE((data / "log-key.pem").stat().st_mode) == 0o600
    entries = verify(data).count
    server = demo(data)
    try:
        until(server.ready, "ready", within_s=60)
    finally:
        server.end(signal.SIGTERM)
    later = [row.entry for row in rows(data, Filter(every=True), None, 1000)]
    starts = [json.loads(entry.values) for entry in later if entry.kind == "began"]
    assert "SHA-256" in starts[0]["restored"]
    assert "restored" not in starts[-1]
    assert verify(data).count > entries
    assert verify(data).fault == ""


def test_the_panel_file_is_written_where_it_is_wanted(made: Path, run: Run, tmp_path: Path) -> None:
    status, text = run("restore", "--panel-to", tmp_path / "cell", made / "a.zip")
    assert status == 0, text
    assert (tmp_path / "cell/panel.toml").read_bytes() == (ROOT / "app/panel.toml").read_bytes()
    assert run("check", tmp_path / "cell/panel.toml")[0] == 0
    assert run("restore", "--panel-to", tmp_path / "cell", made / "a.zip")[0] == 1


def test_recordings_are_in_it_if_asked_for(made: Path, run: Run, tmp_path: Path) -> None:
    options = ("--recordings", "--data-only", "--data", made / "data")
    status, text = run("backup", *options, tmp_path / "b.zip")
    assert status == 0, text
    with zipfile.ZipFile(tmp_path / "b.zip") as packed:
        assert "data/recordings/old.mcap" in packed.namelist()
        assert not any(name.startswith("panel/") for name in packed.namelist())
    assert run("backup", *options, tmp_path / "b.zip")[0] == 1  # it is there


FAULTS: dict[str, tuple[Callable[[dict[str, bytes], Path], Any], str]] = {
    "a byte": (
        lambda files, _: files.update({"data/log-key.pem": files["data/log-key.pem"][:-1] + b"!"}),
        "SHA-256",
    ),
    "missing": (lambda files, _: files.pop("data/alarms.sqlite3"), "is missing in the backup"),
    "unlisted": (lambda files, _: files.update({"data/more": b""}), "is not in its list"),
    "no list": (lambda files, _: files.pop("manifest.json"), "not a backup"),
    "list": (lambda files, _: files.update({"manifest.json": b"[]"}), "not a backup"),
    "format": (lambda files, _: manifest_with(format=2)(files), "the format 2"),
    "version": (lambda files, _: manifest_with(version="99.1")(files), "update first"),
    "name": (lambda files, _: listed(files, "data/../../x", b""), 'the name "data/../../x"'),
    "absolute": (lambda files, _: listed(files, "/etc/x", b""), 'the name "/etc/x"'),
    "database": (
        lambda files, _: listed(files, "data/alarms.sqlite3", b"no database" * 200),
        "alarms.sqlite3 is damaged",
    ),
    "chain": (forged, "the operator's log was changed: entry 1"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_backup_with_a_fault_is_not_restored(
    fault: str, made: Path, run: Run, tmp_path: Path
) -> None:
    change, said = FAULTS[fault]
    file = rewritten(made / "a.zip", tmp_path / "b.zip", lambda files: change(files, tmp_path))
    data = tmp_path / "data"
    data.mkdir()
    (data / NAME).write_bytes(b"old")
    status, text = run("restore", "--data", data, file)
    assert (status, said in text) == (1, True), text
    assert content(data) == {NAME: b"old"}
    assert not list(tmp_path.glob("data.*"))


@pytest.mark.parametrize("cut", [0, 1, 1000])
def test_a_cut_file_is_no_backup(cut: int, made: Path, run: Run, tmp_path: Path) -> None:
    (tmp_path / "cut.zip").write_bytes((made / "a.zip").read_bytes()[:-cut] if cut else b"")
    status, text = run("restore", "--data", tmp_path / "data", tmp_path / "cut.zip")
    assert (status, "damaged" in text) == (1, True), text
    assert not (tmp_path / "data").exists()


def test_a_changed_log_is_kept_as_evidence_only_if_asked_for(
    made: Path, run: Run, tmp_path: Path
) -> None:
    file = rewritten(made / "a.zip", tmp_path / "b.zip", lambda files: forged(files, tmp_path))
    assert run("restore", "--unverified", "--data", tmp_path / "data", file)[0] == 0
    again = ("backup", "--data-only", "--data", tmp_path / "data")
    status, text = run(*again, tmp_path / "c.zip")
    assert (status, "the operator's log was changed: entry 1" in text) == (1, True), text
    assert not (tmp_path / "c.zip").exists()
    assert run(*again, "--unverified", tmp_path / "c.zip")[0] == 0


@pytest.fixture
def other_server(tmp_path: Path) -> Iterator[Path]:
    """The data folder of a demo, held, in that of the live panel."""
    folder = DataDir(tmp_path / "data/demo")
    folder.claim()
    yield folder.path
    folder.release()


def test_restore_refuses_while_a_server_has_a_folder_of_it(
    made: Path, run: Run, tmp_path: Path, other_server: Path
) -> None:
    status, text = run("restore", "--data", tmp_path / "data", made / "a.zip")
    assert (status, str(other_server) in text) == (1, True), text
    assert list((tmp_path / "data").glob("*.sqlite3")) == []


@pytest.mark.parametrize("full", ["before", "while it is written"])
def test_a_full_disk_leaves_the_old_data(
    full: str, made: Path, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = tmp_path / "data"
    data.mkdir()
    (data / NAME).write_bytes(b"old")

    def no_room(_: int) -> None:
        raise OSError(28, "No space left on device")

    if full == "before":
        monkeypatch.setattr("shutil.disk_usage", lambda _: _Full())
    else:
        monkeypatch.setattr("os.fsync", no_room)
    status, text = run("restore", "--data", data, made / "a.zip")
    assert (status, "too full" in text or "No space left" in text) == (1, True), text
    assert content(data) == {NAME: b"old"}
    assert not list(tmp_path.glob("data.*"))


class _Full:
    free = 0


KILLED = """
import os, signal, sys
from app.tools.install import backup
from app.tools.cli.command import main
seen = 0
def call(frame, event, argument):
    global seen
    if event == "call" and frame.f_code.co_filename == backup.__file__:
        seen += 1
        if seen == int(sys.argv[1]):
            os.kill(os.getpid(), signal.SIGKILL)
sys.setprofile(call)
main(sys.argv[2:])
sys.setprofile(None)
print(seen)
"""


def test_killed_at_any_step_there_is_the_old_or_the_new(made: Path, tmp_path: Path) -> None:
    """At each call of the module that comes near the exchange, and at some before."""

    def restored(step: int) -> tuple[bool, Path, str]:
        data = tmp_path / f"{step}/data"
        data.mkdir(parents=True)
        (data / NAME).write_bytes(b"old")
        words = ["restore", "--data", str(data), str(made / "a.zip")]
        command = [sys.executable, "-c", KILLED, str(step), *words]
        run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        return (data / NAME).read_bytes() == b"old", data, run.stdout + run.stderr

    is_old, data, text = restored(0)
    assert not is_old, text
    calls = int(text.split()[-1])
    seen = set()
    for step in (1, calls // 2, *range(calls - 8, calls + 1)):
        is_old, data, text = restored(step)
        seen.add(is_old)
        if not is_old:
            assert verify(data).fault == ""
            (aside,) = (path for path in data.parent.iterdir() if path != data)
            assert (aside / NAME).read_bytes() == b"old"
    assert seen == {True, False}
