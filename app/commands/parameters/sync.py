"""The parameters of a robot's nodes: read when a node is there, followed by its events, and set.

A node is asked when its services appear in the graph, once more when events must have been flowing
for a while, after a set, and where an event may have been missed; never twice at a time. One that did
not answer is asked again only when somebody wants it: each question makes a node on Fast DDS print an
error. What was asked of a bridge or a node that went away meanwhile no longer counts.
"""

import asyncio
import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Final, Literal

from app.clock import format_time
from app.commands.parameters.client import NoAnswer, ParameterClient
from app.commands.parameters.values import checked
from app.commands.service_calls import LONGEST_SAID, Asker, Request, ServiceCalls, with_reply
from app.concurrency import spawn_logged
from app.dialect import bridge_dialect
from app.errors import DecodeError
from app.i18n import TextLike, say
from app.interfaces import Fields, Interfaces, plain_text
from app.panel.model import Panel
from app.panel.widgets.parameter import DESCRIBE, EVENT_TYPE, GET, SET, Parameter, Value
from app.permission.interlocks import SERVER_SETTLE_S, parameters_offered
from app.printable import printable
from app.robot.command_status import FinalCheck, OnCorrection, Outcome, no_check
from app.robot.parameter_state import (
    UNKNOWN,
    ParameterState,
    decode_value,
    encode_value,
    read_parameter_state,
    type_name,
)
from app.robot.state import RobotState, Sample
from app.ros_logging import RobotLog

log = logging.getLogger("kiosk.parameters")

Read = Literal["whole", "partly", "silent"]

FAILED: Final = "following a node's parameters failed"
SETTLE_S: Final = SERVER_SETTLE_S  # before which a question to a node that appeared may be lost
CONFIRM_S: Final = 3.0  # after which the bridge surely brings the events of a node that appeared
AGAIN_S: Final = 1.0  # between two readings at least, and before the first try again
SET_PATHS: Final = ("results[0].successful", "results[0].reason", "results[1].successful")
AGAIN_MOST_S: Final = 600.0  # the pause between tries doubles up to this


@dataclass(slots=True)
class _Node:
    """A node with the panel's parameters; `heard` are values of events while it is being asked.

    `wanted` is set when it is to be asked again, `urgent` when that is not to wait for `AGAIN_S`;
    `told_at` (monotonic seconds) is when it answered last.
    """

    name: str
    widgets: list[Parameter] = field(default_factory=list)
    wanted: asyncio.Event = field(default_factory=asyncio.Event)
    urgent: asyncio.Event = field(default_factory=asyncio.Event)
    heard: dict[str, Any] = field(default_factory=dict)
    told_at: float = -math.inf
    task: "asyncio.Task[None] | None" = None

    def ask_now(self) -> None:
        self.wanted.set()
        self.urgent.set()


