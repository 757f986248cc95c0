"""A child process with all that it starts: a session of its own, ended as a whole."""

import asyncio
import fcntl
import os
import signal
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Final

# Above the descriptors that a child's protocol names: duplicating one never closes another.
LOWEST_FD: Final = 10


def high_pipe() -> tuple[int, int]:
    """(read end, write end) of a pipe, both `LOWEST_FD` or more and closed on exec."""
    low = os.pipe()
    high = [fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, LOWEST_FD) for fd in low]
    for fd in low:
        os.close(fd)
    return high[0], high[1]


class Child:
    """Runs from its making. `ended` is set when the process has exited."""

    def __init__(
        self, command: Sequence[str], env: Mapping[str, str], inherited: Mapping[int, int] | None = None
    ) -> None:
        """`inherited` maps descriptors of this process to numbers in the child. OSError if the program
        can't be started."""
        actions = [(os.POSIX_SPAWN_DUP2, mine, its) for mine, its in (inherited or {}).items()]
        self.pid = os.posix_spawnp(
            command[0],
            list(command),
            dict(env),
            file_actions=actions,
            setsid=True,
            setsigdef=[signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE],
        )
        self.ended = asyncio.Event()
        self._pidfd = os.pidfd_open(self.pid)
        asyncio.get_running_loop().add_reader(self._pidfd, self._reap)

    @property
    def runs(self) -> bool:
        return not self.ended.is_set()

    async def end(self, grace_s: float = 0.0) -> None:
        """Ends the process and its session: by SIGTERM and, after `grace_s`, by SIGKILL."""
        if grace_s and self.runs:
            os.kill(self.pid, signal.SIGTERM)
            with suppress(TimeoutError):
                async with asyncio.timeout(grace_s):
                    await self.ended.wait()
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)  # what it started may live on
        await self.ended.wait()

    def _reap(self) -> None:
        asyncio.get_running_loop().remove_reader(self._pidfd)
        os.close(self._pidfd)
        os.waitpid(self.pid, 0)
        self.ended.set()
