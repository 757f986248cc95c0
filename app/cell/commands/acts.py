"""Operators' acts: tables of what a client may do to this server's own state, such as who has control.

A row of a table has the act's permission, what it does and its sentence in the operator's log.
`ActRunner` runs every act alike: permission → apply → log entry → receipt. Unlike a press, an act sends
nothing to the robot. It is checked and applied in one turn of the event loop, and its receipt is
returned when its entry is on the disk. The same id again is the same act.
"""

import asyncio
import hashlib
import logging
from collections.abc import Awaitable, Callable, Collection, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, Final, Generic, NamedTuple, Protocol, TypeVar

from app.cell.commands.receipts import RECEIPTS_KEPT
from app.cell.permission.press_permission import cause_of
from app.cell.permission.roles import ConfirmedBy, role_verdict
from app.cell.permission.verdict import PERMITTED, Verdict
from app.panel.roles import OPERATOR
from app.records.entry import Kind, OutcomeCode
from app.records.press_record import PressLog, origin_of
from app.records.principal import Principal
from app.system.errors import Cause, NotFound
from app.system.limits import BoundedDict
from app.system.log import RobotLog
from app.system.texts import Text, TextLike, joined, say

# The receipt of an act on this server's own state.


@dataclass(frozen=True, slots=True)
class ActReceipt:
    """The result of an act: `code` names why it was refused, `reason` is the sentence for the operator,
    and `cause` decides the HTTP status. All are "" if the act was applied, except that `reason` may
    then say that the act is not safely in the log. `at` is RFC 3339."""

    id: str
    act: str
    outcome: OutcomeCode
    code: str
    reason: TextLike
    at: str
    cause: Cause

    @property
    def done(self) -> bool:
        return self.outcome != "refused"

    def as_json(self) -> dict[str, TextLike]:
        return {
            "id": self.id,
            "act": self.act,
            "outcome": self.outcome,
            "code": self.code,
            "reason": self.reason,
            "at": self.at,
        }


LONGEST_KEPT: Final = 500  # characters of a value of an earlier act
NO_VALUES: Final[Mapping[str, Any]] = {}
Finish = Callable[[], Awaitable[Text | None]]


class ActRequest(NamedTuple):
    """A client's request for an act.

    `object` is the id of what the act is about, such as the client whose request is answered; "" if the
    table is about one thing. `values` are further inputs; they are written to the log. `at` is when the
    operator touched the screen (in the server's time), None if unknown. `scripted` is false for a page
    without scripts, which reloads instead of sending keepalives. `secrets` are neither logged nor kept.
    `confirmed` is who confirmed it with a PIN, None without it. `read` is what was read of `values`
    beside the event loop.
    """

    act: str
    who: Principal
    object: str = ""
    values: Mapping[str, Any] = NO_VALUES
    at: float | None = None
    scripted: bool = True
    secrets: Mapping[str, str] = NO_VALUES
    confirmed: ConfirmedBy | None = None
    read: Mapping[str, Any] = NO_VALUES


class ActGuard(Protocol):
    """The server's own reasons to refuse."""

    def act_verdict(self, at: float | None) -> Verdict:
        """Whether the server permits an act on which the operator touched the screen at `at`."""

    def control_verdict(self, who: Principal) -> Verdict:
        """Whether the client has control."""


@dataclass(frozen=True, slots=True)
class Applied:
    """The result of `Act.apply`. `refusal`: why it changed nothing. `waits`: it is accepted, and its
    effect is yet to come. `finish` ends what takes time, such as a write to the disk, and returns why
    it failed, None if it did not; the entry is made after it. `fails_by` is the cause of a failure.
    `note` is what the receipt says of an act that was applied. `logged`: `finish` makes the entry, and
    this returns why it is not on the disk."""

    refusal: Text | None = None
    waits: bool = False
    finish: Finish | None = None
    fails_by: Cause = "log"
    note: TextLike = ""
    logged: Callable[[], TextLike] | None = None


