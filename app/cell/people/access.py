"""Users of a running server: the users' file as it is now, sessions, sign-in, and delays after
failures."""

import asyncio
import heapq
import logging
import math
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, TypeVar

from app.cell.people.access_log import WAITS, WRONG, AccessLog, AccessLogWriter
from app.cell.people.oidc import ExternalUser, OidcSignIns
from app.cell.people.secrets_hash import (
    Cost,
    Way,
    badge_hash,
    cost_of_machine,
    hashed,
    matches,
    memory_of_machine,
    unmatched_hash,
)
from app.cell.people.sessions import Session, Sessions
from app.cell.people.users import Edit, User, UserBook, name_key, rights_of
from app.cell.people.users_file import NEVER_READ, Loaded, Stamp, UsersFile, is_lost
from app.cell.permission.client_limits import RATE_LIMITS, RateGuard
from app.cell.permission.client_places import client_key
from app.panel.roles import ROLES, VIEWER
from app.panel.rules import AccessRules
from app.records.principal import Client, Principal, public_id
from app.system.limits import BoundedDict
from app.system.texts import Text, TextLike, say

# Hashes secrets beside the event loop, on one thread for the kiosk's own machine and one for all
# others, which has a low priority: a flood of sign-ins delays neither a press nor a sign-in at the
# cell. The kiosk's own has that of the server: there a person waits for it.

NICE: Final = 10
MOST_WAITING: Final = 4

Result = TypeVar("Result")


class SecretChecker:
    """Used on the event loop only."""

    def __init__(self, cost: Cost, monotonic: Callable[[], float] = time.monotonic) -> None:
        self.cost = cost
        self._rate = RateGuard("sign_ins", monotonic=monotonic)
        self._waiting = {True: 0, False: 0}
        self._threads = {
            True: ThreadPoolExecutor(1, "sign-in-here"),
            False: ThreadPoolExecutor(1, "sign-in-elsewhere", _be_nice),
        }
        self._nothing = unmatched_hash(cost)  # for users that do not exist

    def admit(self, local: bool) -> None:
        """TooMany if more sign-ins are under way than may be."""
        if self._waiting[local] >= MOST_WAITING or self._rate.exceeded(local, sign_ins=""):
            raise RATE_LIMITS["sign_ins"].error

    async def user_of(
        self, book: UserBook, name: str, way: Way, secret: str, local: bool
    ) -> User | None:
        """The user who has this secret, by their name or by their badge alone; None if no one has. It
        takes the same time for a user who does not exist."""
        if way == "badge" and not name:
            badge = await self._run(local, partial(badge_hash, secret, book.badge_salt))
            user = book.user_of_badge(badge)
            return user if user and not user.disabled else None
        user = book.user(name)
        if way == "badge":
            same = await self._run(local, partial(badge_hash, secret, book.badge_salt))
            correct = bool(user and user.badge) and same == (user.badge if user else "")
        else:
            known = user.hash_of(way) if user else ""
            checked = await self._run(local, partial(matches, known or self._nothing, secret))
            correct = checked and bool(known)
        return user if user and correct and not user.disabled else None

    async def hashed(self, secret: str) -> str:
        """The hash of a new PIN or password."""
        return await self._run(True, partial(hashed, secret, self.cost))

    def close(self) -> None:
        for thread in self._threads.values():
            thread.shutdown(wait=False, cancel_futures=True)

    async def _run(self, local: bool, work: Callable[[], Result]) -> Result:
        self._waiting[local] += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(self._threads[local], work)
        finally:
            self._waiting[local] -= 1


def _be_nice() -> None:
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICE)


# Growing delays after failed sign-ins, counted in leaky buckets.
#
# At the kiosk's own machine each user has a bucket, and nothing that others do fills it. Elsewhere a
# user has one at each address and one over all addresses, and an address has one over all users. An
# unknown badge delays the next badge by seconds only. Pure, with an injected clock.

MAX_BUCKETS: Final = 5000  # buckets
MADE_ROOM: Final = 500  # of them, when there are more
ADDRESSES_SHOWN: Final = 20  # of a user whose PIN is tried from elsewhere
ANY_USER: Final = "\0any"
BADGE: Final = "\0badge"  # names no user
ANYWHERE: Final = ""  # all addresses but the kiosk's own


class Leak(NamedTuple):
    """`free` failures have no delay, the next ones `first_s` seconds, doubled with each failure up to
    `longest_s`. One failure is forgotten each `leak_s` seconds."""

    free: int
    first_s: float
    longest_s: float
    leak_s: float


