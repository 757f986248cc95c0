"""What the server sees of itself, for the panel's own alarms: its log, its disk, its clock, the
certificates that it uses and its connection to the broker of MQTT."""

import asyncio
import logging
import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, Protocol

from app.alarms.engine import AlarmEngine
from app.alarms.entries import AlarmEntry
from app.alarms.own import (
    OwnAlarm,
    broker_entry,
    certificate_entry,
    clock_entry,
    disk_entry,
    log_entry,
    own_definitions,
    unused_certificate_entry,
)
from app.audit.press_record import Log
from app.certificates.folder import Listed, about
from app.certificates.served import NO_FILES, UsedCertificates
from app.errors import KioskError
from app.panel.alarm import AlarmRules

log = logging.getLogger("kiosk.alarms")

CHECK_S: Final = 1.0
DISK_EVERY: Final = 10  # checks
CERTIFICATES_EVERY: Final = 3600  # checks
CLOCKS_APART_S: Final = 0.05  # two clocks that are read further apart say nothing
MEGABYTE: Final = 1e6


class Usage(Protocol):
    """The free bytes of a disk."""

    @property
    def free(self) -> int: ...


class Broker(Protocol):
    """Where alarms are published: `address` is "" for nowhere, `state` why there is no connection."""

    is_connected: bool
    state: str

    @property
    def address(self) -> str: ...


class OwnAlarms:
    """The panel's own alarms, from `start` to `stop`. Used on the event loop only."""

    def __init__(
        self,
        rules: AlarmRules,
        folder: Path,
        operators_log: Log,
        engine: AlarmEngine,
        evaluate: Callable[[], None],
        certificates: UsedCertificates = NO_FILES,
    ) -> None:
        self._certificates = certificates
        self._certificate_fault = ""
        self._rules = rules
        self._folder = folder
        self._log = operators_log
        self._engine = engine
        self._evaluate = evaluate
        self._definitions = dict(own_definitions())
        self._entries: dict[OwnAlarm, AlarmEntry] = {}
        self._listening = ExitStack()
        self._ahead_s = time.time() - time.monotonic()  # of the wall clock
        self._disk_is_low = False
        self._checks = 0
        self._broker: Broker | None = None
        self._connected_at = 0.0  # the last time, in monotonic seconds
        self._timer: asyncio.TimerHandle | None = None
        self._measuring: asyncio.Task[None] | None = None
        self._reading: asyncio.Task[None] | None = None

    def start(self, broker: Broker) -> None:
        """Adds the alarms, and looks at what they are about from now on."""
        self._broker, self._connected_at = broker, time.monotonic()
        self._set("panel_disk", disk_entry(self._rules.disk_free_mb, self._rules.disk_free_mb, False))
        self._set("panel_clock", clock_entry(0.0, 0.0))
        self._check_log()
        self._listening.enter_context(self._log.notifying(self._log_changed))
        self._check()

    def stop(self) -> None:
        self._listening.close()
        for work in (self._timer, self._measuring, self._reading):
            if work is not None:
                work.cancel()

    def _set(self, name: OwnAlarm, entry: AlarmEntry) -> None:
        """One that returns still says what its cause was."""
        known = self._entries.get(name)
        self._entries[name] = entry if entry.level or known is None else known._replace(level=0)
        self._engine.own_changed(self._definitions[name], self._entries[name])

    def _log_changed(self) -> None:
        self._check_log()
        self._evaluate()

    def _check_log(self) -> None:
        self._set("panel_log", log_entry(self._log.fault, bool(self._log.lock)))

    def _check(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(CHECK_S, self._check)
        self._check_clock()
        self._check_broker()
        if self._checks % DISK_EVERY == 0 and self._measuring is None:
            self._measuring = asyncio.create_task(self._check_disk())
        fault = self._certificates.fault
        is_new, self._certificate_fault = fault != self._certificate_fault, fault
        if self._certificates.all_files and (is_new or self._checks % CERTIFICATES_EVERY == 0):
            self._reading = asyncio.create_task(self._check_certificates())
        self._checks += 1
        self._evaluate()

    def _check_clock(self) -> None:
        before, wall, after = time.monotonic(), time.time(), time.monotonic()
        if after - before > CLOCKS_APART_S:
            return
        ahead_s = wall - before
        by_s, shown = ahead_s - self._ahead_s, before + self._ahead_s
        self._ahead_s = ahead_s
        self._set("panel_clock", clock_entry(by_s, shown))

    def _check_broker(self) -> None:
        broker, now = self._broker, time.monotonic()
        if broker is None or not broker.address:
            return
        if broker.is_connected:
            self._connected_at = now
        self._set("panel_mqtt", broker_entry(broker.address, broker.state, now - self._connected_at))

    async def _check_disk(self) -> None:
        """Measures on a thread: a disk may not answer."""
        try:
            usage = await asyncio.to_thread(_usage, self._folder)
        except OSError as error:
            log.warning("the free space of %s is not known: %s", self._folder, error)
        else:
            entry = disk_entry(usage.free / MEGABYTE, self._rules.disk_free_mb, self._disk_is_low)
            self._disk_is_low = entry.level > 0
            self._set("panel_disk", entry)
            self._evaluate()
        finally:
            self._measuring = None

    async def _check_certificates(self) -> None:
        """Reads them on a thread: a renewed one is another file, or the same with other content."""
        if self._certificates.fault:
            file = str(self._certificates.all_files[0])
            self._set("panel_certificate", unused_certificate_entry(file))
            self._evaluate()
            return
        listed = await asyncio.to_thread(_listed, self._certificates.all_files)
        if listed:
            first = min(listed, key=lambda certificate: certificate.until)
            entry = certificate_entry(str(first.file), first.until, datetime.now(UTC))
            self._set("panel_certificate", entry)
            self._evaluate()


def _listed(files: Sequence[Path]) -> list[Listed]:
    """The certificates that can be read."""
    listed = []
    for file in files:
        try:
            listed.append(about(file))
        except KioskError as error:
            log.warning("when a certificate ends is not known: %s", error)
    return listed


def _usage(folder: Path) -> Usage:
    """Of the disk of a folder, which may not be there yet."""
    return shutil.disk_usage(next(path for path in (folder, *folder.parents) if path.exists()))
