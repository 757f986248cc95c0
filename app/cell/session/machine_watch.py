"""What the server sees of the machine that it runs on, for pages, metrics and the operator's log:
whether its clock follows a time source and how far each robot's clock is from it, which known
weaknesses concern what is installed, which newer release is there, and whether the log has room."""

import asyncio
import json
import logging
import re
import shutil
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final, Protocol

from app.cell.commands.acts import Finish
from app.cell.robot.clocks import Skew
from app.cell.view.clock_status import skew_text
from app.cell.view.machine_status import (
    Machine,
    Postponed,
    Weaknesses,
    release_text,
    room_text,
    time_remedy,
    time_text,
    weakness_text,
)
from app.panel.rules import LogRules
from app.records.entry import Entry, Kind, new_entry
from app.records.room import LogRoom, log_room
from app.system.errors import LogError, SettingsError, os_error_text
from app.system.inventory import installed, system_packages
from app.system.minisign import SIGNATURE_SUFFIX
from app.system.releases import NewRelease, newest_release
from app.system.texts import Text, TextLike, joined, say
from app.system.time_source import TimeSource, read_time_source
from app.system.version import installed_version
from app.system.vex import read_signed_vex, verdicts
from app.system.whole_file import write_whole

log = logging.getLogger("kiosk.machine")

LOOK_EVERY_S: Final = 5.0
READ_EVERY: Final = 12  # looks
MOVED_S: Final = 1.0  # a skew that has changed by less is not logged again
MOVED_BY: Final = 0.2  # of the logged one


class Reader(Protocol):
    """What reads the machine, and blocks."""

    def read(self) -> Machine: ...
    def postpone(self, postponed: Postponed) -> None: ...


class WatchedLog(Protocol):
    """The operator's log as the watch uses it."""

    def add(self, entry: Entry) -> None: ...


# Beside the panel file, in the data folder, or where newer releases are put: what a maker has written,
# or else the file of the newest release.
VEX: Final = "vex.json"
RELEASE_VEX: Final = "operator_panel-*.vex.json"
UPDATES: Final = "updates"  # the folder of newer releases, beside the panel file
POSTPONED: Final = "update-notice.json"  # in the data folder
MOST_FILES: Final = 200
RELOAD_S: Final = 3600.0  # packages may have been installed since

Stamp = tuple[object, ...]


class MachineReader:
    """Reads what is known of the machine. Used on a thread."""

    def __init__(self, panel: Path, data: Path, keys: Path, rules: LogRules) -> None:
        """`panel` and `data` are the folders of the panel file and of the data, `keys` the public keys
        of releases. `rules` are those of the operator's log."""
        self._folders = panel, data, panel / UPDATES
        self._data = data
        self._updates = panel / UPDATES
        self._keys = keys
        self._rules = rules
        self._weaknesses: tuple[Stamp, float, Weaknesses] | None = None
        self._release: tuple[Stamp, NewRelease | None] | None = None

    def read(self) -> Machine:
        """Blocks for some seconds at most."""
        release = self._newest()
        return Machine(
            read_time_source(),
            self._vex(),
            release,
            read_postponed(self._data / POSTPONED) if release is not None else None,
            self._room(),
        )

    def postpone(self, postponed: Postponed) -> None:
        """OSError."""
        write_whole(self._data / POSTPONED, json.dumps(asdict(postponed)).encode())

    def _room(self) -> LogRoom | None:
        if not self._rules.enabled:
            return None
        try:
            return log_room(self._data, self._rules.days, self._rules.size_mb, free_bytes)
        except (LogError, OSError) as error:
            log.debug("the room of the operator's log is not known: %s", error)
            return None

    def _newest(self) -> NewRelease | None:
        """Its signature is checked again when a file has changed."""
        try:
            files = sorted(self._updates.iterdir())[:MOST_FILES]
        except OSError:
            return None
        stamp = tuple(map(_stamp, (*files, self._keys)))
        if self._release is None or self._release[0] != stamp:
            newest = newest_release(self._updates, installed_version(), self._keys)
            self._release = stamp, newest
        return self._release[1]

    def _vex(self) -> Weaknesses | None:
        """Judged again when one of the files has changed, and each hour."""
        file = vex_file(self._folders)
        if file is None:
            return None
        signature = file.with_name(file.name + SIGNATURE_SUFFIX)
        stamp, now = tuple(map(_stamp, (file, signature, self._keys))), time.monotonic()
        if self._weaknesses is None or self._weaknesses[0] != stamp or self._weaknesses[1] < now:
            self._weaknesses = stamp, now + RELOAD_S, judged(file, self._keys)
        return self._weaknesses[2]


