"""What another process reads of the operator's log for the server, piece by piece."""

import asyncio
import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Final, TypeVar

from app.audit.reader_main import ReadRequest
from app.errors import LogError
from app.i18n import say
from app.settings import PACKAGE

PIECE_BYTES: Final = 65_536  # bytes: as many as a pipe has
COMMAND: Final = (sys.executable, "-P", "-c", "from app.audit.reader_main import run; run()")

Done = TypeVar("Done")


class ReaderProcess:
    """Used on the event loop; what waits for the process, does so on a thread."""

    def __init__(self, wish: ReadRequest) -> None:
        self._request = wish
        self._loop = asyncio.get_running_loop()
        self._thread = ThreadPoolExecutor(1, "operators-log-process")
        self._process: subprocess.Popen[bytes] | None = None
        self._killed = False

    async def start(self) -> bytes:
        """Its first piece; LogError where the log can't be read."""
        return await self._on_thread(self._start_process)

    async def read_next(self) -> bytes:
        """Its next piece, b"" after the last; LogError where it breaks off."""
        return await self._on_thread(self._read_piece)

    async def read_all(self) -> bytes:
        """All of it, of what is not much; LogError."""
        pieces = [await self.start()]
        while pieces[-1]:
            pieces.append(await self.read_next())
        return b"".join(pieces)

    def kill(self) -> None:
        """It ends now: the client that reads gets an error."""
        self._killed = True
        if self._process is not None:
            self._process.kill()

    async def close(self) -> None:
        """Leaves neither process nor thread."""
        self.kill()
        await asyncio.shield(self._on_thread(self._close))
        self._thread.shutdown(wait=False)

    def _on_thread(self, work: Callable[[], Done]) -> "asyncio.Future[Done]":
        return self._loop.run_in_executor(self._thread, work)

    def _start_process(self) -> bytes:
        try:
            self._process = process = _popen()
        except OSError as error:  # such as memory or open files that are used up
            raise LogError(say("log_unreadable", why=error.strerror or str(error))) from error
        if self._killed:
            process.kill()
        assert process.stdin is not None
        try:
            process.stdin.write(self._request.as_json())
            process.stdin.close()
        except BrokenPipeError:
            pass  # it has ended: why is read with its answer
        return self._read_piece()

    def _read_piece(self) -> bytes:
        process = self._process
        assert process is not None
        assert process.stdout is not None
        assert process.stderr is not None
        if piece := process.stdout.read(PIECE_BYTES):
            return piece
        if process.wait():
            said = process.stderr.read(PIECE_BYTES).decode(errors="replace").strip()
            why = said.splitlines()[-1] if said else say("log_reader_ended")
            raise LogError(say("log_unreadable", why=why))
        return b""

    def _close(self) -> None:
        if self._process is not None:
            with self._process:
                self._process.kill()


def _popen() -> "subprocess.Popen[bytes]":
    path = os.pathsep.join(filter(None, (str(PACKAGE.parent), os.environ.get("PYTHONPATH"))))
    return subprocess.Popen(
        COMMAND,
        bufsize=0,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,  # what a terminal tells the server is not for this one
    )
