"""Asking a node for its parameters: ROS 2's services `get_parameters` and `describe_parameters`."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import Any, Final

from app.commands.service_calls import QueryClient
from app.errors import LinkError
from app.interfaces import Interfaces
from app.panel.widgets.parameter import DESCRIBE, GET
from app.robot.state import RobotState

ANSWER_S: Final = 5.0  # within which a node has to tell its parameters
LATE_S: Final = 5.0  # how long after that nothing more is asked: it may only be slow


class NoResponse(Exception):
    """Nothing came in time; what comes late does not count. `dropped`: the question never got there."""

    def __init__(self, why: str, *, dropped: bool) -> None:
        super().__init__(why)
        self.dropped = dropped


class ParameterClient:
    """The services of one robot's nodes; one question of a caller's at a time."""

    def __init__(self, interfaces: Interfaces, robot: RobotState, link: QueryClient) -> None:
        self._interfaces = interfaces
        self._robot = robot
        self._link = link

    async def read(
        self, node: str, names: Sequence[str], silent: Callable[[], None]
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """ParameterDescriptor and ParameterValue by name, without those that the node has not.

        NoAnswer when it does not answer in time, which `silent` tells at once; DecodeError for what
        is no answer.
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
            query = self._link.query(key, payload, ANSWER_S + LATE_S)
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
            raise NoResponse(f"{key} did not answer", dropped=in_time)
        answer: list[Any] = getattr(self._interfaces.decode(response, reply), part)
        return answer


async def _each(
    ask: Callable[[Sequence[str]], Awaitable[list[Any]]], names: Sequence[str]
) -> dict[str, Any]:
    """What a node answers by name: where one of several is not declared, rclcpp answers none."""
    found = await ask(names)
    if len(found) == len(names):
        return dict(zip(names, found, strict=True))
    if len(names) == 1:
        return {}
    each: dict[str, Any] = {}
    for name in names:
        each |= await _each(ask, [name])
    return each
