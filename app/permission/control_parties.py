"""Who has and who requests control of one robot, and what time alone changes about it. Pure."""

from typing import Literal, NamedTuple

from app.permission.principal import Principal


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

    def taken(self, party: Party, wall: float) -> "Parties":
        """The party takes control. A request of another client remains, and waits for this one."""
        own = self.requester and same_client(party.who, self.requester.who)
        return Parties(party, None if own else self.requester, wall)


def same_client(who: Principal, other: Principal | None) -> bool:
    """Whether both are the same browser. A client without a cookie is the same as no other."""
    return other is not None and bool(who.client.id) and who.client.id == other.client.id
