"""What the maps of one robot are drawn from: maps and their layers, read beside the event loop, and
transforms. And the pictures of maps, made one after the other."""

import asyncio
import logging
import time
from collections.abc import Callable, Hashable
from functools import partial
from typing import Final

from app.cell.link.peer import RobotContext
from app.cell.robot.map_layers import read_shape
from app.cell.robot.maps import COMPARED, Grid, MapState, NoMap, is_repeated, read_grid, updated
from app.cell.robot.sample_handlers import SampleHandler, SampleHandlers
from app.cell.robot.transforms import TF, TF_STATIC
from app.panel.widgets.map_layers import updates_of
from app.ros.zenoh.sample import Sample
from app.system.concurrency import spawn_logged
from app.system.errors import DecodeError, TooMany
from app.system.limits import BoundedDict, BoundedQueue
from app.system.texts import say

log = logging.getLogger("kiosk.maps")

PAUSE_S: Final = 0.5  # between two maps of a topic
LAYER_PAUSE_S: Final = 0.2  # between two shapes of a topic
MAX_UPDATES: Final = 100  # of a map that are not applied yet
MAX_UPDATE_BYTES: Final = 32_000_000
TILES_PER_S: Final = 30  # that a browser fetches of maps that change
KEPT_PICTURES: Final = 256
MAX_WAITING: Final = 128  # all tiles of a large map, for two browsers
AGAIN_S: Final = 2


