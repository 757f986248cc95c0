"""Keeps the parameters of a robot's nodes up to date by queries and events, and sets them.

A node is queried when its services appear in the graph, once more when its events surely arrive, after
a set, and if an event may have been missed; never twice at a time. A node that did not respond is
queried again only on demand: each request makes a node on Fast DDS print an error. Responses by way of
a peer or node that was lost in the meantime are ignored.
"""

import asyncio
import logging
import math
import re
import time
from collections.abc import Awaitable, Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Final, Literal

from app.cell.commands.press import PressHandle
from app.cell.commands.services import ServiceCalls, ServiceRequest, value_in_words, with_reply
from app.cell.commands.transport import Transport
from app.cell.permission.verdict import parameters_offered, server_offered
from app.cell.robot.parameter_state import (
    MAX_LIST_LENGTH,
    UNKNOWN,
    ParameterState,
    allowed_range,
    decode_value,
    each_text,
    encode_value,
    limits_text,
    read_parameter_state,
    type_name,
)
from app.cell.robot.sample_handlers import SampleHandler, SampleHandlers
from app.cell.robot.state import RobotState, Sample
from app.panel.model import Panel
from app.panel.robot_texts import RobotTexts
from app.panel.values import split_list
from app.panel.widgets.numbers import no_number
from app.panel.widgets.parameter import (
    DESCRIBE,
    EVENT_TYPE,
    EVENTS,
    GET,
    MAX_TEXT,
    SERVICES,
    SET,
    SET_ATOMICALLY,
    Parameter,
    Scalar,
    Value,
)
from app.records.entry import Outcome
from app.ros.dialects.dialect import Endpoint
from app.ros.messages import INTEGER_RANGES, Fields, Interfaces
from app.ros.messages.names import PARAMETER_EVENTS
from app.ros.messages.validation import format_value
from app.system.clock import format_time
from app.system.concurrency import end_tasks, keep_running
from app.system.errors import DecodeError, InputError, LinkError
from app.system.log import RobotLog
from app.system.texts import ENGLISH, TextLike, joined, say
from app.system.texts.locales import read_numbers
from app.system.texts.text import each_language

# Client of a node's parameter services `get_parameters` and `describe_parameters`.

ANSWER_S: Final = 5.0  # timeout of a request
LATE_S: Final = 5.0  # after the timeout, no new request for this time: the node may only be slow


class NoResponse(Exception):
    """No response within the timeout; late ones are ignored. `dropped`: the request never arrived."""

    def __init__(self, why: str, *, dropped: bool) -> None:
        super().__init__(why)
        self.dropped = dropped


