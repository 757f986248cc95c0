"""`operator-panel users`: changes the users' file, and says what would be right."""

import io
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from app.cell.people.secrets_hash import matches
from app.cell.people.users_file import UsersFile, UsersState, users_configured, write_state
from app.tools.cli.users import main

Users = Callable[..., int]


@pytest.fixture
def users(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Users:
    def run(*arguments: str, stdin: str = "") -> int:
        monkeypatch.setattr("sys.stdin", io.StringIO(stdin))
        return main([*arguments, "--data", str(tmp_path)])

    return run


def test_a_user_is_added_listed_changed_and_removed(
    users: Users, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = UsersFile(tmp_path)
    assert users("list") == 0
    assert "no users" in capsys.readouterr().out
    both = ("--pin-stdin", "--badge-stdin")
    assert users("add", "M. Sato", "--role", "operator", *both, stdin="2580\n04A2\n") == 0
    assert users("role", "m. sato", "--role", "maintenance", "--group", "quality") == 0
    assert users("pin", "M. Sato", stdin="9753\n") == 0
    assert users("badge", "M. Sato", "--none") == 0
    assert users("disable", "M. Sato") == 0
    capsys.readouterr()
    assert users("list", "--json") == 0
    (row,) = json.loads(capsys.readouterr().out)
    row.pop("created")
    row.pop("changed")
    assert row == {
        "name": "M. Sato",
        "role": "maintenance",
        "groups": ["quality"],
        "signs_in_with": ["pin"],
        "disabled": True,
        "last_sign_in": None,
    }
    sato = file.read().user("M. Sato")
    assert sato is not None
    assert matches(sato.pin, "9753")
    assert users("enable", "M. Sato") == 0
    assert users("remove", "M. Sato") == 0
    book = file.read()
    assert book.users == ()
    acts = ["add", "role", "pin", "badge", "disable", "enable", "remove"]
    assert [change.act for change in book.changes] == acts
    assert all(change.by for change in book.changes)


def test_a_token_is_printed_once_and_kept_as_its_hash(
    users: Users, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert users("token", "line", "--role", "operator") == 0
    token = capsys.readouterr().out.strip()
    assert len(token) >= 43
    assert token not in UsersFile(tmp_path).path.read_text()
    assert UsersFile(tmp_path).read().token(token) is not None
    assert users("tokens") == 0
    assert capsys.readouterr().out == "line: operator, last used never\n"
    assert users("token", "line", "--role", "viewer") == 1
    assert users("revoke", "line") == 0
    assert UsersFile(tmp_path).read().token(token) is None
    assert users("revoke", "line") == 1


@pytest.mark.parametrize(
    ("arguments", "stdin", "words"),
    [
        (("add", "A", "--role", "operator"), "", "--pin-stdin, --password-stdin or --badge-stdin"),
        (("add", "A", "--role", "operator", "--pin-stdin"), "987\n", "4 to 12 digits"),
        (("add", "A", "--role", "operator", "--pin-stdin"), "", "4 to 12 digits"),
        (("add", " A", "--role", "operator", "--pin-stdin"), "2580\n", "without spaces at the ends"),
        (("add", "m. SATO", "--role", "operator", "--pin-stdin"), "2580\n", "There is a user"),
        (("add", "A", "--role", "operator", "--badge-stdin"), "04A2\n", 'that of "M. Sato"'),
        (
            ("add", "A", "--role", "operator", "--group", "Q", "--pin-stdin"),
            "2580\n",
            "can not be a group",
        ),
        (("pin", "B"), "2580\n", 'no user "B"; there is M. Sato'),
        (("badge", "M. Sato", "--none"), "", "Disable the user"),
    ],
)
def test_a_mistake_is_refused_with_what_would_be_right(
    arguments: tuple[str, ...],
    stdin: str,
    words: str,
    users: Users,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert users("add", "M. Sato", "--role", "operator", "--badge-stdin", stdin="04A2\n") == 0
    before = UsersFile(tmp_path).path.read_bytes()
    assert users(*arguments, stdin=stdin) == 1
    said = capsys.readouterr().err
    assert words in said
    assert not stdin.strip() or stdin.strip() not in said
    assert UsersFile(tmp_path).path.read_bytes() == before


def test_a_role_that_does_not_exist_is_a_usage_error(
    users: Users, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        users("add", "A", "--role", "boss", "--pin-stdin")
    assert "viewer" in capsys.readouterr().err


def test_no_secret_is_taken_from_the_command_line(users: Users) -> None:
    with pytest.raises(SystemExit):
        users("add", "A", "--role", "operator", "--pin", "2580")


def test_a_panel_is_opened_by_its_own_command_only(
    users: Users, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert users("add", "M. Sato", "--role", "operator", "--pin-stdin", stdin="2580\n") == 0
    assert users("open") == 1
    assert "removes 1 users and 0 tokens" in capsys.readouterr().err
    assert users_configured(tmp_path)
    assert users("open", "--yes") == 0
    book = UsersFile(tmp_path).read()
    assert (book.users, book.changes[-1].act, book.configured) == ((), "open", False)
    assert not users_configured(tmp_path)
    assert users("add", "M. Sato", "--role", "operator", "--pin-stdin", stdin="2580\n") == 0
    assert UsersFile(tmp_path).read().configured


def test_users_that_are_gone_are_no_open_panel(
    users: Users, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_state(tmp_path, UsersState(configured=True))
    assert users("list") == 1
    assert "users open" in capsys.readouterr().err
    assert users_configured(tmp_path)
