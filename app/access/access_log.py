"""Entries of sign-ins and of changes of users for the operator's log. No secret gets here."""

import json
import logging
import secrets
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, Protocol

from app.access.secrets_hash import Way
from app.access.sessions import Session
from app.access.users import Change, UserBook
from app.audit.entry import Entry, Origin, new_entry
from app.audit.press_record import origin_of
from app.errors import LogError
from app.i18n import TextLike, say
from app.permission.clients import Client
from app.permission.principal import Principal

log = logging.getLogger("kiosk.access")

STATE: Final = "users.logged"  # what the operator's log has of the users' file
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
ACTS: Final = (
    "add", "role", "groups", "pin", "password", "badge", "disable", "enable", "remove", "token",
    "revoke",
)  # fmt: skip


class AccessLog(Protocol):
    """The operator's log as sign-ins use it."""

    def add(self, entry: Entry) -> None: ...
    def allowed(self, origin: Origin) -> bool: ...
    def suppress(self, origin: Origin, limited: bool = False) -> None: ...
    async def closed(self, entry: Entry) -> TextLike: ...


@dataclass(frozen=True, slots=True)
class LastUses:
    """When users last signed in (ISO 8601, by their names), and when tokens were last used (in whole
    hours)."""

    users: dict[str, str] = field(default_factory=dict)
    tokens: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class _State:
    """`logged` is the number of the last logged change."""

    logged: int
    last: LastUses


class AccessLogWriter:
    """Writes the entries; keeps in the data folder up to which change they are written."""

    def __init__(self, oplog: AccessLog, folder: Path, wall: Callable[[], float] = time.time) -> None:
        self._log = oplog
        self._path = folder / STATE
        self._wall = wall
        self._state = _read(self._path)
        self._used_at: dict[str, float] = {}
        self._places: dict[str, Origin] = {}

    def signed_in(self, who: Principal, way: Way | Literal["oidc"]) -> None:
        origin = origin_of(who)
        self._places[who.client.id] = origin
        at = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(self._wall()))
        if way != "oidc":
            self._state.last.users[who.user] = at
            self._write()
        reason = say(f"log_signed_in_{way}", name=who.user)
        self._add(
            new_entry(
                "access", origin, {"role": who.role}, reason, action="sign_in", outcome="accepted"
            )
        )

    def signed_out(self, session: Session, reason: str) -> None:
        origin = self._places.pop(session.client.id, None) or origin_of(Principal(session.client))
        sentence = say(f"log_signed_out_{reason}", name=session.user)
        self._add(new_entry("access", origin, reason=sentence, action="sign_out", outcome="accepted"))

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
        for change in book.changes:
            if change.number > self._state.logged:
                self._state.logged = change.number
                fault = await self._log.closed(_entry(change)) or fault
        self._forget_removed(book)
        self._write()
        return fault

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
        draft = self._path.with_name(f".{self._path.name}.{secrets.token_hex(4)}")
        last = self._state.last
        text = json.dumps({"logged": self._state.logged, "used": last.tokens, "signed_in": last.users})
        try:
            draft.touch(mode=0o600)
            draft.write_text(text, encoding="utf-8")
            draft.replace(self._path)
        except OSError as error:
            log.warning("%s can not be written: %s", self._path, error)
            with suppress(OSError):
                draft.unlink()


def last_uses(folder: Path) -> LastUses:
    """When each user and token was last used."""
    return _read(folder / STATE).last


def _entry(change: Change) -> Entry:
    act = change.act if change.act in ACTS else "role"
    reason: TextLike = say(
        f"log_users_{act}", name=change.name, detail=change.detail, by=change.by, at=change.at
    )
    origin = Origin(address=change.address, browser=change.browser, who=change.by)
    values = {"user": change.name, "detail": change.detail, "at": change.at}
    return new_entry("access", origin, values, reason, action=f"users_{act}", outcome="accepted")


def _read(path: Path) -> _State:
    try:
        content: Any = json.loads(path.read_text(encoding="utf-8"))
        signed_in = content.get("signed_in", {})
        last = LastUses(_texts(signed_in), _texts(content["used"]))
        return _State(int(content["logged"]), last)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return _State(0, LastUses())


def _texts(texts: dict[Any, Any]) -> dict[str, str]:
    return {str(name): str(text) for name, text in texts.items()}
