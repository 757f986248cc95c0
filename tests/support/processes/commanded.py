"""A process that is controlled by JSON lines: one command in, one response out; see
`tests/ros_nodes/commands.py`."""

import json
import os
import signal
import subprocess
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from tests.support.processes.forked import Forked, as_here
from tests.support.processes.signals import send_signal

ENDS_WITHIN_S: Final = 10.0


class Commanded:
    """A controlled process. `first` is its first response, sent when it is ready. It ends when its
    stdin is closed, so it never outlives the process that started it."""

    def __init__(self, command: Sequence[str | Path], env: Mapping[str, str], **options: Any) -> None:
        inherited = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        self._command = [str(part) for part in command]
        self._options: dict[str, Any] = {"env": {**inherited, **env}, **options}
        self._lock = threading.Lock()
        self.start()

    def start(self) -> None:
        """Starts the program, or restarts it after its end."""
        self._process = self._started()
        self.first = self._answer()

    def _started(self) -> subprocess.Popen[str] | Forked:
        if self._options.keys() == {"env"} and as_here():
            return Forked.ros_program(self._command, self._options["env"])
        return subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            **self._options,
        )

    @property
    def pid(self) -> int:
        return self._process.pid

    def __call__(self, do: str, **named: Any) -> Any:
        """Sends a command and returns the response; AssertionError with the error of the process."""
        with self._lock:
            assert self._process.stdin is not None
            self._process.stdin.write(json.dumps({"do": do, **named}) + "\n")
            self._process.stdin.flush()
            return self._answer()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, f"{self._process.args!r} has ended"
        answer = json.loads(line)
        assert "error" not in answer, answer["error"]
        return answer["ok"]

    def freeze(self) -> None:
        send_signal(self.pid, signal.SIGSTOP)

    def thaw(self) -> None:
        self._process.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        self._process.kill()
        self.end()

    def end(self) -> None:
        """Ends the process and waits; kills it after `ENDS_WITHIN_S`."""
        self.thaw()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
