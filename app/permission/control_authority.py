"""The single point of control (ISO 10218): one browser at a time may press for a robot.

Pure, except for its clocks: acts and keepalives in, a verdict for each press out. A browser without a
keepalive loses control, or its request for it; each call checks that first.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final, Literal, NamedTuple

from app.i18n import TextLike, say
from app.panel.rules import ControlRules
from app.permission.control_authority_view import NO_CONTROL, ControlView, control_view
from app.permission.principal import Principal
from app.permission.verdict import PERMITTED, Verdict, locked

LIFE_S: Final = 5.0  # without a keepalive; a page with scripts sends one every 1.5 s
ASK_AGAIN_S: Final = 10.0  # after a request was denied

Refusal = Literal[
    "",
    "control_taken",
    "control_asked_by",
    "control_denied",
    "control_not_yours",
    "control_stranger",
]


class HandOver(NamedTuple):
    """A change of control that no act made: `who` had, took or requested control, `other` has it
    now."""

    how: Literal["lost", "idle", "first_page", "request_lost"]
    who: Principal
    other: Principal | None = None


@dataclass(slots=True)
class _Party:
    """The holder or the requester. `since` is when the time to a takeover began, `scripted` whether its
    page has sent a keepalive."""

    who: Principal
    since: float
    alive_until: float
    scripted: bool


class ControlAuthority:
    """Who has control of one robot; times are monotonic seconds."""

    def __init__(
        self,
        rules: ControlRules,
        robot: TextLike,
        *,
        monotonic: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
        log_line: Callable[[str], None] = lambda _: None,
        on_hand_over: Callable[[HandOver], None] = lambda _: None,
    ) -> None:
        """`robot` is its name, "" where there is only one; `log_line` is called with a line for each
        change, `on_hand_over` with each change that no act made."""
        self.rules = rules
        self._robot: TextLike = robot or say("the_robot")
        self._now = monotonic
        self._wall = wall
        self._log_line = log_line
        self._on_hand_over = on_hand_over
        self._holder: _Party | None = None
        self._requester: _Party | None = None
        self._since = ""
        self._given_up = False
        self._denied: dict[str, float] = {}

    @property
    def holder(self) -> Principal | None:
        self.advance()
        return self._holder.who if self._holder else None

    @property
    def requester(self) -> Principal | None:
        self.advance()
        return self._requester.who if self._requester else None

    @property
    def until(self) -> float:
        """When time alone would change who has control, where a panel asks for it."""
        if not self.rules.required:
            return float("inf")
        times = [party.alive_until for party in (self._holder, self._requester) if party]
        return min([*times, self._due()])

    def verdict(self, who: Principal) -> Verdict:
        """Whether this client may press."""
        return PERMITTED if _is(who, self.holder) else self.lock

    @property
    def lock(self) -> Verdict:
        """What locks for every client without control."""
        if not self.rules.required:
            return PERMITTED
        if holder := self.holder:
            return locked("control_held", name=holder.title, robot=self._robot)
        return locked("control_free", robot=self._robot)

    # Acts: each returns why it was refused, "" where it was done. They are idempotent.

    def take(self, who: Principal, life_s: float = LIFE_S) -> Refusal:
        """Takes what is free; the panel at the cell takes over."""
        if not who.client.id:
            return "control_stranger"
        if (holder := self.holder) and not self._may_override(who) and not _is(who, holder):
            return "control_taken"
        if not _is(who, holder):
            self._hold(who, life_s, "taken over" if holder else "taken")
        return ""

    def ask(self, who: Principal, life_s: float = LIFE_S) -> Refusal:
        """Asks the holder; what is free or may be taken over is taken."""
        if not who.client.id:
            return "control_stranger"
        if not self.holder or self._may_override(who) or _is(who, self.holder):
            return self.take(who, life_s)
        if self._requester:
            return "" if _is(who, self._requester.who) else "control_asked_by"
        self._denied = {client: until for client, until in self._denied.items() if until > self._now()}
        if who.client.id in self._denied:
            return "control_denied"
        self._requester = self._party(who, life_s)
        self._log_line(f"{who} asks for control")
        return ""

    def give(self, who: Principal, to: str) -> Refusal:
        """The holder grants the request of the browser with the id `to`."""
        requester = self.requester
        if requester is None or requester.client.id != to or not _is(who, self.holder):
            return "control_not_yours"
        self._pass_on(f"given by {who}")
        return ""

    def keep(self, who: Principal, to: str) -> Refusal:
        """The holder denies the request of the browser with the id `to`."""
        requester = self.requester
        if requester is None or requester.client.id != to or not _is(who, self.holder):
            return "control_not_yours"
        self._denied[to] = self._now() + ASK_AGAIN_S
        self._requester = None
        self.touch(who)
        self._log_line(f"{who} keeps control: {requester} was denied")
        return ""

    def release(self, who: Principal) -> Refusal:
        """The holder gives it up: to the client that requests it, else to no one. A requester withdraws
        its request."""
        if _is(who, self.holder):
            self._given_up = True
            self._pass_on(f"given up by {who}")
        elif _is(who, self.requester):
            self._end_request()
        else:
            return "control_not_yours"
        return ""

    # Keepalives.

    def keepalive(self, who: Principal, touched: bool) -> None:
        """A page with scripts is open; `touched`: by its operator since the last call."""
        for party in self._parties(who):
            party.scripted = True
            party.alive_until = self._now() + LIFE_S
        if touched:
            self.touch(who)

    def touch(self, who: Principal) -> None:
        """The operator touched or pressed something: a request waits longer."""
        self.advance()
        if self._holder and _is(who, self.holder):
            self._holder.since = self._now()
            self._holder.alive_until = max(self._holder.alive_until, self._now() + LIFE_S)

    def loaded(self, who: Principal, life_s: float, opened_by_person: bool) -> None:
        """A page was loaded; without scripts it reloads within `life_s`. Control is taken only with
        `opened_by_person`, not for a program or a browser that prefetches."""
        for party in self._parties(who):
            party.alive_until = self._now() + (LIFE_S if party.scripted else life_s)
        if opened_by_person and not self.holder and not self._given_up and self._may_override(who):
            self._hold(who, life_s, "taken at its first page")
            self._on_hand_over(HandOver("first_page", who))

    def advance(self) -> None:
        """Applies what time alone has changed: a lost holder or requester, a takeover."""
        now = self._now()
        if self._requester and now >= self._requester.alive_until:
            requester = self._requester.who
            self._end_request()
            self._on_hand_over(HandOver("request_lost", requester))
        if self._holder and now >= self._holder.alive_until:
            self._pass_by_time("lost", f"lost by {self._holder.who}")
        elif now >= self._due():
            self._pass_by_time("idle", "taken over for want of a touch")

    def view(self) -> ControlView:
        """The view of control, the same for all clients."""
        if not self.rules.required:
            return NO_CONTROL
        return control_view(self.rules, self._robot, self.holder, self.requester, self._since)

    def _may_override(self, who: Principal) -> bool:
        return who.client.local and self.rules.local and bool(who.client.id)

    def _due(self) -> float:
        """When the request goes through by itself: the holder has the whole time from its begin."""
        if not self._holder or not self._requester:
            return math.inf
        return max(self._holder.since, self._requester.since) + self.rules.takeover_after_s

    def _parties(self, who: Principal) -> list[_Party]:
        self.advance()
        both = (party for party in (self._holder, self._requester) if party)
        return [party for party in both if _is(who, party.who)]

    def _party(self, who: Principal, life_s: float) -> _Party:
        return _Party(who, self._now(), self._now() + life_s, life_s == LIFE_S)

    def _hold(self, who: Principal, life_s: float, how: str) -> None:
        self._install(self._party(who, life_s))
        self._log_line(f"control {how} by {who}")

    def _install(self, party: _Party | None) -> None:
        self._holder = party
        self._since = ""
        if party:
            self._given_up = False
            now = datetime.fromtimestamp(self._wall(), UTC)
            self._since = now.isoformat(timespec="milliseconds")
            if self._requester and _is(party.who, self._requester.who):
                self._requester = None

    def _pass_on(self, how: str) -> None:
        """To the client that requests it, else to no one."""
        heir, self._requester = self._requester, None
        if heir:
            heir.since = self._now()
        self._install(heir)
        self._log_line(f"control {how}, now of {heir.who if heir else 'no one'}")

    def _pass_by_time(self, how: Literal["lost", "idle"], line: str) -> None:
        before = self._holder
        self._pass_on(line)
        if before:
            self._on_hand_over(HandOver(how, before.who, self._holder.who if self._holder else None))

    def _end_request(self) -> None:
        if self._requester:
            self._log_line(f"{self._requester.who} no longer asks for control")
        self._requester = None


def _is(who: Principal, other: Principal | None) -> bool:
    return other is not None and bool(who.client.id) and who.client.id == other.client.id
