"""A distribution's messages at the second start: the same, without rosbags; a damaged file is none."""

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from app.interfaces import DISTROS, distribution_cache
from app.interfaces.bundled_messages import load_messages
from tests.support.parts import ROOT

FILE = "messages-jazzy.json"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "state" / "data"


@pytest.mark.parametrize("distro", DISTROS)
def test_what_is_kept_is_what_was_read(distro: str, folder: Path) -> None:
    messages = load_messages(distro)
    distribution_cache.write(folder, distro, messages)
    found = distribution_cache.read(folder, distro)
    assert found == messages
    assert {name: dict(one.constant_types) for name, one in found.items()} == {
        name: dict(one.constant_types) for name, one in messages.items()
    }
    assert [path.name for path in folder.iterdir()] == [f"messages-{distro}.json"]
    assert folder.stat().st_mode & 0o777 == 0o700


def test_what_is_not_there_is_not_found(folder: Path) -> None:
    assert distribution_cache.read(folder, "jazzy") is None


def test_a_file_that_is_damaged_anywhere_is_as_good_as_none(folder: Path) -> None:
    distribution_cache.write(folder, "jazzy", load_messages("jazzy"))
    whole = (folder / FILE).read_bytes()
    for at in (0, 5, 20, 60, 100, len(whole) // 2, len(whole) - 1):
        (folder / FILE).write_bytes(whole[:at] + bytes((whole[at] ^ 1,)) + whole[at + 1 :])
        assert distribution_cache.read(folder, "jazzy") is None, at
        (folder / FILE).write_bytes(whole[:at])
        assert distribution_cache.read(folder, "jazzy") is None, at
    (folder / FILE).write_bytes(whole)
    assert distribution_cache.read(folder, "jazzy") is not None


@pytest.mark.parametrize("changed", ["rosbags", "format"])
def test_a_file_of_another_version_is_as_good_as_none(
    changed: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distribution_cache.write(folder, "jazzy", load_messages("jazzy"))
    if changed == "format":
        monkeypatch.setattr(distribution_cache, "FORMAT", distribution_cache.FORMAT + 1)
    else:
        monkeypatch.setattr(distribution_cache, "version", lambda name: f"{name} of tomorrow")
    assert distribution_cache.read(folder, "jazzy") is None


def test_a_file_of_another_distribution_is_as_good_as_none(folder: Path) -> None:
    distribution_cache.write(folder, "humble", load_messages("humble"))
    (folder / "messages-humble.json").rename(folder / FILE)
    assert distribution_cache.read(folder, "jazzy") is None


def test_a_folder_that_can_not_be_written_is_no_fault(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    distribution_cache.write(tmp_path / "file", "jazzy", load_messages("jazzy"))
    distribution_cache.write(tmp_path / "file" / "data", "jazzy", load_messages("jazzy"))
    assert distribution_cache.read(tmp_path / "file", "jazzy") is None


def test_servers_that_write_at_once_leave_a_whole_file_or_none(folder: Path) -> None:
    messages = load_messages("jazzy")
    threads = [
        threading.Thread(target=distribution_cache.write, args=(folder, "jazzy", messages))
        for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        assert distribution_cache.read(folder, "jazzy") in (None, messages)
        thread.join()
    distribution_cache.write(folder, "jazzy", messages)
    assert distribution_cache.read(folder, "jazzy") == messages


def test_the_second_start_knows_the_same_without_rosbags(folder: Path) -> None:
    first, second = started(folder), started(folder)
    assert first["rosbags"]
    assert not second["rosbags"]
    assert not second["numpy"]
    assert first["hashes"] == second["hashes"]
    (folder / FILE).write_bytes(b"")
    assert started(folder) == first
    assert started(folder) == second


STARTED = """
import json, sys
from app.main import app
from app.interfaces import load_interfaces
known = load_interfaces("jazzy")
hashes = {name: known.type_hash(name) for name in known.structures}
loaded = {name: name in sys.modules for name in ("rosbags", "numpy")}
print(json.dumps({"hashes": hashes, **loaded}))
"""


def started(folder: Path) -> dict[str, object]:
    """What a process knows and has loaded that has read its modules and its panel."""
    env = {k: v for k, v in os.environ.items() if not k.startswith("KIOSK_")}
    ran = subprocess.run(
        [sys.executable, "-c", STARTED],
        env=env | {"KIOSK_DATA": str(folder)},
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    found: dict[str, object] = json.loads(ran.stdout)
    return found
