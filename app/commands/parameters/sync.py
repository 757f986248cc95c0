"""Keeps the parameters of a robot's nodes up to date by queries and events, and sets them.

A node is queried when its services appear in the graph, once more when its events surely arrive, after
a set, and if an event may have been missed; never twice at a time. A node that did not respond is
queried again only on demand: each request makes a node on Fast DDS print an error. Responses by way of
a peer or node that was lost in the meantime are ignored.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Final, Literal

from app.commands.parameters.client import NoResponse, ParameterClient
from app.commands.parameters.known import KnownParameters
from app.commands.parameters.node import Node, within
from app.commands.parameters.setting import set_all_request, set_request
from app.commands.parameters.values import check_value
from app.commands.press import PressHandle
from app.commands.service_calls import ServiceCalls
from app.commands.transport import Transport
from app.concurrency import end_tasks, spawn_logged
from app.dialect.endpoint import Endpoint
from app.errors import DecodeError
from app.i18n import TextLike, say
from app.interfaces import Interfaces
from app.interfaces.names import PARAMETER_EVENTS
from app.panel.model import Panel
from app.panel.widgets.parameter import DESCRIBE, EVENT_TYPE, EVENTS, GET, SET, Parameter, Value
from app.permission.servers import parameters_offered
from app.robot.command_status import Outcome
from app.robot.parameter_state import read_parameter_state
from app.robot.sample_handlers import SampleHandler, SampleHandlers
from app.robot.state import RobotState, Sample
from app.ros_logging import RobotLog

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
        self._nodes: dict[str, Node] = {}
        for widget in panel.parameters():
            self._nodes.setdefault(widget.node, Node(widget.node)).widgets.append(widget)
        self._nodes_by_full_name = {f"/{robot.key(name)}": node for name, node in self._nodes.items()}
        services = (name for name, _ in (GET, DESCRIBE, SET))
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
                node.task = spawn_logged(self._keep_updated(node), self._log, FAILED)

    async def stop(self) -> None:
        """Ends the tasks."""
        await end_tasks(node.task for node in self._nodes.values())

    def _cut(self, node: Node) -> None:
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

    def _apply_event(self, node: Node, event: Any, wall: float) -> None:
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

    async def _keep_updated(self, node: Node) -> None:
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

    async def _read(self, node: Node) -> Read:
        """Queries all of a node's parameters; returns whether it sent all, some, or nothing."""
        self._robot.querying |= {widget.id for widget in node.widgets}
        self._changed()
        try:
            return await self._query(node)
        finally:
            if node.task is asyncio.current_task():  # else it was canceled, and another task may query
                self._end_query(node)
                self._changed()

    async def _query(self, node: Node) -> Read:
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
        self._calls.mark_answered(f"{node.name}/{SET[0]}")
        values |= node.event_values  # newer than the query
        for widget in node.widgets:
            name = widget.parameter
            state = read_parameter_state(widget, descriptors.get(name), values.get(name), time.time())
            self._known.set(widget, state)
        self._changed()
        live = all(self._known.state(widget).state == "live" for widget in node.widgets)
        return "whole" if live else "partly"

    def _end_query(self, node: Node) -> None:
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
        request = set_request(self._interfaces, widget, value)
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
        the node, whatever the outcome."""
        request = set_all_request(self._interfaces, widget, values, timeout_s)
        nodes = {self._nodes[parameter.node] for parameter, _ in values}

        def correct(answer: Outcome) -> None:
            self._query_now(nodes)
            handle.correct(answer)

        answer = await self._calls.send_request(request, replace(handle, correct=correct))
        self._query_now(nodes)
        return answer

    def query(self, names: Iterable[str]) -> None:
        """Queries the nodes with these names now."""
        self._query_now(self._nodes[name] for name in names)

    def _query_now(self, nodes: Iterable[Node]) -> None:
        for node in nodes:
            node.request_query()

    def are_read_since(self, names: Iterable[str], since: float) -> bool:
        """Whether the nodes have answered a query that was made after `since` (monotonic seconds)."""
        return all(self._nodes[name].asked_at >= since for name in names)

    def _silent(self, node: Node) -> None:
        self._known.mark_silent(node.name, node.widgets)
        self._changed()
