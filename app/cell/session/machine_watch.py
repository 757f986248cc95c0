"""What the server sees of the machine that it runs on, for pages, metrics and the operator's log:
whether the machine's clock follows a time source, and how far each robot's clock is from it."""

import asyncio
import logging
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final, Protocol

from app.cell.robot.clocks import Skew
from app.cell.view.clock_status import skew_text
from app.records.entry import Entry, new_entry
from app.system.errors import LogError
from app.system.texts import Text, TextLike, joined, number, say
from app.system.time_source import TimeSource, read_time_source

log = logging.getLogger("kiosk.machine")

LOOK_EVERY_S: Final = 5.0
READ_EVERY: Final = 12  # looks
MOVED_S: Final = 1.0  # a skew that has changed by less is not logged again
MOVED_BY: Final = 0.2  # of the logged one


class WatchedLog(Protocol):
    """The operator's log as the watch uses it."""

    def add(self, entry: Entry) -> None: ...


@dataclass(frozen=True, slots=True)
class Machine:
    """What was read last."""

    time: TimeSource = field(default_factory=TimeSource)


def read_machine() -> Machine:
    """Blocks for some seconds at most."""
    return Machine(read_time_source())


def time_text(source: TimeSource) -> Text:
    """Whether the clock of this machine is synchronised, as a sentence."""
    if source.synchronised is None:
        return say("time_unknown")
    return say("time_synchronised" if source.synchronised else "time_unsynchronised")


def time_about(source: TimeSource) -> TextLike:
    """By what, and how exactly; "" where nothing is known of it."""
    parts: list[TextLike] = [say("time_by", source=source.source)] if source.source else []
    if source.within_s is not None:
        parts.append(say("time_within", within=number(f"{source.within_s:.3f}", "s")))
    return joined(parts)


def time_remedy(source: TimeSource) -> TextLike:
    """What to do; "" for nothing."""
    if source.synchronised is None:
        return say("time_unknown_do")
    return "" if source.synchronised else say("time_unsynchronised_do")


class MachineWatch:
    """Looks at the machine, and writes what changes into the operator's log. Used on the event loop;
    what blocks is read on a thread."""

    def __init__(
        self,
        operators_log: WatchedLog,
        skews: Callable[[], Mapping[str, Skew | None]],
        read: Callable[[], Machine] = read_machine,
    ) -> None:
        """`skews` returns the skew of each robot's clock, by the robot's id."""
        self.now = Machine()
        self._log = operators_log
        self._skews = skews
        self._read = read
        self._logged_time: tuple[object, ...] = ()
        self._logged_skews: dict[str, Skew] = {}

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
        """Writes entries of kind `clock`: of the time source if it is another than before, and of each
        robot whose skew is known now, or has moved. What the log does not take is tried again."""
        try:
            self._log_time(self.now.time)
            for robot, skew in self._skews().items():
                if skew is not None and _has_moved(self._logged_skews.get(robot), skew):
                    self._add(say("log_robot_clock", text=skew_text(skew)), _skew_values(skew), robot)
                    self._logged_skews[robot] = skew
        except LogError as error:
            log.debug("not in the operator's log yet: %s", error)

    def _log_time(self, source: TimeSource) -> None:
        """How exact it is changes all the time, and is logged with the rest only."""
        state = source.synchronised, source.source
        if state == self._logged_time:
            return
        self._add(joined((time_text(source), time_remedy(source))), asdict(source))
        self._logged_time = state

    def _add(self, reason: TextLike, values: Mapping[str, Any], robot: str = "") -> None:
        known = {name: value for name, value in values.items() if value not in (None, "")}
        self._log.add(new_entry("clock", values=known, reason=reason, robot=robot))


def _has_moved(before: Skew | None, now: Skew) -> bool:
    if before is None or before.state != now.state:
        return True
    return abs(now.seconds - before.seconds) >= max(MOVED_S, MOVED_BY * abs(before.seconds))


def _skew_values(skew: Skew) -> Mapping[str, Any]:
    return {"skew_s": round(skew.seconds, 3), "by": skew.witness}
