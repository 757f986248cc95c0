"""Users of a server's data folder, and browsers that sign in."""

import csv
import io
import re
from contextlib import ExitStack
from pathlib import Path
from typing import Final
from unittest.mock import patch

import httpx

from app.cell.people.secrets_hash import Cost, badge_hash, hashed, new_api_token, token_hash
from app.cell.people.users import ApiToken, User, UserBook
from app.cell.people.users_file import UsersFile
from app.tools.cli.users import main

QUICK: Final = Cost(8, 1)
OPENED: Final = {"sec-fetch-dest": "document"}


def add_user(
    folder: Path,
    name: str,
    role: str,
    *,
    pin: str = "",
    password: str = "",
    badge: str = "",
    groups: tuple[str, ...] = (),
) -> None:
    """Adds a user to the data folder, with hashes that cost little."""

    def edit(book: UserBook) -> UserBook:
        user = User(
            name,
            role,
            groups,
            hashed(pin, QUICK) if pin else "",
            hashed(password, QUICK) if password else "",
            badge_hash(badge, book.badge_salt) if badge else "",
        )
        return book.with_user(user, "now").with_change("now", "add", name, role, "test")

    UsersFile(folder).edit(edit)


def token_of(folder: Path, name: str, role: str) -> str:
    """Adds a token to the data folder, and returns it."""
    token = new_api_token()

    def edit(book: UserBook) -> UserBook:
        made = ApiToken(name, role, token_hash(token), "now")
        tokens = (*book.tokens, made)
        return UserBook(book.users, tokens, book.changes, book.badge_salt)

    UsersFile(folder).edit(edit)
    return token


def command(folder: Path, *arguments: str, stdin: str = "") -> None:
    """Runs `operator-panel users` for the data folder."""
    with patch("sys.stdin", io.StringIO(stdin)):
        assert main([*arguments, "--data", str(folder)]) == 0


class Browsers:
    """Browsers of a test, each with its own cookies."""

    def __init__(self) -> None:
        self._clients = ExitStack()

    def new(self, url: str) -> httpx.Client:
        """A browser that has no cookie yet."""
        return self._clients.enter_context(httpx.Client(base_url=url, trust_env=False, timeout=20))

    def opened(self, url: str) -> httpx.Client:
        """A browser that has loaded a page."""
        browser = self.new(url)
        browser.get("/", headers=OPENED).raise_for_status()
        return browser

    def signed_in(self, url: str, name: str, **secret: str) -> httpx.Client:
        """A browser where this user is signed in."""
        browser = self.opened(url)
        browser.post("/session", json={"user": name, **secret}).raise_for_status()
        return browser

    def close(self) -> None:
        self._clients.close()


def log_rows(client: httpx.Client) -> list[dict[str, str]]:
    """The entries of the operator's log, the oldest first."""
    answer = client.get("/log.csv").raise_for_status()
    rows = csv.DictReader(io.StringIO(answer.text.removeprefix("\ufeff")))
    return sorted(rows, key=lambda row: int(row["seq"]))


def says(data: object, pin: str) -> bool:
    """Whether a PIN stands anywhere in the data: not as a part of a hash, an id or a time."""
    return re.search(rf"(?<![0-9a-f.]){pin}(?![0-9a-f])", str(data)) is not None
