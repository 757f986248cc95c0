"""The operator's log as a file: what is appended stays, in a chain that shows every change."""

import csv
import gzip
import hashlib
import io
import json
import sqlite3
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from app.records import reader
from app.records import verify as verification
from app.records.data_dir import LOCK, DataDir
from app.records.database import NAME, Filter, Head, log_query, rows, set_aside
from app.records.entry import LONGEST_VALUES, Entry, Origin, as_json, clean_text, new_entry
from app.records.store import COLUMNS, DAY_MS, REMOVED_AT_ONCE, Store
from app.records.verify import verify
from app.records.writer import HOUR_S, ClockSteadiness, Opening
from app.system import csv_text
from app.system.errors import FolderInUse, LogCorrupt, LogError
from app.system.texts import TextLike, say
from app.tools.cli.log import main

pytestmark = pytest.mark.promise("log")

FROM = Origin(address="10.0.0.7", browser="b1", who="Kim", seen="boot-7")


def pressed(number: int = 1, widget: str = "drive") -> Entry:
    values = {"speed": number}
    return new_entry("pressed", FROM, values, press=f"p{number}", widget=widget, action="press")


def fill(store: Store, count: int) -> None:
    """`count` presses with their outcomes."""
    for entry in store.append([pressed(number) for number in range(count)]):
        store.append([entry.follow_up("closed", "published", "Sent.", verdict="permitted")])


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    mine = Store(tmp_path, "boot1")
    yield mine
    mine.close()


def read(folder: Path, **wanted: Any) -> list[Entry]:
    return [row.entry for row in rows(folder, Filter(**wanted), None, 10_000)]


def test_an_entry_is_read_as_it_was_written(store: Store, tmp_path: Path) -> None:
    (written,) = store.append([pressed()])
    (entry,) = read(tmp_path)
    assert entry == written
    assert (entry.seq, entry.boot, entry.address, entry.who, entry.seen) == (
        1, "boot1", "10.0.0.7", "Kim", "boot-7",
    )  # fmt: skip
    assert abs(entry.at - time.time() * 1000) < 5000
    assert entry.hash == entry.computed_hash()


@pytest.mark.parametrize("reason", ['Nein: "ö"\\', say("interlock_waiting", topic="/ö")])
def test_a_hash_can_be_computed_by_any_reader_of_the_file(
    store: Store, tmp_path: Path, reason: TextLike
) -> None:
    (written,) = store.append([new_entry("refused", FROM, {"text": 'ä"\n'}, reason=reason)])
    with closing(sqlite3.connect(tmp_path / NAME)) as db:
        *row, prev, digest, code = db.execute("SELECT * FROM entry").fetchone()
    row += [code, prev] if code else [prev]
    text = json.dumps(row, ensure_ascii=False, separators=(",", ":"))
    assert digest == written.hash == hashlib.sha256(text.encode()).hexdigest()


def test_outcome_has_the_number_of_its_press(store: Store, tmp_path: Path) -> None:
    fill(store, 1)
    closed, opened = read(tmp_path, every=True)
    assert (closed.kind, closed.of, closed.outcome, closed.verdict) == (
        "closed", opened.seq, "published", "permitted",
    )  # fmt: skip
    assert (closed.press, closed.widget, closed.values) == (opened.press, opened.widget, opened.values)
    assert closed.prev == opened.hash


def test_entries_go_on_in_one_chain_when_the_file_is_opened_again(tmp_path: Path) -> None:
    for boot in ("boot1", "boot2", "boot3"):
        store = Store(tmp_path, boot)
        fill(store, 2)
        head = store.head
        store.close()
    verified = verify(tmp_path)
    assert (verified.fault, verified.count, verified.head) == ("", 12, head.hash)


@pytest.mark.parametrize(
    "text", ["", "日本語", "🤖", "\ud800 half", "a\0b", "x" * 10_000, "'; DROP TABLE entry; --"]
)
def test_every_text_can_be_written_and_verified(store: Store, tmp_path: Path, text: str) -> None:
    store.append([new_entry("refused", FROM, {"message": text}, widget="w", reason=text)])
    (entry,) = read(tmp_path)
    assert entry.reason == clean_text(text)
    assert len(entry.reason) <= 510
    assert verify(tmp_path).fault == ""


def test_long_values_are_cut_and_marked() -> None:
    cut = as_json({"message": "x" * 5000})
    assert len(cut) < LONGEST_VALUES + 100
    assert '"… of": 5015' in cut
    assert as_json({"message": "short"}) == '{"message": "short"}'


