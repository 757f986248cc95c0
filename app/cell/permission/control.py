"""The single point of control (ISO 10218): one browser at a time may press for a robot.

Acts and keepalives in, a verdict for each press out. A browser without a keepalive loses control, or
its request for it. Properties, `verdict` and `view` answer for the current time and write nothing.
`advance` records what time has changed since the last call; acts and keepalives call it first.
"""

import math
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import Final, Literal, NamedTuple, TypedDict

from app.cell.permission.verdict import PERMITTED, Verdict, locked
from app.panel.rules import ControlRules
from app.records.principal import Principal
from app.system.texts import TextLike, number, say

# Who has and who requests control of one robot, and what time alone changes about it. Pure.


class HandOver(NamedTuple):
    """A change of control that no act made: `who` had, took or requested control, `other` has it
    now."""

    how: Literal["lost", "idle", "first_page", "request_lost"]
    who: Principal
    other: Principal | None = None

    def __str__(self) -> str:
        """The line in the server's log."""
        match self.how:
            case "lost":
                return f"control lost by {self.who}, now of {self.other or 'no one'}"
            case "idle":
                return f"control taken over for want of a touch, now of {self.other}"
            case "first_page":
                return f"control taken at its first page by {self.who}"
        return f"{self.who} no longer asks for control"


class Party(NamedTuple):
    """The holder or the requester; times are monotonic seconds. `since` is when the time to a takeover
    began, `scripted` whether its page has sent a keepalive."""

    who: Principal
    since: float
    alive_until: float
    scripted: bool


class TimedChange(NamedTuple):
    """What time alone changes next, and when (monotonic seconds)."""

    at: float
    hand_over: HandOver


class Parties(NamedTuple):
    """The parties at one time. `since` is when the holder got control (wall time), `given_up` whether
    the last holder released it to no one."""

    holder: Party | None = None
    requester: Party | None = None
    since: float = 0.0
    given_up: bool = False

    def next_change(self, takeover_after_s: float) -> TimedChange | None:
        """The earliest change; of two at the same time the end of the request, then that of the holder.
        None if time alone changes nothing."""
        holder, requester = self.holder, self.requester
        if not holder:
            return None
        lost = HandOver("lost", holder.who, requester.who if requester else None)
        changes = [TimedChange(holder.alive_until, lost)]
        if requester:
            ended = HandOver("request_lost", requester.who)
            changes.insert(0, TimedChange(requester.alive_until, ended))
            # The holder has the whole time from the begin of the request.
            due = max(holder.since, requester.since) + takeover_after_s
            changes.append(TimedChange(due, lost._replace(how="idle")))
        return min(changes, key=lambda change: change.at)

    def after(self, change: TimedChange, wall: float) -> "Parties":
        """The parties after a change, which happened at `wall`."""
        if change.hand_over.how == "request_lost":
            return self._replace(requester=None)
        return self.passed_on(change.at, wall)

    def passed_on(self, now: float, wall: float) -> "Parties":
        """Control passes to the client that requests it, else to no one."""
        return Parties(self.requester and self.requester._replace(since=now), None, wall)

    def taken_by(self, party: Party, wall: float) -> "Parties":
        """The party takes control. A request of another client remains, and waits for this one."""
        own = self.requester and same_client(party.who, self.requester.who)
        return Parties(party, None if own else self.requester, wall)


def same_client(who: Principal, other: Principal | None) -> bool:
    """Whether both are the same browser. A client without a cookie is the same as no other."""
    return other is not None and bool(who.client.id) and who.client.id == other.client.id


# The view of control: one for all clients, and one for each role.

# What a client is to who has control; "" where control is not required, `embedded` for a page in a
# frame of another site, which may only show.
Role = Literal["", "free", "held", "over", "asking", "holding", "asked", "embedded"]
IN_CONTROL: Final = frozenset[Role]({"", "holding", "asked"})


class ControlView(TypedDict):
    """The state of control. `role` and `shown`, the text for that role, are "" in the view for all. An
    id or a name is "" if there is none; `since` is RFC 3339."""

    required: bool
    holder: str
    holder_name: TextLike
    asker: str
    asker_name: TextLike
    since: str
    holder_text: TextLike
    asker_text: TextLike
    text: TextLike
    role: Role
    shown: TextLike


NO_CONTROL: Final = ControlView(
    required=False,
    holder="",
    holder_name="",
    asker="",
    asker_name="",
    since="",
    holder_text="",
    asker_text="",
    text="",
    role="",
    shown="",
)


