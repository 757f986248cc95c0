"""A log of a version before reasons had codes: it is read, verified, opened and continued."""

import asyncio
import hashlib
import json
import sqlite3
from pathlib import Path
from typing import Any, Final

import pytest

from app.records import Entry, Filter, Limits, OperatorLog, Origin, new_entry
from app.records.database import NAME, OpenPress, open_presses, rows
from app.records.entry import reason_as_json
from app.records.reader import export
from app.records.verify import verify
from app.system.texts import ENGLISH, PanelText, Text, number, render, say, sentences, time_of_day
from app.system.texts.catalogue import catalogues_in, renamed_codes
from app.system.texts.check import placeholders

# As that version made its file.
SCHEMA: Final = """
CREATE TABLE entry (
  seq INTEGER PRIMARY KEY, at INTEGER NOT NULL, boot TEXT NOT NULL, monotonic INTEGER NOT NULL,
  kind TEXT NOT NULL, of INTEGER, address TEXT NOT NULL, browser TEXT NOT NULL, who TEXT NOT NULL,
  robot TEXT NOT NULL, press TEXT NOT NULL, widget TEXT NOT NULL, action TEXT NOT NULL,
  "values" TEXT NOT NULL, seen TEXT NOT NULL, verdict TEXT NOT NULL, board TEXT NOT NULL,
  outcome TEXT NOT NULL, reason TEXT NOT NULL, prev TEXT NOT NULL, hash TEXT NOT NULL
) STRICT;
CREATE TABLE undone (seq INTEGER PRIMARY KEY, outcome TEXT NOT NULL) STRICT;
CREATE TABLE about (key TEXT PRIMARY KEY, value ANY NOT NULL) STRICT, WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS entry_press ON entry (press) WHERE press <> '';
PRAGMA application_id = 1330662471;
PRAGMA user_version = 1;
"""
SENTENCES: Final = sentences(ENGLISH)
GENESIS: Final = "ab" * 32
WHO: Final = ("10.0.0.7", "b1", "Panel 1", "")
PRESS: Final = ("p1", "say", "press", '{"message": "hé"}', "77-1", "permitted", "77-2")
SENT: Final = "Sent on /say at 10:00:00."
OLD: Final[list[tuple[Any, ...]]] = [
    (1, 1_700_000_000_000, "boot", 5, "began", None, "", "", "", "", "", "", "",
     '{"mode": "live"}', "", "", "", "", "The panel's server started."),
    (2, 1_700_000_001_000, "boot", 6, "pressed", None, *WHO, *PRESS, "", ""),
    (3, 1_700_000_002_000, "boot", 7, "closed", 2, *WHO, *PRESS, "published", SENT),
    (4, 1_700_000_003_000, "boot", 8, "pressed", None, *WHO, "p2", *PRESS[1:], "", ""),
]  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """With a log of that version, of which one press has no end."""
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    db = sqlite3.connect(data / NAME)
    db.execute("PRAGMA journal_mode = WAL")
    db.executescript(SCHEMA)
    db.executemany("INSERT INTO about VALUES (?, ?)", [("genesis", GENESIS), ("first", 1)])
    last = GENESIS
    for row in OLD:
        text = json.dumps([*row, last], ensure_ascii=False, separators=(",", ":"))
        sealed = (*row, last, last := hashlib.sha256(text.encode()).hexdigest())
        db.execute(f"INSERT INTO entry VALUES ({', '.join('?' * len(sealed))})", sealed)
    db.execute("INSERT INTO undone VALUES (4, '')")
    db.commit()
    db.close()
    return data


PUBLISHED: Final = say("published", topic="/say", time="11:00:00")


def continued(folder: Path, press_id: str = "p3", reason: Text = PUBLISHED) -> None:
    """By this version: a press and its end, with a reason of the catalogue."""

    async def work() -> None:
        log = OperatorLog(folder, Limits())
        await log.start()
        try:
            assert log.fault == ""
            press = await log.pressed(
                new_entry(
                    "pressed", Origin(address="10.0.0.7"), press=press_id, action="press", widget="say"
                )
            )
            assert press is not None
            assert await log.closed(press.follow_up("closed", "published", reason)) == ""
        finally:
            await log.stop()

    asyncio.run(work())


def entries(folder: Path, **wanted: Any) -> list[Entry]:
    newest_first = rows(folder, Filter(every=True, **wanted), None, 100)
    return [row.entry for row in reversed(newest_first)]


def test_an_old_file_is_read_and_verified_as_it_is(folder: Path) -> None:
    read = entries(folder)
    assert [(entry.seq, entry.reason, entry.text) for entry in read][2] == (3, SENT, "")
    assert read[2].reason_text == SENT
    assert (verify(folder).count, verify(folder).fault) == (4, "")
    (unended,) = open_presses(folder, "", ["say"], 0)
    assert (unended.press.press, unended.reason, unended.code) == ("p2", "", "")