def test_values_that_are_no_json_are_kept_as_text() -> None:
    assert as_json({"x": float("nan")}) == '{"…": "{\'x\': nan}"}'


# The chain.


def changes(db: sqlite3.Connection) -> None:
    db.execute("UPDATE entry SET address = '10.0.0.8' WHERE seq = 5")


def changes_hash_too(db: sqlite3.Connection) -> None:
    db.execute("UPDATE entry SET hash = 'f' WHERE seq = 5")


def changes_and_seals_again(db: sqlite3.Connection) -> None:
    """One entry, with a right hash of its own: only the entry after it shows that."""
    entry = Entry(*db.execute(f"SELECT {COLUMNS} FROM entry WHERE seq = 5").fetchone())
    forged = entry._replace(address="10.0.0.8")
    changed = (forged.address, forged.computed_hash())
    db.execute("UPDATE entry SET address = ?, hash = ? WHERE seq = 5", changed)


def removes(db: sqlite3.Connection) -> None:
    db.execute("DELETE FROM entry WHERE seq = 5")


def removes_two(db: sqlite3.Connection) -> None:
    db.execute("DELETE FROM entry WHERE seq IN (5, 6)")


def removes_the_first(db: sqlite3.Connection) -> None:
    db.execute("DELETE FROM entry WHERE seq < 5")


def removes_and_renumbers(db: sqlite3.Connection) -> None:
    removes(db)
    for seq in range(6, 21):
        db.execute("UPDATE entry SET seq = ? WHERE seq = ?", (seq - 1, seq))


def swaps(db: sqlite3.Connection) -> None:
    for old, new in ((5, 100), (6, 5), (100, 6)):
        db.execute("UPDATE entry SET seq = ? WHERE seq = ?", (new, old))


def inserts_well_made(db: sqlite3.Connection) -> None:
    (last,) = db.execute("SELECT hash FROM entry WHERE seq = 4").fetchone()
    for seq in range(25, 4, -1):
        db.execute("UPDATE entry SET seq = ? WHERE seq = ?", (seq + 1, seq))
    forged = pressed(99).sealed(5, "boot1", last)
    marks = ", ".join("?" * len(forged))
    columns = ", ".join(f'"{name}"' for name in Entry._fields)
    db.execute(f"INSERT INTO entry ({columns}) VALUES ({marks})", forged)


def changes_the_genesis(db: sqlite3.Connection) -> None:
    db.execute("UPDATE about SET value = 'f' WHERE key = 'genesis'")


def takes_the_genesis_of(db: sqlite3.Connection, seq: int) -> None:
    db.execute("DELETE FROM entry WHERE seq < ?", (seq,))
    (before,) = db.execute("SELECT prev FROM entry WHERE seq = ?", (seq,)).fetchone()
    db.execute("UPDATE about SET value = ? WHERE key = 'genesis'", (before,))
    db.execute("UPDATE about SET value = ? WHERE key = 'first'", (seq,))


def removes_the_first_and_begins_anew(db: sqlite3.Connection) -> None:
    takes_the_genesis_of(db, 5)


def begins_anew_with_a_start(db: sqlite3.Connection) -> None:
    takes_the_genesis_of(db, 21)


def empties(db: sqlite3.Connection) -> None:
    db.execute("DELETE FROM entry")


def writes_no_unicode(db: sqlite3.Connection) -> None:
    db.execute("UPDATE entry SET reason = CAST(x'ff' AS TEXT) WHERE seq = 5")


@pytest.mark.parametrize(
    ("tamper", "says"),
    [
        (changes, "entry 5 was changed"),
        (changes_hash_too, "entry 5 was changed"),
        (changes_and_seals_again, "entry 6 does not follow the one before it"),
        (removes, "entry 5 is missing"),
        (removes_two, "entries 5 to 6 are missing"),
        (removes_the_first, "what stood before entry 5 was removed"),
        (removes_and_renumbers, "entry 5 was changed, or is not in its place"),
        (swaps, "entry 5 was changed, or is not in its place"),
        (inserts_well_made, "entry 5 was inserted"),
        (changes_the_genesis, "what stood before entry 1 was removed"),
        (removes_the_first_and_begins_anew, "what stood before entry 5 was removed"),
        (begins_anew_with_a_start, "what stood before entry 21 was removed"),
        (empties, "it has no entries"),
        (writes_no_unicode, "entry 5 was changed"),
    ],
)
def test_change_to_the_file_is_named(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    tamper: Callable[[sqlite3.Connection], None],
    says: str,
) -> None:
    store = Store(tmp_path, "boot1")
    fill(store, 10)
    store.append([new_entry("began", values={"mode": "live"}, reason="The panel server started.")])
    fill(store, 2)
    head = store.head.hash
    store.close()
    assert main(["verify", "--data", str(tmp_path), "--head", head]) == 0
    with sqlite3.connect(tmp_path / NAME) as db:
        tamper(db)
    db.close()
    capsys.readouterr()
    assert main(["verify", "--data", str(tmp_path), "--head", head]) == 1
    assert says in capsys.readouterr().out


