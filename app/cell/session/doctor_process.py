"""The work of `operator-panel doctor` and `support` for the page of diagnostics, one at a time, and of
`parcel` for the page of a stop, one at a time.

Each is done in a process: its checks take some seconds of CPU, which no press waits for, and it has a
Zenoh session to itself. So the page has what the commands have, by the same rules.
"""

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Final

from pydantic import BaseModel, Field, ValidationError

from app.records.principal import Principal
from app.system.concurrency import spawn_logged
from app.system.errors import DoctorError, TooMany
from app.system.settings import Settings
from app.system.texts import TextLike, say
from app.system.worker import Limits, RunningWorker, Worker, Workers

if TYPE_CHECKING:
    from app.cell.stops.story import Stop

log = logging.getLogger("kiosk.doctor")

LIMITS: Final = Limits(within_s=120.0)
MOST_BYTES: Final = 64_000_000  # of a bundle
LONGEST_REASON: Final = 300  # characters
AGAIN_S: Final = 10


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


def _failed(why: TextLike) -> DoctorError:
    log.warning("the doctor failed: %s", why)
    cut = why[:LONGEST_REASON] if isinstance(why, str) else why
    return DoctorError(say("doctor_failed", why=cut or "its process ended"))


def _not_made(why: TextLike) -> DoctorError:
    log.warning("a fault parcel was not made: %s", why)
    cut = why[:LONGEST_REASON] if isinstance(why, str) else why
    return DoctorError(say("parcel_failed", why=cut or "its process ended"))


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
    _workers: Workers = field(default_factory=lambda: Workers(_failed))
    _parcel_lock: asyncio.Lock = field(default_factory=asyncio.Lock)
    _parcels: Workers = field(default_factory=lambda: Workers(_not_made))
    _checking: "asyncio.Task[None] | None" = None

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
        bundle: bytes = await self._run("app.tools.cli.support:bundle")
        if len(bundle) > MOST_BYTES:
            raise _failed("the bundle is too large")
        return bundle

    @asynccontextmanager
    async def parcel(
        self, stop: "Stop", language: str, taker: Principal, now: Callable[[], Awaitable[bytes | None]]
    ) -> AsyncIterator[RunningWorker]:
        """The fault parcel of a stop, in pieces of its zip, with the pages that `taker` may see; `now`
        returns what they show now, None if that is not known. DoctorError if it can't be made, TooMany
        while another one is."""
        if self._parcel_lock.locked():
            raise TooMany(say("parcel_busy"), AGAIN_S)
        async with self._parcel_lock:
            about = (stop.at, stop.robot, stop.key), language, (taker.role, taker.groups)
            name = "app.tools.cli.parcel:pieces"
            worker = Worker(name, self.settings, *about, await now(), limits=LIMITS)
            async with self._parcels.run(worker) as running:
                yield running

    async def stop(self) -> None:
        """Ends the process that runs."""
        self._workers.close()
        self._parcels.close()
        if self._checking is not None:
            await asyncio.gather(self._checking, return_exceptions=True)

    async def _check(self) -> None:
        try:
            self.report = DoctorReport.model_validate(await self._run("app.tools.cli.doctor:check"))
            self.wall, self.fault = time.time(), ""
        except DoctorError as error:
            self.fault = error.text
        except ValidationError as error:
            self.fault = _failed(str(error)).text
        finally:
            self._checking = None

    async def _run(self, work: str) -> Any:
        """The result of a function of the commands, in a process; DoctorError."""
        async with self._lock:
            worker = Worker(work, self.settings, self.host, self.port, limits=LIMITS)
            async with self._workers.run(worker) as running:
                (result,) = await running.all_results()
        return result
