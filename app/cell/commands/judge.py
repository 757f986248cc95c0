"""Decides whether a press may be sent: by permission, by the view that the operator saw, and by rate
limits."""

import re
import time
from collections.abc import Callable, Collection, Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Final

from app.cell.commands.press import EVENT_ID, Press
from app.cell.commands.receipts import MAX_FINAL_CHECKS, Refusal
from app.cell.permission.client_limits import RATE_LIMITS, RateGuard
from app.cell.permission.control import ControlAuthority
from app.cell.permission.press_permission import ServerConditions, cause_of, judged, with_hint
from app.cell.permission.roles import UNKNOWN_USERS, ConfirmLocks
from app.cell.permission.verdict import PERMITTED, Verdict, locked
from app.cell.robot.state import RobotState
from app.cell.view.publisher import ViewPublisher
from app.panel.model import Panel
from app.panel.widgets.families import Command
from app.panel.widgets.key_parts import confirmation_of
from app.panel.widgets.templated import is_stop
from app.records import Origin
from app.records.press_record import Log, PendingEntry, origin_of
from app.records.principal import Principal
from app.system import clock
from app.system.errors import InputError, PressRefused
from app.system.texts import TextLike, number, say

# The server's own conditions for a press, and whether the view that the operator saw is stale.
#
# They are the same for presses as JSON, as forms and for holds.

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
        self._ending = ""  # the code of the lock

    def close(self, code: str = "server_shutting_down") -> None:
        """Refuses every command from now on, with the first reason that it was closed for."""
        self._ending = self._ending or code

    def reopen(self) -> None:
        """Permits commands again: the server does not end after all."""
        self._ending = ""

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
            control, lock, self._ending, who, self._inhibited(), self._needs, self._confirm_locks
        )

    def stale_reason(self, press: Press[Command]) -> TextLike:
        """Why the view that the operator saw is stale, "" if it is not. It is not if the press has
        neither `seen` nor `at`. A stop needs no view of its own lock."""
        instance_id, _, version = press.seen.partition("-")
        publisher = self._publisher_of(press)
        if instance_id and instance_id != publisher.instance_id:
            is_other = instance_id in self._instance_ids()
            return say("press_seen_on_another_robot" if is_other else "press_seen_before_restart")
        changed_at = 0 if is_stop(press.widget) else publisher.lock_changed_at(press.widget.id)
        if instance_id and int(version) < changed_at:
            return say("press_state_changed")
        return "" if press.at is None else self.late(press.at)

    def act_verdict(self, at: float | None) -> Verdict:
        """Whether the server permits an operator's act; `at` as in a press."""
        if self._ending:
            return locked(self._ending)
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
        """The publisher of the page that the operator saw, which may be another robot's: a stop button
        may be for several robots."""
        if press.widget.id in self._shared or is_stop(press.widget):
            return self._publisher_by_id(press.seen.partition("-")[0]) or self._publisher
        return self._publisher

    def _check(self, seen: str, publisher: ViewPublisher) -> None:
        instance_id, _, version = seen.partition("-")
        if not _is_event_id(seen):
            raise InputError(f'seen: "{seen:.60}" is not the id of an event')
        if instance_id == publisher.instance_id and int(version) > publisher.version:
            newest = publisher.id
            raise InputError(f"seen: version {version} is not there yet, the newest is {newest}")


# Decides whether a press may be sent, from everything that has arrived from the robot so far.


@dataclass(frozen=True, slots=True)
class PendingSamples:
    """Data that has arrived from the robot: `ingest` applies it to the robot's state, `has_urgent`
    returns whether more has arrived that may change a permission."""

    ingest: Callable[[], None] = lambda: None
    has_urgent: Callable[[], bool] = lambda: False


@dataclass(frozen=True, slots=True)
class Judgement:
    """Whether a press may be sent: the verdict of the permission's checks, and the `refusal`, None if
    it may. A permitted press is refused if its page is outdated."""

    verdict: Verdict
    refusal: Refusal | None = None


class PressJudge:
    """Judges the presses and holds of one robot. Used on the event loop only. Callers must not await
    between the judgement and sending."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        guard: PressGuard,
        arrivals: PendingSamples,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self.arrivals = arrivals
        self._panel = panel
        self._robot = robot
        self._guard = guard
        self._monotonic = monotonic
        self._closed = False

    def close(self) -> None:
        """Refuses every press from now on."""
        self._closed = True

    def verdict(self, press: Press[Command], now: float) -> Verdict:
        """The verdict of the permission's checks at `now` (monotonic seconds). Ingests nothing."""
        interlocks = self._panel.interlocks_of(press.widget)
        conditions = self._guard.conditions(press.principal)
        if confirmation_of(press.widget):
            conditions = replace(conditions, pressed=True, confirmed=press.confirmed)
        verdict = judged(press.widget, interlocks, self._robot, now, conditions)
        return with_hint(self._panel, press.widget, verdict)

    def judge_at(self, press: Press[Command], now: float) -> Judgement:
        """Whether a press or hold may be sent at `now` (monotonic seconds). Ingests nothing."""
        verdict = self.verdict(press, now)
        if not verdict.permitted:
            return Judgement(verdict, Refusal(verdict.reason or "", cause_of(verdict.code)))
        stale = self._guard.stale_reason(press)
        return Judgement(verdict, Refusal(stale, "interlock") if stale else None)

    def judge(self, press: Press[Command]) -> Judgement:
        """Whether a press may be sent now, after ingesting what has arrived."""
        self.arrivals.ingest()
        judgement = self.judge_at(press, self._monotonic())
        if self._closed and judgement.verdict.permitted:
            return replace(judgement, refusal=Refusal(say("press_during_shutdown"), "interlock"))
        return judgement

    def final_check(self, press: Press[Command], pending: PendingEntry) -> None:
        """Called right before sending: judges again if more has arrived since the judgement.
        PressRefused if the press may not be sent."""
        for _ in range(MAX_FINAL_CHECKS):
            if not self.arrivals.has_urgent():
                return
            judgement = self.judge(press)
            pending.set_verdict(judgement.verdict.code)
            if judgement.refusal:
                raise PressRefused(*judgement.refusal)
        raise PressRefused(say("link_catching_up"), "link")


# Rate limits of presses, for all robots together. A press over a limit is not checked, sent or
# recorded.

RETRY_AFTER_S: Final = RATE_LIMITS["presses"].retry_after_s


class PressLimits:
    """The rate limits of one server. Used on the event loop only."""

    def __init__(
        self, leave_out: Callable[[Origin], None], monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        """`leave_out` counts a refused press for the operator's log, which has no entry of it."""
        self._count_unlogged = leave_out
        rows = "presses", "address_presses", "other_presses", "cancels"
        self._guard = RateGuard(*rows, monotonic=monotonic)
        self.refused = 0

    def admit(self, who: Principal) -> bool:
        """Whether a client may press now. Counts refused presses, here and for the log."""
        client = who.client
        return self._admitted(
            who,
            presses=(client.address, client.id),
            address_presses=client.address,
            other_presses="",
        )

    def admit_cancel(self, who: Principal, *goal: str) -> bool:
        """Whether a goal may be canceled now. The limit is per goal, so that presses and other goals
        never block a cancel."""
        return self._admitted(who, cancels=goal)

    def _admitted(self, who: Principal, **keys: Hashable) -> bool:
        if self._guard.exceeded(who.client.local, **keys) is None:
            return True
        self.refused += 1
        self._count_unlogged(origin_of(who))
        return False
