"""Runs `operator-panel doctor` and `operator-panel support` for the page of diagnostics, one at a time.

Each is a process at a low priority: its checks take some seconds of CPU, which no press waits for, and
it has a Zenoh session to itself. So the page has what the commands have, by the same rules.
"""

import asyncio
import json
import logging
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Final

from pydantic import BaseModel, Field, ValidationError

from app.system.concurrency import spawn_logged
from app.system.errors import DoctorError
from app.system.settings import PACKAGE, PREFIX, Settings
from app.system.texts import TextLike, say

log = logging.getLogger("kiosk.doctor")

NICE: Final = 10
# The unit's filter of system calls forbids a change of the priority, as with `app.records.reader`.
PROGRAM: Final = f"""
import contextlib, os, sys
with contextlib.suppress(OSError):
    os.nice({NICE})
from app.tools.cli.command import main
sys.exit(main())
"""
COMMAND: Final = (sys.executable, "-P", "-c", PROGRAM)
WITHIN_S: Final = 120.0
MOST_BYTES: Final = 64_000_000  # of a bundle
WELL: Final = (0, 1)  # the exit status of a doctor that could look
LAST_LINE: Final = 300  # characters


class FoundFault(BaseModel):
    """A finding of the doctor: the `sentence` of what is wrong, in JSON `what`, and what to `do`.
    `about` names it, `robot` is the id of one of several. `details` are the values in both, each a text
    or a sentence of the catalogue by its code."""

    severity: str
    code: str
    about: str
    robot: str
    sentence: Annotated[str, Field(alias="what")]
    do: str
    details: dict[str, Any] = Field(default_factory=dict, exclude=True)


class DoctorReport(BaseModel):
    """What the doctor found: `more` counts, by code, findings that are left out; `facts` are what is as
    it should be."""

    well: bool
    findings: list[FoundFault]
    more: dict[str, int]
    facts: list[str]


@dataclass(slots=True)
class DoctorProcess:
    """The doctor of one server, which listens on `host` and `port`. Used on the event loop only.
    `wall` is when the `report` was made, in seconds since the epoch; `fault`: why there is none
    newer."""

    settings: Settings
    host: str = "127.0.0.1"
    port: int = 8000
    report: DoctorReport | None = None
    wall: float = 0.0
    fault: TextLike = ""
    _lock: asyncio.Lock = field(default_factory=asyncio.Lock)
    _process: "subprocess.Popen[bytes] | None" = None
    _checking: "asyncio.Task[None] | None" = None
    _stopped: bool = False

    @property
    def is_busy(self) -> bool:
        """Whether it checks, or collects a bundle."""
        return self._lock.locked() or self._checking is not None

    def begin_check(self) -> None:
        """Begins a check, which takes some seconds; `report` is its result."""
        if self._checking is None:
            self._checking = spawn_logged(self._check(), log, "the doctor failed")

    async def bundle(self) -> bytes:
        """The zip of a support bundle; DoctorError if it can't be made."""
        with TemporaryDirectory(prefix="operator-panel-") as folder:
            file = Path(folder) / "bundle.zip"
            await self._run("support", "--yes", "-o", str(file), allowed=(0,))
            try:
                if file.stat().st_size > MOST_BYTES:
                    raise DoctorError(say("doctor_failed", why="the bundle is too large"))
                return await asyncio.to_thread(file.read_bytes)
            except OSError as error:
                raise DoctorError(say("doctor_failed", why=str(error))) from error

    async def stop(self) -> None:
        """Ends the process that runs."""
        self._stopped = True
        if self._process is not None:
            self._process.kill()
        if self._checking is not None:
            await asyncio.gather(self._checking, return_exceptions=True)

    async def _check(self) -> None:
        try:
            output = await self._run("doctor", "--json", allowed=WELL)
            self.report = DoctorReport.model_validate(json.loads(output))
            self.wall, self.fault = time.time(), ""
        except DoctorError as error:
            self.fault = error.text
        except (ValueError, ValidationError) as error:
            self.fault = say("doctor_failed", why=str(error)[:LAST_LINE])
        finally:
            self._checking = None

    async def _run(self, command: str, *options: str, allowed: Sequence[int]) -> bytes:
        """The output of a command, which ends with a status that is allowed; else DoctorError."""
        where = ("--host", self.host, "--port", str(self.port))
        async with self._lock:
            if self._stopped:
                raise DoctorError(say("doctor_failed", why="the server ends"))
            status, output, errors = await asyncio.to_thread(
                self._run_process, [*COMMAND, command, str(self.settings.panel), *where, *options]
            )
        if status not in allowed:
            lines = (errors or output).decode(errors="replace").strip().splitlines()
            why = lines[-1][:LAST_LINE] if lines else f"it ended with {status}"
            log.warning("operator-panel %s ended with %d", command, status)
            raise DoctorError(say("doctor_failed", why=why))
        return output

    def _run_process(self, command: Sequence[str]) -> tuple[int, bytes, bytes]:
        """On a thread. (status, output, errors)."""
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env=self._environment(),
                start_new_session=True,  # signals of the server's terminal do not reach it
            )
        except OSError as error:
            raise DoctorError(say("doctor_failed", why=str(error))) from error
        self._process = process
        try:
            output, errors = process.communicate(timeout=WITHIN_S)
        except subprocess.TimeoutExpired:
            process.kill()
            output, errors = process.communicate()
        finally:
            self._process = None
        return process.returncode, output, errors

    def _environment(self) -> dict[str, str]:
        """The server's own, with the settings that it runs with."""
        known: dict[str, Any] = {
            "ZENOH": self.settings.zenoh,
            "MODE": self.settings.mode,
            "DATA": self.settings.data,
        }
        path = os.pathsep.join(filter(None, (str(PACKAGE.parent), os.environ.get("PYTHONPATH"))))
        return {
            **os.environ,
            **{PREFIX + name: str(value) for name, value in known.items() if value is not None},
            "PYTHONPATH": path,
        }