NOT_APPLIED: Final = Applied()
Subject = TypeVar("Subject")
Result = TypeVar("Result", bound=Applied)


@dataclass(frozen=True, slots=True)
class Act(Generic[Subject, Result]):
    """A row of a table of acts on a subject.

    `word` is the code of its word on the page of the operator's log. `permission` returns whether the
    server permits it now. `apply` does it; done twice, it changes nothing more. `entry` is the sentence
    of the log for what was done. `needs` is the role that it needs; an object may need a further one.
    `confirmable`: an object may say that a person confirms it.
    """

    word: str
    permission: Callable[[ActGuard, ActRequest], Verdict]
    apply: Callable[[Subject, ActRequest], Result]
    entry: Callable[[Result], TextLike]
    needs: str = OPERATOR
    confirmable: bool = False


def server_permits(guard: ActGuard, request: ActRequest) -> Verdict:
    """The permission of most acts: refused at shutdown, without a log, and if it is too late."""
    return guard.act_verdict(request.at)


def server_and_control_permit(guard: ActGuard, request: ActRequest) -> Verdict:
    """The permission of acts for which the client needs control."""
    verdict = server_permits(guard, request)
    return verdict if not verdict.permitted else guard.control_verdict(request.who)


def always(guard: ActGuard, request: ActRequest) -> Verdict:
    """The permission of an act that is never refused, such as giving control up."""
    return PERMITTED


class ActContext(NamedTuple):
    """What all tables of one robot share. `changed` is called when a subject may have changed."""

    guard: ActGuard
    press_log: PressLog
    robot: str
    changed: Callable[[], None]


