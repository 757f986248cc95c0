"""The newest frame of each camera's topic, while a browser shows it.

A camera's topic is subscribed to only while a browser shows it. A peer sends a topic only to
subscribers, so a camera that no browser shows needs no bandwidth. On the link's thread a message
replaces the last one undecoded; the event loop is woken only if a browser waits for the next frame.
"""

import asyncio
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Final

from app.cell.link.peer import RobotContext
from app.cell.permission.client_limits import VIEWERS
from app.cell.permission.client_places import ClientPlaces
from app.cell.robot.pictures import NoPicture, Picture, picture
from app.cell.robot.topics import CameraTopicState
from app.panel.widgets.displays import Camera
from app.ros.zenoh.sample import Buffer, Sample
from app.system.errors import LinkError, TooMany
from app.system.texts import TextLike, say

LINGER_S: Final = 6.0  # a page without scripts requests the next frame after five seconds


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One message: `number` counts those of its topic, `at` is in monotonic seconds."""

    number: int
    payload: Buffer
    at: float
    wall: float


class Frames:
    """The cameras of one robot. Used on the event loop only."""

    def __init__(self, context: RobotContext, update_tokens: Callable[[], None]) -> None:
        """`update_tokens` is called when a topic is subscribed to or no longer."""
        cameras = [w for w in context.panel.widgets() if isinstance(w, Camera)]
        self._feeds = {}
        for topic, type_name in context.panel.on_demand().items():
            showing = [camera for camera in cameras if camera.topic == topic]
            self._feeds[topic] = Feed(context, update_tokens, topic, type_name, showing)

    def feed(self, widget: Camera) -> "Feed":
        """The topic of a camera."""
        return self._feeds[widget.topic]

    def close(self) -> None:
        """Unsubscribes from all topics."""
        for feed in self._feeds.values():
            feed.close()


class Feed:
    """One camera topic: its newest message, and the viewers that wait for the next one."""

    def __init__(
        self,
        context: RobotContext,
        update_tokens: Callable[[], None],
        topic: str,
        type_name: str,
        cameras: Sequence[Camera],
    ) -> None:
        """`cameras` are those of the topic: the strictest of their limits count."""
        self.topic = topic
        self._max_age_s = min(camera.max_age_s for camera in cameras)
        self._max_side_px = min(camera.max_side_px for camera in cameras)
        self._type = type_name
        self._robot = context.robot
        self._key = context.robot.key(topic)
        self._interfaces = context.interfaces
        self._link = context.link
        self._changed = context.signals.changed.emit
        self._update_tokens = update_tokens
        self._loop = asyncio.get_running_loop()
        self._viewers = ClientPlaces(VIEWERS)
        self._closing: asyncio.TimerHandle | None = None
        self._newest: Frame | None = None  # set on the link's thread
        self._state = CameraTopicState()
        self._viewed_at = -math.inf  # of the newest frame that the view knows of
        self._counted = 0  # the number of the newest frame whose traffic was recorded
        self._next_frame: asyncio.Future[None] | None = None  # if a viewer waits for it
        self._encoding: tuple[Frame, asyncio.Task[Picture]] | None = None

    @contextmanager
    def subscribed(self, client: str) -> Iterator[None]:
        """Keeps the topic subscribed to during the block, and `LINGER_S` longer. `client` is that of
        `client_key`; TooMany if no more of its viewers may look."""
        if not self._viewers.has_place(client):
            raise TooMany(say("camera_too_many_viewers", most=self._viewers.most(client)), 5)
        self._viewers.take(client)
        self._subscribe()
        try:
            yield
        finally:
            self._viewers.release(client)
            if self._viewers.empty and self._robot.camera_topics.get(self._key) is self._state:
                self._closing = self._loop.call_later(LINGER_S, self.close)

    async def newer(self, than: int) -> Frame:
        """The newest frame with a larger number; waits for the next one if there is none."""
        while (newest := self._newest) is None or newest.number <= than:
            if self._next_frame is None:
                self._next_frame = self._loop.create_future()
            if self._newest is newest:  # none has arrived in between
                await asyncio.shield(self._next_frame)
        self._show(newest)
        self._count(newest)
        return newest

    async def picture(self, frame: Frame, widget: Camera) -> Picture:
        """The picture of a frame, encoded once for all viewers; NoPicture says why there is none."""
        try:
            if difference := self._robot.difference("MP", self._key):
                raise NoPicture(say("topic_definition_differs", name=self.topic, type=difference.type))
            if len(frame.payload) > widget.max_bytes:
                size, most = len(frame.payload), widget.max_bytes
                raise NoPicture(say("camera_large", size=size, most=most))
            encoded = await asyncio.shield(self._encode_once(frame))
        except NoPicture as error:
            self._set_problem(error.reason)
            raise
        self._set_problem("")
        return encoded

    def close(self) -> None:
        """Unsubscribes and drops the newest frame."""
        self._cancel_closing()
        if self._robot.camera_topics.pop(self._key, None) is not None:
            with suppress(LinkError):
                self._link.unsubscribe(self._key)
            self._update_tokens()
            self._newest = self._encoding = None

    def _cancel_closing(self) -> None:
        if self._closing is not None:
            self._closing.cancel()
            self._closing = None

    def _subscribe(self) -> None:
        self._cancel_closing()
        if self._key in self._robot.camera_topics:
            return
        self._state = self._robot.camera_topics[self._key] = CameraTopicState()
        self._viewed_at = -math.inf
        self._newest, self._counted = None, 0  # what arrived while the last subscription ended
        expression = self._robot.dialect.topic(self._key, self._type)
        self._update_tokens()
        with suppress(LinkError):  # the next session subscribes
            self._link.subscribe_on_demand(self._key, expression, self._on_payload)
        self._changed()

    def _on_payload(self, payload: Buffer) -> None:
        """On the link's thread: replaces the newest frame, and wakes the loop if a viewer waits."""
        last = self._newest  # the loop may replace it by None
        frame = Frame(last.number + 1 if last else 1, payload, time.monotonic(), time.time())
        self._newest = frame
        self._state.at, self._state.wall = frame.at, frame.wall
        if self._next_frame is not None:
            with suppress(RuntimeError):  # the loop is closed
                self._loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        next_frame, self._next_frame = self._next_frame, None
        if next_frame is not None and not next_frame.done():
            next_frame.set_result(None)

    def _count(self, frame: Frame) -> None:
        """Records a frame and those before it that no viewer took, once for all viewers."""
        if frame.number > self._counted:
            skipped, self._counted = frame.number - self._counted - 1, frame.number
            sample = Sample(frame.payload, 0, frame.at, frame.wall, None, skipped)
            self._robot.traffic.record(self._key, sample)

    def _show(self, frame: Frame) -> None:
        """The view has a deadline for the age of a frame: only the first frame after it changes it."""
        if frame.at - self._viewed_at >= self._max_age_s:
            self._changed()
        self._viewed_at = frame.at

    def _encode_once(self, frame: Frame) -> "asyncio.Task[Picture]":
        if self._encoding is None or self._encoding[0] is not frame:
            work = asyncio.to_thread(self._encode, frame.payload)
            self._encoding = frame, asyncio.ensure_future(work)
        return self._encoding[1]

    def _encode(self, payload: Buffer) -> Picture:
        return picture(self._interfaces, self._type, bytes(payload), self._max_side_px)

    def _set_problem(self, problem: TextLike) -> None:
        if self._state.problem != problem:
            self._state.problem = problem
            self._changed()
