"""Entries of sign-ins and of changes of users for the operator's log. No secret gets here."""

import logging
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Final, Literal, Protocol

from app.cell.people.secrets_hash import Way
from app.cell.people.sessions import Session
from app.cell.people.users import ApiToken, User, UserBook, UserChange, UsersError
from app.cell.people.users_file import NAME, LastUses, UsersFile, book_id, read_state, write_state
from app.records.entry import Entry, Origin, new_entry
from app.records.press_record import origin_of
from app.records.principal import Client, Principal
from app.system.errors import LogError
from app.system.texts import TextLike, say

log = logging.getLogger("kiosk.access")

USED_EVERY_S: Final = 3600.0  # the last use of a token is kept this coarsely
# Why a secret is not taken, by what it is for.
WAITS: Final = {"sign_in": "sign_in_wait_logged", "confirm": "confirm_wait_logged"}
WRONG: Final[Mapping[str, Mapping[Way, str]]] = {
    "sign_in": {
        "pin": "sign_in_wrong_pin",
        "password": "sign_in_wrong_password",
        "badge": "sign_in_wrong_badge",
    },
    "confirm": {
        "pin": "confirm_wrong_pin",
        "password": "confirm_wrong_password",
        "badge": "confirm_wrong_badge",
    },
}
# The action of a change of the users' file, and its sentence.
CHANGES: Final = {
    "add": ("users_add", "log_users_add"),
    "role": ("users_role", "log_users_role"),
    "groups": ("users_groups", "log_users_groups"),
    "pin": ("users_pin", "log_users_pin"),
    "password": ("users_password", "log_users_password"),
    "badge": ("users_badge", "log_users_badge"),
    "disable": ("users_disable", "log_users_disable"),
    "enable": ("users_enable", "log_users_enable"),
    "remove": ("users_remove", "log_users_remove"),
    "token": ("users_token", "log_users_token"),
    "revoke": ("users_revoke", "log_users_revoke"),
    "open": ("users_open", "log_users_open"),
}
SIGN_IN_SENTENCES: Final[Mapping[Way | Literal["oidc"], str]] = {
    "pin": "log_signed_in_pin",
    "password": "log_signed_in_password",
    "badge": "log_signed_in_badge",
    "oidc": "log_signed_in_oidc",
}
SIGN_OUT_SENTENCES: Final = {
    "sign_out": "log_signed_out_sign_out",
    "hand_over": "log_signed_out_hand_over",
    "idle": "log_signed_out_idle",
    "changed": "log_signed_out_changed",
    "limit": "log_signed_out_limit",
    "longest": "log_signed_out_longest",
    "ended": "log_signed_out_ended",
}


class AccessLog(Protocol):
    """The operator's log as sign-ins use it."""

    def add(self, entry: Entry) -> None: ...
    def allowed(self, origin: Origin) -> bool: ...
    def suppress(self, origin: Origin, limited: bool = False) -> None: ...
    async def closed(self, entry: Entry) -> TextLike: ...