class ParameterClient:
    """The parameter services of one robot's nodes. One request per caller at a time."""

    def __init__(self, interfaces: Interfaces, robot: RobotState, transport: Transport) -> None:
        self._interfaces = interfaces
        self._robot = robot
        self._transport = transport

    async def read(
        self, node: str, names: Sequence[str], silent: Callable[[], None]
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """ParameterDescriptor and ParameterValue by name, without parameters that the node does not
        have.

        NoResponse at a timeout, and `silent` is called then; DecodeError for an invalid response.
        """
        ask = partial(self._request, node, silent)
        descriptors = await _each(partial(ask, DESCRIBE, "descriptors"), names)
        return descriptors, await _each(partial(ask, GET, "values"), names)

    async def _request(
        self,
        node: str,
        silent: Callable[[], None],
        service: tuple[str, str],
        part: str,
        names: Sequence[str],
    ) -> list[Any]:
        request, response = self._interfaces.service_types(service[1])
        payload = self._interfaces.encode(request, {"names": list(names)})
        key = self._robot.key(f"{node}/{service[0]}")
        try:
            query = self._transport.query(key, payload, ANSWER_S + LATE_S)
        except LinkError as error:
            silent()
            raise NoResponse(str(error), dropped=True) from error
        await asyncio.wait({query}, timeout=ANSWER_S)
        in_time = query.done()
        if not in_time:
            silent()
        reply = await query
        if reply is None or not in_time:
            silent()
            raise NoResponse(f"{key} did not respond", dropped=in_time)
        answer: list[Any] = getattr(self._interfaces.decode(response, reply), part)
        return answer


async def _each(
    ask: Callable[[Sequence[str]], Awaitable[list[Any]]], names: Sequence[str]
) -> dict[str, Any]:
    """The response by parameter name. If one of several is undeclared, rclcpp returns none, so they are
    requested one by one."""
    response = await ask(names)
    if len(response) == len(names):
        return dict(zip(names, response, strict=True))
    if len(names) == 1:
        return {}
    each: dict[str, Any] = {}
    for name in names:
        each |= await _each(ask, [name])
    return each


# The known states of one robot's parameters. Only this module changes them.


class KnownParameters:
    """Parameter states by widget. Used on the event loop only."""

    def __init__(self, robot: RobotState, log: RobotLog) -> None:
        self._robot = robot
        self._log = log

    def state(self, widget: Parameter) -> ParameterState:
        return self._robot.parameters.get(widget.id, UNKNOWN)

    def set(self, widget: Parameter, state: ParameterState) -> None:
        if state.state == "undeclared" and self.state(widget).state != "undeclared":
            self._log.warning("%s has no parameter %s", widget.node, widget.parameter)
        self._robot.parameters[widget.id] = state

    def apply_event(self, widget: Parameter, value: Any, wall: float) -> bool:
        """Applies a new value (a ParameterValue) from a parameter event at `wall` (seconds since the
        epoch). False if the node has to be queried instead."""
        known = self.state(widget)
        if known.state not in ("live", "missing"):
            return False
        if type_name(value.type) != widget.type:
            self.set(widget, ParameterState("mistyped", robot_type=type_name(value.type), wall=wall))
        else:
            self.set(widget, replace(known, state="live", value=decode_value(widget, value), wall=wall))
        return True

    def mark_unreadable(self, widgets: Iterable[Parameter], wall: float) -> None:
        """The node's response is not decodable."""
        for widget in widgets:
            self.set(widget, ParameterState("unreadable", wall=wall))

    def mark_silent(self, node: str, widgets: Collection[Parameter]) -> None:
        """The node does not respond."""
        if any(self.state(widget).state != "silent" for widget in widgets):
            self._log.warning("%s does not respond to requests for its parameters", node)
        for widget in widgets:
            self.set(widget, replace(self.state(widget), state="silent"))

    def mark_cut(self, widgets: Iterable[Parameter]) -> None:
        """The node is gone. Its values are no longer current."""
        for widget in widgets:
            known = self.state(widget)
            cut = replace(known, state="cut") if known.value is not None else UNKNOWN
            self._robot.parameters[widget.id] = cut


# A node with parameters that the panel shows, and when to query it again.


@dataclass(slots=True, eq=False)
class ParameterNode:
    """A node; `task` queries it while its services are available.

    `event_values` are values from events during a query. `query_needed` is set when the node has to be
    queried again, `query_now` when that must not wait for the pause between two queries. `answered_at`
    (monotonic seconds) is the time of its last response, `asked_at` that of the request for it.
    """

    name: str
    widgets: list[Parameter] = field(default_factory=list)
    query_needed: asyncio.Event = field(default_factory=asyncio.Event)
    query_now: asyncio.Event = field(default_factory=asyncio.Event)
    event_values: dict[str, Any] = field(default_factory=dict)
    answered_at: float = -math.inf
    asked_at: float = -math.inf
    task: "asyncio.Task[None] | None" = None

    def request_query(self) -> None:
        self.query_needed.set()
        self.query_now.set()

    def begin_query(self) -> None:
        """Resets the requests for a query, which this query fulfils."""
        self.query_needed.clear()
        self.query_now.clear()
        self.event_values.clear()


async def within(event: asyncio.Event, longest_s: float | None) -> None:
    """Waits for an event, at most `longest_s` seconds (None: no limit)."""
    try:
        async with asyncio.timeout(longest_s):
            await event.wait()
    except TimeoutError:
        pass


# Setting parameters by ROS 2's `set_parameters` or `set_parameters_atomically`: the request, and the
# outcome in its response. Pure.

SET_PATHS: Final = ("results[0].successful", "results[0].reason", "results[1].successful")
SET_ALL_PATHS: Final = ("result.successful", "result.reason")


def set_request(
    interfaces: Interfaces, widget: Parameter, value: Value, texts: RobotTexts
) -> ServiceRequest:
    """The request that sets one parameter, with the function that reads its response; `texts` are those
    of the panel file."""
    service, type_name = SET
    fields = {"parameters": [{"name": widget.parameter, "value": encode_value(widget, value)}]}
    payload = interfaces.encode(interfaces.service_types(type_name)[0], fields)
    name, read = f"{widget.node}/{service}", partial(_answer, widget, value, texts)
    return ServiceRequest(widget.id, name, type_name, payload, widget.timeout_s, SET_PATHS, read)


def _answer(widget: Parameter, value: Value, texts: RobotTexts, response: Fields) -> Outcome:
    """The outcome in a response of SetParameters for one parameter."""
    now = format_time(time.time())
    successful, reason, second = (response.get(path) for path in SET_PATHS)
    if successful is None or second is not None:
        return Outcome("unknown", say("call_response_unreadable", wanted=SET[1]))
    if successful:
        return Outcome("succeeded", say("parameter_set", value=widget.value_text(value), time=now))
    text = _reason_text(reason, texts)
    return Outcome("rejected", with_reply(say("call_rejected", time=now), text))


def _reason_text(reason: Any, texts: RobotTexts) -> TextLike:
    """The node's own reason for a refusal; "" without one."""
    return value_in_words(reason, texts) if reason else ""


def set_all_request(
    interfaces: Interfaces,
    widget: str,
    values: Sequence[tuple[Parameter, Value]],
    timeout_s: float,
    texts: RobotTexts,
    *,
    atomically: bool,
) -> ServiceRequest:
    """The request that sets several parameters of one node; `atomically`: all of them or none. `texts`
    as of `set_request`."""
    service, type_name = SET_ATOMICALLY if atomically else SET
    each = [{"name": p.parameter, "value": encode_value(p, value)} for p, value in values]
    payload = interfaces.encode(interfaces.service_types(type_name)[0], {"parameters": each})
    parameters = [parameter for parameter, _ in values]
    name = f"{parameters[0].node}/{service}"
    if atomically:
        return ServiceRequest(
            widget, name, type_name, payload, timeout_s, SET_ALL_PATHS, partial(_atomic_answer, texts)
        )
    paths = [f"results[{i}].{key}" for i in range(len(each) + 1) for key in ("successful", "reason")]
    read = partial(_answers, parameters, texts)
    return ServiceRequest(widget, name, type_name, payload, timeout_s, tuple(paths), read)


def _atomic_answer(texts: RobotTexts, response: Fields) -> Outcome:
    """The outcome in a response of SetParametersAtomically."""
    now = format_time(time.time())
    successful, reason = (response.get(path) for path in SET_ALL_PATHS)
    if successful is None:
        return Outcome("unknown", say("call_response_unreadable", wanted=SET_ATOMICALLY[1]))
    if successful:
        return Outcome("succeeded", say("with_stop", said=say("call_succeeded", time=now)))
    return Outcome("rejected", with_reply(say("call_rejected", time=now), _reason_text(reason, texts)))


def _answers(parameters: Sequence[Parameter], texts: RobotTexts, response: Fields) -> Outcome:
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
            why = _reason_text(response.get(f"results[{i}].reason"), texts)
            refused.append(say("recipe_field_refused", label=parameter.label, why=why or "?"))
    return Outcome("rejected", say("recipe_fields_refused", fields=joined(refused, "between_names")))


# Checks and converts the entered value of a parameter. Pure.

# As browsers send it. A typed text that is read as another number is none of these.
WHOLE: Final = re.compile(r"-?(0|[1-9][0-9]{0,18})", re.ASCII)


def check_value(parameter: Parameter, known: ParameterState, entered: Any) -> Value:
    """The value to set; InputError with the label and the limits."""
    if parameter.options:
        entered = _option_value(parameter, entered)
    if not parameter.is_list:
        return _scalar(parameter, known, parameter.label, entered)
    elements = _elements(parameter, known, entered)
    if len(elements) > MAX_LIST_LENGTH:
        raise InputError(
            say(
                "parameter_list_too_long",
                label=parameter.label,
                most=MAX_LIST_LENGTH,
                count=len(elements),
            )
        )
    named = (
        say("parameter_list_element", label=parameter.label, number=i + 1) for i in range(len(elements))
    )
    return tuple(
        _scalar(parameter, known, name, element) for name, element in zip(named, elements, strict=True)
    )


def _option_value(parameter: Parameter, entered: Any) -> Any:
    """The value of an option, given by its value or its key."""
    option = parameter.find_option(entered) or next(
        (choice for choice in parameter.options if choice.key == entered), None
    )
    if option is None:
        options = tuple(choice.label for choice in parameter.options)
        raise InputError(
            say(
                "input_not_an_option",
                label=parameter.label,
                options=options,
                given=format_value(entered),
            )
        )
    return option.value


def _elements(parameter: Parameter, known: ParameterState, entered: Any) -> list[Any]:
    """The elements of a list: from text with commas, or from a program's list."""
    if isinstance(entered, list):
        return entered
    try:
        if not isinstance(entered, str) or len(entered) > MAX_TEXT:
            raise ValueError
        if parameter.is_number_list:  # of a program: pages send JSON's own lists
            return list(read_numbers(entered, ENGLISH, whole=parameter.is_whole))
        return [_entered(parameter, text) for text in split_list(entered)]
    except ValueError:
        text = limits_text(parameter, allowed_range(parameter, known))
        raise InputError(
            say("parameter_not_a_list", label=parameter.label, limits=text, given=format_value(entered))
        ) from None


def _entered(parameter: Parameter, text: str) -> Any:
    if parameter.element_type != "bool":
        return text
    words = {"true": True, "false": False}
    words |= dict.fromkeys(_words(parameter.on), True)
    words |= dict.fromkeys(_words(parameter.off), False)
    return words.get(text.lower(), text)


def _words(text: TextLike) -> list[str]:
    return [word.lower() for word in each_language(text).values()]


def _scalar(parameter: Parameter, known: ParameterState, label: TextLike, entered: Any) -> Scalar:
    match parameter.element_type:
        case "bool":
            if isinstance(entered, bool):
                return entered
            raise InputError(
                say(
                    "input_not_a_boolean",
                    label=label,
                    on=parameter.on,
                    off=parameter.off,
                    given=format_value(entered),
                )
            )
        case "string":
            if isinstance(entered, str) and len(entered) <= MAX_TEXT:
                return entered
            text = format_value(entered)
            raise InputError(say("parameter_not_a_text", label=label, most=MAX_TEXT, given=text))
    return _number(parameter, known, label, entered)


def _number(parameter: Parameter, known: ParameterState, label: TextLike, entered: Any) -> int | float:
    limits = allowed_range(parameter, known)
    text = each_text(parameter, limits)
    if entered == "" or entered is None:
        raise InputError(say("input_number_empty", label=label, limits=text))
    value = _whole(entered) if parameter.element_type == "integer" else _double(entered)
    if value is None:
        raise InputError(no_number(label, text, entered, whole=parameter.is_whole))
    for allowed in (limits, known.range):
        if not allowed.contains(value):
            text = each_text(parameter, allowed)
            raise InputError(
                say("input_outside_limits", label=label, limits=text, given=parameter.value_text(value))
            )
    return value


def _whole(entered: Any) -> int | None:
    """An int64, given as a number, or as text beyond the exact range of a browser's numbers."""
    if isinstance(entered, str) and WHOLE.fullmatch(entered):
        entered = int(entered)
    if isinstance(entered, float) and entered.is_integer():
        entered = int(entered)
    if isinstance(entered, bool) or not isinstance(entered, int):
        return None
    low, high = INTEGER_RANGES["int64"]
    return entered if low <= entered <= high else None


def _double(entered: Any) -> float | None:
    if isinstance(entered, bool) or not isinstance(entered, int | float):
        return None
    try:
        value = float(entered)
    except OverflowError:
        return None
    return value if math.isfinite(value) else None


log = logging.getLogger("kiosk.parameters")

Read = Literal["whole", "partly", "silent"]

FAILED: Final = "updating a node's parameters failed"
AGAIN_S: Final = 1.0  # at least between two queries, and before the first retry
AGAIN_MOST_S: Final = 600.0  # the pause between retries doubles up to this


class ParameterSync:
    """The parameters of one robot that its panel shows. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        robot: RobotState,
        transport: Transport,
        calls: ServiceCalls,
        changed: Callable[[], None],
    ) -> None:
        """`changed` is called when the state of a parameter has changed."""
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._services = ParameterClient(interfaces, robot, transport)
        self._calls = calls
        self._changed = changed
        self._known = KnownParameters(robot, self._log)
        self._nodes: dict[str, ParameterNode] = {}
        for widget in panel.parameters():
            self._nodes.setdefault(widget.node, ParameterNode(widget.node)).widgets.append(widget)
        self._nodes_by_full_name = {f"/{robot.key(name)}": node for name, node in self._nodes.items()}
        services = (name for name, _ in SERVICES)
        self._served_by = {
            robot.key(f"{node.name}/{service}"): node
            for service in services
            for node in self._nodes.values()
        }

    def register(self, handlers: SampleHandlers) -> None:
        """Handles parameter events and lost nodes from now on."""
        handlers.on_endpoint_lost(self.on_token_lost)
        for key in self._robot.possible_keys(EVENTS):
            take = partial(self.on_event, key)
            handlers.add(key, SampleHandler(take, is_stored=True, is_immediate=True))

    # Changes of the graph.

    def on_token_lost(self, endpoint: Endpoint) -> None:
        """An endpoint's token ended, possibly for a moment: the node may have been replaced."""
        if endpoint.role is None:
            for node in self._nodes.values():
                self._cut(node)
        elif endpoint.role == "SS" and (lost := self._served_by.get(endpoint.key)):
            self._cut(lost)

    def on_graph_change(self) -> None:
        """Starts to query new nodes and stops for lost ones. Call it after every change of the
        graph."""
        for node in self._nodes.values():
            offered = parameters_offered(node.name, self._robot) is None
            if not (offered and self._robot.graph.peers):
                self._cut(node)
            elif node.task is None:
                node.task = keep_running(partial(self._keep_updated, node), self._log, FAILED)

    async def stop(self) -> None:
        """Ends the tasks."""
        await end_tasks(node.task for node in self._nodes.values())

    def _cut(self, node: ParameterNode) -> None:
        if node.task is None:
            return
        node.task.cancel()
        node.task = None
        self._end_query(node)
        self._known.mark_cut(node.widgets)

    # Queries and events.

    def on_event(self, key: str, sample: Sample) -> None:
        """Applies a parameter event of any node, from the topic of this key. Queries the nodes if an
        event may have been missed."""
        passed_on = self._robot.is_from_peer(key, sample)
        if not (self._nodes and passed_on):
            return
        if sample.skipped:
            self._query_all()
        try:
            event = self._interfaces.decode(EVENT_TYPE, bytes(sample.payload))
        except DecodeError as error:
            self._log.debug("%s", error)
            self._query_all()
            return
        peer_namespace = f"/{key}".removesuffix(PARAMETER_EVENTS)
        node = self._nodes_by_full_name.get(f"{peer_namespace}{event.node}")
        if node is not None and node.task is not None:
            self._apply_event(node, event, sample.wall)

    def _query_all(self) -> None:
        """Queries all nodes: an event was missed, and its node is unknown."""
        for node in self._nodes.values():
            node.query_needed.set()

    def _apply_event(self, node: ParameterNode, event: Any, wall: float) -> None:
        redeclared = {
            parameter.name for parameter in (*event.new_parameters, *event.deleted_parameters)
        }
        changed = {parameter.name: parameter.value for parameter in event.changed_parameters}
        node.event_values |= {
            w.parameter: changed[w.parameter] for w in node.widgets if w.parameter in changed
        }
        for widget in node.widgets:
            name = widget.parameter
            if name in redeclared or (
                name in changed and not self._known.apply_event(widget, changed[name], wall)
            ):
                node.query_needed.set()

    async def _keep_updated(self, node: ParameterNode) -> None:
        """Queries a node whenever needed, until the task is canceled."""
        traits, confirmed, pause = self._robot.traits, False, AGAIN_S
        await asyncio.sleep(traits.server_settle_s)  # earlier requests to a new node may be lost
        while True:
            node.begin_query()
            read = await self._read(node)
            await within(node.query_now, AGAIN_S)
            match read:
                case "silent":
                    await node.query_now.wait()
                case "partly":
                    await within(node.query_needed, pause)
                    pause = min(2 * pause, AGAIN_MOST_S)
                case "whole":
                    await within(node.query_needed, None if confirmed else traits.events_settle_s)
                    confirmed, pause = True, AGAIN_S

    async def _read(self, node: ParameterNode) -> Read:
        """Queries all of a node's parameters; returns whether it sent all, some, or nothing."""
        self._robot.querying |= {widget.id for widget in node.widgets}
        self._changed()
        try:
            return await self._query(node)
        finally:
            if node.task is asyncio.current_task():  # else it was canceled, and another task may query
                self._end_query(node)
                self._changed()

    async def _query(self, node: ParameterNode) -> Read:
        names = list(dict.fromkeys(widget.parameter for widget in node.widgets))
        asked_at = time.monotonic()
        try:
            reading = self._services.read(node.name, names, partial(self._silent, node))
            descriptors, values = await reading
        except NoResponse as error:
            return "partly" if error.dropped else "silent"
        except DecodeError as error:
            self._log.error("%s: %s", node.name, error)
            self._known.mark_unreadable(node.widgets, time.time())
            self._changed()
            return "partly"
        node.answered_at, node.asked_at = time.monotonic(), asked_at
        for service, _ in (SET, SET_ATOMICALLY):
            self._calls.mark_answered(f"{node.name}/{service}")
        values |= node.event_values  # newer than the query
        for widget in node.widgets:
            name = widget.parameter
            state = read_parameter_state(widget, descriptors.get(name), values.get(name), time.time())
            self._known.set(widget, state)
        self._changed()
        live = all(self._known.state(widget).state == "live" for widget in node.widgets)
        return "whole" if live else "partly"

    def _end_query(self, node: ParameterNode) -> None:
        self._robot.querying -= {widget.id for widget in node.widgets}

    def read_again(self, widget: Parameter) -> TextLike:
        """Queries the node of a parameter again, unless a query runs or it has just responded: a node
        gets at most one query per `AGAIN_S` on demand. Returns why it can't be queried, else ""."""
        node = self._nodes[widget.node]
        if node.task is None:
            return say("parameter_node_unavailable", node=widget.node)
        fresh = time.monotonic() - node.answered_at < AGAIN_S
        if widget.id not in self._robot.querying and not fresh:
            node.request_query()
        return ""

    # Setting.

    def check_value(self, widget: Parameter, entered: Any) -> Value:
        """The value to set; InputError with the label and the limits."""
        return check_value(widget, self._known.state(widget), entered)

    async def set(self, widget: Parameter, value: Value, handle: PressHandle) -> Outcome:
        """Sets a parameter by a service call, then queries the node, whatever the outcome."""
        request = set_request(self._interfaces, widget, value, self._robot.texts)
        node = self._nodes[widget.node]

        def correct(answer: Outcome) -> None:
            node.request_query()
            handle.correct(answer)

        answer = await self._calls.send_request(request, replace(handle, correct=correct))
        node.request_query()
        return answer

    async def set_all(
        self,
        widget: str,
        values: Sequence[tuple[Parameter, Value]],
        timeout_s: float,
        handle: PressHandle,
    ) -> Outcome:
        """Sets parameters of one node by one service call, for the widget with this id, then queries
        the node, whatever the outcome. All or none of them, if the node can do so."""
        nodes = {self._nodes[parameter.node] for parameter, _ in values}
        atomically = self._sets_atomically(values[0][0].node)
        texts = self._robot.texts
        request = set_all_request(
            self._interfaces, widget, values, timeout_s, texts, atomically=atomically
        )

        def correct(answer: Outcome) -> None:
            self._query_now(nodes)
            if answer.outcome == "rejected" and not atomically:
                answer = Outcome("rejected", say("recipe_others_may_be_loaded", said=answer.text))
            handle.correct(answer)

        answer = await self._calls.send_request(request, replace(handle, correct=correct))
        self._query_now(nodes)
        return answer

    def _sets_atomically(self, node: str) -> bool:
        service, type_name = SET_ATOMICALLY
        return server_offered("SS", f"{node}/{service}", type_name, self._robot) is None

    def set_service(self, node: str) -> str:
        """The service by which several parameters of a node are set."""
        return f"{node}/{(SET_ATOMICALLY if self._sets_atomically(node) else SET)[0]}"

    def value(self, widget: Parameter) -> Value | None:
        """The value that the node has now, None if that is not known."""
        known = self._known.state(widget)
        return known.value if known.state == "live" else None

    def query(self, names: Iterable[str]) -> None:
        """Queries the nodes with these names now."""
        self._query_now(self._nodes[name] for name in names)

    def _query_now(self, nodes: Iterable[ParameterNode]) -> None:
        for node in nodes:
            node.request_query()

    def are_read_since(self, names: Iterable[str], since: float) -> bool:
        """Whether the nodes have answered a query that was made after `since` (monotonic seconds)."""
        return all(self._nodes[name].asked_at >= since for name in names)

    def _silent(self, node: ParameterNode) -> None:
        self._known.mark_silent(node.name, node.widgets)
        self._changed()
