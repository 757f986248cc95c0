"""One turn of a robot's session: inbox → robot's state → control → alarms → holds → confirmations →
view.

Only this module defines the order. Holds and confirmations do not depend on the view: a slow or failing
view never delays the end of a hold.
"""

import asyncio
import logging
import math
from collections.abc import Iterable
from contextlib import suppress
from typing import Final

from app.permission.control_authority import ControlAuthority
from app.robot.state import Reading
from app.ros_logging import RobotLog
from app.runtime.ingest import Ingest, Updates
from app.runtime.robot_alarms import RobotAlarms
from app.runtime.robot_commands import RobotCommands
from app.transport.peer import Peer, RobotContext
from app.view.refresh import ViewRefresher

log = logging.getLogger("kiosk")

LATEST_S: Final = 0.04  # until data that waits for a frame is ingested, also where frames are rare


class Turn:
    """The turns of one robot. Used on the event loop only, except `wake`."""

    def __init__(
        self,
        context: RobotContext,
        peer: Peer,
        control: ControlAuthority,
        ingest: Ingest,
        commands: RobotCommands,
        refresher: ViewRefresher,
        alarms: RobotAlarms,
    ) -> None:
        self._link = context.link
        self._robot = context.robot
        self._link_lost, self._ran = context.signals.link_lost, context.signals.ran
        self._peer = peer
        self._control = control
        self._ingest = ingest
        self._commands = commands
        self._refresher = refresher
        self._alarms = alarms
        self._log = RobotLog(log, self._robot.name)
        self._loop = asyncio.get_running_loop()
        self._frame: asyncio.TimerHandle | None = None  # the turn that is scheduled for the next frame
        self._control_timer: asyncio.TimerHandle | None = None
        self._control_due = math.inf  # when the turn of `_control_timer` runs, in monotonic seconds
        self._running = False
        self._again = False  # something changed that no step of a turn may have shown
        self._stopped = False

    def stop(self) -> None:
        """Runs no further turns."""
        self._stopped = True
        self._cancel_frame()
        if self._control_timer is not None:
            self._control_timer.cancel()

    def wake(self, immediate: bool) -> None:
        """Called on Zenoh's threads. Data that is not `immediate` waits for the next frame."""
        with suppress(RuntimeError):  # the loop is closed: the process ends
            self._loop.call_soon_threadsafe(self.run if immediate else self._run_by_frame)

    def _run_by_frame(self) -> None:
        if self._refresher.due <= self._loop.time():
            self.run()
        elif self._frame is None:
            latest = self._loop.time() + LATEST_S
            self._frame = self._loop.call_at(min(self._refresher.due, latest), self.run)

    def run(self) -> None:
        """Runs a turn with everything that has arrived so far."""
        self._cancel_frame()
        if self._stopped:
            return
        self._peer.check_stall()
        changes = self._link.drain()
        came_up = not self._robot.link_up and changes.link_up
        if self._robot.link_up and not changes.link_up:
            self._log.warning("Zenoh link lost")
            self._link_lost.emit()
            return
        if changes.reopen:  # what it waited for is there
            self._link_lost.emit()
            return
        if came_up:
            self._robot.link_up = True
            self._again = True  # the first step shows it
            self._log.info("Zenoh link up")
        self._run_steps(self._ingest.steps(changes))

    def run_late_reading(self, key: str, reading: Reading) -> None:
        """Runs a turn for a message that took more than one turn to decode."""
        if not self._stopped:
            self._run_steps([self._ingest.late_reading(key, reading)])

    def changed(self) -> None:
        """Runs a turn after a change that no data caused: of the peer, a command, or control."""
        if self._running:
            self._again = True
            return
        self._run_steps([Updates(urgent=True)])

    def on_graph_change(self, peer_appeared: bool) -> None:
        """Updates everything after a change of the graph; `peer_appeared`: there was no peer before."""
        self._robot.update_publishers()
        self._commands.on_graph_change()
        self._peer.on_graph_change(peer_appeared)

    def on_graph_read(self) -> None:
        """Updates everything after the nodes of the graph were read: what they are may be known now."""
        self._robot.update_nodes()
        self._commands.on_graph_change()
        self.changed()

    def _run_steps(self, steps: Iterable[Updates]) -> None:
        """Runs the steps of a turn. Changes during it are shown at its end, or in one more turn."""
        running, self._running = self._running, True
        try:
            self._control.advance()
            for updates in steps:
                self._apply(updates)
        finally:
            self._running = running
            self._ran.emit()
            if self._again and not running:
                self._again = False
                self._loop.call_soon(self.changed)
            self._schedule_control()

    def _apply(self, updates: Updates) -> None:
        """Updates alarms, holds, confirmations, then the view, from the robot's current state."""
        if updates.graph:
            self._peer.lost(updates.peers_lost)
            self._peer.appeared(updates.peers_found)
            self.on_graph_change(updates.peer_appeared)
        self._alarms.update(updates.topics)
        self._commands.holds.judge()
        for key, reading in updates.readings:
            self._confirm(key, reading)
        if updates.urgent or self._again:
            self._again = False
            self._refresher.refresh_now()
        elif updates.other:
            self._refresher.refresh_next_frame()
        elif updates.values:
            self._refresher.refresh_values(updates.values)

    def _schedule_control(self) -> None:
        """Plans the turn that records the next change of control by time: no data may arrive until
        then."""
        due = self._control.until
        if self._stopped or due == math.inf or (self._control_timer and self._control_due <= due):
            return
        if self._control_timer:
            self._control_timer.cancel()
        self._control_due = due
        self._control_timer = self._loop.call_at(due, self._run_for_control)

    def _run_for_control(self) -> None:
        self._control_timer = None
        self.run()

    def _confirm(self, key: str, reading: Reading) -> None:
        try:
            self._commands.confirmations.update(key, reading)
        except Exception:
            self._log.exception("checking %s for confirmations failed", key)

    def _cancel_frame(self) -> None:
        if self._frame is not None:
            self._frame.cancel()
            self._frame = None