class AccessLogWriter:
    """Writes the entries; keeps in the data folder up to which change they are written."""

    def __init__(self, oplog: AccessLog, folder: Path, wall: Callable[[], float] = time.time) -> None:
        self._log = oplog
        self._folder = folder
        self._wall = wall
        self._state = read_state(folder)
        self._used_at: dict[str, float] = {}
        self._places: dict[str, Origin] = {}

    def signed_in(self, who: Principal, way: Way | Literal["oidc"]) -> None:
        origin = origin_of(who)
        self._places[who.client.id] = origin
        at = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(self._wall()))
        if way != "oidc":
            self._state.last.users[who.user] = at
            self._write()
        reason = say(SIGN_IN_SENTENCES[way], name=who.user)
        self._add(
            new_entry(
                "access", origin, {"role": who.role}, reason, action="sign_in", outcome="accepted"
            )
        )

    def signed_out(self, session: Session, reason: str, by: Principal | None = None) -> None:
        """`by` is who ended the session from afar."""
        origin = self._places.pop(session.client.id, None) or origin_of(Principal(session.client))
        names = {"by": by.title} if by is not None else {}
        sentence = say(SIGN_OUT_SENTENCES[reason], name=session.user, **names)
        self._add(new_entry("access", origin, reason=sentence, action="sign_out", outcome="accepted"))

    def locked(self, reason: TextLike) -> None:
        """No one can sign in: the users' file is missing or can't be read."""
        self._add(
            new_entry(
                "access", Origin(address=""), reason=reason, action="users_locked", outcome="refused"
            )
        )

    def _add(self, entry: Entry) -> None:
        try:
            self._log.add(entry)
        except LogError as error:
            log.warning("%s is not in the operator's log: %s", entry.reason, error)

    async def failed(
        self, client: Client, user: str, action: str, widget: str, reason: TextLike
    ) -> None:
        """A failed sign-in, or confirmation of a press of `widget`, if the quota of refusals permits an
        entry. `user` is the name of a user that exists, else "": what was typed as a name may be a
        secret."""
        origin = origin_of(Principal(client))
        if not self._log.allowed(origin):
            self._log.suppress(origin)
            return
        about = {"user": user} if user else {}
        await self._log.closed(
            new_entry("access", origin, about, reason, action=action, widget=widget, outcome="refused")
        )

    def changes(self, book: UserBook) -> None:
        """Writes the changes that are not written yet."""
        self._follow(book)
        new = [change for change in book.changes if change.number > self._state.logged]
        if not new:
            return
        if new[0].number > self._state.logged + 1 and self._state.logged:
            log.warning("%d changes of users are not in the operator's log", new[0].number - 1)
        for change in new:
            try:
                self._log.add(_entry(change))
            except LogError:
                break  # the rest later
            self._state.logged = change.number
        self._forget_removed(book)
        self._write()

    async def changed_here(self, book: UserBook) -> TextLike:
        """Writes the changes that are not written yet. Returns "" when they are on the disk, else why
        they are not."""
        fault: TextLike = ""
        self._follow(book)
        for change in book.changes:
            if change.number > self._state.logged:
                self._state.logged = change.number
                fault = await self._log.closed(_entry(change)) or fault
        self._forget_removed(book)
        self._write()
        return fault

    def _follow(self, book: UserBook) -> None:
        """Keeps whether there are users. The changes of a users' file that was made again are new."""
        identity = book_id(book) if book.changes else self._state.book
        is_other = bool(self._state.book) and identity != self._state.book
        if not is_other and (identity, book.configured) == (self._state.book, self._state.configured):
            return
        if is_other:
            self._state.logged = 0
        self._state.book, self._state.configured = identity, book.configured
        self._write()

    @property
    def had_users(self) -> bool:
        """Whether the panel had users when the users' file was last read."""
        return self._state.configured

    @property
    def last(self) -> LastUses:
        return self._state.last

    def _forget_removed(self, book: UserBook) -> None:
        """A later user or token of the same name has not been used yet."""
        for kept, names in (
            (self._state.last.users, {user.name for user in book.users}),
            (self._state.last.tokens, {token.name for token in book.tokens}),
        ):
            for name in kept.keys() - names:
                del kept[name]
                self._used_at.pop(name, None)

    def token_used(self, name: str) -> None:
        """Keeps the hour of the use of a token."""
        now = self._wall()
        if now - self._used_at.get(name, 0.0) < USED_EVERY_S:
            return
        self._used_at[name] = now
        self._state.last.tokens[name] = time.strftime("%Y-%m-%dT%H:00Z", time.gmtime(now))
        self._write()

    def _write(self) -> None:
        write_state(self._folder, self._state)


def _entry(change: UserChange) -> Entry:
    action, sentence = CHANGES.get(change.act, CHANGES["role"])
    reason: TextLike = say(sentence, name=change.name, detail=change.detail, by=change.by, at=change.at)
    origin = Origin(address=change.address, browser=change.browser, who=change.by)
    values = {"user": change.name, "detail": change.detail, "at": change.at}
    return new_entry("access", origin, values, reason, action=action, outcome="accepted")


# Who may do what, as text for the operator's log: names, roles and groups, and nothing by which one
# signs in.


def read_rights(folder: Path) -> Mapping[str, str]:
    """`user Ada` or `token mes` → role, groups, ways to sign in, of the users' file in this folder. A
    file that can't be read has the error. Blocks."""
    try:
        return dict(rights_of_all(UsersFile(folder).read()))
    except (UsersError, OSError) as error:
        return {NAME: f"unreadable: {error}"}


def rights_of_all(book: UserBook) -> Iterator[tuple[str, str]]:
    """The name and the rights of each user and token, by name."""
    for user in sorted(book.users, key=lambda user: user.name):
        yield f"user {user.name}", _of_user(user)
    for token in sorted(book.tokens, key=lambda token: token.name):
        yield f"token {token.name}", _of_token(token)


def _of_user(user: User) -> str:
    parts = [user.role, *sorted(user.groups)]
    if user.ways:
        parts.append(f"by {' or '.join(user.ways)}")
    return ", ".join([*parts, *(["disabled"] if user.disabled else [])])


def _of_token(token: ApiToken) -> str:
    return token.role
