"""Acts on alarms: the rows of acknowledge, shelve, unshelve, out of service, in service and reset.

`ActRequest.object` is the alarm's id. `values` has the `occurrence` that the screen showed, the
`reason` of a shelf or of out of service, and `until`, when a shelf ends (RFC 3339).
"""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from app.cell.alarms.engine import AlarmEngine
from app.cell.alarms.states import (
    ActResult,
    AlarmInstance,
    AlarmStatus,
    Definition,
    Moment,
    TakenOut,
    acknowledge,
    remove_from_service,
    reset,
    return_to_service,
    shelve,
    unshelve,
)
from app.cell.commands.acts import Act, ActRequest, Applied, server_and_control_permit
from app.cell.commands.press import Press
from app.cell.commands.receipts import GOOD_OUTCOMES, Receipt
from app.cell.permission.roles import ConfirmLocks, unconfirmed
from app.cell.permission.verdict import Verdict
from app.panel.roles import MAINTENANCE, OPERATOR
from app.panel.widgets.families import PressCommand
from app.records.principal import Principal
from app.system.errors import InputError
from app.system.texts import Text, TextLike, say

LONGEST_REASON: Final = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmChange(Applied):
    """What an act did to the alarm with this text."""

    name: TextLike = ""


StatusChange = Callable[[AlarmStatus, Definition, ActRequest, Moment], ActResult]


def _changes(change: StatusChange) -> Callable[[AlarmEngine, ActRequest], AlarmChange]:
    """`Act.apply` from a function that changes the status of one alarm."""

    def apply(engine: AlarmEngine, request: ActRequest) -> AlarmChange:
        alarm, now = engine.alarms.get(request.object), engine.now()
        if alarm is None:
            return AlarmChange(say("alarm_gone"))

        def changed(status: AlarmStatus, definition: Definition) -> ActResult:
            return change(status, definition, request, now)

        result = engine.act(request.object, request.act, changed, str(request.who))
        return AlarmChange(result.refusal if result else None, name=alarm.text)

    return apply


def _acknowledge(
    status: AlarmStatus, definition: Definition, request: ActRequest, _: Moment
) -> ActResult:
    occurrence = request.values.get("occurrence")
    if not isinstance(occurrence, int) or isinstance(occurrence, bool):
        raise InputError("occurrence must be the number that the screen showed")
    return acknowledge(status, definition.rules, occurrence)


def _shelve(status: AlarmStatus, definition: Definition, request: ActRequest, now: Moment) -> ActResult:
    until = now.monotonic + _until(request) - now.wall
    return shelve(status, definition.rules, TakenOut(now, _reason(request), str(request.who), until))


def _remove(status: AlarmStatus, _: Definition, request: ActRequest, now: Moment) -> ActResult:
    return remove_from_service(status, TakenOut(now, _reason(request), str(request.who)))


def _reason(request: ActRequest) -> str:
    return str(request.values.get("reason", ""))[:LONGEST_REASON]


def _until(request: ActRequest) -> float:
    """In seconds since the epoch; InputError if it is no time with an offset."""
    try:
        until = datetime.fromisoformat(str(request.values.get("until")))
    except ValueError:
        until = datetime.min
    if until.tzinfo is None:
        raise InputError("until must be a time of RFC 3339, like 2026-05-04T14:00:00+02:00")
    return until.timestamp()


def needs_of_alarm(engine: AlarmEngine, alarm_id: str) -> tuple[str, ...]:
    """The roles and groups that acts on this alarm need beside those of the act."""
    alarm = engine.alarms.get(alarm_id)
    needs = alarm.definition.alarm.needs if alarm else None
    return (needs,) if needs else ()


def lock_of_alarm(
    engine: AlarmEngine, confirm_locks: ConfirmLocks, request: ActRequest
) -> Verdict | None:
    """Why an act is refused because no person has confirmed it, or none can; None if it is not."""
    alarm = engine.alarms.get(request.object)
    confirmation = alarm.definition.alarm.confirm_act if alarm and request.act in CONFIRMED else None
    if alarm is None or confirmation is None:
        return None
    if lock := confirm_locks.lock_of(confirm_key(alarm.definition.alarm.id)):
        return lock
    return unconfirmed(confirmation, request.who, request.confirmed)


def confirm_key(alarm: str) -> str:
    """Under which `ConfirmLocks` has the acts on the alarms of an entry of the panel file, whose id may
    be that of a command too."""
    return f"alarm {alarm}"


def _row(
    word: str, change: StatusChange, code: str, needs: str = OPERATOR, *, confirmable: bool = False
) -> Act[AlarmEngine, AlarmChange]:
    """`code` is that of the sentence in the log."""

    def entry(done: AlarmChange) -> Text:
        return say(code, name=done.name)

    return Act(word, server_and_control_permit, _changes(change), entry, needs, confirmable)


ALARM_ACTS: Final[Mapping[str, Act[AlarmEngine, AlarmChange]]] = {
    "acknowledge": _row(
        "log_page_alarm_acknowledge", _acknowledge, "log_done_acknowledge", confirmable=True
    ),
    "shelve": _row("log_page_alarm_shelve", _shelve, "log_done_shelve", MAINTENANCE, confirmable=True),
    "unshelve": _row(
        "log_page_alarm_unshelve",
        lambda status, definition, _, now: unshelve(status, definition.rules, now),
        "log_done_unshelve",
        MAINTENANCE,
    ),
    "out_of_service": _row(
        "log_page_alarm_out_of_service",
        _remove,
        "log_done_out_of_service",
        MAINTENANCE,
        confirmable=True,
    ),
    "in_service": _row(
        "log_page_alarm_in_service",
        lambda status, definition, _, now: return_to_service(status, definition.rules, now),
        "log_done_in_service",
        MAINTENANCE,
    ),
    "reset": _row(
        "log_page_alarm_reset",
        lambda status, definition, _, __: reset(status, definition.rules),
        "log_done_reset",
        confirmable=True,
    ),
}
# The other acts bring an alarm back.
CONFIRMED: Final = frozenset(name for name, act in ALARM_ACTS.items() if act.confirmable)


# The command that is sent when an alarm is acknowledged: a press of a control of the panel, with all
# checks, entries of the log and the receipt of any press.

DIGITS: Final = 32


def press_id_of(act_id: str) -> str:
    """The id of the press of an act: the same act again is the same press."""
    return f"ack-{hashlib.sha256(act_id.encode()).hexdigest()[:DIGITS]}"


def press_of(
    alarm: AlarmInstance, widget: PressCommand, act_id: str, who: Principal, at: float | None
) -> Press[PressCommand]:
    """The press, with the alarm's own name in the input of `ack_input`: the code or name under which
    the robot published it, or else its id."""
    described = alarm.definition.alarm
    name = alarm.entry.name if alarm.entry else described.id
    inputs = {described.ack_input: name} if described.ack_input else {}
    return Press(press_id_of(act_id), widget, inputs, who, "", at)


def sentence_of(label: TextLike, receipt: Receipt | None) -> Text:
    """What the operator reads after the acknowledgement; None: the robot has not answered yet."""
    if receipt is None:
        return say("alarm_command_waits", label=label)
    if receipt.outcome in GOOD_OUTCOMES:
        return say("alarm_command_sent", label=label, said=receipt.reason)
    return say("alarm_command_failed", label=label, why=receipt.reason)
