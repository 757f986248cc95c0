"""Work in a child process: reading a long log or checking a robot takes no time of the interpreter from
presses and holds, and what a template does ends within its limits.

The parent names a function and gives its arguments; the results of the function, a generator, arrive
one by one. They are plain values (None, numbers, texts, bytes, and lists, tuples and tables of them):
the child can make the parent create nothing else. A child ends with its parent, also if that is killed.
"""

import asyncio
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import AsyncIterator, Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from tempfile import TemporaryFile
from typing import IO, Any, Final, TypeVar

from app.system.errors import KioskError, os_error_text
from app.system.settings import PACKAGE
from app.system.texts import TextLike

COMMAND: Final = (sys.executable, "-P", "-c", "from app.system.worker import serve; serve()")
BACKGROUND: Final = 10  # added to the niceness: a lower priority than the server's
MAX_OUTPUT: Final = 65_536  # bytes of what it writes to stderr

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a child may take: seconds until it is killed, and bytes of memory beside what it uses before
    it calls the function."""

    within_s: float | None = None
    memory: int | None = None
    nice: int = BACKGROUND


UNLIMITED: Final = Limits()


class WorkerError(KioskError):
    """The work failed, for a reason to be put into a sentence; "" if the child ended without a word.
    `ended_with` is its exit status, negative for a signal; `output` is what it wrote to stderr."""

    def __init__(self, reason: TextLike = "", ended_with: int = 0, output: str = "") -> None:
        super().__init__(reason)
        self.ended_with = ended_with
        self.output = output


class Worker:
    """Calls the function `name` ("app.records.reader:search") in a child process. One thread at a time
    uses it; any thread may kill it."""

    def __init__(self, name: str, *arguments: object, limits: Limits = UNLIMITED) -> None:
        self._request = pickle.dumps((name, arguments, limits))
        self._process: subprocess.Popen[bytes] | None = None
        self._killed = False

    def results(self) -> Generator[Any, None, None]:
        """Starts the child; its results as they arrive. WorkerError if it fails, OSError if it can't be
        started."""
        with TemporaryFile() as errors, _start(errors) as process:
            assert process.stdin is not None
            self._process = process
            try:
                if self._killed:
                    process.kill()
                with suppress(BrokenPipeError):  # it has ended: the reason is read below
                    process.stdin.write(self._request)
                    process.stdin.flush()  # it stays open: its end is the end of the parent
                yield from _results(process, errors)
            finally:
                process.kill()
                with suppress(BrokenPipeError):
                    process.stdin.close()

    def kill(self) -> None:
        """Ends the child: the reader of its results gets a WorkerError."""
        self._killed = True
        if self._process is not None:
            self._process.kill()


class _PlainValues(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        raise pickle.UnpicklingError(f"{module}.{name} is not a plain value")


def _start(errors: IO[bytes]) -> "subprocess.Popen[bytes]":
    """`errors` takes what the child writes to stderr: a pipe that no one reads would stop it."""
    path = os.pathsep.join(filter(None, (str(PACKAGE.parent), os.environ.get("PYTHONPATH"))))
    return subprocess.Popen(
        COMMAND,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,  # signals of the server's terminal do not reach it
    )


def _results(process: "subprocess.Popen[bytes]", errors: IO[bytes]) -> Iterator[Any]:
    assert process.stdout is not None
    while (frame := _frame(process.stdout)) is not None:
        is_result, value = frame
        if not is_result:
            raise WorkerError(value)
        yield value
    if status := process.wait():
        errors.seek(max(0, errors.seek(0, os.SEEK_END) - MAX_OUTPUT))
        output = errors.read().decode(errors="replace").strip()
        raise WorkerError((output.splitlines() or [""])[-1], status, output)


def _frame(source: IO[bytes]) -> tuple[bool, Any] | None:
    """The next result or failure; None after the last, or where it breaks off."""
    try:
        is_result, value = _PlainValues(source).load()
        return bool(is_result), value
    except (EOFError, pickle.UnpicklingError, ValueError, TypeError):
        return None


class RunningWorker:
    """A worker that is read on the event loop; a thread waits for it. `failed` makes the exception of
    its failure, of the reason; "" if the child ended without a word."""

    def __init__(self, worker: Worker, failed: Callable[[TextLike], KioskError]) -> None:
        self._failed = failed
        self._results = worker.results()
        self._thread = ThreadPoolExecutor(1, "worker")
        self.kill: Final = worker.kill

    async def next_result(self) -> Any:
        """None after the last."""
        return await self._read(lambda: next(self._results, None))

    async def all_results(self) -> list[Any]:
        """All that are left."""
        return await self._read(lambda: list(self._results))

    async def close(self) -> None:
        """Ends the child and the thread."""
        self.kill()
        await asyncio.shield(self._on_thread(self._results.close))
        self._thread.shutdown(wait=False)

    async def _read(self, work: Callable[[], Result]) -> Result:
        try:
            return await self._on_thread(work)
        except WorkerError as error:
            raise self._failed(error.text) from error
        except OSError as error:  # such as memory or open files that are used up
            raise self._failed(os_error_text(error)) from error

    def _on_thread(self, work: Callable[[], Result]) -> "asyncio.Future[Result]":
        return asyncio.get_running_loop().run_in_executor(self._thread, work)


class Workers:
    """The workers of one owner. Used on the event loop only."""

    def __init__(self, failed: Callable[[TextLike], KioskError]) -> None:
        """`failed` is as of `RunningWorker`."""
        self._failed = failed
        self._running: set[RunningWorker] = set()
        self.closed = False

    @asynccontextmanager
    async def run(self, worker: Worker) -> AsyncIterator[RunningWorker]:
        """Runs a worker within the block."""
        running = RunningWorker(worker, self._failed)
        if self.closed:
            running.kill()
        self._running.add(running)
        try:
            yield running
        finally:
            self._running.discard(running)
            await running.close()

    def close(self) -> None:
        """Ends all at shutdown: what they still do fails."""
        self.closed = True
        for running in self._running:
            running.kill()


# The child.


def serve() -> None:
    """Its entry point: the request is on stdin, the results go to stdout."""
    request = sys.stdin.buffer
    name, arguments, limits = pickle.load(request)
    with os.fdopen(os.dup(1), "wb") as out:
        os.dup2(2, 1)  # what a function prints is no result
        threading.Thread(target=_end_with_parent, daemon=True).start()
        sys.exit(_answer(name, arguments, limits, out))


def _end_with_parent() -> None:
    signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())  # they are the main thread's
    while os.read(0, 1):
        pass
    os.kill(os.getpid(), signal.SIGKILL)


def _answer(name: str, arguments: tuple[Any, ...], limits: Limits, out: IO[bytes]) -> int:
    """Writes the results; returns the exit status."""
    module, _, function = name.partition(":")
    call = getattr(import_module(module), function)
    _limit(limits)
    try:
        for result in call(*arguments):
            _write(out, True, result)
    except KioskError as error:
        _write(out, False, str(error))
    except BrokenPipeError:
        pass
    except Exception:
        traceback.print_exc()
        return 1
    return 0


def _write(out: IO[bytes], is_result: bool, value: Any) -> None:
    pickle.dump((is_result, value), out)
    out.flush()


def _limit(limits: Limits) -> None:
    with suppress(OSError):  # a unit of before forbids it
        os.nice(limits.nice)
    if limits.within_s is not None:
        signal.setitimer(signal.ITIMER_REAL, limits.within_s)  # SIGALRM ends a process
    if limits.memory is not None:
        with open("/proc/self/statm") as file:
            used = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        resource.setrlimit(resource.RLIMIT_AS, (used + limits.memory,) * 2)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