def vex_file(folders: Iterable[Path]) -> Path | None:
    """The VEX file that counts; None without one."""
    places = list(folders)
    own = next((file for folder in places if (file := folder / VEX).is_file()), None)
    shipped = (file for folder in places for file in folder.glob(RELEASE_VEX) if file.is_file())
    return own or max(shipped, key=_release_number, default=None)


def _release_number(file: Path) -> list[int]:
    return [int(number) for number in re.findall(r"[0-9]+", file.name)]


def judged(file: Path, keys: Path) -> Weaknesses:
    """What a signed VEX file says of what is installed. Blocks."""
    try:
        vex, _ = read_signed_vex(file, keys)
    except SettingsError as error:
        return Weaknesses(file, fault=str(error))
    judgements = verdicts(vex, (*installed(), *system_packages()))
    affected = [verdict for verdict in judgements if verdict.status == "affected"]
    investigated = sum(verdict.status == "under_investigation" for verdict in judgements)
    return Weaknesses(file, affected, investigated)


def free_bytes(folder: Path) -> int:
    return shutil.disk_usage(folder).free


def read_postponed(file: Path) -> Postponed | None:
    """None where nothing is postponed, or the file can't be read."""
    try:
        about = json.loads(file.read_bytes())
        return Postponed(str(about["version"]), float(about["until"]), str(about["by"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


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
        reader: Reader,
    ) -> None:
        """`skews` returns the skew of each robot's clock, by the robot's id."""
        self.now = Machine()
        self._log = operators_log
        self._skews = skews
        self._reader = reader
        self._logged_time: tuple[object, ...] = ()
        self._logged_skews: dict[str, Skew] = {}
        self._logged_weaknesses: Weaknesses | None = None
        self._logged_release: NewRelease | None = None
        self._postponed: Postponed | None = None  # since the start
        self._is_room_logged = False

    async def run(self) -> None:
        """Until it is cancelled."""
        looks = 0
        while True:
            if looks % READ_EVERY == 0:
                machine = await asyncio.to_thread(self._reader.read)
                # What was postponed while it was read may not be on the disk yet.
                self.now = replace(machine, postponed=self._postponed or machine.postponed)
            looks += 1
            self.log_changes()
            await asyncio.sleep(LOOK_EVERY_S)

    def postpone(self, postponed: Postponed) -> Finish:
        """Shows the notice of a newer release later, and keeps that over a restart."""
        self._postponed = postponed
        self.now = replace(self.now, postponed=postponed)

        async def finish() -> Text | None:
            try:
                await asyncio.to_thread(self._reader.postpone, postponed)
            except OSError as error:
                return say("release_not_kept", why=os_error_text(error))
            return None

        return finish

    def log_changes(self) -> None:
        """Writes an entry of the time source if it is another than before, of each robot whose skew is
        known now, or has moved, of the weaknesses that a VEX file says, of a newer release, and of a
        room that has become short. What the log does not take is tried again."""
        try:
            self._log_time(self.now.time)
            self._log_weaknesses(self.now.weaknesses)
            self._log_release(self.now.release)
            self._log_room(self.now.room)
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

    def _log_release(self, release: NewRelease | None) -> None:
        if release is None or release == self._logged_release:
            return
        about = {"version": release.version, "file": str(release.file), "signed": release.signed}
        self._add("diagnostics", release_text(release), about, action="diagnostics_release")
        self._logged_release = release

    def _log_room(self, room: LogRoom | None) -> None:
        """Once of each start."""
        if room is not None and room.is_short and not self._is_room_logged:
            self._add("diagnostics", room_text(room), {}, action="diagnostics_log_room")
            self._is_room_logged = True

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
