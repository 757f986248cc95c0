"""The server's own conditions for a press, and whether the view that the operator saw is stale.

They are the same for presses as JSON, as forms and for holds.
"""

import re
from collections.abc import Callable, Collection, Mapping
from typing import Final

from app import clock
from app.audit.press_record import Log
from app.commands.press import EVENT_ID, Press
from app.errors import InputError
from app.i18n import TextLike, number, say
from app.panel.widgets.families import Command
from app.permission.confirmations import UNKNOWN_USERS, ConfirmLocks
from app.permission.control_authority import ControlAuthority
from app.permission.press_permission import ServerConditions
from app.permission.principal import Principal
from app.permission.verdict import PERMITTED, Verdict, locked
from app.view.publisher import ViewPublisher

MAX_AHEAD_S: Final = 1.0  # tolerance for a press time in the future: rounding and drift
NO_NEEDS: Final[Mapping[str, frozenset[str]]] = {}
_is_event_id: Final = re.compile(EVENT_ID).fullmatch


class PressGuard:
    """The server's conditions for presses, holds and acts on one robot, evaluated at the moment of
    sending."""

    def __init__(
        self,
        publisher: ViewPublisher,
        control: ControlAuthority,
        operators_log: Log,
        expires_s: float,
        instance_ids: Callable[[], Collection[str]],
        inhibited: Callable[[], Mapping[str, Verdict]] = dict,
        shared: Collection[str] = (),
        publisher_by_id: Callable[[str], ViewPublisher | None] = lambda _: None,
        needs: Mapping[str, frozenset[str]] = NO_NEEDS,
        confirm_locks: ConfirmLocks = UNKNOWN_USERS,
    ) -> None:
        """`instance_ids`: those of the views of all robots. A press with another robot's is refused,
        unless its widget is on the pages of all (`shared`). `inhibited` returns the locks by alarms, by
        the widgets' ids; `needs` has the roles and groups that a command needs, by its id.
        `confirm_locks` says why no person can confirm a press."""
        self._publisher = publisher
        self._control = control
        self._log = operators_log
        self._expires_s = expires_s
        self._instance_ids = instance_ids
        self._inhibited = inhibited
        self._shared = shared
        self._publisher_by_id = publisher_by_id
        self._needs = needs
        self._confirm_locks = confirm_locks
        self._ended = False

    def close(self) -> None:
        """Refuses every command from now on."""
        self._ended = True

    def receive(self, press: Press[Command]) -> None:
        """Accepts a press or hold that has arrived: its client is present. InputError for an invalid
        `seen`."""
        if press.seen:
            self._check(press.seen, self._publisher_of(press))
        self._control.touch(press.principal)

    def conditions(self, who: Principal) -> ServerConditions:
        """The server's own locks for a client: shutdown, log, control, alarms."""
        control, lock = self._control.verdict(who), self._log.lock
        return ServerConditions(
            control, lock, self._ended, who, self._inhibited(), self._needs, self._confirm_locks
        )

    def stale_reason(self, press: Press[Command]) -> TextLike:
        """Why the view that the operator saw is stale, "" if it is not. It is not if the press has
        neither `seen` nor `at`."""
        instance_id, _, version = press.seen.partition("-")
        publisher = self._publisher_of(press)
        if instance_id and instance_id != publisher.instance_id:
            is_other = instance_id in self._instance_ids()
            return say("press_seen_on_another_robot" if is_other else "press_seen_before_restart")
        if instance_id and int(version) < publisher.lock_changed_at(press.widget.id):
            return say("press_state_changed")
        return "" if press.at is None else self.late(press.at)

    def act_verdict(self, at: float | None) -> Verdict:
        """Whether the server permits an operator's act; `at` as in a press."""
        if self._ended:
            return locked("server_shutting_down")
        if self._log.lock:
            return Verdict(False, "log", self._log.lock)
        why = "" if at is None else self.late(at)
        return Verdict(False, "late", why) if why else PERMITTED

    def control_verdict(self, who: Principal) -> Verdict:
        """Whether a client has control, or needs none; an act keeps it."""
        self._control.touch(who)
        return self._control.verdict(who)

    def late(self, at: float) -> TextLike:
        """Why a touch at this time (in the server's time) is too old or in the future, else ""."""
        age = clock.server_now() - at
        if age > self._expires_s:
            return say("press_expired", seconds=number(f"{age:.1f}"))
        return say("press_clock_ahead") if age < -MAX_AHEAD_S else ""

    def _publisher_of(self, press: Press[Command]) -> ViewPublisher:
        """The publisher of the page that the operator saw, which may be another robot's."""
        if press.widget.id in self._shared:
            return self._publisher_by_id(press.seen.partition("-")[0]) or self._publisher
        return self._publisher

    def _check(self, seen: str, publisher: ViewPublisher) -> None:
        instance_id, _, version = seen.partition("-")
        if not _is_event_id(seen):
            raise InputError(f'seen: "{seen:.60}" is not the id of an event')
        if instance_id == publisher.instance_id and int(version) > publisher.version:
            newest = publisher.id
            raise InputError(f"seen: version {version} is not there yet, the newest is {newest}")