def control_view(
    rules: ControlRules,
    robot: TextLike,
    holder: Principal | None,
    requester: Principal | None,
    since: str,
) -> ControlView:
    """The view for a robot's name; a requester only where there is a holder."""
    if not rules.required:
        return NO_CONTROL
    view = ControlView(
        required=True,
        holder=holder.client.id if holder else "",
        holder_name=holder.title if holder else "",
        asker=requester.client.id if requester else "",
        asker_name=requester.title if requester else "",
        since=since,
        holder_text=say("control_held_here", robot=robot),
        asker_text="",
        text=say("control_free", robot=robot),
        role="",
        shown="",
    )
    if holder:
        view["text"] = say("control_held", name=holder.title, robot=robot)
    if holder and requester:
        seconds = number(f"{rules.takeover_after_s:g}")
        view["holder_text"] = say(
            "control_requested_by_other", name=requester.title, robot=robot, seconds=seconds
        )
        view["asker_text"] = say("control_request_waiting", name=holder.title, seconds=seconds)
    return view


def role(control: ControlView, who: Principal, rules: ControlRules) -> Role:
    """The role of a client in control; pages show their buttons by it."""
    if not control["required"]:
        return ""
    if not control["holder"]:
        return "free"
    if who.client.id == control["holder"]:
        return "asked" if control["asker"] else "holding"
    if who.client.id and who.client.id == control["asker"]:
        return "asking"
    return "over" if who.client.local and rules.local else "held"


def for_role(control: ControlView, role: Role) -> ControlView:
    """The view for a client of this role."""
    if role == "asking":
        shown = control["asker_text"]
    elif role in ("holding", "asked"):
        shown = control["holder_text"]
    else:
        shown = control["text"]
    return {**control, "role": role, "shown": shown}


LIFE_S: Final = 5.0  # without a keepalive; a page with scripts sends one every 1.5 s
ASK_AGAIN_S: Final = 10.0  # after a request was denied

