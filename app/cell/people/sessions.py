"""Sessions of signed-in users: which browser is whose, until sign-out, idle time, the longest time, an
end from afar or restart. Pure, with an injected clock."""

import math
import secrets
import time
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final, Literal

from app.records.principal import Client

MOST: Final = 1000
MOST_OF_USER: Final = 10
EndsBy = Literal["idle", "longest"]


@dataclass(slots=True)
class Session:
    """`client` is the browser that has it. `begun_at` and `touched_at` are monotonic seconds; `holds`
    are the holds under way, during which it does not end by itself. `handle` names it for others; its
    `id` is a secret. `role` and `groups` are those of a
    user whom the plant's provider knows, "" for a user of the users' file; `id_token` is what ends the
    session there."""

    user: str
    client: Client
    touched_at: float
    begun_at: float
    id: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    handle: str = field(default_factory=lambda: secrets.token_hex(8))
    holds: int = 0
    role: str = ""
    groups: frozenset[str] = frozenset()
    id_token: str = field(default="", repr=False)


class Sessions:
    """The sessions of one server. A browser has one at most."""

    def __init__(
        self,
        idle_s: float,
        monotonic: Callable[[], float] = time.monotonic,
        longest_s: float = 0.0,
        most: int = MOST_OF_USER,
    ) -> None:
        """Without a touch for `idle_s` seconds a session ends, and `longest_s` after its begin; 0: it
        does not by itself. A user has at most `most`."""
        self.idle_s = idle_s
        self.longest_s = longest_s
        self._most = most
        self._monotonic = monotonic
        self._sessions: OrderedDict[str, Session] = OrderedDict()

    def begin(
        self, user: str, client: Client, role: str = "", groups: frozenset[str] = frozenset()
    ) -> Session:
        """A new session of this browser, in place of the one that it had. `end_surplus` follows."""
        self.end_client(client.id)
        now = self._monotonic()
        session = Session(user, client, now, now, role=role, groups=groups)
        self._sessions[session.id] = session
        return session

    def end_surplus(self) -> list[Session]:
        """Ends the sessions that are more than a user, or all together, may have, and returns them: the
        longest untouched ones of the user who has the most."""
        ended = []
        while surplus := self._surplus():
            self.end(surplus)
            ended.append(surplus)
        return ended

    def _surplus(self) -> Session | None:
        counts = Counter(session.user for session in self._sessions.values())
        user, most = counts.most_common(1)[0] if counts else ("", 0)
        if most <= self._most and len(self._sessions) <= MOST:
            return None
        of_user = [session for session in self._sessions.values() if session.user == user]
        return min(of_user, key=lambda session: bool(session.holds))

    def get(self, session_id: str, client: str) -> Session | None:
        """The session of this id, if it is that of the browser with the public id `client`, and its
        time is not over."""
        session = self._sessions.get(session_id)
        if session is None or not client or session.client.id != client or self._left(session) <= 0:
            return None
        return session

    def touch(self, session: Session) -> None:
        """The user has touched the page."""
        if self._left(session) > 0:
            session.touched_at = self._monotonic()
            if session.id in self._sessions:
                self._sessions.move_to_end(session.id)

    @contextmanager
    def holding(self, session: Session | None) -> Iterator[None]:
        """A hold of this session is under way: it does not become idle, and counts as a touch."""
        if session is None:
            yield
            return
        session.holds += 1
        try:
            yield
        finally:
            session.holds -= 1
            session.touched_at = self._monotonic()

    def left_s(self, session: Session) -> float | None:
        """Seconds until the session ends by itself; None if it never does."""
        return self._left(session) if self.idle_s or self.longest_s else None

    def ends_by(self, session: Session) -> EndsBy:
        """What ends it first: a touch puts off the one, and not the other."""
        idle, longest = self._ends(session)
        return "longest" if longest <= idle else "idle"

    def seen_s(self, session: Session) -> tuple[float, float]:
        """How many seconds ago it began, and its page was touched."""
        now = self._monotonic()
        return now - session.begun_at, now - session.touched_at

    def end(self, session: Session) -> None:
        self._sessions.pop(session.id, None)

    def of_client(self, client: str) -> Session | None:
        """The session of this browser, None without one."""
        sessions = (session for session in self._sessions.values() if session.client.id == client)
        return next(sessions, None)

    def end_client(self, client: str) -> Session | None:
        """Ends the session of this browser, and returns it."""
        session = self.of_client(client)
        if session is not None:
            self.end(session)
        return session

    def of_handle(self, handle: str) -> Session | None:
        return next((each for each in self._sessions.values() if each.handle == handle), None)

    def end_due(self) -> list[tuple[Session, EndsBy]]:
        """Ends the sessions whose time is over, and returns them, each with what ended it."""
        due = [each for each in self._sessions.values() if self._left(each) <= 0]
        ended = [(session, self.ends_by(session)) for session in due]
        for session in due:
            self.end(session)
        return ended

    def end_users(self, users: frozenset[str]) -> list[Session]:
        """Ends the sessions of these users, and returns them."""
        ended = [session for session in self._sessions.values() if session.user in users]
        for session in ended:
            self.end(session)
        return ended

    def __len__(self) -> int:
        return len(self._sessions)

    def __iter__(self) -> Iterator[Session]:
        """The longest untouched first."""
        return iter([*self._sessions.values()])

    def _left(self, session: Session) -> float:
        return math.inf if session.holds else min(self._ends(session)) - self._monotonic()

    def _ends(self, session: Session) -> tuple[float, float]:
        """When it is idle for too long, and when its longest time is over, in monotonic seconds."""
        return (
            session.touched_at + self.idle_s if self.idle_s else math.inf,
            session.begun_at + self.longest_s if self.longest_s else math.inf,
        )
