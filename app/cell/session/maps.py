"""What the maps of one robot are drawn from: maps, read beside the event loop, and transforms."""

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Final

from app.cell.link.peer import RobotContext
from app.cell.robot.maps import NoMap, read_grid
from app.cell.robot.transforms import TF, TF_STATIC, TF_TYPE
from app.panel.widgets.map_view import MapView
from app.ros.zenoh.sample import Sample
from app.system.concurrency import spawn_logged
from app.system.errors import DecodeError

log = logging.getLogger("kiosk.maps")

PAUSE_S: Final = 0.5  # between two maps of a topic: a browser fetches all tiles of each


class MapListener:
    """The `SampleListener` of a robot's maps and transforms. Used on the event loop only."""

    def __init__(self, context: RobotContext, changed: Callable[[str], None]) -> None:
        """`changed` is called with the key of a topic whose map was read."""
        robot, panel = context.robot, context.panel
        views = [widget for widget in panel.widgets() if isinstance(widget, MapView)]
        self._robot = robot
        self._interfaces = context.interfaces
        self._changed = changed
        self._newest: dict[str, Sample] = {}  # not read yet
        self._reading: set[str] = set()
        uses_transforms = any(view.pose is None for view in views)
        topics = (TF, TF_STATIC) if uses_transforms else ()
        self._static = {robot.key(topic): topic == TF_STATIC for topic in topics}

    @property
    def keys(self) -> frozenset[str]:
        return frozenset((*self._robot.maps, *self._static))

    def record_sample(self, key: str, sample: Sample) -> None:
        """A map, or transforms."""
        if (is_static := self._static.get(key)) is not None:
            try:
                message = self._interfaces.decode(TF_TYPE, bytes(sample.payload))
            except DecodeError as error:
                self._robot.traffic.count_undecodable(key, sample, error)
            else:
                self._robot.transforms.record(message, sample.at, is_static=is_static)
            return
        self._newest[key] = sample
        if key not in self._reading:
            self._reading.add(key)
            spawn_logged(self._read(key), log, "reading a map failed")

    async def _read(self, key: str) -> None:
        """Reads the newest map until there is no newer one, with a pause between two."""
        try:
            while (sample := self._newest.pop(key, None)) is not None:
                began = time.monotonic()
                await self._read_one(key, sample)
                await asyncio.sleep(max(PAUSE_S, 4 * (time.monotonic() - began)))
        finally:
            self._reading.discard(key)

    async def _read_one(self, key: str, sample: Sample) -> None:
        state = self._robot.maps[key]
        state.wall = sample.wall
        try:
            grid = await asyncio.to_thread(lambda: read_grid(self._interfaces, bytes(sample.payload)))
        except NoMap as error:
            state.grid, state.problem = None, error.reason
        else:
            before, state.problem = state.grid, ""
            if before is None or before.digest != grid.digest:
                state.grid = grid
        self._changed(key)
