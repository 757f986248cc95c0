"""The newest picture of each camera's topic, while a browser shows it.

Only then the topic is subscribed to: the bridge reads a topic for its subscribers, so a camera that no
browser shows does not even cross the network. A message is replaced by the next one where it arrives,
on the link's thread, undecoded; the event loop is woken only where a browser waits for one.
"""

import asyncio
import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Final

from app.errors import LinkError, TooMany
from app.i18n import say
from app.interfaces import Interfaces
from app.panel.model import Panel
from app.panel.widgets.camera import Camera
from app.robot.looked_at import LookedAt
from app.robot.pictures import NoPicture, Picture, picture
from app.robot.sample import Buffer
from app.robot.state import RobotState
from app.transport.zenoh_session import ZenohSession

LINGER_S: Final = 6.0  # a page without scripts looks again after five seconds
LOOKERS_MOST: Final = 32  # at one topic


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One message: `number` counts those of its topic, `at` is in monotonic seconds."""

    number: int
    payload: Buffer
    at: float
    wall: float


class Frames:
    """The cameras of one robot. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        interfaces: Interfaces,
        link: ZenohSession,
        changed: Callable[[], None],
        tokens: Callable[[], None],
    ) -> None:
        """`changed` is called when what the view shows of a camera has changed by itself, `tokens` when
        a topic is wanted or not any more."""
        cameras = [w for w in panel.widgets() if isinstance(w, Camera)]
        self._feeds = {}
        for topic, name in panel.on_demand().items():
            fresh_s = min(camera.max_age_s for camera in cameras if camera.topic == topic)
            self._feeds[topic] = Feed(topic, name, robot, interfaces, link, changed, tokens, fresh_s)

    def feed(self, widget: Camera) -> "Feed":
        """The topic of a camera."""
        return self._feeds[widget.topic]

    def close(self) -> None:
        """Unsubscribes from all topics."""
        for feed in self._feeds.values():
            feed.close()


class Feed:
    """One topic: the newest message, and who waits for one."""

    def __init__(
        self,
        topic: str,
        type_name: str,
        robot: RobotState,
        interfaces: Interfaces,
        link: ZenohSession,
        changed: Callable[[], None],
        tokens: Callable[[], None],
        fresh_s: float,
    ) -> None:
        self.topic = topic
        self._fresh_s = fresh_s
        self._type = type_name
        self._robot = robot
        self._key = robot.key(topic)
        self._interfaces = interfaces
        self._link = link
        self._changed = changed
        self._tokens = tokens
        self._loop = asyncio.get_running_loop()
        self._lookers = 0
        self._leaving: asyncio.TimerHandle | None = None
        self._newest: Frame | None = None  # set on the link's thread
        self._received = LookedAt()
        self._viewed_at = -math.inf  # of the newest frame that the view knows of
        self._came: asyncio.Future[None] | None = None  # of those who wait for a frame
        self._made: tuple[Frame, asyncio.Task[Picture]] | None = None

    @contextmanager
    def looked_at(self) -> Iterator[None]:
        """The topic is subscribed to while the block runs, and a little longer."""
        if self._lookers >= LOOKERS_MOST:
            raise TooMany(say("camera_lookers", most=LOOKERS_MOST), 5)
        self._lookers += 1
        self._look()
        try:
            yield
        finally:
            self._lookers -= 1
            if not self._lookers and self._robot.looked_at.get(self._key) is self._received:
                self._leaving = self._loop.call_later(LINGER_S, self.close)

    async def newer(self, than: int) -> Frame:
        """The newest frame, when its number is larger: at once, or as soon as one comes."""
        while (found := self._newest) is None or found.number <= than:
            if self._came is None:
                self._came = self._loop.create_future()
            if self._newest is found:  # none has come in between
                await asyncio.shield(self._came)
        self._show(found)
        return found

    async def picture(self, frame: Frame, widget: Camera) -> Picture:
        """The picture of a frame, made once for all; NoPicture says why there is none."""
        try:
            if len(frame.payload) > widget.max_bytes:
                size, most = len(frame.payload), widget.max_bytes
                raise NoPicture(say("camera_large", size=size, most=most))
            made = await asyncio.shield(self._making(frame))
        except NoPicture as error:
            self._problem(error)
            raise
        self._problem(None)
        return made

    def close(self) -> None:
        """Unsubscribes, and keeps nothing."""
        if self._leaving is not None:
            self._leaving.cancel()
            self._leaving = None
        if self._robot.looked_at.pop(self._key, None) is not None:
            with suppress(LinkError):
                self._link.unsubscribe(self._key)
            self._tokens()
            self._newest = self._made = None

    def _look(self) -> None:
        if self._leaving is not None:
            self._leaving.cancel()
            self._leaving = None
        if self._key in self._robot.looked_at:
            return
        self._received = self._robot.looked_at[self._key] = LookedAt()
        self._viewed_at = -math.inf
        self._newest = None  # what arrived while the last subscription ended
        expression = self._robot.dialect.topic(self._key, self._type)
        self._tokens()
        with suppress(LinkError):  # the next session has it
            self._link.subscribe_on_demand(self._key, expression, self._take)
        self._changed()

    def _take(self, payload: Buffer) -> None:
        """On the link's thread: replaces what was there, and wakes the loop where someone waits."""
        last = self._newest  # the loop may replace it by None
        frame = Frame(last.number + 1 if last else 1, payload, time.monotonic(), time.time())
        self._newest = frame
        self._received.at, self._received.wall = frame.at, frame.wall
        if self._came is not None:
            with suppress(RuntimeError):  # the loop is closed
                self._loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        came, self._came = self._came, None
        if came is not None and not came.done():
            came.set_result(None)

    def _show(self, frame: Frame) -> None:
        """The view looks by itself when a frame gets old: the first one after that changes it."""
        if frame.at - self._viewed_at >= self._fresh_s:
            self._changed()
        self._viewed_at = frame.at

    def _making(self, frame: Frame) -> "asyncio.Task[Picture]":
        if self._made is None or self._made[0] is not frame:
            work = asyncio.to_thread(self._make, frame.payload)
            self._made = frame, asyncio.ensure_future(work)
        return self._made[1]

    def _make(self, payload: Buffer) -> Picture:
        return picture(self._interfaces, self._type, bytes(payload))

    def _problem(self, error: NoPicture | None) -> None:
        problem = error.reason if error else ""
        if self._received.problem != problem:
            self._received.problem = problem
            self._changed()
