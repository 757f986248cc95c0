"""Client of a node's parameter services `get_parameters` and `describe_parameters`."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import Any, Final

from app.commands.transport import Transport
from app.errors import LinkError
from app.interfaces import Interfaces
from app.panel.widgets.parameter import DESCRIBE, GET
from app.robot.state import RobotState

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
