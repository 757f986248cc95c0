"""Keeps what the pages of each robot showed at its stops.

Nothing is done while nothing stops. At a stop the view is built once, on the event loop; curves and
lines of logs follow one by one, and the file is written beside the event loop.
"""

import asyncio
import logging
import math
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Final, TypeVar

from app.cell.robot.log_lines import Line, LogFilter
from app.cell.robot.state import RobotState
from app.cell.session.alarms import SHOWN_WITHIN_S
from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.cell.stops.shown import ShownFault, ShownView, as_bytes, write
from app.cell.view.trend import Plot, plot
from app.panel.widgets.displays import LogView
from app.panel.widgets.trend import Trend
from app.system.concurrency import spawn_logged
from app.system.errors import LogError
from app.system.limits import Quota, TokenBuckets
from app.system.version import installed_version

log = logging.getLogger("kiosk.stops")

TOGETHER_S: Final = 1.0  # what stops a robot within this time is kept once
STOPS: Final = Quota(10, per_s=1 / 60)  # of a robot that are kept
ALARMS_WITHIN_S: Final = SHOWN_WITHIN_S + 0.1  # after the stop
MOST_CURVES: Final = 12  # trends, and as many logs
MOST_LINES: Final = 200  # of a log

Kind = TypeVar("Kind", Trend, LogView)


class StopViews:
    """Writes into the data folder, until `stop`. Used on the event loop only."""

    def __init__(self, fleet: Fleet, data: Path) -> None:
        self._fleet = fleet
        self._data = data
        self._kept_at: dict[str, float] = {}  # monotonic seconds, by the robot's id
        self._buckets = TokenBuckets(STOPS)
        self._writing = asyncio.Lock()
        self._ending = asyncio.Event()
        self._waiting: deque[RobotSession] = deque()
        self._tasks: set[asyncio.Task[None]] = set()
        self._has_failed = False

    def stopped(self, session: RobotSession) -> None:
        """A robot has stopped, in a turn that goes on: what it shows is taken after that."""
        robot, now = str(session.robot.id or ""), time.monotonic()
        if now - self._kept_at.get(robot, -math.inf) < TOGETHER_S or not self._buckets.has_token(robot):
            return
        self._kept_at[robot] = now
        self._buckets.take_token(robot)
        self._waiting.append(session)
        if len(self._waiting) == 1:
            asyncio.get_running_loop().call_soon(self._keep_next)

    async def stop(self) -> None:
        """Waits for what is being written."""
        self._ending.set()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def now(self, session: RobotSession) -> bytes:
        """What the pages of a robot show now, as the content of a file; ShownFault."""
        shown = await self._with_lines(self._taken(session), session)
        return await asyncio.to_thread(as_bytes, await self._with_curves(shown, session))

    def _keep_next(self) -> None:
        """One robot in a step: an alarm of the panel stops all of them."""
        session = self._waiting[0]
        try:
            writing = self._write(self._taken(session), session)
            task = spawn_logged(writing, log, "what was shown at a stop is not kept")
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        finally:
            self._waiting.popleft()
            if self._waiting:
                asyncio.get_running_loop().call_soon(self._keep_next)

    def _taken(self, session: RobotSession) -> ShownView:
        return ShownView(
            at=time.time(),
            robot=str(session.robot.id or ""),
            revision=self._fleet.panel.revision,
            version=installed_version(),
            view=self._fleet.whole_view(session),
        )

    async def _write(self, shown: ShownView, session: RobotSession) -> None:
        shown = await self._with_lines(shown, session)
        # The alarms of the stop are shown when they are on the disk, and trends get their last values.
        with suppress(TimeoutError):
            await asyncio.wait_for(self._ending.wait(), ALARMS_WITHIN_S)
        shown = await self._with_curves(shown, session)
        shown = replace(shown, view={**shown.view, "alarms": self._fleet.alarms.view()})
        async with self._writing:
            try:
                await asyncio.to_thread(write, self._data, shown)
            except LogError as error:
                if not self._has_failed or isinstance(error, ShownFault):
                    log.error("what was shown at a stop is not kept: %s", error)
                self._has_failed = True
            else:
                self._has_failed = False

    async def _with_lines(self, shown: ShownView, session: RobotSession) -> ShownView:
        """With the newest lines of logs, each topic in a step of its own."""
        lines: dict[str, list[tuple[int, Line]]] = {}
        for name, widget, robot in self._widgets(LogView, session):
            kept = robot.log_lines[robot.key(widget.topic)]
            lines[name] = kept.newest(LogFilter(), MOST_LINES).lines
            await asyncio.sleep(0)
        return replace(shown, lines=lines)

    async def _with_curves(self, shown: ShownView, session: RobotSession) -> ShownView:
        """With the curves of trends until its time, each in a step of its own."""
        monotonic = time.monotonic() - (time.time() - shown.at)
        plots: dict[str, Plot] = {}
        for name, widget, robot in self._widgets(Trend, session):
            plots[name] = plot(widget, robot, monotonic, shown.at)
            await asyncio.sleep(0)
        return replace(shown, plots=plots)

    def _widgets(
        self, kind: type[Kind], session: RobotSession
    ) -> Iterator[tuple[str, Kind, RobotState]]:
        """Those of a kind on the pages of a robot, each with the robot that it shows."""
        widgets = (widget for widget in self._fleet.panel.widgets() if isinstance(widget, kind))
        for widget in islice(widgets, MOST_CURVES):
            name = str(widget.id)
            yield name, widget, self._fleet.session_for(session, name).robot


def keep_stops(fleet: Fleet, data: Path) -> StopViews:
    """Keeps what is shown at the stops of each robot of a fleet from now on."""
    views = StopViews(fleet, data)
    for session in fleet.sessions:
        session.context.signals.stopped.connect(partial(views.stopped, session))
    return views