def began(values: dict[str, Any]) -> Entry:
    return new_entry("began", values=values, reason="The log before this one was damaged.")


@pytest.mark.parametrize(
    ("entries", "good"),
    [
        ([began({"first": 8})], True),
        ([began({"first": 8}), pressed()], True),
        ([began({"first": 7})], False),
        ([pressed(), began({"first": 9})], False),
        ([began({"mode": "live"})], False),
        # As it was written at first.
        ([began({})], True),
        ([pressed().follow_up("closed", "published", "Sent."), began({})], True),
        ([pressed(), began({})], False),
        ([pressed().follow_up("closed", "published", "Sent."), began({"mode": "live"})], False),
        ([pressed().follow_up("closed", "published", "Sent."), pressed(), began({})], False),
        ([new_entry("corrected", FROM)], False),
    ],
)
def test_a_log_begins_later_only_with_an_entry_that_says_so(
    tmp_path: Path, entries: list[Entry], good: bool
) -> None:
    before = Head(7, "ab" * 32, 7)
    store = Store(tmp_path, "boot1", before)
    store.append(entries)
    fill(store, 2)
    store.close()
    assert (verify(tmp_path, before.hash).fault == "") is good


def test_entry_that_says_where_a_log_begins_does_not_hide_removed_entries(
    store: Store, tmp_path: Path
) -> None:
    fill(store, 2)
    store.append([began({"first": store.head.seq + 1})])
    fill(store, 1)
    assert verify(tmp_path).fault == ""
    store._db.execute("DELETE FROM entry WHERE kind != 'began' AND seq < 5")
    assert "removed" in verify(tmp_path).fault


def test_emptied_log_is_reported_when_writing_continues(tmp_path: Path) -> None:
    Store(tmp_path, "boot1").close()
    store = Store(tmp_path, "boot2")
    (entry,) = Opening(tmp_path, "boot2").first_entries(store, None)
    assert (entry.kind, "was empty" in entry.reason) == ("began", True)
    store.close()


def test_a_good_log_is_said_to_be(
    store: Store, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fill(store, 2)
    assert main(["verify", "--data", str(tmp_path)]) == 0
    first, _ = capsys.readouterr().out.split("\n", 1)
    assert first == f"ok, 4 entries, head {store.head.hash}"


def test_a_log_that_is_not_there_or_no_log_is_unreadable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["verify", "--data", str(tmp_path / "none")]) == 2
    (tmp_path / NAME).write_bytes(b"garbage" * 1000)
    assert main(["verify", "--data", str(tmp_path)]) == 2
    assert "can't be read" in capsys.readouterr().err


