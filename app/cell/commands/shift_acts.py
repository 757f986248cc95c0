"""Acts of a shift: the rows of a message to the next shift, of the reason of a stop, of "later", of a
fault parcel, and of a recording that is shared with Foxglove.

`ActRequest.values` has the `text` of a message; of a stop its key `stop`, when it `began` (RFC 3339)
and the id of its `reason`. `object` is then the key of the stop. All of it is only in the operator's
log, in the entry of its act: the newest reason of a stop counts.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from app.cell.commands.acts import Act, ActRequest, Applied, server_permits
from app.panel.roles import MAINTENANCE
from app.panel.rules import OeeRules
from app.system.clock import format_time
from app.system.texts import Text, TextLike, say

LONGEST_MESSAGE: Final = 400
SHIFT_ACTION: Final = "alarm_message"  # of the entries of messages
REASON_ACTION: Final = "alarm_reason"  # of those of reasons


@dataclass(frozen=True, slots=True, kw_only=True)
class StopAct(Applied):
    """What was said of the stop that began at `began`."""

    label: TextLike = ""
    began: TextLike = ""


def _leave(_: OeeRules | None, request: ActRequest) -> Applied:
    """The entry of the act is the message."""
    text = str(request.values.get("text", "")).strip()
    return Applied(None if text else say("alarms_message_empty"))


def _answer(rules: OeeRules | None, request: ActRequest) -> StopAct:
    """The entry of the act is the reason."""
    chosen = request.values.get("reason")
    reason = next((each for each in (rules.reasons if rules else ()) if each.id == chosen), None)
    if reason is None:
        return StopAct(say("oee_reason_unknown"))
    return StopAct(label=reason.label, began=_began(request))


def _postpone(_: OeeRules | None, request: ActRequest) -> StopAct:
    return StopAct(began=_began(request))


def _take(_: OeeRules | None, request: ActRequest) -> StopAct:
    """The caller makes the parcel, or shares the recording, once the act is logged."""
    return StopAct(began=_began(request))


def _began(request: ActRequest) -> TextLike:
    return format_time(datetime.fromisoformat(str(request.values["began"])).timestamp())


def _answered(act: StopAct) -> Text:
    return say("log_done_stop_reason", reason=act.label, time=act.began)


def needs_of_reason(rules: OeeRules | None, stop: str) -> tuple[str, ...]:
    """The role or group that says why it stood still, for an act on a stop ("" for another act)."""
    return (rules.needs,) if stop and rules and rules.needs else ()


SHIFT_ACTS: Final[Mapping[str, Act[OeeRules | None, Any]]] = {
    "message": Act("log_page_alarm_message", server_permits, _leave, lambda _: say("log_done_message")),
    "reason": Act("log_page_stop_reason", server_permits, _answer, _answered),
    "parcel": Act(
        "log_page_stop_parcel",
        server_permits,
        _take,
        lambda act: say("log_done_stop_parcel", time=act.began),
        MAINTENANCE,
    ),
    "foxglove": Act(
        "log_page_diagnostics_foxglove",
        server_permits,
        _take,
        lambda act: say("log_done_stop_foxglove", time=act.began),
        MAINTENANCE,
    ),
    "later": Act(
        "log_page_stop_later",
        server_permits,
        _postpone,
        lambda act: say("log_done_stop_later", time=act.began),
    ),
}