class ParameterSync:
    """The parameters of one robot that its panel shows; used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        robot: RobotState,
        link: Asker,
        calls: ServiceCalls,
        changed: Callable[[], None],
    ) -> None:
        """`changed` is called when what the widgets show has changed."""
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._services = ParameterClient(interfaces, robot, link)
        self._calls = calls
        self._changed = changed
        self._nodes: dict[str, _Node] = {}
        for widget in panel.parameters():
            self._nodes.setdefault(widget.node, _Node(widget.node)).widgets.append(widget)
        services = (name for name, _ in (GET, DESCRIBE, SET))
        self._served_by = {
            robot.key(f"{node.name}/{service}"): node
            for service in services
            for node in self._nodes.values()
        }

    # What the graph shows.

    def lose(self, token_key: str) -> None:
        """A token ended, be it for a moment: its node may be another one now."""
        if (endpoint := bridge_dialect.parsed(token_key)) is None:
            return
        if endpoint.role is None:
            for node in self._nodes.values():
                self._cut(node)
        elif endpoint.role == "SS" and (lost := self._served_by.get(endpoint.key)):
            self._cut(lost)

    def follow(self) -> None:
        """After every change of the graph: asks the nodes that are there now."""
        for node in self._nodes.values():
            offered = parameters_offered(node.name, self._robot) is None
            if not (offered and self._robot.graph.bridges):
                self._cut(node)
            elif node.task is None:
                node.task = spawn_logged(self._follow_node(node), self._log, FAILED)

    async def stop(self) -> None:
        """Ends its tasks."""
        tasks = [node.task for node in self._nodes.values() if node.task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _cut(self, node: _Node) -> None:
        if node.task is None:
            return
        node.task.cancel()
        node.task = None
        self._end_asking(node)
        for widget in node.widgets:
            known = self._known(widget)
            cut = replace(known, state="cut") if known.value is not None else UNKNOWN
            self._robot.parameters[widget.id] = cut

    # What the node tells.

    def hear(self, sample: Sample) -> None:
        """An event of some node's: takes the values that changed; what it may hide is asked for."""
        passed_on = sample.source is None or sample.source in self._robot.graph.bridges
        if not (self._nodes and passed_on):
            return
        if sample.skipped:
            self._missed()
        try:
            event = self._interfaces.decode(EVENT_TYPE, bytes(sample.payload))
        except DecodeError as error:
            self._log.debug("%s", error)
            self._missed()
            return
        if (teller := self._nodes.get(event.node)) and teller.task is not None:
            self._take_event(teller, event, sample.wall)

    def _missed(self) -> None:
        """Whatever an event said that nobody read: its node may be any."""
        for node in self._nodes.values():
            node.wanted.set()

    def _take_event(self, node: _Node, event: Any, wall: float) -> None:
        redeclared = {one.name for one in (*event.new_parameters, *event.deleted_parameters)}
        changed = {one.name: one.value for one in event.changed_parameters}
        node.heard |= {
            w.parameter: changed[w.parameter] for w in node.widgets if w.parameter in changed
        }
        for widget in node.widgets:
            if widget.parameter in redeclared:
                node.wanted.set()
            elif widget.parameter in changed:
                self._take_value(node, widget, changed[widget.parameter], wall)

    def _take_value(self, node: _Node, widget: Parameter, value: Any, wall: float) -> None:
        known = self._known(widget)
        if known.state not in ("live", "missing"):
            node.wanted.set()
        elif type_name(value.type) != widget.type:
            self._learn(widget, ParameterState("mistyped", robot_type=type_name(value.type), wall=wall))
        else:
            self._learn(
                widget, replace(known, state="live", value=decode_value(widget, value), wall=wall)
            )

    async def _follow_node(self, node: _Node) -> None:
        """Asks a node, as often as there is need, until it is cut off."""
        confirmed, pause = False, AGAIN_S
        await asyncio.sleep(SETTLE_S)
        while True:
            node.wanted.clear()
            node.urgent.clear()
            node.heard.clear()
            read = await self._read(node)
            await _within(node.urgent, AGAIN_S)
            match read:
                case "silent":
                    await node.urgent.wait()
                case "partly":
                    await _within(node.wanted, pause)
                    pause = min(2 * pause, AGAIN_MOST_S)
                case "whole":
                    await _within(node.wanted, None if confirmed else CONFIRM_S)
                    confirmed, pause = True, AGAIN_S

    async def _read(self, node: _Node) -> Read:
        """Asks for all of a node's parameters: whether it told all, not all, or nothing."""
        self._robot.querying |= {widget.id for widget in node.widgets}
        self._changed()
        try:
            return await self._answered(node)
        finally:
            if node.task is asyncio.current_task():  # else it was cut off, and may be asked anew
                self._end_asking(node)
                self._changed()

    async def _answered(self, node: _Node) -> Read:
        names = list(dict.fromkeys(widget.parameter for widget in node.widgets))
        try:
            asked = self._services.read(node.name, names, partial(self._silent, node))
            descriptors, values = await asked
        except NoAnswer as error:
            return "partly" if error.dropped else "silent"
        except DecodeError as error:
            self._log.error("%s: %s", node.name, error)
            self._learn_all(node, lambda known: ParameterState("unreadable", wall=time.time()))
            return "partly"
        node.told_at = time.monotonic()
        self._calls.mark_answered(f"{node.name}/{SET[0]}")
        values |= node.heard  # told after it was asked
        for widget in node.widgets:
            name = widget.parameter
            found = read_parameter_state(widget, descriptors.get(name), values.get(name), time.time())
            self._learn(widget, found)
        self._changed()
        live = all(self._known(widget).state == "live" for widget in node.widgets)
        return "whole" if live else "partly"

    def _end_asking(self, node: _Node) -> None:
        self._robot.querying -= {widget.id for widget in node.widgets}

    def read_again(self, widget: Parameter) -> TextLike:
        """Asks the node of a parameter once more, unless it is being asked or has just answered; why it
        can't be, or "". However often anybody wants it, a node has no more than `AGAIN_S` allows."""
        node = self._nodes[widget.node]
        if node.task is None:
            return say("no_parameters", node=widget.node)
        fresh = time.monotonic() - node.told_at < AGAIN_S
        if widget.id not in self._robot.querying and not fresh:
            node.ask_now()
        return ""

    # Setting.

    def checked(self, widget: Parameter, given: Any) -> Value:
        """The value to set; InputError with a sentence that names label and limits."""
        return checked(widget, self._known(widget), given)

    async def set(
        self,
        widget: Parameter,
        value: Value,
        press_id: str,
        corrected: OnCorrection,
        look: FinalCheck = no_check,
    ) -> Outcome:
        """Sets a parameter, as a call does; whatever came of it, the node is asked how it is now."""
        service, type_name = SET
        fields = {"parameters": [{"name": widget.parameter, "value": encode_value(widget, value)}]}
        payload = self._interfaces.encode(self._interfaces.service_types(type_name)[0], fields)
        name, read = f"{widget.node}/{service}", partial(_answer, widget, value)
        request = Request(widget.id, name, type_name, payload, widget.timeout_s, SET_PATHS, read)
        node = self._nodes[widget.node]

        def late(press_id: str, answer: Outcome) -> None:
            node.ask_now()
            corrected(press_id, answer)

        answer = await self._calls.ask(request, press_id, late, look)
        node.ask_now()
        return answer

    # What is known.

    def _known(self, widget: Parameter) -> ParameterState:
        return self._robot.parameters.get(widget.id, UNKNOWN)

    def _learn(self, widget: Parameter, known: ParameterState) -> None:
        if known.state == "undeclared" and self._known(widget).state != "undeclared":
            self._log.warning("%s has no parameter %s", widget.node, widget.parameter)
        self._robot.parameters[widget.id] = known

    def _learn_all(self, node: _Node, of: Callable[[ParameterState], ParameterState]) -> None:
        for widget in node.widgets:
            self._learn(widget, of(self._known(widget)))
        self._changed()

    def _silent(self, node: _Node) -> None:
        if any(self._known(widget).state != "silent" for widget in node.widgets):
            self._log.warning("%s does not answer when it is asked for its parameters", node.name)
        self._learn_all(node, lambda known: replace(known, state="silent"))


def _answer(widget: Parameter, value: Value, response: Fields) -> Outcome:
    """What a response of SetParameters says of the one parameter that was to be set."""
    now = format_time(time.time())
    successful, reason, second = (response.get(path) for path in SET_PATHS)
    if successful is None or second is not None:
        return Outcome("unknown", say("answer_unreadable", wanted=SET[1]))
    if successful:
        return Outcome("succeeded", say("parameter_set", value=widget.value_text(value), time=now))
    said = printable(plain_text(reason, LONGEST_SAID)) if reason else ""
    return Outcome("rejected", with_reply(say("said_no", time=now), said))


async def _within(event: asyncio.Event, longest_s: float | None) -> None:
    """Waits for an event, or until this time is up."""
    try:
        async with asyncio.timeout(longest_s):
            await event.wait()
    except TimeoutError:
        pass
