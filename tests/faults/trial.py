"""One fault from beginning to end during continuous presses: break, lock, repair, permission again."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from tests.faults.presser import Account, Press, Presser, accounted
from tests.faults.results import ms, record
from tests.faults.rig import Rig, limit
from tests.faults.watch import Watch, answering
from tests.support.parts import Server, until

# A press with the outcome `published` this shortly before a fault may still be in flight.
UNDER_WAY_S: Final = 0.2
WELL: Final = 20  # presses that come through before and after


@dataclass(frozen=True, slots=True)
class Trial:
    """The result: `locked_s` from the fault to the first lock shown, `opened_s` from the repair to the
    permission; `claimed` counts presses that were sent, and got the outcome `published`, while the part
    was broken. While it breaks (the command that takes a link down runs for some milliseconds), a press
    may still come through, and one that waits for the answer of a robot may after the repair."""

    locked_s: float
    opened_s: float
    account: Account
    claimed: int


def nothing() -> None:
    """For faults that need no repair."""


def try_fault(
    rig: Rig,
    server: Server,
    breaks: Callable[[], object],
    mends: Callable[[], object] = nothing,
    *,
    locks_within_s: float,
    lasts_s: float = 0.0,
    late_s: float = 1.0,
    interlock: str = "kept",
    widget: str = "guarded",
    opens_within_s: float = 30.0,
    because: str = "",
) -> Trial:
    """Breaks a part, waits for the lock and for `lasts_s`, repairs it, waits until presses are
    published.

    `because` is a regular expression; the lock that counts has a reason in which it is found.
    """
    watch, presser = Watch(server), Presser(server, widget)
    with answering(server):
        presses_work(presser)
        broken_at = time.monotonic()
        breaks()
        gone_at = time.monotonic()
        locked_s = watch.locked_after(broken_at, interlock, limit(locks_within_s), because)
        until(lambda: time.monotonic() >= broken_at + lasts_s, "the fault's time is over", lasts_s + 1)
        mended_at = time.monotonic()
        mends()
        watch.opened(interlock, limit(opens_within_s))
        opened_at = watch.now(interlock).at
        heard_at = heard(rig, widget, presser, opened_at)
        presses_work(presser)
    presses = presser.end()
    watch.end()

    def whole(press: Press) -> bool:
        return press.answered_at < broken_at - UNDER_WAY_S or press.at > heard_at

    account = accounted(presses, lambda: rig.arrivals(widget), whole, limit(late_s))
    claimed = sum(
        p.outcome == "published" and gone_at < p.at and p.answered_at < mended_at for p in presses
    )
    return Trial(locked_s, opened_at - mended_at, account, claimed)


def heard(rig: Rig, widget: str, presser: Presser, since: float) -> float:
    """When the robot has heard the first press since a moment: a bridge that is new sends before it
    knows of the robot's subscriber."""

    def hears() -> bool:
        sent = {press.text for press in presser.presses if press.at > since}
        return any(text in sent for _, text in rig.arrivals(widget))

    until(hears, "the robot hears presses")
    return time.monotonic()


def recorded(fault: str, trial: Trial) -> None:
    """A row of the table."""
    record(
        fault,
        locked=ms(trial.locked_s),
        presses=trial.account,
        latest=ms(trial.account.latest_s),
        after=f"open after {ms(trial.opened_s)}",
    )


def presses_work(presser: Presser) -> None:
    """Waits until some more presses came through."""
    since = time.monotonic()
    until(
        lambda: presser.count("published", since) >= WELL,
        f"presses are published: {presser.presses[-1:]}",
    )
