"""The answers of the persons who watch a live proof, in a file: written whole after each answer, so
that the proof can be interrupted at any moment and continued later."""

import fcntl
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, Literal, TextIO

from pydantic import BaseModel, ValidationError

from app.system.errors import KioskError, os_error_text
from app.system.texts import render
from app.system.whole_file import write_whole

HASH_SHOWN: Final = 12
Word = Literal["tick", "cross", "skip"]


class Answer(BaseModel):
    """What a person has said of a step, and what was measured: `rows` are `Result`s, none of a step
    that was skipped. `at` is RFC 3339."""

    word: Word
    by: str
    at: str
    remark: str = ""
    rows: list[dict[str, Any]] = []


class Answers(BaseModel):
    """The answers by the keys of their steps, for a panel file."""

    version: Literal[1] = 1
    panel: str
    sha256: str
    began: str
    answers: dict[str, Answer] = {}


class AnswersFile:
    """Locked by one proof at a time. `aside` is where the answers for another panel file were put, None
    without any."""

    def __init__(self, path: Path, panel: str, sha256: str) -> None:
        """KioskError if it is in use, or can't be read or written."""
        self._path = path
        self._lock = self._locked()
        self.aside: Path | None = None
        read = self._read()
        if read is not None and read.sha256 != sha256:
            self.aside = path.with_name(f"{path.name}.{read.sha256[:HASH_SHOWN]}")
            path.replace(self.aside)
            read = None
        self._answers = read or Answers(panel=panel, sha256=sha256, began=now_text())
        self._write()

    def _locked(self) -> TextIO:
        try:
            lock = self._path.with_name(f".{self._path.name}.lock").open("w")
        except OSError as error:
            raise self._fault("written", error) from error
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            raise KioskError(
                f"{self._path} is in use: this proof runs at another terminal. End it there to"
                " continue here"
            ) from None
        return lock

    def _read(self) -> Answers | None:
        try:
            return Answers.model_validate_json(self._path.read_bytes())
        except FileNotFoundError:
            return None
        except OSError as error:
            raise self._fault("read", error) from error
        except ValidationError as error:
            raise KioskError(
                f"{self._path} has no answers of a live proof: name another file with --state"
            ) from error

    def _write(self) -> None:
        text = json.dumps(self._answers.model_dump(), indent=1, ensure_ascii=False)
        try:
            write_whole(self._path, text.encode(), mode=None)
        except OSError as error:
            raise self._fault("written", error) from error

    def _fault(self, act: str, error: OSError) -> KioskError:
        return KioskError(f"{self._path} can't be {act}: {render(os_error_text(error))}")

    def get(self, key: str) -> Answer | None:
        return self._answers.answers.get(key)

    def keep(self, key: str, answer: Answer) -> None:
        """Is on the disk when it returns; KioskError if it can't be written."""
        self._answers.answers[key] = answer
        self._write()

    def close(self) -> None:
        self._lock.close()


def now_text() -> str:
    """Now in UTC, as RFC 3339."""
    return datetime.now(UTC).isoformat(timespec="seconds")
