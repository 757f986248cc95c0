"""Users of a running server: the users' file as it is now, sessions, sign-in."""

import asyncio
import logging
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, Literal

from app.access.access_log import WAITS, WRONG, AccessLog, AccessLogWriter
from app.access.delays import SignInDelays
from app.access.oidc import ExternalUser, OidcSignIns
from app.access.secret_checker import SecretChecker
from app.access.secrets_hash import Cost, Way, cost_of_machine, memory_of_machine
from app.access.sessions import Session, Sessions
from app.access.typed_digits import TypedDigits
from app.access.users import Edit, User, UserBook, rights_of
from app.access.users_file import Loaded, Stamp, UsersFile
from app.i18n import TextLike, say
from app.panel.rules import AccessRules
from app.permission.client_places import client_key
from app.permission.clients import Client, public_id
from app.permission.principal import Principal
from app.rate_limit import Quota, TokenBuckets
from app.roles import ROLES, VIEWER

log = logging.getLogger("kiosk.access")

TOKEN_QUOTA: Final = Quota(100, 50)
WATCHED_EVERY_S: Final = 0.5
EndReason = Literal["sign_out", "hand_over", "idle", "changed"]


@dataclass(frozen=True, slots=True)
class Attempt:
    """What somebody signs in with: a name ("" with a badge), and a PIN, password or badge."""

    name: str
    way: Way
    secret: str


@dataclass(frozen=True, slots=True)
class Checked:
    """The result of a check: the user, or why there is none. `wait_s`: seconds until the next try;
    `tries_left`: tries before there is a delay."""

    user: User | None
    reason: TextLike = ""
    code: str = ""
    wait_s: int = 0
    tries_left: int = 0


