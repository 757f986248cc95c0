"""Reads the operator's log in another process, chunk by chunk."""

import asyncio
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final, Protocol, TypeVar

from app.errors import LogError, os_error_text
from app.i18n import say
from app.settings import PACKAGE

PIECE_BYTES: Final = 65_536  # the capacity of a pipe
COMMAND: Final = (sys.executable, "-P", "-c", "from app.audit.reader_main import run; run()")


class Request(Protocol):
    """What the process reads, as JSON on its stdin."""

    def as_json(self) -> bytes: ...


Done = TypeVar("Done")


class ReaderProcess:
    """Runs `app.audit.reader_main`, or another command, in a process. Used on the event loop; a thread
    waits for the process."""

    def __init__(self, request: Request, command: Sequence[str] = ()) -> None:
        self._request = request
        self._command = command
        self._loop = asyncio.get_running_loop()
        self._thread = ThreadPoolExecutor(1, "operators-log-process")
        self._process: subprocess.Popen[bytes] | None = None
        self._killed = False

    async def start(self) -> bytes:
        """Starts the process; returns the first chunk. LogError if the log can't be read."""
        return await self._on_thread(self._start_process)

    async def read_next(self) -> bytes:
        """The next chunk, b"" after the last; LogError if the process fails."""
        return await self._on_thread(self._read_piece)

    async def read_all(self) -> bytes:
        """The whole output, for short ones; LogError."""
        pieces = [await self.start()]
        while pieces[-1]:
            pieces.append(await self.read_next())
        return b"".join(pieces)

    def kill(self) -> None:
        """Kills the process: the client that reads gets an error."""
        self._killed = True
        if self._process is not None:
            self._process.kill()

    async def close(self) -> None:
        """Ends the process and the thread."""
        self.kill()
        await asyncio.shield(self._on_thread(self._close))
        self._thread.shutdown(wait=False)

    def _on_thread(self, work: Callable[[], Done]) -> "asyncio.Future[Done]":
        return self._loop.run_in_executor(self._thread, work)

    def _start_process(self) -> bytes:
        try:
            self._process = process = _popen(self._command or COMMAND)
        except OSError as error:  # such as memory or open files that are used up
            raise LogError(say("log_unreadable", why=os_error_text(error))) from error
        if self._killed:
            process.kill()
        assert process.stdin is not None
        try:
            process.stdin.write(self._request.as_json())
            process.stdin.close()
        except BrokenPipeError:
            pass  # the process has ended; `_read_piece` raises the reason
        return self._read_piece()

    def _read_piece(self) -> bytes:
        process = self._process
        assert process is not None
        assert process.stdout is not None
        assert process.stderr is not None
        if piece := process.stdout.read(PIECE_BYTES):
            return piece
        if process.wait():
            output = process.stderr.read(PIECE_BYTES).decode(errors="replace").strip()
            why = output.splitlines()[-1] if output else say("log_reader_ended")
            raise LogError(say("log_unreadable", why=why))
        return b""

    def _close(self) -> None:
        if self._process is not None:
            with self._process:
                self._process.kill()


def _popen(command: Sequence[str]) -> "subprocess.Popen[bytes]":
    path = os.pathsep.join(filter(None, (str(PACKAGE.parent), os.environ.get("PYTHONPATH"))))
    return subprocess.Popen(
        command,
        bufsize=0,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,  # signals of the server's terminal do not reach it
    )