USER: Final = Leak(5, 30.0, 900.0, 600.0)
ADDRESS: Final = Leak(20, 30.0, 900.0, 120.0)
USER_ANYWHERE: Final = Leak(20, 60.0, 3600.0, 1800.0)
BADGE_HERE: Final = Leak(2, 2.0, 10.0, 10.0)
BADGE_ANYWHERE: Final = Leak(20, 2.0, 60.0, 60.0)
GUESSED: Final = (USER_ANYWHERE, ADDRESS, BADGE_ANYWHERE)  # raise the panel's own alarm

Key = tuple[str, str]  # user or badge, address


class Guessed(NamedTuple):
    """Secrets are tried from elsewhere: those of a user, by the key of the name, or "" for badges and
    several users. `addresses` are the last ones, the newest at the end."""

    user: str
    addresses: tuple[str, ...]


@dataclass(slots=True)
class _Bucket:
    """`level` was that after the last failure."""

    level: float = 0.0
    last_at: float = 0.0
    addresses: dict[str, None] = field(default_factory=dict)


class SignInDelays:
    """Counts failures, and forgets them as time goes on. A success forgets those of the user at this
    address, where failures elsewhere do not delay the user from then on."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._monotonic = monotonic
        self._buckets: dict[Key, _Bucket] = {}
        self._known = BoundedDict[Key, None](MAX_BUCKETS)  # where users elsewhere have signed in

    def wait_s(self, user: str, address: str, local: bool) -> int:
        """Whole seconds until the next try; 0 if it may be made now."""
        keys = [*_keys(user, address, local)]
        known = keys[0][0] in self._known
        waits = (self._wait(*key) for key in keys if not (known and key[1] is USER_ANYWHERE))
        return math.ceil(max(waits))

    def tries_left(self, user: str, address: str, local: bool) -> int:
        """Tries before there is a delay; during and after delays 1."""
        (key, leak), *_ = _keys(user, address, local)
        return max(1, leak.free - math.ceil(self._level(key, leak)))

    def failed(self, user: str, address: str, local: bool) -> None:
        """Counts a failure. It is counted before the secret is checked, so that tries that are made at
        the same time count too; `succeeded` takes it back."""
        for key, leak in _keys(user, address, local):
            level, bucket = self._level(key, leak), self._buckets.setdefault(key, _Bucket())
            if not level:
                bucket.addresses.clear()
            bucket.level, bucket.last_at = level + 1.0, self._monotonic()
            bucket.addresses.pop(address, None)
            bucket.addresses[address] = None
            if len(bucket.addresses) > ADDRESSES_SHOWN:
                del bucket.addresses[next(iter(bucket.addresses))]
        if len(self._buckets) > MAX_BUCKETS:
            self._make_room()

    def succeeded(self, user: str, address: str, local: bool) -> None:
        """Forgets the failures of the user at this address, and the try that succeeded."""
        own, *others = (key for key, _ in _keys(user, address, local))
        self._buckets.pop(own, None)
        for key in others:
            if (bucket := self._buckets.get(key)) is not None:
                bucket.level = max(0.0, bucket.level - 1.0)
        if not local:
            self._known[own] = None

    @property
    def guessed(self) -> Guessed | None:
        """What is tried most often from elsewhere, while that is so often that further tries wait."""
        most, about = 0.0, None
        for key, bucket in self._buckets.items():
            leak = _leak_of(key)
            if leak not in GUESSED or (level := self._level(key, leak)) <= max(most, leak.free - 1):
                continue
            name = key[0] if leak is USER_ANYWHERE else ""
            most, about = level, Guessed(name, tuple(bucket.addresses))
        return about

    def _level(self, key: Key, leak: Leak) -> float:
        bucket = self._buckets.get(key)
        if bucket is None:
            return 0.0
        return max(0.0, bucket.level - (self._monotonic() - bucket.last_at) / leak.leak_s)

    def _wait(self, key: Key, leak: Leak) -> float:
        bucket = self._buckets.get(key)
        over = math.ceil(bucket.level) - leak.free if bucket else -1
        if bucket is None or over < 0:
            return 0.0
        delay = min(leak.longest_s, leak.first_s * 2.0 ** min(over, 10))
        return max(0.0, bucket.last_at + delay - self._monotonic())

    def _make_room(self) -> None:
        """Forgets the buckets that matter least: those that delay nothing, the oldest first."""

        def matters(key: Key) -> tuple[float, float, float]:
            leak = _leak_of(key)
            return self._wait(key, leak), self._level(key, leak), self._buckets[key].last_at

        for key in heapq.nsmallest(MADE_ROOM, self._buckets, key=matters):
            del self._buckets[key]


def _keys(user: str, address: str, local: bool) -> Iterator[tuple[Key, Leak]]:
    """The buckets of a try, that of the user at this address first. A badge has "" for the user."""
    name = name_key(user) if user else BADGE
    addresses = (address,) if local else (address, ANYWHERE)
    keys = [(name, address) for address in addresses] + ([] if local else [(ANY_USER, address)])
    return ((key, _leak_of(key)) for key in keys)


def _leak_of(key: Key) -> Leak:
    name, address = key
    if name == ANY_USER:
        return ADDRESS
    if name == BADGE:
        return BADGE_ANYWHERE if address == ANYWHERE else BADGE_HERE
    return USER_ANYWHERE if address == ANYWHERE else USER


log = logging.getLogger("kiosk.access")

WATCHED_EVERY_S: Final = 0.5
EndReason = Literal["sign_out", "hand_over", "idle", "longest", "changed", "limit", "ended"]
# Why a session ended that its user did not end.
END_SENTENCES: Final[Mapping[EndReason, str]] = {
    "idle": "signin_ended_idle",
    "changed": "signin_ended_changed",
    "limit": "signin_ended_limit",
    "longest": "signin_ended_longest",
    "ended": "signin_ended_afar",
}
MAX_END_REASONS: Final = 1000  # browsers
PIN_HERE: Final = "sign_in_pin_here"
NO_USERS: Final = "users_unreadable"  # no one can sign in


@dataclass(frozen=True, slots=True)
class Attempt:
    """What somebody signs in with: a name ("" with a badge), and a PIN, password or badge."""

    name: str
    way: Way
    secret: str


@dataclass(frozen=True, slots=True)
class SecretCheck:
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
        state: Path | None = None,
    ) -> None:
        """`state` is the folder that keeps which changes of the users are logged; that of the file by
        default."""
        self.rules = rules
        self.sessions = Sessions(rules.idle_s, monotonic, rules.longest_s, rules.max_sessions)
        self.delays = SignInDelays(monotonic)
        self.checker = SecretChecker(cost or cost_of_machine(memory_of_machine()), monotonic)
        self.log = AccessLogWriter(oplog, state or file.folder)
        self.fault: TextLike = ""
        self.book = UserBook()
        self.file = file
        self.oidc = OidcSignIns(rules.oidc, rules.groups, monotonic) if rules.oidc else None
        self._reader = ThreadPoolExecutor(1, "users")
        self._stamp: Stamp | None = NEVER_READ
        self._monotonic = monotonic
        self._end_reasons = BoundedDict[str, Text](MAX_END_REASONS)  # by client
        self._token_requests = RateGuard("token_requests", monotonic=monotonic)
        self._listeners: list[Callable[[Session, EndReason], None]] = []
        self._change_listeners: list[Callable[[], None]] = []

    @property
    def configured(self) -> bool:
        """Whether clients have roles: there are users, their file can't be read, which locks, or the
        plant's provider has them."""
        return self.book.configured or bool(self.fault) or self.oidc is not None

    @property
    def has_roles(self) -> bool:
        """Whether clients differ in what they may do: else everyone may do everything."""
        return self.configured or not self.rules.open

    async def reload(self) -> None:
        """Reads the users' file if it has changed, on a thread of its own: others may wait for a slow
        disk or the robot. Logs the changes."""
        loop = asyncio.get_running_loop()
        self.apply(await loop.run_in_executor(self._reader, self.file.newer, self._stamp))

    def apply(self, loaded: Loaded | None) -> None:
        """Works with a newer version of the file; None if there is none. No one is signed in while it
        can't be read."""
        if loaded is not None:
            self._stamp, before = loaded.stamp, self.book
            path, why = str(self.file.path), loaded.fault
            fault: TextLike = say("users_unreadable", path=path, why=why) if why else ""
            if not why and is_lost(loaded.book, self.log.had_users):
                fault = say("users_lost", path=path)
            if fault and fault != self.fault:
                log.error("%s", fault)
                self.log.locked(fault)
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
        if token is None:
            return False
        return not self._token_requests.exceeded(False, token_requests=token.hash)

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
    ) -> SecretCheck:
        """Checks a PIN, password or badge, with the delays after failures; logs a failure, with the
        `widget` whose press it confirms. TooMany if others do that already."""
        if self.fault:
            return SecretCheck(None, self.fault, NO_USERS)
        if not self.takes(attempt.way, client):
            return SecretCheck(None, say(PIN_HERE), PIN_HERE)
        bucket = attempt.name, _address(client), client.local
        named = self.book.user(attempt.name)
        failed = partial(self.log.failed, client, named.name if named else "", action, widget)
        if wait_s := self.delays.wait_s(*bucket):
            await failed(say(WAITS[action]))
            return SecretCheck(None, say("sign_in_wait", seconds=str(wait_s)), "sign_in_wait", wait_s)
        self.checker.admit(client.local)
        self.delays.failed(*bucket)
        asked = attempt.name, attempt.way, attempt.secret
        user = await self.checker.user_of(self.book, *asked, client.local)
        now = self.book.user(user.name) if user else None  # the file may have changed
        if user is None or now is None or rights_of(now) != rights_of(user):
            left = self.delays.tries_left(*bucket)
            code = WRONG[action][attempt.way]
            wait_s = self.delays.wait_s(*bucket)
            await failed(say(code))
            counted = attempt.name and not wait_s  # the next badge is another person's
            return SecretCheck(None, say(code), code, wait_s, left if counted else 0)
        self.delays.succeeded(*bucket)
        return SecretCheck(now)

    def takes(self, way: Way, client: Client) -> bool:
        """Whether this way to sign in is taken from the client: a PIN is short, and is taken at the
        panel itself only, unless the panel file permits it anywhere."""
        return way != "pin" or client.local or self.rules.pin == "anywhere"

    def wait_s(self, client: Client, name: str) -> int:
        """Whole seconds until this user can try again at this client; 0 for now."""
        return self.delays.wait_s(name, _address(client), client.local)

    def tries_left(self, client: Client, name: str) -> int:
        """Tries of this user at this client before there is a delay."""
        return self.delays.tries_left(name, _address(client), client.local)

    @property
    def guessed(self) -> Guessed | None:
        """The user, if it is one of the panel's, whose secret is tried from elsewhere."""
        guessed = self.delays.guessed
        user = self.book.user(guessed.user) if guessed else None
        return guessed and guessed._replace(user=user.name if user else "")

    async def sign_in(self, client: Client, attempt: Attempt) -> tuple[SecretCheck, Session | None]:
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
        for other in self.sessions.end_surplus():
            self._ended(other, "limit")
        self._end_reasons.pop(client.id, None)
        self.log.signed_in(self.principal(client, session.id), way)
        self._changed()
        return session

    def sign_out(self, session: Session) -> None:
        self.sessions.end(session)
        self._ended(session, "sign_out")

    def end_due(self) -> None:
        """Signs out users who have not touched their page for too long, or have the longest time
        behind them."""
        for session, reason in self.sessions.end_due():
            self._ended(session, reason)

    def own_sessions(self, who: Principal) -> list[Session]:
        """The sessions of the user who is signed in, the longest untouched first; none of a program's
        owner. A name that the plant's provider gave is another user's than the same in the users'
        file."""
        current = self.sessions.of_client(who.client.id) if who.user and not who.program else None
        if current is None:
            return []
        own = (current.user, bool(current.role))
        return [each for each in self.sessions if (each.user, bool(each.role)) == own]

    def end(self, session: Session, by: Principal) -> None:
        """Signs a user out from afar."""
        self.sessions.end(session)
        self._ended(session, "ended", by)

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

    def end_reason(self, client: Client) -> TextLike:
        """Why the last session of this browser ended, "" if its user ended it."""
        return self._end_reasons.get(client.id, "")

    def _ended(self, session: Session, reason: EndReason, by: Principal | None = None) -> None:
        """`by` is who ended it from afar."""
        self.log.signed_out(session, reason, by)
        self._end_reasons.pop(session.client.id, None)
        if reason in END_SENTENCES:
            names = {"by": by.title} if by is not None else {}
            self._end_reasons[session.client.id] = say(END_SENTENCES[reason], **names)
        for listener in self._listeners:
            listener(session, reason)
        self._changed()

    async def watch(self) -> None:
        """Reads changes of the users' file and signs out idle users, until it is cancelled."""
        reading = asyncio.ensure_future(self.reload())
        try:
            while True:
                await asyncio.sleep(WATCHED_EVERY_S)
                self.end_due()
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


def _address(client: Client) -> str:
    """Where the failures of a client count."""
    return "127.0.0.1" if client.local else client_key(client.address)