class Access:
    """Who a client is. Used on the event loop only."""

    def __init__(
        self,
        file: UsersFile,
        rules: AccessRules,
        oplog: AccessLog,
        monotonic: Callable[[], float] = time.monotonic,
        cost: Cost | None = None,
    ) -> None:
        self.rules = rules
        self.sessions = Sessions(rules.idle_s, monotonic)
        self.delays = SignInDelays(monotonic)
        self.checker = SecretChecker(cost or cost_of_machine(memory_of_machine()), monotonic)
        self.log = AccessLogWriter(oplog, file.folder)
        self.fault: TextLike = ""
        self.book = UserBook()
        self.file = file
        self.oidc = OidcSignIns(rules.oidc, rules.groups, monotonic) if rules.oidc else None
        self._reader = ThreadPoolExecutor(1, "users")
        self._stamp: Stamp | None = None
        self._monotonic = monotonic
        self.typed_digits = TypedDigits(monotonic)
        self._token_requests = TokenBuckets(TOKEN_QUOTA, monotonic)
        self._listeners: list[Callable[[Session, EndReason], None]] = []
        self._change_listeners: list[Callable[[], None]] = []

    @property
    def configured(self) -> bool:
        """Whether clients have roles: there are users, their file can't be read, which locks, or the
        plant's provider has them."""
        return self.book.configured or bool(self.fault) or self.oidc is not None

    @property
    def has_roles(self) -> bool:
        """Whether clients differ in what they may do: else everybody may do everything."""
        return self.configured or not self.rules.open

    async def reload(self) -> None:
        """Reads the users' file if it has changed, on a thread of its own: others may wait for a slow
        disk or the robot. Logs the changes."""
        loop = asyncio.get_running_loop()
        self.apply(await loop.run_in_executor(self._reader, self.file.newer, self._stamp))

    def apply(self, loaded: Loaded | None) -> None:
        """Works with a newer version of the file; None if there is none. Nobody is signed in while it
        can't be read."""
        if loaded is not None:
            self._stamp, before = loaded.stamp, self.book
            path, why = str(self.file.path), loaded.fault
            fault = say("users_unreadable", path=path, why=why) if why else ""
            if fault and fault != self.fault:
                log.error("%s", fault)
            self.book, self.fault = loaded.book, fault
            self._end_changed(before)
            self._changed()
        if not self.fault:
            self.log.changes(self.book)

    async def edit(self, edit: Edit) -> TextLike:
        """Changes the users' file, logs the change and works with it at once; UsersError or OSError if
        it changes nothing. Returns "" when the entries of the log are on the disk, else why not."""
        loop = asyncio.get_running_loop()
        book = await loop.run_in_executor(self._reader, self.file.edit, edit)
        fault = await self.log.changed_here(book)
        await self.reload()
        return fault

    def _end_changed(self, before: UserBook) -> None:
        """Ends the sessions of users who may do something else now, or have another secret."""
        now = {user.name: rights_of(user) for user in self.book.users}
        names = {user.name for user in before.users if rights_of(user) != now.get(user.name)}
        for session in self.sessions.end_users(frozenset(names)):
            self._ended(session, "changed")

    def principal(self, client: Client, session_id: str = "", bearer: str = "") -> Principal:
        """Who asks now. A client that is not signed in, or whose token is not known, is a viewer."""
        if not self.configured:
            return Principal(client) if self.rules.open else Principal(client, role=VIEWER)
        if bearer:
            return self._program(client, bearer)
        session = self.sessions.get(session_id, client.id) if session_id else None
        if session is not None and session.role:
            role = self._capped(client, session.role)
            return Principal(client, session.user, role, session.groups)
        user = self.book.user(session.user) if session else None
        return self.person(client, user) if user else Principal(client, role=VIEWER)

    def person(self, client: Client, user: User) -> Principal:
        """This user at a browser."""
        return Principal(client, user.name, self._capped(client, user.role), frozenset(user.groups))

    def knows(self, bearer: str) -> bool:
        """Whether there is such a token."""
        return self.book.token(bearer) is not None

    def admit_token(self, bearer: str) -> bool:
        """Whether a program may make a request now, by the rate limit of its token."""
        token = self.book.token(bearer)
        if token is None or not self._token_requests.has_token(token.hash):
            return False
        self._token_requests.take_token(token.hash)
        return True

    def _program(self, client: Client, bearer: str) -> Principal:
        token = self.book.token(bearer)
        if token is None:
            return Principal(client, role=VIEWER)
        self.log.token_used(token.name)
        named = Client(public_id(token.hash), client.address, client.local, 0)
        return Principal(named, token.name, self._capped(client, token.role), program=True)

    def _capped(self, client: Client, role: str) -> str:
        """The role, or the panel's `remote` if that is lower and the client is on another machine."""
        if client.local:
            return role
        return ROLES[min(ROLES.index(role), ROLES.index(self.rules.remote))]

    async def check(
        self, client: Client, attempt: Attempt, action: str = "sign_in", widget: str = ""
    ) -> Checked:
        """Checks a PIN, password or badge, with the delays after failures; logs a failure, with the
        `widget` whose press it confirms. TooMany if others do that already."""
        if self.fault:
            return Checked(None, self.fault, "users_unreadable")
        address = "127.0.0.1" if client.local else client_key(client.address)
        named = self.book.user(attempt.name)
        failed = partial(self.log.failed, client, named.name if named else "", action, widget)
        if wait_s := self.delays.wait_s(attempt.name, address):
            await failed(say(WAITS[action]))
            return Checked(None, say("sign_in_wait", seconds=str(wait_s)), "sign_in_wait", wait_s)
        self.checker.admit(client.local)
        self.delays.failed(attempt.name, address)
        asked = attempt.name, attempt.way, attempt.secret
        user = await self.checker.user_of(self.book, *asked, client.local)
        now = self.book.user(user.name) if user else None  # the file may have changed
        if user is None or now is None or rights_of(now) != rights_of(user):
            left = self.delays.tries_left(attempt.name, address)
            code = WRONG[action][attempt.way]
            wait_s = self.delays.wait_s(attempt.name, address)
            await failed(say(code))
            return Checked(None, say(code), code, wait_s, 0 if wait_s else left)
        self.delays.succeeded(attempt.name, address)
        return Checked(now)

    async def sign_in(self, client: Client, attempt: Attempt) -> tuple[Checked, Session | None]:
        """Signs a user in at a browser, in place of the user who is signed in there."""
        checked = await self.check(client, attempt)
        if checked.user is None:
            return checked, None
        return checked, self._begin(client, attempt.way, checked.user.name)

    def sign_in_external(self, client: Client, user: ExternalUser) -> Session:
        """Signs in a user whom the plant's provider has checked."""
        session = self._begin(client, "oidc", user.name, user.role, user.groups)
        session.id_token = user.id_token
        return session

    def _begin(self, client: Client, way: Way | Literal["oidc"], *about: Any) -> Session:
        if before := self.sessions.end_client(client.id):
            self._ended(before, "hand_over")
        session = self.sessions.begin(about[0], client, *about[1:])
        self.log.signed_in(self.principal(client, session.id), way)
        self._changed()
        return session

    def sign_out(self, session: Session) -> None:
        self.sessions.end(session)
        self._ended(session, "sign_out")

    def end_idle(self) -> None:
        """Signs out users who have not touched their page for too long."""
        for session in self.sessions.end_idle():
            self._ended(session, "idle")

    def on_end(self, listener: Callable[[Session, EndReason], None]) -> None:
        """`listener` is called when a session has ended, and why."""
        self._listeners.append(listener)

    def on_change(self, listener: Callable[[], None]) -> None:
        """`listener` is called when clients may have other roles: after a sign-in, a sign-out, or
        another version of the users' file."""
        self._change_listeners.append(listener)

    @contextmanager
    def notifying(self, listener: Callable[[], None]) -> Iterator[None]:
        """`listener` is called as that of `on_change`, while the context lasts."""
        self._change_listeners.append(listener)
        try:
            yield
        finally:
            self._change_listeners.remove(listener)

    def _changed(self) -> None:
        for listener in list(self._change_listeners):
            listener()

    def _ended(self, session: Session, reason: EndReason) -> None:
        self.log.signed_out(session, reason)
        for listener in self._listeners:
            listener(session, reason)
        self._changed()

    async def watch(self) -> None:
        """Reads changes of the users' file and signs out idle users, until it is cancelled."""
        reading = asyncio.ensure_future(self.reload())
        try:
            while True:
                await asyncio.sleep(WATCHED_EVERY_S)
                self.end_idle()
                if reading.done():
                    reading.result()
                    reading = asyncio.ensure_future(self.reload())
        finally:
            reading.cancel()

    def close(self) -> None:
        self.checker.close()
        if self.oidc is not None:
            self.oidc.close()
        self._reader.shutdown(wait=False, cancel_futures=True)