class ActRunner(Generic[Subject]):
    """Runs the acts of one table on one robot's subject. Used on the event loop only."""

    def __init__(
        self,
        kind: Kind,
        acts: Mapping[str, Act[Subject, Any]],
        subject: Subject,
        context: ActContext,
        further_needs: Callable[[str], Collection[str]] = lambda _: (),
        further_lock: Callable[[ActRequest], Verdict | None] = lambda _: None,
    ) -> None:
        """`kind` is that of the log entries; with the act's name it is their action, such as
        "control_take". `further_needs` returns the roles and groups that acts on an object need,
        `further_lock` why it refuses an act of a client who has them, None if it does not."""
        self._kind = kind
        self._acts = acts
        self._subject = subject
        self._further_needs = further_needs
        self._further_lock = further_lock
        self._context = context
        self._press_log = context.press_log
        self._log = RobotLog(logging.getLogger(f"kiosk.{kind}"), context.robot)
        self._made = BoundedDict[str, tuple[ActRequest, asyncio.Task[ActReceipt]]](RECEIPTS_KEPT)

    async def act(self, request: ActRequest, act_id: str) -> ActReceipt:
        """Applies an act or refuses it; NotFound for an act that is not in the table."""
        if request.act not in self._acts:
            raise NotFound(f'there is no act "{request.act:.40}": there is {", ".join(self._acts)}')
        if made := self._made.get(act_id):
            earlier, task = made
            if not _same_act(earlier, _comparable(request)):
                return _refused(request, act_id, "press_id_reused", say("press_id_reused", id=act_id))
        else:
            task = self._begin(request, act_id)
        return await asyncio.shield(task)

    def receipt(self, act_id: str) -> ActReceipt | None:
        """The receipt of an earlier act, for pages without scripts."""
        made = self._made.get(act_id)
        return made[1].result() if made and made[1].done() and not made[1].cancelled() else None

    def request(self, act_id: str) -> ActRequest | None:
        """The request of an earlier act."""
        made = self._made.get(act_id)
        return made[0] if made else None

    def limited(self, request: ActRequest, act_id: str, reason: Text) -> ActReceipt:
        """The receipt of an act over the rate limit. The client may repeat it later with the same
        id."""
        return _refused(request, act_id, reason.code, reason, "limit")

    def _begin(self, request: ActRequest, act_id: str) -> "asyncio.Task[ActReceipt]":
        """Applies the act at once; the task returned ends when its entry is written."""
        receipt, entry, applied = self._applied(request, act_id)
        task = asyncio.ensure_future(self._ended(request, receipt, entry, applied))
        self._made[act_id] = _comparable(request), task
        return task

    def _applied(self, request: ActRequest, act_id: str) -> tuple[ActReceipt, TextLike, Applied]:
        """The receipt, the sentence of the log, and what was applied."""
        act = self._acts[request.act]
        needs = {act.needs, *self._further_needs(request.object)}
        verdict = role_verdict(needs, request.who) or self._further_lock(request)
        verdict = verdict or act.permission(self._context.guard, request)
        if not verdict.permitted:
            reason = verdict.reason or ""
            return _refused(request, act_id, verdict.code, reason), reason, NOT_APPLIED
        applied = act.apply(self._subject, request)
        self._context.changed()
        if refusal := applied.refusal:
            return _refused(request, act_id, refusal.code, refusal), refusal, applied
        outcome: OutcomeCode = "accepted" if applied.waits else "succeeded"
        confirmed = request.confirmed.sentence if request.confirmed else ""
        note = joined((applied.note, confirmed))
        receipt = ActReceipt(act_id, request.act, outcome, "", note, _now(), "")
        return receipt, joined((act.entry(applied), confirmed)), applied

    async def _ended(
        self, request: ActRequest, receipt: ActReceipt, entry: TextLike, applied: Applied
    ) -> ActReceipt:
        """The receipt of an act that is over and logged."""
        finish = applied.finish if receipt.done else None
        if finish is not None and (failure := await finish()):
            cause = applied.fails_by
            receipt, entry = _refused(request, receipt.id, failure.code, failure, cause), failure
        if finish is not None:
            self._context.changed()
        if not receipt.done:
            self._log.warning(
                "%s: %s by %s: refused: %s", self._kind, request.act, request.who, receipt.reason
            )
        if receipt.done and applied.logged is not None:
            return _with_fault(receipt, entry, applied.logged())
        return await self._logged(request, receipt, entry)

    async def _logged(self, request: ActRequest, receipt: ActReceipt, entry: TextLike) -> ActReceipt:
        origin = origin_of(request.who)
        if not receipt.done and not self._press_log.has_room(origin):
            self._press_log.count_unlogged(origin)
            return receipt
        action, values = f"{self._kind}_{request.act}", request.values
        fault = await self._press_log.acted(
            self._kind, action, receipt.id, origin, receipt.outcome, entry, values
        )
        return _with_fault(receipt, entry, fault)


def same_principal(who: Principal, other: Principal | None) -> bool:
    """Whether both are the same client (or, without a cookie, have the same address)."""
    if other is None or who.client.id != other.client.id:
        return False
    return bool(who.client.id) or who.client.address == other.client.address


def _comparable(request: ActRequest) -> ActRequest:
    """The request as it is kept to recognize a repetition: of a long text its hash."""
    values = {
        name: hashlib.sha256(value.encode("utf-8", "surrogatepass")).hexdigest()
        if isinstance(value, str) and len(value) > LONGEST_KEPT
        else value
        for name, value in request.values.items()
    }
    return request._replace(values=values, secrets=NO_VALUES, read=NO_VALUES)


def _same_act(earlier: ActRequest, request: ActRequest) -> bool:
    same = (earlier.act, earlier.object) == (request.act, request.object)
    return same and earlier.values == request.values and same_principal(earlier.who, request.who)


def _with_fault(receipt: ActReceipt, entry: TextLike, fault: TextLike) -> ActReceipt:
    """The receipt; it says so if its entry is not safely in the log."""
    if not fault:
        return receipt
    return replace(receipt, reason=say("log_not_on_disk", said=entry, why=fault))


def _refused(
    request: ActRequest, act_id: str, code: str, reason: TextLike, cause: Cause | None = None
) -> ActReceipt:
    why = cause_of(code) if cause is None else cause
    return ActReceipt(act_id, request.act, "refused", code, reason, _now(), why)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