class MapListener:
    """The `SampleListener` of a robot's maps, layers and transforms. Used on the event loop only."""

    def __init__(self, context: RobotContext, changed: Callable[[str], None]) -> None:
        """`changed` is called with the key of a topic whose map or layer was read."""
        robot, panel = context.robot, context.panel
        self._robot = robot
        self._interfaces = context.interfaces
        self._changed = changed
        self._newest: dict[str, Sample] = {}  # not read yet
        self._reading: set[str] = set()
        self._comparing: set[str] = set()
        uses_transforms = any(view.uses_transforms for view in panel.map_views.values())
        topics = (TF, TF_STATIC) if uses_transforms else ()
        self._static = {robot.key(topic): topic == TF_STATIC for topic in topics}
        self._shapes = {robot.key(topic): kind for topic, kind in panel.map_shapes.items()}
        # The key of a grid's updates → that of the grid.
        self._updated = {robot.key(updates_of(topic).topic): robot.key(topic) for topic in panel.maps}
        self._updates = {key: BoundedQueue[Sample](MAX_UPDATES, MAX_UPDATE_BYTES) for key in robot.maps}

    @property
    def keys(self) -> frozenset[str]:
        """The topics of which each message counts: transforms, and the updates of maps. Of a map the
        newest counts: it is not recorded with the others."""
        return frozenset((*self._static, *self._updated))

    def register(self, handlers: SampleHandlers) -> None:
        for key in self._robot.maps:
            handlers.add(key, SampleHandler(partial(self.take_map, key)))
        for key in self._shapes:  # others may read the same topic
            handlers.add(key, SampleHandler(partial(self.take_map, key), is_stored=True))

    def record_sample(self, key: str, sample: Sample) -> None:
        """Transforms, or an update of a map."""
        if self._robot.is_foreign(sample.source):
            return
        if key in self._updated:
            self._take_update(self._updated[key], sample)
            return
        transforms, is_static = self._robot.transforms, self._static[key]
        try:
            transforms.record_bytes(bytes(sample.payload), sample.at, is_static=is_static)
        except DecodeError as error:
            self._robot.traffic.count_undecodable(key, sample, error)

    def take_map(self, key: str, sample: Sample) -> None:
        """A map or a layer; the one before it is not read if it waits."""
        if (state := self._robot.maps.get(key)) is not None:
            is_large = len(sample.payload) >= COMPARED
            state.is_behind = is_large or not is_repeated(state.grid, bytes(sample.payload))
            state.overtaken += state.is_behind and key in self._newest
            if is_large and key not in self._comparing:
                self._comparing.add(key)
                spawn_logged(self._compare(key, state), log, "comparing a map failed")
        self._newest[key] = sample
        self._begin(key)

    async def _compare(self, key: str, state: MapState) -> None:
        """Finds out beside the event loop whether the newest large map is the one that was read last:
        then it need not be read, and nothing waits for a pause between two maps."""
        try:
            while (sample := self._newest.get(key)) is not None:
                grid = state.grid
                is_same = await asyncio.to_thread(_is_same, grid, sample)
                if self._newest.get(key) is not sample or state.grid is not grid:
                    continue  # a newer one, or it is being read
                if is_same:
                    del self._newest[key]
                    self._take_arrival(state, sample)
                    state.is_behind, state.overtaken = False, 0
                    self._changed(key)
                return
        finally:
            self._comparing.discard(key)

    @staticmethod
    def _take_arrival(state: MapState, sample: Sample) -> None:
        state.wall, state.at, state.source = sample.wall, sample.at, sample.source
        state.doubt = ""

    def _take_update(self, key: str, sample: Sample) -> None:
        """An update of a map: all count that came after it."""
        state = self._robot.maps[key]
        has_map = key in self._newest or (state.grid is not None and not state.is_cut)
        if not has_map and key not in self._reading:
            return
        if self._updates[key].add(sample, len(sample.payload)):
            state.doubt = say("map_updates_lost")
        self._begin(key)

    def _begin(self, key: str) -> None:
        if key not in self._reading:
            self._reading.add(key)
            spawn_logged(self._read(key), log, "reading a map failed")

    async def _read(self, key: str) -> None:
        """Reads the newest message until there is no newer one, with a pause between two."""
        try:
            while key in self._newest or (key in self._updates and len(self._updates[key])):
                began = time.monotonic()
                if key in self._shapes:
                    await self._read_shape(key, self._newest.pop(key))
                    pause_s = LAYER_PAUSE_S
                else:
                    await self._read_map(key)
                    self._robot.maps[key].is_behind = key in self._newest
                    grid = self._robot.maps[key].grid
                    tiles = grid.columns * grid.rows if grid is not None else 0
                    pause_s = max(PAUSE_S, tiles / TILES_PER_S)
                self._changed(key)
                await asyncio.sleep(max(pause_s, 4 * (time.monotonic() - began)))
            if (state := self._robot.maps.get(key)) is not None:
                state.overtaken = 0
        finally:
            self._reading.discard(key)

    async def _read_map(self, key: str) -> None:
        """The newest map if there is one, then the updates that came after it."""
        state, updates = self._robot.maps[key], self._updates[key]
        if (sample := self._newest.pop(key, None)) is not None:
            await self._read_grid(state, sample)
        waiting = [updates.take() for _ in range(len(updates))]
        newer = [update for update in waiting if update.at >= state.at]
        if not newer or state.grid is None or state.is_cut:
            return
        grid, payloads = state.grid, [bytes(update.payload) for update in newer]
        state.grid, problem = await asyncio.to_thread(updated, self._interfaces, grid, payloads)
        state.updated_at = newer[-1].at
        if problem:
            state.doubt = problem

    async def _read_grid(self, state: MapState, sample: Sample) -> None:
        self._take_arrival(state, sample)
        try:
            grid = await asyncio.to_thread(lambda: read_grid(self._interfaces, bytes(sample.payload)))
        except NoMap as error:
            state.grid, state.problem = None, error.reason
        else:
            before, state.problem = state.grid, ""
            if before is None or before.digest != grid.digest:
                state.grid = grid

    async def _read_shape(self, key: str, sample: Sample) -> None:
        state, payload = self._robot.map_layers[key], bytes(sample.payload)
        try:
            shape = await asyncio.to_thread(read_shape, self._interfaces, self._shapes[key], payload)
        except NoMap as error:
            state.shape, state.problem = None, error.reason
        else:
            state.shape, state.problem = shape, ""
        state.wall, state.at, state.source = sample.wall, sample.at, sample.source


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


def _is_same(grid: Grid | None, sample: Sample) -> bool:
    return is_repeated(grid, bytes(sample.payload))
