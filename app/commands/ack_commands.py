"""The command that is sent when an alarm is acknowledged: a press of a control of the panel, with all
checks, entries of the log and the receipt of any press."""

import hashlib
from typing import Final

from app.alarms.instance import AlarmInstance
from app.commands.press import Press
from app.commands.receipts import GOOD_OUTCOMES, Receipt
from app.i18n import Text, TextLike, say
from app.panel.widgets.families import PressCommand
from app.permission.principal import Principal

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
