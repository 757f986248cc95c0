"""Publishes the summary of the cell, for a panel with `[site]`: at most once a second, when it has
changed, and every few seconds else."""

import asyncio
import logging
import time
from contextlib import suppress
from typing import Any, Final

from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.cell.site.summary import (
    EVERY_S,
    MAX_BYTES,
    About,
    FigureNow,
    RobotNow,
    payload_of,
    read_summary,
    summary_of,
)
from app.cell.view.conditions import state_s
from app.cell.view.kinds import attributes_of
from app.panel.rules import SiteRules
from app.panel.widgets.displays import Readout
from app.ros.zenoh.config import Config
from app.ros.zenoh.site import SummaryPublisher
from app.system.concurrency import keep_running
from app.system.errors import InputError
from app.system.version import installed_version

log = logging.getLogger("kiosk.site")

LOOK_EVERY_S: Final = 1.0
TWIN_KEPT_S: Final = 4 * EVERY_S  # without a word of it, another panel with this name is gone


class SiteSummary:
    """From `start` to `stop`. Used on the event loop only. `name` is the cell's, `twin` another panel
    that publishes with it, "" for none."""

    def __init__(self, fleet: Fleet, rules: SiteRules, config: Config, simulated: bool) -> None:
        panel = fleet.panel
        self.name = f"{rules.name}/{panel.site_cell}"
        self.twin = ""
        self._twin_at = 0.0
        self._fleet, self._rules = fleet, rules
        self._about = About(
            rules.name,
            panel.site_cell,
            rules.url or "",
            installed_version(),
            fleet.first.publisher.instance_id,
            panel.readers_languages,
            simulated,
        )
        self._figures = [panel.widget(figure, Readout) for figure in rules.figures]
        self._link = SummaryPublisher(config, rules.name, panel.site_cell)
        self._last: dict[str, Any] = {}
        self._sent_at = 0.0
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def is_connected(self) -> bool:
        """Whether a router is reached now."""
        return self._link.is_connected

    def start(self) -> None:
        self._tasks = [
            keep_running(self._run, log, "publishing the cell's summary failed"),
            asyncio.create_task(self._link.open()),
        ]

    async def stop(self) -> None:
        for task in self._tasks:
            task.cancel()
        for task in self._tasks:
            with suppress(asyncio.CancelledError):
                await task
        await self._link.close()

    async def _run(self) -> None:
        while True:
            self._look(time.monotonic(), time.time())
            await asyncio.sleep(LOOK_EVERY_S)

    def _look(self, now: float, wall: float) -> None:
        self._hear(now)
        summary = self.summary(now, wall)
        # `since` is computed of two clocks, and may differ by a second.
        is_same = {**summary, "since": ""} == {**self._last, "since": ""}
        if is_same and now - self._sent_at < EVERY_S:
            return
        if is_same:
            summary["since"] = self._last["since"]
        self._last, self._sent_at = summary, now
        payload = payload_of(summary, wall)
        if len(payload) > MAX_BYTES:
            payload = payload_of({**summary, "alarm_list": [], "links": []}, wall)
        self._link.put(payload)

    def _hear(self, now: float) -> None:
        """Takes what another panel publishes with this name. What can't be read is one too."""
        if (payload := self._link.take_other()) is not None:
            try:
                other = read_summary(payload, self._about.site, self._about.cell)
                is_other, named = other.instance != self._about.instance, other.url or other.instance
            except InputError as error:
                is_other, named = True, f"({error})"
            if is_other:
                self.twin, self._twin_at = named, now
        elif self.twin and now - self._twin_at > TWIN_KEPT_S:
            self.twin = ""

    def summary(self, now: float, wall: float) -> dict[str, Any]:
        """What is published, at `now` (monotonic seconds) and `wall` (seconds since the epoch)."""
        robots = [self._robot(session, now) for session in self._fleet.sessions]
        figures = [self._figure(figure, now) for figure in self._figures]
        return summary_of(self._about._replace(twin=self.twin), robots, figures, wall)

    def _robot(self, session: RobotSession, now: float) -> RobotNow:
        state = self._fleet.panel.state
        since = state_s(state.display, session.robot, now) if state else None
        return RobotNow(session.publisher.view, session.refresher.lamp, since)

    def _figure(self, readout: Readout, now: float) -> FigureNow:
        """Not from the view: no page may show it now."""
        session = self._fleet.session_for(self._fleet.first, readout.id)
        attributes, _ = attributes_of(readout, session.robot, now)
        return FigureNow(readout.id, readout.label, readout.unit or "", attributes)
