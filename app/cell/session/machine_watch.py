"""What the server sees of the machine that it runs on, for pages, metrics and the operator's log:
whether the machine's clock follows a time source, how far each robot's clock is from it, and which
known weaknesses concern what is installed."""

import asyncio
import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, Protocol

from app.cell.robot.clocks import Skew
from app.cell.view.clock_status import skew_text
from app.cell.view.machine_status import (
    Machine,
    Weaknesses,
    time_remedy,
    time_text,
    weakness_text,
)
from app.records.entry import Entry, Kind, new_entry
from app.system.errors import LogError, SettingsError
from app.system.inventory import installed
from app.system.minisign import SIGNATURE_SUFFIX
from app.system.texts import TextLike, joined, say
from app.system.time_source import TimeSource, read_time_source
from app.system.vex import read_signed_vex, verdicts

log = logging.getLogger("kiosk.machine")

LOOK_EVERY_S: Final = 5.0
READ_EVERY: Final = 12  # looks
MOVED_S: Final = 1.0  # a skew that has changed by less is not logged again
MOVED_BY: Final = 0.2  # of the logged one


class WatchedLog(Protocol):
    """The operator's log as the watch uses it."""

    def add(self, entry: Entry) -> None: ...


VEX: Final = "vex.json"  # beside the panel file, or in the data folder
RELOAD_S: Final = 3600.0  # packages may have been installed meanwhile

Stamp = tuple[object, ...]


class MachineReader:
    """Reads what is known of the machine. Used on a thread."""

    def __init__(self, folders: Sequence[Path], keys: Path) -> None:
        """`folders` may have a VEX file, `keys` are the public keys that it may be signed with."""
        self._folders = folders
        self._keys = keys
        self._weaknesses: tuple[Stamp, float, Weaknesses] | None = None

    def read(self) -> Machine:
        """Blocks for some seconds at most."""
        return Machine(read_time_source(), self._vex())

    def _vex(self) -> Weaknesses | None:
        """Judged again when one of the files has changed, and each hour."""
        file = next((file for each in self._folders if (file := each / VEX).is_file()), None)
        if file is None:
            return None
        signature = file.with_name(file.name + SIGNATURE_SUFFIX)
        stamp, now = tuple(map(_stamp, (file, signature, self._keys))), time.monotonic()
        if self._weaknesses is None or self._weaknesses[0] != stamp or self._weaknesses[1] < now:
            self._weaknesses = stamp, now + RELOAD_S, judged(file, self._keys)
        return self._weaknesses[2]


def judged(file: Path, keys: Path) -> Weaknesses:
    """What a signed VEX file says of what is installed. Blocks."""
    try:
        vex, _ = read_signed_vex(file, keys)
    except SettingsError as error:
        return Weaknesses(file, fault=str(error))
    judgements = verdicts(vex, installed())
    affected = [verdict for verdict in judgements if verdict.status == "affected"]
    investigated = sum(verdict.status == "under_investigation" for verdict in judgements)
    return Weaknesses(file, affected, investigated)


def _stamp(file: Path) -> Stamp:
    try:
        about = file.stat()
    except OSError:
        return (str(file),)
    return str(file), about.st_mtime_ns, about.st_size, about.st_ino


class MachineWatch:
    """Looks at the machine, and writes what changes into the operator's log. Used on the event loop;
    what blocks is read on a thread."""

    def __init__(
        self,
        operators_log: WatchedLog,
        skews: Callable[[], Mapping[str, Skew | None]],
        read: Callable[[], Machine],
    ) -> None:
        """`skews` returns the skew of each robot's clock, by the robot's id. `read` blocks."""
        self.now = Machine()
        self._log = operators_log
        self._skews = skews
        self._read = read
        self._logged_time: tuple[object, ...] = ()
        self._logged_skews: dict[str, Skew] = {}
        self._logged_weaknesses: Weaknesses | None = None

    async def run(self) -> None:
        """Until it is cancelled."""
        looks = 0
        while True:
            if looks % READ_EVERY == 0:
                self.now = await asyncio.to_thread(self._read)
            looks += 1
            self.log_changes()
            await asyncio.sleep(LOOK_EVERY_S)

    def log_changes(self) -> None:
        """Writes an entry of the time source if it is another than before, of each robot whose skew is
        known now, or has moved, and of the weaknesses that a VEX file says. What the log does not take
        is tried again."""
        try:
            self._log_time(self.now.time)
            self._log_weaknesses(self.now.weaknesses)
            for robot, skew in self._skews().items():
                if skew is not None and _has_moved(self._logged_skews.get(robot), skew):
                    said = say("log_robot_clock", text=skew_text(skew))
                    self._add("clock", said, _skew_values(skew), robot)
                    self._logged_skews[robot] = skew
        except LogError as error:
            log.debug("not in the operator's log yet: %s", error)

    def _log_time(self, source: TimeSource) -> None:
        """How exact it is changes all the time, and is logged with the rest only."""
        state = source.synchronised, source.source
        if state == self._logged_time:
            return
        self._add("clock", joined((time_text(source), time_remedy(source))), asdict(source))
        self._logged_time = state

    def _log_weaknesses(self, weaknesses: Weaknesses | None) -> None:
        if weaknesses is None or weaknesses == self._logged_weaknesses:
            return
        names = {each.weakness: str(each.component) for each in weaknesses.affected}
        about = {"file": str(weaknesses.file)} | names
        self._add("diagnostics", weakness_text(weaknesses), about, action="diagnostics_vex")
        self._logged_weaknesses = weaknesses

    def _add(
        self, kind: Kind, reason: TextLike, values: Mapping[str, Any], robot: str = "", action: str = ""
    ) -> None:
        known = {name: value for name, value in values.items() if value not in (None, "")}
        self._log.add(new_entry(kind, values=known, reason=reason, robot=robot, action=action))


def _has_moved(before: Skew | None, now: Skew) -> bool:
    if before is None or before.state != now.state:
        return True
    return abs(now.seconds - before.seconds) >= max(MOVED_S, MOVED_BY * abs(before.seconds))


def _skew_values(skew: Skew) -> Mapping[str, Any]:
    return {"skew_s": round(skew.seconds, 3), "by": skew.witness}
