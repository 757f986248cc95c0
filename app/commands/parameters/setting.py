"""Setting a parameter by ROS 2's `set_parameters`: the request, and the outcome in its response.
Pure."""

import time
from functools import partial
from typing import Final

from app.clock import format_time
from app.commands.service_calls import MAX_VALUE_CHARS, Request, with_reply
from app.i18n import say
from app.interfaces import Fields, Interfaces, plain_text
from app.panel.widgets.parameter import SET, Parameter, Value
from app.printable import printable, without_terminal_codes
from app.robot.command_status import Outcome
from app.robot.parameter_state import encode_value

SET_PATHS: Final = ("results[0].successful", "results[0].reason", "results[1].successful")


def set_request(interfaces: Interfaces, widget: Parameter, value: Value) -> Request:
    """The request that sets one parameter, with the function that reads its response."""
    service, type_name = SET
    fields = {"parameters": [{"name": widget.parameter, "value": encode_value(widget, value)}]}
    payload = interfaces.encode(interfaces.service_types(type_name)[0], fields)
    name, read = f"{widget.node}/{service}", partial(_answer, widget, value)
    return Request(widget.id, name, type_name, payload, widget.timeout_s, SET_PATHS, read)


def _answer(widget: Parameter, value: Value, response: Fields) -> Outcome:
    """The outcome in a response of SetParameters for one parameter."""
    now = format_time(time.time())
    successful, reason, second = (response.get(path) for path in SET_PATHS)
    if successful is None or second is not None:
        return Outcome("unknown", say("call_response_unreadable", wanted=SET[1]))
    if successful:
        return Outcome("succeeded", say("parameter_set", value=widget.value_text(value), time=now))
    text = printable(plain_text(reason, MAX_VALUE_CHARS, without_terminal_codes)) if reason else ""
    return Outcome("rejected", with_reply(say("call_rejected", time=now), text))
