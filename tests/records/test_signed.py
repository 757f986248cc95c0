"""Attacks on the operator's log: an entry that was changed and sealed again, a tail that was cut off,
signatures that were taken out or made with another key."""

import json
import shutil
import sqlite3
import stat
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from app.records.database import NAME as DATABASE
from app.records.database import Filter, rows
from app.records.entry import FIELDS, Entry, Origin, new_entry
from app.records.log_key import NAME, Signer, load_key, load_or_make_key
from app.records.store import COLUMNS, INSERT, Store
from app.records.verify import LONGEST_UNSIGNED_US, verify
from app.system.errors import LogError
from app.system.settings import APP
from app.tools.cli.log import main

pytestmark = pytest.mark.promise("log")

FROM = Origin(address="10.0.0.7", browser="b1", who="Kim")


def pressed(number: int) -> Entry:
    return new_entry("pressed", FROM, {"speed": number}, press=f"p{number}", widget="drive")


def write(folder: Path, count: int, boot: str = "b1", sign: bool = True) -> None:
    """A server's run: presses, with a signature after every second one and at the end."""
    folder.mkdir(exist_ok=True)
    store, signer = Store(folder, boot), Signer(folder)
    store.append([new_entry("began", values={"mode": "live"})])
    for number in range(count):
        store.append([pressed(number)])
        if sign and number % 2:
            signer.sign(store, "hour")
    if sign:
        signer.sign_end(store)
    store.checkpoint()
    store.close()


@pytest.fixture
def data(tmp_path: Path) -> Path:
    write(tmp_path / "data", 6)
    return tmp_path / "data"


def entries(folder: Path) -> list[Entry]:
    with closing(sqlite3.connect(folder / DATABASE)) as db:
        return [Entry(*row) for row in db.execute(f"SELECT {COLUMNS} FROM entry ORDER BY seq")]


def reseal(folder: Path, changed: Callable[[list[Entry]], list[Entry]]) -> None:
    """Writes the entries with a chain that fits, as an attacker does who can write the file."""
    before = entries(folder)
    prev = before[0].prev
    with closing(sqlite3.connect(folder / DATABASE)) as db, db:
        db.execute("DELETE FROM entry")
        for seq, entry in enumerate(changed(before), 1):
            sealed = entry.sealed(seq, entry.boot, prev)
            prev = sealed.hash
            db.execute(INSERT, sealed._replace(boot=entry.boot))


def with_other_value(before: list[Entry]) -> list[Entry]:
    return [entry._replace(values='{"speed": 99}') if entry.seq == 3 else entry for entry in before]


def key_of(folder: Path) -> str:
    key = load_key(folder)
    assert key is not None
    return key.public


