"""The context of a press: its client, and whether the view that the operator saw is stale.

Presses as JSON, as forms and holds all use it. It is evaluated at the moment of sending.
"""

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Final

from app import clock
from app.audit import Origin
from app.audit.press_record import Log, origin_of
from app.errors import InputError
from app.i18n import TextLike, number, say
from app.permission.control_authority import ControlAuthority
from app.permission.press_permission import NO_CONDITIONS, ServerConditions
from app.permission.principal import Principal
from app.permission.verdict import PERMITTED, Verdict, locked
from app.view.publisher import ViewPublisher

MAX_AHEAD_S: Final = 1.0  # tolerance for a press time in the future: rounding and drift
EVENT_ID: Final = r"^[0-9a-f]{1,32}-[0-9]{1,18}$"  # <instance_id>-<version>
MAX_ID_LENGTH: Final = 64
PRESS_ID: Final = rf"^[A-Za-z0-9_.:-]{{1,{MAX_ID_LENGTH}}}$"
_is_event_id: Final = re.compile(EVENT_ID).fullmatch


def never_stale() -> TextLike:
    """For clients that send neither `seen` nor `at`: their presses are never stale."""
    return ""


@dataclass(frozen=True, slots=True)
class PressContext:
    """The client of a press, and the conditions besides the robot's permission.

    `grounds` returns the server's own locks (shutdown, log, control). `stale_reason` returns why the
    view that the operator saw is stale, "" if it is not."""

    origin: Origin
    grounds: Callable[[], ServerConditions] = lambda: NO_CONDITIONS
    stale_reason: Callable[[], TextLike] = never_stale


class PressGuard:
    """Makes the contexts of presses, holds and acts on one robot."""

    def __init__(
        self,
        publisher: ViewPublisher,
        control: ControlAuthority,
        operators_log: Log,
        expires_s: float,
        instance_ids: Callable[[], Collection[str]],
    ) -> None:
        """`instance_ids`: those of the views of all robots. A press with another robot's is refused."""
        self._publisher = publisher
        self._control = control
        self._log = operators_log
        self._expires_s = expires_s
        self._instance_ids = instance_ids
        self._ended = False

    def close(self) -> None:
        """Refuses every command from now on."""
        self._ended = True

    def context_for(
        self, widget: str, who: Principal, seen: str = "", at: float | None = None
    ) -> PressContext:
        """The context of a press or hold of a widget.

        `seen` is the id of the last event that the operator saw, "" if unknown. `at` is the time of the
        press in the server's time. InputError for an invalid `seen`.
        """
        if seen:
            self._check(seen)
        self._control.touch(who)
        return PressContext(
            origin_of(who, seen),
            lambda: self._grounds(who),
            lambda: self._stale_reason(widget, seen, at),
        )

    def act_verdict(self, at: float | None) -> Verdict:
        """Whether the server permits an operator's act; `at` as in `context_for`."""
        if self._ended:
            return locked("server_shutting_down")
        if self._log.lock:
            return Verdict(False, "log", self._log.lock)
        why = "" if at is None else self.late(at)
        return Verdict(False, "late", why) if why else PERMITTED

    def late(self, at: float) -> TextLike:
        """Why a touch at this time (in the server's time) is too old or in the future, else ""."""
        age = clock.server_now() - at
        if age > self._expires_s:
            return say("press_expired", seconds=number(f"{age:.1f}"))
        return say("press_clock_ahead") if age < -MAX_AHEAD_S else ""

    def _check(self, seen: str) -> None:
        instance_id, _, version = seen.partition("-")
        if not _is_event_id(seen):
            raise InputError(f'seen: "{seen:.60}" is not the id of an event')
        if instance_id == self._publisher.instance_id and int(version) > self._publisher.version:
            newest = self._publisher.id
            raise InputError(f"seen: version {version} is not there yet, the newest is {newest}")

    def _grounds(self, who: Principal) -> ServerConditions:
        return ServerConditions(self._control.verdict(who), self._log.lock, self._ended, who)

    def _stale_reason(self, widget: str, seen: str, at: float | None) -> TextLike:
        """Why the view that the operator saw is stale, "" if it is not."""
        instance_id, _, version = seen.partition("-")
        if instance_id and instance_id != self._publisher.instance_id:
            is_other = instance_id in self._instance_ids()
            return say("press_seen_on_another_robot" if is_other else "press_seen_before_restart")
        if instance_id and int(version) < self._publisher.lock_changed_at(widget):
            return say("press_state_changed")
        return "" if at is None else self.late(at)
