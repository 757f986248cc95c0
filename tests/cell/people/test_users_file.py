"""The users' file: checked when it is read, written whole, readable by its user only."""

import json
import os
import re
from dataclasses import replace
from pathlib import Path

import pytest

from app.cell.people.secrets_hash import SMALL, badge_hash, fault_of, hashed, matches, token_hash
from app.cell.people.users import ApiToken, User, UserBook, UsersError, book_of
from app.cell.people.users_file import UsersFile, users_configured

SATO = User("M. Sato", "operator", ("quality",), pin="hash")


def added(book: UserBook) -> UserBook:
    return book.with_user(SATO, "2026-11-27T08:00:00+00:00").with_change(
        "now", "add", SATO.name, "", "root"
    )


def test_the_file_has_what_was_written_and_only_its_user_reads_it(tmp_path: Path) -> None:
    file = UsersFile(tmp_path / "data")
    assert not users_configured(file.folder)
    file.edit(added)
    assert file.path.stat().st_mode & 0o777 == 0o600
    assert file.folder.stat().st_mode & 0o777 == 0o700
    book = file.read()
    assert book.user("m. sato") == replace(
        SATO, created="2026-11-27T08:00:00+00:00", changed="2026-11-27T08:00:00+00:00"
    )
    assert [(change.number, change.act) for change in book.changes] == [(1, "add")]
    assert book_of(book.as_text()) == book
    assert users_configured(file.folder)
    assert sorted(path.name for path in file.folder.iterdir()) == ["users.json", "users.lock"]


def test_a_newer_file_is_noticed_by_its_stamp(tmp_path: Path) -> None:
    file = UsersFile(tmp_path)
    assert file.newer(None) is None
    file.edit(added)
    loaded = file.newer(None)
    assert loaded is not None
    assert loaded.book.configured
    assert loaded.fault == ""
    assert file.newer(loaded.stamp) is None
    file.edit(lambda book: book.without_user(SATO.name))
    again = file.newer(loaded.stamp)
    assert again is not None
    assert again.book.users == ()


def test_the_removal_of_the_last_user_does_not_open_the_panel(tmp_path: Path) -> None:
    file = UsersFile(tmp_path)
    file.edit(lambda book: added(book).with_change("now", "add", SATO.name, "operator", "test"))
    file.edit(lambda book: book.without_user(SATO.name))
    assert users_configured(tmp_path)
    file.path.unlink()
    assert not users_configured(tmp_path)


def test_an_edit_that_is_refused_changes_nothing(tmp_path: Path) -> None:
    file = UsersFile(tmp_path)
    file.edit(added)
    before = file.path.read_bytes()

    def refused(book: UserBook) -> UserBook:
        raise UsersError("no")

    with pytest.raises(UsersError):
        file.edit(refused)
    assert file.path.read_bytes() == before


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not JSON"),
        ("[]", "valid dictionary"),
        ('{"version": 2, "badge_salt": "SALT"}', "version 2: this program reads version 1"),
        ('{"version": 1}', "badge_salt: Field required"),
        ('{"version": 1, "badge_salt": "SALT", "user": []}', "user: Extra inputs"),
        ('{"version": 1, "badge_salt": "SALT", "users": [{"name": "a"}]}', "users.0.role"),
        (
            '{"version": 1, "badge_salt": "SALT", "users": [{"name": "a", "role": "boss"}]}',
            '"boss" is not',
        ),
        (
            '{"version": 1, "badge_salt": "SALT", "users": [{"name": "a", "role": "viewer"},'
            ' {"name": "A", "role": "viewer"}]}',
            "twice",
        ),
    ],
)
def test_a_broken_file_says_why_and_locks(text: str, words: str, tmp_path: Path) -> None:
    file = UsersFile(tmp_path)
    file.path.write_text(text.replace("SALT", "0" * 32))
    file.path.chmod(0o600)
    with pytest.raises(UsersError, match=re.escape(words)):
        file.read()
    assert users_configured(tmp_path)
    loaded = file.newer(None)
    assert loaded is not None
    assert loaded.fault


def test_a_fault_never_shows_what_the_file_has(tmp_path: Path) -> None:
    content = {
        "version": 1,
        "badge_salt": "0" * 32,
        "users": [{"name": "a", "pin": ["$argon2id$canary"]}],
    }
    with pytest.raises(UsersError) as caught:
        book_of(json.dumps(content))
    assert "canary" not in str(caught.value)


def test_a_file_that_other_accounts_may_write_is_refused(tmp_path: Path) -> None:
    file = UsersFile(tmp_path)
    file.edit(added)
    file.path.chmod(0o620)
    with pytest.raises(UsersError, match="chmod 600"):
        file.read()


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    file = UsersFile(tmp_path)
    os.symlink("/etc/passwd", file.path)
    loaded = file.newer(None)
    assert loaded is not None
    assert loaded.fault


def test_hashes_fit_their_secret_only() -> None:
    phc = hashed("2580", SMALL)
    assert phc.startswith("$argon2id$v=19$m=19456,t=2,p=1$")
    assert (matches(phc, "2580"), matches(phc, "2581"), matches("", "2580")) == (True, False, False)
    assert badge_hash("04A2", "00" * 16) != badge_hash("04A2", "01" * 16)
    book = UserBook(tokens=(ApiToken("line", "operator", token_hash("opt_x")),))
    assert book.token("opt_x") is not None
    assert book.token("opt_y") is None


@pytest.mark.parametrize(
    ("way", "secret", "words"),
    [
        ("pin", "123", "4 to 12 digits"),
        ("pin", "12a4", "4 to 12 digits"),
        ("pin", "\u0661\u0662\u0663\u0664", "4 to 12 digits"),
        ("pin", "7777", "guessed first"),
        ("pin", "3456", "guessed first"),
        ("pin", "9876", "guessed first"),
        ("pin", "2580", ""),
        ("password", "short", "at least 8"),
        ("password", "x" * 129, "at most 128"),
        ("password", "long enough", ""),
        ("badge", "04", "at least 4"),
        ("badge", "04:A2:11", ""),
    ],
)
def test_a_new_secret_is_checked(way: str, secret: str, words: str) -> None:
    fault = fault_of(way, secret)  # type: ignore[arg-type]
    assert words in str(fault) if words else fault is None
