"""One turn of a robot's session: inbox → robot's state → holds → confirmations → view.

The order is said here and nowhere else. Holds and confirmations depend on nothing that is shown: a view
that is slow, or that fails, keeps no hold from its end.
"""

import asyncio
import logging
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from app.robot.state import Reading
from app.ros_logging import RobotLog
from app.runtime.ingest import Ingest, Updates
from app.runtime.robot_commands import RobotCommands
from app.transport.peer import Peer, RobotContext
from app.view.refresh import ViewRefresher

log = logging.getLogger("kiosk")


class Turn:
    """The turns of one robot; on the event loop only, but for `wake`."""

    def __init__(
        self,
        context: RobotContext,
        peer: Peer,
        ingest: Ingest,
        commands: RobotCommands,
        refresher: ViewRefresher,
    ) -> None:
        self._link = context.link
        self._robot = context.robot
        self._renew = context.renew
        self._peer = peer
        self._ingest = ingest
        self._commands = commands
        self._refresher = refresher
        self._log = RobotLog(log, self._robot.name)
        self._loop = asyncio.get_running_loop()
        self._frame: asyncio.TimerHandle | None = None  # when what waits is taken
        self._running = False
        self._again = False  # something changed while a turn ran, that it may not have shown
        self._stopped = False

    def stop(self) -> None:
        """Takes nothing any more."""
        self._stopped = True
        self._cancel_frame()

    def wake(self, prompt: bool) -> None:
        """On a thread of Zenoh's; what is not prompt waits for the next frame."""
        with suppress(RuntimeError):  # the loop is closed: the process ends
            self._loop.call_soon_threadsafe(self.run if prompt else self._run_by_frame)

    def _run_by_frame(self) -> None:
        if self._refresher.due <= self._loop.time():
            self.run()
        elif self._frame is None:
            self._frame = self._loop.call_at(self._refresher.due, self.run)

    def run(self) -> None:
        """One turn, with all that has arrived until now."""
        self._cancel_frame()
        if self._stopped:
            return
        self._peer.look()
        changes = self._link.drain()
        came_up = not self._robot.link_up and changes.link_up
        if self._robot.link_up and not changes.link_up:
            self._log.warning("Zenoh link lost")
            self._renew()
            return
        if came_up:
            self._robot.link_up = True
            self._log.info("Zenoh link up")
        with self._turn():
            for updates in self._ingest.steps(changes):
                updates.urgent |= came_up
                if updates.graph:
                    self._peer.lost(updates.bridges_lost)
                    self._peer.found(updates.bridges_found)
                    self.on_graph_change(updates.bridge_appeared)
                self._apply(updates)

    def run_late_reading(self, key: str, reading: Reading) -> None:
        """The same for a message of a topic that took more than one turn to read."""
        if not self._stopped:
            with self._turn():
                self._apply(self._ingest.late_reading(key, reading))

    def changed(self) -> None:
        """The same for what has changed by itself: of the peer, a command, or who has control."""
        if self._running:
            self._again = True
            return
        with self._turn():
            self._apply(Updates(urgent=True))

    def on_graph_change(self, came: bool) -> None:
        """After every change of the graph; `came`: there is a peer where there was none."""
        self._robot.update_publishers()
        self._commands.on_graph_change()
        self._peer.follow(came)

    def _apply(self, updates: Updates) -> None:
        """By the robot's state as it is now: holds, then confirmations, and the view last."""
        self._commands.holds.judge()
        for key, reading in updates.readings:
            self._confirm(key, reading)
        if updates.urgent or self._again:
            self._again = False
            self._refresher.now()
        elif updates.other:
            self._refresher.soon()
        elif updates.values:
            self._refresher.values(updates.values)

    def _confirm(self, key: str, reading: Reading) -> None:
        try:
            self._commands.confirmations.update(key, reading)
        except Exception:
            self._log.exception("whether %s confirms a command was not judged", key)

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """While it runs, what changes by it is shown by it: at its end, or in one more turn."""
        running, self._running = self._running, True
        try:
            yield
        finally:
            self._running = running
            if self._again and not running:
                self._again = False
                self._loop.call_soon(self.changed)

    def _cancel_frame(self) -> None:
        if self._frame is not None:
            self._frame.cancel()
            self._frame = None
