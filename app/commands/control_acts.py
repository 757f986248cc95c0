"""Acts on control authority (take, ask, give, keep, release): checked, logged and answered like
presses.

An act changes only this server's state. It is checked and applied in one turn of the event loop, and
its receipt is returned when its entry is on the disk. The same id again is the same act.
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
from app.permission.control_authority import LIFE_S, ControlAuthority
from app.permission.control_parties import HandOver
from app.permission.press_permission import cause_of
from app.permission.principal import Principal
from app.robot.command_status import OutcomeCode
from app.ros_logging import RobotLog

log = logging.getLogger("kiosk.control")

Act = Literal["take", "ask", "give", "keep", "release"]
ACTS: Final = get_args(Act)


class ActRequest(NamedTuple):
    """A client's request for an act; `to` is the client id of the request that `give` and `keep`
    answer."""

    act: str
    who: Principal
    to: str = ""


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


class ControlActs:
    """The acts on one robot's control authority. Used on the event loop only."""

    def __init__(
        self,
        control: ControlAuthority,
        press_guard: PressGuard,
        press_log: PressLog,
        robot: str,
        show: Callable[[], None],
    ) -> None:
        """`show` is called when the holder of control may have changed."""
        self._control = control
        self._guard = press_guard
        self._press_log = press_log
        self._log = RobotLog(log, robot)
        self._show = show
        self._acts: OrderedDict[str, tuple[ActRequest, asyncio.Task[ActReceipt]]] = OrderedDict()

    async def act(
        self, request: ActRequest, act_id: str, at: float | None = None, life_s: float = LIFE_S
    ) -> ActReceipt:
        """Applies an act or refuses it; NotFound for an unknown act.

        `at` is when the operator touched the control (in the server's time), None if unknown. The
        client counts as present for `life_s`.
        """
        if request.act not in ACTS:
            raise NotFound(
                f'there is no "/control/{request.act:.40}": there is {", ".join(ACTS)}, here'
            )
        if known := self._acts.get(act_id):
            earlier, task = known
            same_act = (earlier.act, earlier.to) == (request.act, request.to)
            if not (same_act and _same(earlier.who, request.who)):
                return _receipt(request, act_id, "press_id_reused", say("press_id_reused", id=act_id))
        else:
            task = self._begin(request, act_id, at, life_s)
        return await asyncio.shield(task)

    def receipt(self, act_id: str) -> ActReceipt | None:
        """The receipt of an earlier act, for pages without scripts."""
        known = self._acts.get(act_id)
        return known[1].result() if known and known[1].done() and not known[1].cancelled() else None

    def limited(self, request: ActRequest, act_id: str) -> ActReceipt:
        """The receipt of an act over the rate limit. The client may repeat it later with the same
        id."""
        return _receipt(request, act_id, "control_too_often", say("control_too_often"), "limit")

    def log_hand_over(self, hand_over: HandOver) -> None:
        """Logs a change of control without an act, such as a timeout. Does not wait for the disk."""
        who, other = hand_over.who, hand_over.other.title if hand_over.other else say("control_no_one")
        reason = say(f"log_control_{hand_over.how}", name=who.title, other=other)
        self._press_log.note(f"control_{hand_over.how}", origin_of(who), reason)

    def _begin(
        self, request: ActRequest, act_id: str, at: float | None, life_s: float
    ) -> "asyncio.Task[ActReceipt]":
        """Applies the act at once; the task returned ends when its entry is written."""
        entry: TextLike = ""
        refusal = self._refusal(request, at)
        if refusal is None:
            before = self._control.holder, self._control.requester
            code = self._apply(request, life_s)
            refusal = (code, say(code)) if code else None
            entry = "" if refusal else self._entry_text(request, *before)
            self._show()
        if refusal is None:
            waits = request.act == "ask" and not _same(request.who, self._control.holder)
            receipt = _receipt(request, act_id, outcome="accepted" if waits else "succeeded")
        else:
            receipt = _receipt(request, act_id, *refusal)
            self._log.warning(
                "control: %s by %s: refused: %s", request.act, request.who, receipt.reason
            )
        task = asyncio.ensure_future(self._logged(request, receipt, entry or receipt.reason))
        self._acts[act_id] = request, task
        while len(self._acts) > RECEIPTS_KEPT:
            self._acts.popitem(last=False)
        return task

    def _refusal(self, request: ActRequest, at: float | None) -> tuple[str, TextLike] | None:
        """Code and sentence of the server's reason to refuse. Giving control up is never refused."""
        if request.act == "release":
            return None
        verdict = self._guard.act_verdict(at)
        return None if verdict.permitted else (verdict.code, verdict.reason or "")

    def _apply(self, request: ActRequest, life_s: float) -> str:
        """Applies the act; the code of the reason if control authority refuses it, else ""."""
        control, who = self._control, request.who
        match request.act:
            case "take":
                return control.take(who, life_s)
            case "ask":
                return control.ask(who, life_s)
            case "give":
                return control.give(who, request.to)
            case "keep":
                return control.keep(who, request.to)
        return control.release(who)

    def _entry_text(
        self, request: ActRequest, holder: Principal | None, requester: Principal | None
    ) -> TextLike:
        """The log's sentence for an act; `holder` and `requester` are those before it."""
        names = {"holder": holder, "requester": requester}
        code = f"log_done_{request.act}"
        if request.act in ("take", "ask") and _same(request.who, self._control.holder):
            over = holder is not None and not _same(request.who, holder)
            code = "log_done_take_over" if over else "log_done_take"
        elif request.act == "release" and not _same(request.who, holder):
            code = "log_done_withdraw"
        return say(code, **{name: who.title if who else "" for name, who in names.items()})

    async def _logged(self, request: ActRequest, receipt: ActReceipt, entry: TextLike) -> ActReceipt:
        origin = origin_of(request.who)
        if not receipt.done and not self._press_log.has_room(origin):
            self._press_log.count_unlogged(origin)
            return receipt
        action = f"control_{request.act}"
        fault = await self._press_log.acted(action, receipt.id, origin, receipt.outcome, entry)
        if not fault:
            return receipt
        return replace(receipt, reason=say("log_not_on_disk", said=entry, why=fault))


def _same(who: Principal, other: Principal | None) -> bool:
    """Whether both are the same client (or, without a cookie, have the same address)."""
    if other is None or who.client.id != other.client.id:
        return False
    return bool(who.client.id) or who.client.address == other.client.address


def _receipt(
    request: ActRequest,
    act_id: str,
    code: str = "",
    reason: TextLike = "",
    cause: Cause | None = None,
    *,
    outcome: OutcomeCode = "refused",
) -> ActReceipt:
    at = datetime.now(UTC).isoformat(timespec="milliseconds")
    why = cause if cause is not None else cause_of(code) if code else ""
    return ActReceipt(act_id, request.act, outcome, code, reason, at, why)