def test_an_old_file_is_opened_continued_and_verified(folder: Path) -> None:
    before = [tuple(entry) for entry in entries(folder)]
    continued(folder)
    read = entries(folder)
    assert [tuple(entry) for entry in read[:4]] == before
    assert (verify(folder).count, verify(folder).fault) == (len(read), "")
    assert {entry.text for entry in read[:4]} == {""}
    assert [json.loads(entry.text)["code"] for entry in read[4:] if entry.reason] == [
        "press_unknown_server_ended",
        "log_began",
        "published",
    ]
    said = read[-1].reason_text
    assert isinstance(said, Text)
    assert said == say("published", topic="/say", time="11:00:00")
    assert read[-1].reason == str(said)
    assert [entry.seq for entry in entries(folder, text="Sent on /say")] == [3]
    assert [entry.seq for entry in entries(folder, text="Sent at 11:00")] == [read[-1].seq]
    continued(folder, "p4")
    assert (verify(folder).count, verify(folder).fault) == (len(read) + 3, "")


def test_a_reader_has_new_entries_in_their_language_and_old_ones_as_they_are(
    folder: Path, tmp_path: Path
) -> None:
    continued(folder)
    (tmp_path / "de.po").write_text('msgid "published"\nmsgstr "Gesendet auf {topic}, {time}."\n')
    with catalogues_in(tmp_path):
        old, new = (entry for entry in entries(folder) if entry.outcome == "published")
        assert (old.reason_in("de"), old.reason_in("en")) == (SENT, SENT)
        assert (new.reason_in("de"), new.reason_in("en")) == (
            "Gesendet auf /say, 11:00:00.",
            str(say("published", topic="/say", time="11:00:00")),
        )
        german = (
            b"".join(export(folder, Filter(), None, language="de")).decode("utf-8-sig").splitlines()
        )
        english = b"".join(export(folder, Filter(), None)).decode("utf-8-sig").splitlines()
    assert german[0] == english[0]
    assert german[0].endswith(",reason,prev,hash,text")
    assert "Gesendet auf /say, 11:00:00." in german[1]
    assert [line for line in german if SENT in line] == [line for line in english if SENT in line]


def test_texts_numbers_and_times_of_an_entry_are_in_the_readers_language(
    folder: Path, tmp_path: Path
) -> None:
    label = PanelText({"en": "Limit", "de": "Grenze"}, "en")
    why = say("input_outside_limits", label=label, given=number("7.5", "m"), limits=number("1,234.5"))
    continued(folder, reason=say("refused", why=why, time=time_of_day("11:00:00")))
    (tmp_path / "de.po").write_text(
        'msgid "refused"\nmsgstr "Nicht gesendet um {time}: {why}"\n'
        'msgid "input_outside_limits"\nmsgstr "{label} ist {given}: erlaubt ist {limits}"\n'
    )
    with catalogues_in(tmp_path):
        last = entries(folder)[-1]
        assert last.reason == last.reason_in("en")
        assert last.reason == "Not sent at 11:00:00: Limit is 7.5 m: it must be 1,234.5"
        assert (
            last.reason_in("de") == "Nicht gesendet um 11:00:00: Grenze ist 7,5 m: erlaubt ist 1.234,5"
        )
        assert last.reason_in("fr") == last.reason
        csv = b"".join(export(folder, Filter(), None, language="de")).decode("utf-8-sig")
        assert "Grenze ist 7,5 m: erlaubt ist 1.234,5" in csv
    assert (verify(folder).count, verify(folder).fault) == (len(entries(folder)), "")


@pytest.mark.parametrize(
    ("change", "seq"),
    [
        ("UPDATE entry SET text = '{}' WHERE seq = 3", 3),
        ("UPDATE entry SET text = '' WHERE seq = 8", 8),
        ("UPDATE entry SET text = replace(text, '/say', '/other') WHERE seq = 8", 8),
    ],
)
def test_a_code_that_was_changed_is_found(folder: Path, change: str, seq: int) -> None:
    continued(folder)
    with sqlite3.connect(folder / NAME) as db:
        assert db.execute(change).rowcount == 1
    db.close()
    assert verify(folder).fault == f"entry {seq} was changed, or is not in its place"


def test_an_entry_whose_code_this_version_does_not_know_is_shown_as_it_was_written() -> None:
    strange = new_entry("refused", reason="As it was.")._replace(text='{"code": "gone", "params": {}}')
    broken = strange._replace(text='{"code": 1')
    assert [entry.reason_in("xx") for entry in (strange, broken)] == ["As it was."] * 2


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_entry_with_a_former_code_is_shown_with_its_sentence(language: str) -> None:
    for former, present in renamed_codes().items():
        about = {name: f"<{name}>" for name in placeholders(SENTENCES[present])}
        sentence = say("refused", why=say(present, **about), time="10:00:00")
        text = reason_as_json(sentence).replace(f'"code":"{present}"', f'"code":"{former}"')
        entry = new_entry("refused", reason=sentence)._replace(text=text)
        assert former in text
        assert former not in SENTENCES
        assert entry.reason_text == sentence
        assert entry.reason_in(language) == render(sentence, language)


def test_open_press_with_a_former_code_has_the_present_code() -> None:
    press = OpenPress(new_entry("pressed"), "", "", '{"code":"goal_lost","params":{}}', False)
    assert press.code == "goal_forgotten"
