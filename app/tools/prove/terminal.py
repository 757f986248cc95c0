"""Keys and lines of a person at a terminal, or lines of a program."""

import os
import select
import sys
import termios
import tty
from types import TracebackType
from typing import Any, Final, TextIO

CHUNK: Final = 1024


class Terminal:
    """At a terminal a key counts at once; otherwise each line is one, by its first letter. EOFError at
    the end of the input."""

    def __init__(self, descriptor: int | None = None, out: TextIO | None = None) -> None:
        self._in = sys.stdin.fileno() if descriptor is None else descriptor
        self._out = out or sys.stdout
        self._typed = b""
        self._mode: list[Any] | None = None

    def __enter__(self) -> "Terminal":
        if os.isatty(self._in):
            self._mode = termios.tcgetattr(self._in)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._mode is not None:
            termios.tcsetattr(self._in, termios.TCSADRAIN, self._mode)

    def say(self, text: str) -> None:
        print(text, file=self._out, flush=True)

    def key(self, within_s: float) -> str:
        """The next key in lower case; "" if there is none in time."""
        if self._mode is None:
            line = self._line(within_s)
            return "" if line is None else line.strip()[:1].lower()
        tty.setcbreak(self._in, termios.TCSADRAIN)
        if not self._typed:
            self._read(within_s)
        key, self._typed = self._typed[:1], self._typed[1:]
        return key.decode("ascii", "replace").strip().lower()

    def line(self, prompt: str) -> str:
        """A line of text."""
        if self._mode is not None:
            termios.tcsetattr(self._in, termios.TCSADRAIN, self._mode)
        print(prompt, end="", file=self._out, flush=True)
        while (line := self._line(None)) is None:
            pass
        return line.strip()

    def _line(self, within_s: float | None) -> str | None:
        while b"\n" not in self._typed:
            if not self._read(within_s):
                return None
        line, _, self._typed = self._typed.partition(b"\n")
        return line.decode(errors="replace")

    def _read(self, within_s: float | None) -> bool:
        """Whether something was typed in time."""
        if not select.select([self._in], [], [], within_s)[0]:
            return False
        typed = os.read(self._in, CHUNK)
        if not typed or typed == b"\x04":  # Ctrl-D
            raise EOFError
        self._typed += typed
        return True
