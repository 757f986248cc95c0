"""Acts on control authority (take, ask, give, keep, release): guarded, logged, answered like presses.

An act changes nothing but this server's own state: it is judged and done in one turn of the event loop,
and its receipt is given when its entry is on the disk. The same id again is the same act.
"""

import asyncio
import logging
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Final, Literal, NamedTuple, get_args

from app.audit.press_record import PressLog, origin_of
from app.commands.press_context import PressGuard
from app.commands.receipts import RECEIPTS_KEPT
from app.errors import Cause, NotFound
from app.i18n import TextLike, say
from app.permission.control_authority import LIFE_S, ControlAuthority, Passing
from app.permission.press_permission import cause_of
from app.permission.principal import Principal
from app.robot.command_status import OutcomeCode
from app.ros_logging import RobotLog

log = logging.getLogger("kiosk.control")

Act = Literal["take", "ask", "give", "keep", "release"]
ACTS: Final = get_args(Act)


class Asked(NamedTuple):
    """What a client asks for; `to` is the client id of the request that `give` and `keep` answer."""

    act: str
    who: Principal
    to: str = ""


@dataclass(frozen=True, slots=True)
class ActReceipt:
    """The result of an act: `code` names why it was refused, `reason` says it to the operator, and
    `cause` decides the HTTP status. All are "" where it was done; only a `reason` may then say that the
    act is not safely in the log. `at` is RFC 3339."""

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


class ControlActs:
    """Of one robot; used on the event loop only."""

    def __init__(
        self,
        control: ControlAuthority,
        press_guard: PressGuard,
        press_log: PressLog,
        robot: str,
        show: Callable[[], None],
    ) -> None:
        """`show` is called when who has control may have changed."""
        self._control = control
        self._guard = press_guard
        self._press_log = press_log
        self._log = RobotLog(log, robot)
        self._show = show
        self._made: OrderedDict[str, tuple[Asked, asyncio.Task[ActReceipt]]] = OrderedDict()

    async def act(
        self, asked: Asked, act_id: str, at: float | None = None, life_s: float = LIFE_S
    ) -> ActReceipt:
        """Does it, or refuses; NotFound for what is no act.

        `at` is when it was touched (the server's own time), None where that is not known; the client
        counts as present for `life_s`.
        """
        if asked.act not in ACTS:
            raise NotFound(f'there is no "/control/{asked.act:.40}": there is {", ".join(ACTS)}, here')
        if known := self._made.get(act_id):
            before, task = known
            if (before.act, before.to) != (asked.act, asked.to) or not _same(before.who, asked.who):
                return _receipt(asked, act_id, "press_reused", say("press_reused", id=act_id))
        else:
            task = self._begin(asked, act_id, at, life_s)
        return await asyncio.shield(task)

    def receipt(self, act_id: str) -> ActReceipt | None:
        """The receipt of an act that was made; a page without scripts shows it."""
        known = self._made.get(act_id)
        return known[1].result() if known and known[1].done() and not known[1].cancelled() else None

    def limited(self, asked: Asked, act_id: str) -> ActReceipt:
        """Of one that its client may do later, by the same id."""
        return _receipt(asked, act_id, "control_too_often", say("control_too_often"), "limit")

    def passed(self, passing: Passing) -> None:
        """Control changed by no act: an entry of the log, for which no one waits."""
        who, other = passing.who, passing.other.title if passing.other else say("no_client")
        reason = say(f"log_{passing.code}", name=who.title, other=other)
        self._press_log.note(passing.code, origin_of(who), reason)

    def _begin(
        self, asked: Asked, act_id: str, at: float | None, life_s: float
    ) -> "asyncio.Task[ActReceipt]":
        """The act itself, at once; its entry takes time."""
        entry: TextLike = ""
        refusal = self._refusal(asked, at)
        if refusal is None:
            before = self._control.holder, self._control.requester
            code = self._do(asked, life_s)
            refusal = (code, say(code)) if code else None
            entry = "" if refusal else self._entry(asked, *before)
            self._show()
        if refusal is None:
            waits = asked.act == "ask" and not _same(asked.who, self._control.holder)
            receipt = _receipt(asked, act_id, outcome="accepted" if waits else "succeeded")
        else:
            receipt = _receipt(asked, act_id, *refusal)
            self._log.warning("control: %s by %s: refused: %s", asked.act, asked.who, receipt.reason)
        task = asyncio.ensure_future(self._logged(asked, receipt, entry or receipt.reason))
        self._made[act_id] = asked, task
        while len(self._made) > RECEIPTS_KEPT:
            self._made.popitem(last=False)
        return task

    def _refusal(self, asked: Asked, at: float | None) -> tuple[str, TextLike] | None:
        """Code and sentence of what the server has against it; giving up is never too late."""
        if asked.act == "release":
            return None
        verdict = self._guard.act_verdict(at)
        return None if verdict.permitted else (verdict.code, verdict.reason or "")

    def _do(self, asked: Asked, life_s: float) -> str:
        """Why it was refused, "" where it was done."""
        control, who = self._control, asked.who
        match asked.act:
            case "take":
                return control.take(who, life_s)
            case "ask":
                return control.ask(who, life_s)
            case "give":
                return control.give(who, asked.to)
            case "keep":
                return control.keep(who, asked.to)
        return control.release(who)

    def _entry(self, asked: Asked, holder: Principal | None, requester: Principal | None) -> TextLike:
        """What was done, in the log's words: `holder` and `requester` are those before it."""
        names = {"holder": holder, "requester": requester}
        code = f"log_done_{asked.act}"
        if asked.act in ("take", "ask") and _same(asked.who, self._control.holder):
            over = holder is not None and not _same(asked.who, holder)
            code = "log_done_take_over" if over else "log_done_take"
        elif asked.act == "release" and not _same(asked.who, holder):
            code = "log_done_withdraw"
        return say(code, **{name: who.title if who else "" for name, who in names.items()})

    async def _logged(self, asked: Asked, receipt: ActReceipt, entry: TextLike) -> ActReceipt:
        origin = origin_of(asked.who)
        if not receipt.done and not self._press_log.room(origin):
            self._press_log.leave_out(origin)
            return receipt
        action = f"control_{asked.act}"
        doubt = await self._press_log.acted(action, receipt.id, origin, receipt.outcome, entry)
        if not doubt:
            return receipt
        return replace(receipt, reason=say("log_not_on_disk", said=entry, why=doubt))


def _same(who: Principal, other: Principal | None) -> bool:
    """Whether these are one client; without a cookie, one address."""
    if other is None or who.client.id != other.client.id:
        return False
    return bool(who.client.id) or who.client.address == other.client.address


def _receipt(
    asked: Asked,
    act_id: str,
    code: str = "",
    reason: TextLike = "",
    cause: Cause | None = None,
    *,
    outcome: OutcomeCode = "refused",
) -> ActReceipt:
    at = datetime.now(UTC).isoformat(timespec="milliseconds")
    why = cause if cause is not None else cause_of(code) if code else ""
    return ActReceipt(act_id, asked.act, outcome, code, reason, at, why)