ControlRefusal = Literal[
    "",
    "control_held_by_other",
    "control_already_requested",
    "control_denied",
    "control_changed",
    "control_no_cookie",
]


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
        self._robot: TextLike = robot or say("control_the_robot")
        self._now = monotonic
        self._wall = wall
        self._log_line = log_line
        self._on_hand_over = on_hand_over
        self._recorded = Parties()
        self._wall_offset = wall() - monotonic()  # the same in the view as in the next record
        self._denied: dict[str, float] = {}

    @property
    def holder(self) -> Principal | None:
        holder = self._parties.holder
        return holder.who if holder else None

    @property
    def requester(self) -> Principal | None:
        requester = self._parties.requester
        return requester.who if requester else None

    @property
    def until(self) -> float:
        """When time alone would change who has control, where a panel asks for it."""
        change = self._parties.next_change(self.rules.takeover_after_s)
        return change.at if change and self.rules.required else math.inf

    def verdict(self, who: Principal) -> Verdict:
        """Whether this client may press."""
        return PERMITTED if same_client(who, self.holder) else self.lock

    @property
    def lock(self) -> Verdict:
        """What locks for every client without control."""
        if not self.rules.required:
            return PERMITTED
        if holder := self.holder:
            return locked("control_held", name=holder.title, robot=self._robot)
        return locked("control_free", robot=self._robot)

    def view(self) -> ControlView:
        """The view of control, the same for all clients."""
        if not self.rules.required:
            return NO_CONTROL
        holder, requester, wall, _ = self._parties
        since = datetime.fromtimestamp(wall, UTC).isoformat(timespec="milliseconds")
        return control_view(
            self.rules,
            self._robot,
            holder.who if holder else None,
            requester.who if requester else None,
            since if holder else "",
        )

    def advance(self) -> None:
        """Records what time alone has changed, each change once: a lost holder or requester, a
        takeover. It is called in each turn and at each press."""
        for hand_over, parties in self._due():
            self._recorded = parties
            self._record(hand_over)
        self._wall_offset = self._wall() - self._now()

    # Acts: each returns why it was refused, "" where it was done. They are idempotent.

    def take(self, who: Principal, life_s: float = LIFE_S) -> ControlRefusal:
        """Takes what is free; the panel at the cell takes over."""
        self.advance()
        if not who.client.id:
            return "control_no_cookie"
        if (holder := self.holder) and not self._may_override(who) and not same_client(who, holder):
            return "control_held_by_other"
        if not same_client(who, holder):
            self._recorded = self._recorded.taken_by(self._party(who, life_s), self._wall())
            self._log_line(f"control {'taken over' if holder else 'taken'} by {who}")
        return ""

    def ask(self, who: Principal, life_s: float = LIFE_S) -> ControlRefusal:
        """Asks the holder; what is free or may be taken over is taken."""
        self.advance()
        if not who.client.id:
            return "control_no_cookie"
        if not self.holder or self._may_override(who) or same_client(who, self.holder):
            return self.take(who, life_s)
        if self.requester:
            return "" if same_client(who, self.requester) else "control_already_requested"
        self._denied = {client: until for client, until in self._denied.items() if until > self._now()}
        if who.client.id in self._denied:
            return "control_denied"
        self._recorded = self._recorded._replace(requester=self._party(who, life_s))
        self._log_line(f"{who} asks for control")
        return ""

    def give(self, who: Principal, to: str) -> ControlRefusal:
        """The holder grants the request of the browser with the id `to`."""
        self.advance()
        requester = self.requester
        if requester is None or requester.client.id != to or not same_client(who, self.holder):
            return "control_changed"
        self._pass_on(f"given by {who}")
        return ""

    def keep(self, who: Principal, to: str) -> ControlRefusal:
        """The holder denies the request of the browser with the id `to`."""
        self.advance()
        requester = self.requester
        if requester is None or requester.client.id != to or not same_client(who, self.holder):
            return "control_changed"
        self._denied[to] = self._now() + ASK_AGAIN_S
        self._recorded = self._recorded._replace(requester=None)
        self.touch(who)
        self._log_line(f"{who} keeps control: {requester} was denied")
        return ""

    def release(self, who: Principal) -> ControlRefusal:
        """The holder gives it up: to the client that requests it, else to no one. A requester withdraws
        its request."""
        self.advance()
        if same_client(who, self.holder):
            self._pass_on(f"given up by {who}")
            self._recorded = self._recorded._replace(given_up=self._recorded.holder is None)
        elif same_client(who, self.requester):
            self._recorded = self._recorded._replace(requester=None)
            self._log_line(f"{who} no longer asks for control")
        else:
            return "control_changed"
        return ""

    # Keepalives.

    def keepalive(self, who: Principal, touched: bool) -> None:
        """A page with scripts is open; `touched`: by its operator since the last call."""
        self.advance()
        until = self._now() + LIFE_S
        self._update(who, lambda party: party._replace(scripted=True, alive_until=until))
        if touched:
            self.touch(who)

    def touch(self, who: Principal) -> None:
        """The operator touched or pressed something: a request waits longer."""
        self.advance()
        now, holder = self._now(), self._recorded.holder
        if holder and same_client(who, holder.who):
            alive_until = max(holder.alive_until, now + LIFE_S)
            touched = holder._replace(since=now, alive_until=alive_until)
            self._recorded = self._recorded._replace(holder=touched)

    def loaded(self, who: Principal, life_s: float, opened_by_person: bool) -> None:
        """A page was loaded; without scripts it reloads within `life_s`. Control is taken only with
        `opened_by_person`, not for a program or a browser that prefetches."""
        self.advance()
        now, parties = self._now(), self._recorded
        free = not parties.holder and not parties.given_up
        self._update(
            who,
            lambda party: party._replace(alive_until=now + (LIFE_S if party.scripted else life_s)),
        )
        if opened_by_person and free and self._may_override(who):
            self._recorded = parties.taken_by(self._party(who, life_s), self._wall())
            self._record(HandOver("first_page", who))

    def _may_override(self, who: Principal) -> bool:
        return who.client.local and self.rules.local and bool(who.client.id)

    @property
    def _parties(self) -> Parties:
        """The parties after every change that is due."""
        parties = self._recorded
        for _, later in self._due():
            parties = later
        return parties

    def _due(self) -> Iterator[tuple[HandOver, Parties]]:
        """The changes that are due and not yet recorded, in the order of their times, each with the
        parties after it."""
        now, parties = self._now(), self._recorded
        while (change := parties.next_change(self.rules.takeover_after_s)) and change.at <= now:
            parties = parties.after(change, change.at + self._wall_offset)
            yield change.hand_over, parties

    def _record(self, hand_over: HandOver) -> None:
        self._log_line(str(hand_over))
        self._on_hand_over(hand_over)

    def _update(self, who: Principal, updated: Callable[[Party], Party]) -> None:
        """Updates the parties that are this client: the user there may be another one now."""
        holder, requester = self._recorded.holder, self._recorded.requester
        if holder and same_client(who, holder.who):
            self._recorded = self._recorded._replace(holder=updated(holder)._replace(who=who))
        elif requester and same_client(who, requester.who):
            self._recorded = self._recorded._replace(requester=updated(requester)._replace(who=who))

    def _party(self, who: Principal, life_s: float) -> Party:
        return Party(who, self._now(), self._now() + life_s, life_s == LIFE_S)

    def _pass_on(self, how: str) -> None:
        """To the client that requests it, else to no one."""
        self._recorded = self._recorded.passed_on(self._now(), self._wall())
        heir = self._recorded.holder
        self._log_line(f"control {how}, now of {heir.who if heir else 'no one'}")