def test_a_log_can_be_verified_with_a_fault_in_the_panel(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(store, 2)
    (tmp_path / "bad.toml").write_text("title = 3")
    monkeypatch.setenv("KIOSK_PANEL", str(tmp_path / "bad.toml"))
    monkeypatch.setenv("KIOSK_DATA", str(tmp_path))
    assert main(["verify"]) == 0


@pytest.mark.parametrize("is_terminal", [True, False])
def test_verification_shows_its_progress_on_a_terminal_only(
    store: Store,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    is_terminal: bool,
) -> None:
    fill(store, 3)
    monkeypatch.setattr(verification, "REPORTED_EVERY", 2)
    monkeypatch.setattr("sys.stderr.isatty", lambda: is_terminal)
    assert main(["verify", "--data", str(tmp_path)]) == 0
    shown = "\r2 of 6 entries verified\r4 of 6 entries verified\r\x1b[K"
    assert shown in capsys.readouterr().err if is_terminal else not capsys.readouterr().err


@pytest.mark.parametrize("name", ["log.csv", "log.csv.gz"])
def test_the_whole_log_is_exported_with_its_progress(
    store: Store,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
) -> None:
    fill(store, 3)
    for module in (csv_text, reader):
        monkeypatch.setattr(module, "ROWS_AT_ONCE", 4)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    file = tmp_path / name
    assert main(["export", "--data", str(tmp_path), str(file)]) == 0
    shown = "\r4 of 6 entries exported\r6 of 6 entries exported\r\x1b[K6 entries written to "
    assert shown in capsys.readouterr().err
    written = gzip.decompress(file.read_bytes()) if file.suffix == ".gz" else file.read_bytes()
    assert written == b"".join(reader.export(tmp_path, Filter(every=True), None))
    assert [row["seq"] for row in csv.DictReader(io.StringIO(written.decode("utf-8-sig")))] == [
        str(seq) for seq in range(6, 0, -1)
    ]
    assert file.stat().st_mode & 0o077 == 0
    assert sorted(path.name for path in tmp_path.glob("*log.csv*")) == [name]


def test_an_export_to_where_nothing_can_be_written_leaves_nothing(
    store: Store, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fill(store, 1)
    file = tmp_path / "none" / "log.csv"
    assert main(["export", "--data", str(tmp_path), str(file)]) == 1
    assert f"{file} can't be written" in capsys.readouterr().err
    assert main(["export", "--data", str(tmp_path / "none"), str(tmp_path / "log.csv")]) == 2
    assert not (tmp_path / "log.csv").exists()


def test_removing_the_newest_shows_by_the_head_alone(tmp_path: Path) -> None:
    store = Store(tmp_path, "boot1")
    fill(store, 3)
    head = store.head.hash
    store.close()
    with sqlite3.connect(tmp_path / NAME) as db:
        db.execute("DELETE FROM entry WHERE seq = 6")
    db.close()
    verified = verify(tmp_path)
    assert verified.fault == ""
    assert verified.head != head
    assert verify(tmp_path, verified.head).fault == ""
    assert main(["verify", "--data", str(tmp_path), "--head", head]) == 1


# Retention.


def test_old_entries_are_removed_and_the_rest_can_be_verified(store: Store, tmp_path: Path) -> None:
    fill(store, REMOVED_AT_ONCE)
    year_later = time.time_ns() // 1_000_000 + 366 * DAY_MS
    before = store.head
    while store.remove_old(365, 512, year_later):
        verified = verify(tmp_path)
        assert verified.fault == ""
        if store.head.count <= 2:
            break
    removed = read(tmp_path)[0]
    assert (removed.kind, removed.reason) == ("removed", "older than 365 days")
    assert f'"last": {before.seq}' in removed.values
    assert before.hash in removed.values
    fill(store, 2)
    assert verify(tmp_path).fault == ""


def test_young_entries_are_never_removed(store: Store) -> None:
    fill(store, 5)
    assert not store.remove_old(1, 512, time.time_ns() // 1_000_000)
    assert store.head.count == 10


def test_only_old_entries_are_removed(store: Store, tmp_path: Path) -> None:
    fill(store, 5)
    threading_gap = time.time_ns() // 1_000_000 + 20
    while time.time_ns() // 1_000_000 < threading_gap:
        pass
    fill(store, 5)
    assert store.remove_old(1, 512, threading_gap + DAY_MS - 1)
    assert store.head.count == 11
    assert verify(tmp_path).fault == ""


def test_setting_the_clock_does_not_make_entries_old(store: Store) -> None:
    at_1970 = [new_entry("refused", FROM)._replace(at=number) for number in range(1, 4)]
    store.append(at_1970)
    fill(store, 1)
    now = time.time_ns() // 1_000_000
    assert not store.remove_old(365, 512, now)
    assert store.head.count == 5
    assert store.remove_old(365, 512, now + 366 * DAY_MS)  # with what came after them
    assert store.head.count == 1


def test_only_a_clock_that_was_not_set_for_an_hour_makes_anything_old() -> None:
    clock = ClockSteadiness()
    assert not clock.is_steady(1000.0, 0.0)
    assert not clock.is_steady(1000.0 + HOUR_S - 1, HOUR_S - 1)
    assert clock.is_steady(1000.0 + HOUR_S + 5, HOUR_S)  # it drifts
    ahead = 1e9
    assert not clock.is_steady(ahead + HOUR_S + 1, HOUR_S + 1)
    assert not clock.is_steady(ahead + 2 * HOUR_S, 2 * HOUR_S)
    assert clock.is_steady(ahead + 2 * HOUR_S + 2, 2 * HOUR_S + 2)


def test_a_large_log_loses_its_oldest_and_its_pages(store: Store, tmp_path: Path) -> None:
    long = {"message": "x" * 1500}
    for _ in range(6):
        store.append([new_entry("refused", FROM, long, reason="r" * 400) for _ in range(1000)])
    used = store.used_bytes()
    assert used > 9_000_000
    removals = 0
    while store.remove_old(365, 8, time.time_ns() // 1_000_000):
        removals += 1
    assert store.used_bytes() <= 8_000_000
    assert 1 <= removals <= 5
    assert read(tmp_path)[0].reason == "the log was larger than 8 MB"
    assert verify(tmp_path).fault == ""
    for _ in range(20):
        store.remove_old(365, 8, time.time_ns() // 1_000_000)
    store.checkpoint()
    assert (tmp_path / NAME).stat().st_size < used


def test_removal_by_hand_is_not_taken_for_retention(store: Store, tmp_path: Path) -> None:
    fill(store, 600)
    while store.remove_old(365, 512, time.time_ns() // 1_000_000 + 366 * DAY_MS):
        if store.head.count <= 300:
            break
    fill(store, 5)
    first = read(tmp_path, every=True)[-1].seq
    store._db.execute("DELETE FROM entry WHERE seq = ?", (first,))
    assert "removed" in verify(tmp_path).fault or "missing" in verify(tmp_path).fault


# Presses whose end is not known.


def test_presses_of_an_earlier_server_are_undone_until_they_are_closed(tmp_path: Path) -> None:
    store = Store(tmp_path, "boot1")
    done, goal, cut = store.append([pressed(1), pressed(2), pressed(3)])
    store.append([done.follow_up("closed", "published", "Sent.")])
    store.append([goal.follow_up("closed", "accepted", "Accepted.")])
    assert store.undone() == []
    store.close()
    store = Store(tmp_path, "boot2")
    assert [entry.seq for entry in store.undone()] == [goal.seq, cut.seq]
    assert (store.has_outcome(goal.seq), store.has_outcome(cut.seq)) == (True, False)
    store.append([e.follow_up("closed", "unknown", "ended") for e in store.undone()])
    assert store.undone() == []
    store.close()


# The file and its folder.


def test_the_folder_and_the_file_are_the_users_alone(tmp_path: Path) -> None:
    folder = DataDir(tmp_path / "state/panel")
    folder.claim()
    store = Store(folder.path, "boot1")
    fill(store, 1)
    modes = {p.name: stat.S_IMODE(p.stat().st_mode) for p in (folder.path, *folder.path.iterdir())}
    assert modes.pop("panel") == 0o700
    assert modes.keys() == {LOCK, NAME, f"{NAME}-wal", f"{NAME}-shm"}
    assert set(modes.values()) == {0o600}
    store.close()
    folder.release()


def test_a_folder_has_one_holder_at_a_time(tmp_path: Path) -> None:
    first, second = DataDir(tmp_path), DataDir(tmp_path)
    first.claim()
    with pytest.raises(FolderInUse, match=rf"{tmp_path} is in use by process \d+ since 2\d{{3}}-"):
        second.claim()
    first.release()
    second.claim()
    second.release()


def test_the_lock_is_not_written_through_a_link(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_text("not mine")
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / LOCK).symlink_to(other)
    with pytest.raises(OSError, match="symbolic links"):
        DataDir(tmp_path / "state").claim()
    assert other.read_text() == "not mine"


def test_a_file_that_is_no_log_is_corrupt_and_can_be_put_aside(tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes(b"garbage" * 1000)
    with pytest.raises(LogCorrupt):
        Store(tmp_path, "boot1")
    name = set_aside(tmp_path)
    assert (tmp_path / name).read_bytes() == b"garbage" * 1000
    Store(tmp_path, "boot1").close()


def test_two_damaged_files_of_one_second_are_both_kept(tmp_path: Path) -> None:
    names = set()
    for _ in range(3):
        (tmp_path / NAME).write_bytes(b"garbage")
        names.add(set_aside(tmp_path))
    assert len(names) == 3
    assert {path.name for path in tmp_path.iterdir()} == names


def test_another_programs_database_is_not_written_into(tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / NAME) as db:
        db.execute("CREATE TABLE entry (x)")
    db.close()
    with pytest.raises(LogCorrupt, match="not an operator's log"):
        Store(tmp_path, "boot1")


def test_a_file_of_a_later_version_is_left_alone(tmp_path: Path) -> None:
    Store(tmp_path, "boot1").close()
    with sqlite3.connect(tmp_path / NAME) as db:
        db.execute("PRAGMA user_version = 3")
    db.close()
    with pytest.raises(LogError, match="another version"):
        Store(tmp_path, "boot1")


# Reading.


def test_log_filter_finds_the_matching_entries(store: Store, tmp_path: Path) -> None:
    for number, widget in ((1, "drive"), (2, "home")):
        (entry,) = store.append([pressed(number, widget)])
        store.append([entry.follow_up("closed", "published", f"Sent 100%_{number}.")])
    middle = read(tmp_path)[0].at
    assert [e.press for e in read(tmp_path, widget="home")] == ["p2"]
    assert [e.press for e in read(tmp_path, outcome="published")] == ["p2", "p1"]
    assert [e.kind for e in read(tmp_path, outcome="pressed", every=True)] == ["pressed"] * 2
    assert read(tmp_path, outcome="refused") == []
    assert len(read(tmp_path, who="Kim")) == len(read(tmp_path, who="10.0.0.7")) == 2
    assert read(tmp_path, who="Ki") == []
    assert [e.press for e in read(tmp_path, text="100%_2")] == ["p2"]
    assert read(tmp_path, text="1%0") == []
    assert [e.press for e in read(tmp_path, text='"speed": 1')] == ["p1"]
    assert read(tmp_path, until=middle - 60_000) == []
    assert len(read(tmp_path, since=middle - 60_000)) == 2


@pytest.mark.parametrize("every", [False, True])
@pytest.mark.parametrize("outcome", ["refused", "closed", "pressed", "no such outcome"])
def test_a_search_by_outcome_reads_no_other_entries(
    store: Store, tmp_path: Path, outcome: str, every: bool
) -> None:
    """Of a million entries it would read all, where nothing has the outcome."""
    fill(store, 3)
    query, values = log_query(Filter(outcome=outcome, every=every), None, 50)
    with closing(sqlite3.connect(tmp_path / NAME)) as db:
        steps = [row[-1] for row in db.execute(f"EXPLAIN QUERY PLAN {query}", values)]
    (search,) = (step for step in steps if step.startswith("SEARCH e USING INDEX entry_result"))
    assert ("rowid=?" in search) == (outcome == "pressed" and not every), search  # one by one
    assert not any("SCAN e" in step or "TEMP B-TREE" in step for step in steps), steps


def test_a_press_without_an_outcome_shows(store: Store, tmp_path: Path) -> None:
    fill(store, 1)
    store.append([pressed(7)])
    assert [(e.kind, e.press) for e in read(tmp_path)] == [("pressed", "p7"), ("closed", "p0")]


def test_pages_follow_by_number_while_more_is_written(store: Store, tmp_path: Path) -> None:
    fill(store, 10)
    first = rows(tmp_path, Filter(), None, 6)
    fill(store, 5)
    second = rows(tmp_path, Filter(), first[-1].entry.seq, 6)
    presses = [row.entry.press for row in first + second]
    assert presses == [f"p{number}" for number in range(9, -1, -1)]
    assert all(row.pressed_at is not None for row in first)


@pytest.mark.long("real time")
def test_a_reader_never_holds_up_the_writer(store: Store, tmp_path: Path) -> None:
    fill(store, 10)
    reader = sqlite3.connect(f"{(tmp_path / NAME).as_uri()}?mode=ro", uri=True)
    reader.execute("BEGIN")
    assert reader.execute("SELECT count(*) FROM entry").fetchone() == (20,)
    began = time.monotonic()
    fill(store, 100)
    store.checkpoint()
    assert time.monotonic() - began < 1
    assert reader.execute("SELECT count(*) FROM entry").fetchone() == (20,)
    reader.close()
    assert verify(tmp_path).count == 220


@pytest.mark.parametrize(
    ("files", "mode", "after"),
    [
        ((), 0o755, 0o700),
        (("operators-log.sqlite3", "notes.txt"), 0o750, 0o700),
        (("notes.txt",), 0o755, 0o755),  # not the server's alone
        ((), 0o1777, 0o1777),  # as /tmp
    ],
)
def test_data_folder_that_others_can_read_is_closed_to_them(
    tmp_path: Path, files: tuple[str, ...], mode: int, after: int
) -> None:
    path = tmp_path / "data"
    path.mkdir()
    for name in files:
        (path / name).touch()
    path.chmod(mode)
    folder = DataDir(path)
    folder.claim()
    folder.release()
    assert stat.S_IMODE(path.stat().st_mode) == after
