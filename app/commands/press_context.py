"""Who presses, and why what he saw may no longer be what he means: judged in the moment of sending.

The one place for this, whether a press comes as JSON, as a form or as a hold.
"""

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Final

from app import clock
from app.audit import Origin
from app.audit.press_record import Log, origin_of
from app.errors import InputError
from app.i18n import TextLike, say
from app.permission.control_authority import ControlAuthority
from app.permission.interlocks import PERMITTED, Verdict, locked
from app.permission.press_permission import NO_GROUNDS, Grounds
from app.permission.principal import Principal
from app.view.publisher import ViewPublisher

AHEAD_S: Final = 1.0  # a press can't be from later than now, but for rounding and drift
SEEN: Final = r"^[0-9a-f]{1,32}-[0-9]{1,18}$"  # <boot>-<version>, an event's id
LONGEST_ID: Final = 64
PRESS_ID: Final = rf"^[A-Za-z0-9_.:-]{{1,{LONGEST_ID}}}$"
_is_seen: Final = re.compile(SEEN).fullmatch


def not_stale() -> TextLike:
    """Of a client that does not say what was seen, and when it was pressed."""
    return ""


@dataclass(frozen=True, slots=True)
class PressContext:
    """Who presses, and what has to hold beside the robot's permission when it is sent.

    `grounds` is what the server has against it, `stale_reason` why what the operator saw is no longer
    so, "" if it still is."""

    origin: Origin
    grounds: Callable[[], Grounds] = lambda: NO_GROUNDS
    stale_reason: Callable[[], TextLike] = not_stale


class PressGuard:
    """Of one robot's controls."""

    def __init__(
        self,
        publisher: ViewPublisher,
        control: ControlAuthority,
        operators_log: Log,
        expires_s: float,
        boots: Callable[[], Collection[str]],
    ) -> None:
        """`boots` are those of all robots' boards, by which a page of another one is told."""
        self._publisher = publisher
        self._control = control
        self._log = operators_log
        self._expires_s = expires_s
        self._boots = boots
        self._ended = False

    def end(self) -> None:
        """From now on nothing is sent any more."""
        self._ended = True

    def by(self, widget: str, who: Principal, seen: str = "", at: float | None = None) -> PressContext:
        """Who presses or holds a widget, and what has to hold for that at every moment.

        `seen` is the id of the last event that the operator saw, "" where that is not known; `at`
        is when it was pressed, in the server's own time. InputError for what can't have been seen.
        """
        if seen:
            self._check(seen)
        self._control.touch(who)
        return PressContext(
            origin_of(who, seen),
            lambda: self._grounds(who),
            lambda: self._doubt(widget, seen, at),
        )

    def act_verdict(self, at: float | None) -> Verdict:
        """What the server has against an act that is no press, touched at this moment (the server's own
        time, None where it is not known)."""
        if self._ended:
            return locked("ending")
        if self._log.lock:
            return Verdict(False, "log", self._log.lock)
        why = "" if at is None else self.late(at)
        return Verdict(False, "late", why) if why else PERMITTED

    def late(self, at: float) -> TextLike:
        """Why what was touched at this moment (the server's own time) is not done now; "" if it is."""
        age = clock.server_now() - at
        if age > self._expires_s:
            return say("expired", seconds=f"{age:.1f}")
        return say("ahead") if age < -AHEAD_S else ""

    def _check(self, seen: str) -> None:
        boot, _, version = seen.partition("-")
        if not _is_seen(seen):
            raise InputError(f'seen: "{seen:.60}" is not the id of an event')
        if boot == self._publisher.boot and int(version) > self._publisher.version:
            newest = self._publisher.id
            raise InputError(f"seen: version {version} is not there yet, the newest is {newest}")

    def _grounds(self, who: Principal) -> Grounds:
        return Grounds(self._control.verdict(who), self._log.lock, self._ended, who)

    def _doubt(self, widget: str, seen: str, at: float | None) -> TextLike:
        """Why a press is no longer what was meant; "" if it is."""
        boot, _, version = seen.partition("-")
        if boot and boot != self._publisher.boot:
            return say("seen_on_another" if boot in self._boots() else "seen_before_restart")
        if boot and int(version) < self._publisher.lock_changed_at(widget):
            return say("changed_meanwhile")
        return "" if at is None else self.late(at)
