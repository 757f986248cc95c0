"""Setting a parameter by ROS 2's `set_parameters`: the request, and the outcome in its response.
Pure."""

import time
from collections.abc import Sequence
from functools import partial
from typing import Final

from app.clock import format_time
from app.commands.service_calls import MAX_VALUE_CHARS, Request, with_reply
from app.i18n import joined, say
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


def set_all_request(
    interfaces: Interfaces, widget: str, values: Sequence[tuple[Parameter, Value]], timeout_s: float
) -> Request:
    """The request that sets several parameters of one node."""
    service, type_name = SET
    each = [{"name": p.parameter, "value": encode_value(p, value)} for p, value in values]
    payload = interfaces.encode(interfaces.service_types(type_name)[0], {"parameters": each})
    parameters = [parameter for parameter, _ in values]
    paths = [f"results[{i}].{key}" for i in range(len(each) + 1) for key in ("successful", "reason")]
    name, read = f"{parameters[0].node}/{service}", partial(_answers, parameters)
    return Request(widget, name, type_name, payload, timeout_s, tuple(paths), read)


def _answers(parameters: Sequence[Parameter], response: Fields) -> Outcome:
    """The outcome in a response for several parameters: rejected if the node has not taken one."""
    now, count = format_time(time.time()), len(parameters)
    taken = [response.get(f"results[{i}].successful") for i in range(count + 1)]
    if None in taken[:count] or taken[count] is not None:
        return Outcome("unknown", say("call_response_unreadable", wanted=SET[1]))
    if all(taken[:count]):
        return Outcome("succeeded", say("with_stop", said=say("call_succeeded", time=now)))
    refused = []
    for i, parameter in enumerate(parameters):
        if not taken[i]:
            reason = response.get(f"results[{i}].reason")
            why = (
                printable(plain_text(reason, MAX_VALUE_CHARS, without_terminal_codes)) if reason else ""
            )
            refused.append(say("recipe_field_refused", label=parameter.label, why=why or "?"))
    return Outcome("rejected", say("recipe_fields_refused", fields=joined(refused, "between_names")))