def test_a_signed_log_is_proven_to_its_end(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    verified = verify(data, keys=[key_of(data)])
    assert verified.fault == ""
    assert (verified.signed.seq, verified.signed.unsigned) == (verified.count - 1, 0)
    assert main(["verify", "--data", str(data), "--key", key_of(data)]) == 0
    assert f"signed up to entry {verified.count - 1} at " in capsys.readouterr().out


def test_the_key_is_made_once_and_for_its_user_only(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert stat.S_IMODE((data / NAME).stat().st_mode) == 0o600
    assert load_or_make_key(data).public == key_of(data)
    assert main(["key", "--data", str(data)]) == 0
    assert capsys.readouterr().out == f"{key_of(data)}\n"
    (data / NAME).unlink()
    assert main(["key", "--data", str(data)]) == 1


def test_entries_after_the_last_signature_are_said_to_be_unproven(data: Path) -> None:
    write(data, 3, boot="b2", sign=False)
    verified = verify(data)
    assert verified.fault == ""
    assert verified.signed.unsigned == 4
    assert verified.signed.seq == verified.count - 5


def test_attack_an_entry_is_changed_and_the_chain_sealed_again(data: Path) -> None:
    reseal(data, with_other_value)
    assert "the signature in entry 4 is of another entry" in verify(data).fault


def test_attack_the_signatures_are_fitted_to_the_changed_chain(data: Path) -> None:
    """Without the key, the signed hash can be written over, but not signed."""

    def forged(before: list[Entry]) -> list[Entry]:
        result: list[Entry] = []
        prev = before[0].prev
        for entry in with_other_value(before):
            if entry.kind == "signed":
                values = json.loads(entry.values) | {"hash": prev}
                entry = entry._replace(values=json.dumps(values))
            result.append(entry)
            prev = entry.sealed(entry.seq, entry.boot, prev).hash
        return result

    reseal(data, forged)
    assert verify(data).fault == "the signature in entry 4 does not fit: entries before it were changed"


def test_attack_the_time_of_a_signature_is_changed(data: Path) -> None:
    def later(before: list[Entry]) -> list[Entry]:
        return [*before[:-1], before[-1]._replace(at=before[-1].at + 1000)]

    reseal(data, later)
    assert "does not fit" in verify(data).fault


def test_attack_all_is_signed_again_with_another_key(data: Path, tmp_path: Path) -> None:
    noted = key_of(data)
    shutil.rmtree(data)
    write(data, 6)  # a whole log of the attacker, with a key of its own
    assert verify(data).fault == ""  # consistent by itself
    assert "is signed with another key" in verify(data, keys=[noted]).fault
    assert main(["verify", "--data", str(data), "--key", noted]) == 1


def test_attack_the_end_is_signed_with_another_key(data: Path) -> None:
    noted = key_of(data)
    (data / NAME).unlink()
    write(data, 2, boot="b2")
    assert "if the key was replaced, name both with --key" in verify(data).fault
    assert verify(data, keys=[noted, key_of(data)]).fault == ""
    assert main(["verify", "--data", str(data)]) == 1  # by the key in the folder


def test_attack_all_signatures_are_taken_out(data: Path) -> None:
    noted = key_of(data)
    reseal(data, lambda before: [entry for entry in before if entry.kind != "signed"])
    assert verify(data).fault == ""
    assert verify(data, keys=[noted]).fault == f"no entry is signed with the key {noted}"
    assert main(["verify", "--data", str(data)]) == 1  # the folder has a key


def test_attack_late_signatures_are_taken_out(data: Path) -> None:
    """A server that ran on for hours would have signed."""

    def unsigned(before: list[Entry]) -> list[Entry]:
        first = next(entry for entry in before if entry.kind == "signed")
        rest = [e for e in before if e.seq > first.seq and e.kind != "signed"]
        hours = [
            e._replace(monotonic=e.monotonic + number * LONGEST_UNSIGNED_US // 2)
            for number, e in enumerate(rest)
        ]
        return [*before[: first.seq], *hours]

    reseal(data, unsigned)
    assert "are not signed, though the server ran on for 2 hours" in verify(data).fault


def test_attack_the_tail_is_cut_off(data: Path) -> None:
    """The chain and the signatures are whole: only what was noted elsewhere shows it."""
    head = verify(data).head
    with closing(sqlite3.connect(data / DATABASE)) as db, db:
        db.execute("DELETE FROM entry WHERE seq > 7")
    verified = verify(data)
    assert (verified.fault, verified.signed.unsigned) == ("", 0)
    assert "the newest were removed" in verify(data, head).fault


def test_a_damaged_key_signs_nothing_and_stops_nothing(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / NAME).write_text("garbage")
    write(tmp_path / "data", 2)
    assert all(entry.kind != "signed" for entry in entries(tmp_path / "data"))
    with pytest.raises(LogError, match="is not a private key"):
        load_or_make_key(tmp_path / "data")


@pytest.mark.parametrize(
    "values", ["{}", '{"seq": "1", "hash": 2, "key": 3, "signature": 4}', "[]", "x"]
)
def test_a_signature_that_can_not_be_read_is_a_fault(tmp_path: Path, values: str) -> None:
    store = Store(tmp_path, "b1")
    store.append([pressed(1), new_entry("signed")._replace(values=values)])
    store.close()
    assert verify(tmp_path).fault == "entry 2 has no signature that can be read"


def test_a_log_of_an_earlier_version_has_no_signatures_and_is_verified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "data", 3, sign=False)
    assert main(["verify", "--data", str(tmp_path / "data")]) == 0
    assert "no entry is signed" in capsys.readouterr().out


def test_fields_of_an_entry_are_all_hashed() -> None:
    assert FIELDS[-2:] == ("prev", "hash")


def test_signatures_are_read_with_every_step_or_by_their_name(data: Path) -> None:
    def kinds(**wanted: Any) -> set[str]:
        return {row.entry.kind for row in rows(data, Filter(**wanted), None, 100)}

    assert "signed" not in kinds()
    assert "signed" in kinds(every=True)
    assert kinds(outcome="signed") == {"signed"}


def test_the_log_of_a_panel_is_found_by_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A live panel has another data folder than the demo, which is the default."""
    monkeypatch.delenv("KIOSK_DATA", raising=False)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    panel = tmp_path / "cell1.toml"
    panel.write_text('title = "Cell"\nmode = "live"\n[[page]]\nid = "one"\ntitle = "One"\n')
    (tmp_path / APP).mkdir()
    key = load_or_make_key(tmp_path / APP).public
    assert main(["key", "--panel", str(panel)]) == 0
    assert capsys.readouterr().out == f"{key}\n"
    assert main(["key"]) == 1  # that of the demo, which never ran
