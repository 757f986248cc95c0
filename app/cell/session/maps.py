"""What the maps of one robot are drawn from: maps, read beside the event loop, and transforms. And the
pictures of maps, made one after the other."""

import asyncio
import logging
import time
from collections.abc import Callable, Hashable
from functools import partial
from typing import Final

from app.cell.link.peer import RobotContext
from app.cell.robot.maps import NoMap, read_grid
from app.cell.robot.sample_handlers import SampleHandler, SampleHandlers
from app.cell.robot.transforms import TF, TF_STATIC
from app.panel.widgets.map_view import MapView
from app.ros.zenoh.sample import Sample
from app.system.concurrency import spawn_logged
from app.system.errors import DecodeError, TooMany
from app.system.limits import BoundedDict
from app.system.texts import say

log = logging.getLogger("kiosk.maps")

PAUSE_S: Final = 0.5  # between two maps of a topic
TILES_PER_S: Final = 30  # that a browser fetches of maps that change
KEPT_PICTURES: Final = 256
MAX_WAITING: Final = 128  # all tiles of a large map, for two browsers
AGAIN_S: Final = 2


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
        """The topics of transforms. Of a map the newest counts: it is not recorded with the others."""
        return frozenset(self._static)

    def register(self, handlers: SampleHandlers) -> None:
        for key in self._robot.maps:
            handlers.add(key, SampleHandler(partial(self.take_map, key)))

    def record_sample(self, key: str, sample: Sample) -> None:
        """Transforms."""
        if self._robot.is_foreign(sample.source):
            return
        transforms, is_static = self._robot.transforms, self._static[key]
        try:
            transforms.record_bytes(bytes(sample.payload), sample.at, is_static=is_static)
        except DecodeError as error:
            self._robot.traffic.count_undecodable(key, sample, error)

    def take_map(self, key: str, sample: Sample) -> None:
        """A map; the one before it is not read if it waits."""
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
                grid = self._robot.maps[key].grid
                tiles = grid.columns * grid.rows if grid is not None else 0
                took_s = time.monotonic() - began
                await asyncio.sleep(max(PAUSE_S, 4 * took_s, tiles / TILES_PER_S))
        finally:
            self._reading.discard(key)

    async def _read_one(self, key: str, sample: Sample) -> None:
        state = self._robot.maps[key]
        state.wall, state.at, state.source = sample.wall, sample.at, sample.source
        try:
            grid = await asyncio.to_thread(lambda: read_grid(self._interfaces, bytes(sample.payload)))
        except NoMap as error:
            state.grid, state.problem = None, error.reason
        else:
            before, state.problem = state.grid, ""
            if before is None or before.digest != grid.digest:
                state.grid = grid
        self._changed(key)


class MapPictures:
    """The newest pictures of maps. A large one takes a second and half a gigabyte: they are made one
    after the other, for all clients. Used on the event loop only."""

    def __init__(self) -> None:
        self._kept = BoundedDict[Hashable, bytes](KEPT_PICTURES)
        self._making: dict[Hashable, asyncio.Task[bytes]] = {}
        self._turn = asyncio.Semaphore(1)

    async def picture(self, key: Hashable, make: Callable[[], bytes]) -> bytes:
        """The picture with this key, made by `make` in a thread unless it is kept. TooMany if too many
        others are asked for."""
        if (kept := self._kept.get(key)) is not None:
            return kept
        making = self._making.get(key)
        if making is None:
            if len(self._making) >= MAX_WAITING:
                raise TooMany(say("map_too_many"), AGAIN_S)
            making = self._making[key] = asyncio.ensure_future(self._make(key, make))
        return await asyncio.shield(making)

    async def _make(self, key: Hashable, make: Callable[[], bytes]) -> bytes:
        try:
            async with self._turn:
                picture = await asyncio.to_thread(make)
            self._kept[key] = picture
            return picture
        finally:
            del self._making[key]
