"""Calls the services that list the options of selects, again and again while their servers are there.

A list is forgotten as soon as its server is gone: until the next one answers, what may be chosen is not
known.
"""

import asyncio
import json
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from app.commands.transport import Transport
from app.concurrency import end_tasks, spawn_logged
from app.errors import DecodeError, LinkError
from app.interfaces import Interfaces
from app.panel.model import Panel
from app.panel.used_options import listing_services
from app.panel.widgets.robot_options import ListingService
from app.permission.servers import server_offered
from app.robot.option_list import OptionList
from app.robot.state import RobotState
from app.ros_logging import RobotLog

log = logging.getLogger("kiosk.options")

FAILED: Final = "asking for the options of a select failed"
ANSWER_S: Final = 10.0  # an answer that takes longer does not count, and the service is called again


@dataclass(slots=True, eq=False)
class _Listing:
    """A service, how often it is called, and the task that does it while the server is there."""

    service: ListingService
    every_s: float
    task: "asyncio.Task[None] | None" = None


class OptionLists:
    """The lists of one robot's services. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        robot: RobotState,
        transport: Transport,
        changed: Callable[[], None],
    ) -> None:
        """`changed` is called when a list has changed, is renewed or is forgotten."""
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._transport = transport
        self._changed = changed
        self._listings = [_Listing(*named) for named in listing_services(panel).items()]

    def on_graph_change(self) -> None:
        """Starts to call new servers and stops for lost ones. Call it after every change of the
        graph."""
        for listing in self._listings:
            service = listing.service
            offered = server_offered("SS", service.name, service.type, self._robot) is None
            if not (offered and self._robot.graph.peers):
                self._cut(listing)
            elif listing.task is None:
                listing.task = spawn_logged(self._keep_asking(listing), self._log, FAILED)

    async def stop(self) -> None:
        """Ends the tasks."""
        await end_tasks(listing.task for listing in self._listings)

    def _cut(self, listing: _Listing) -> None:
        if listing.task is None:
            return
        listing.task.cancel()
        listing.task = None
        if self._robot.option_lists.pop(listing.service, None) is not None:
            self._changed()

    async def _keep_asking(self, listing: _Listing) -> None:
        await asyncio.sleep(self._robot.traits.server_settle_s)  # earlier requests may be lost
        while True:
            texts = await self._ask(listing.service)
            if texts is not None:
                self._robot.option_lists[listing.service] = OptionList(texts, time.monotonic())
                self._changed()
            await asyncio.sleep(listing.every_s)

    async def _ask(self, service: ListingService) -> tuple[str, ...] | None:
        """The texts of one answer; None without one in time, or for one that can't be read."""
        request, response = self._interfaces.service_types(service.type)
        payload = self._interfaces.encode(request, json.loads(service.request))
        try:
            reply = await self._transport.query(self._robot.key(service.name), payload, ANSWER_S)
        except LinkError as error:
            self._log.debug("%s: %s", service.name, error)
            return None
        if reply is None:
            self._log.warning("%s did not list its options within %g s", service.name, ANSWER_S)
            return None
        reader = self._interfaces.field_reader(response, [service.field])
        try:
            fields = await self._robot.slices.read_all(reader, reply)
        except DecodeError as error:
            self._log.error("%s: %s", service.name, error)
            return None
        return tuple(fields.get(service.field) or ())
