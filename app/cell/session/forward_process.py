"""The forwarder's process, as the server sees it: started, started again, and what it tells of itself.

The server reads only its small status: no press waits for the disk or the network of the forwarding.
"""

import asyncio
import logging
import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.cell.forward.status import ForwardStatus, parse_status
from app.system.concurrency import keep_running
from app.system.errors import LogError
from app.system.texts import TextLike, say
from app.system.worker import Limits, Worker, Workers

log = logging.getLogger("kiosk.forward")

LIMITS: Final = Limits(memory=400_000_000, nice=19)


def _failed(why: TextLike) -> LogError:
    return LogError(why or "its process ended")


class ForwardProcess:
    """The forwarding of a data folder by the settings of a file, from `start` to `stop`. Used on the
    event loop only."""

    def __init__(self, settings: Path, folder: Path, address: str) -> None:
        """`address` is of the database, as a person reads it."""
        self.status = ForwardStatus(address=address)
        self._settings = settings
        self._folder = folder
        self._address = address
        self._workers = Workers(_failed)
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        self._task = keep_running(self._run, log, "forwarding failed")

    async def stop(self) -> None:
        """Ends the process: what it has not sent is sent after the next start."""
        self._workers.close()
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task

    async def _run(self) -> None:
        worker = Worker(
            "app.cell.forward.forwarder:run",
            str(self._settings),
            str(self._folder),
            os.getpid(),
            limits=LIMITS,
        )
        try:
            async with self._workers.run(worker) as running:
                while (text := await running.next_result()) is not None:
                    self.status = parse_status(text)
        except LogError as error:
            if not self._workers.closed:
                self._report_end(error.text)
                raise
            return
        self._report_end("")
        raise LogError("its process ended")

    def _report_end(self, why: TextLike) -> None:
        """The last status, as one that is not connected."""
        status = self.status
        if status.connected or not status.since:
            status.since = time.time()
        status.connected, status.note = False, ""
        status.fault = say("forward_ended", why=why or "its process ended")
