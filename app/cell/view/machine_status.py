"""What is said of the machine that the server runs on: pure, from what was read of it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal

from app.records.room import LogRoom
from app.system.clock import format_datetime
from app.system.releases import NewRelease
from app.system.texts import Text, TextLike, joined, number, say
from app.system.time_source import TimeSource
from app.system.vex import Verdict

State = Literal["ok", "problem", "unknown", "note"]
NAMED_MOST: Final = 3
TIME_STATES: Final[Mapping[bool | None, tuple[State, Text]]] = {
    None: ("unknown", say("diagnostics_time_unknown")),
    True: ("ok", say("diagnostics_time_yes")),
    False: ("problem", say("diagnostics_time_no")),
}


@dataclass(frozen=True, slots=True)
class Weaknesses:
    """What the VEX file `file` says of what is installed; `fault` is why it can't be used, "" if it
    can. `investigated` counts the weaknesses of which nothing is known yet."""

    file: Path
    affected: Sequence[Verdict] = ()
    investigated: int = 0
    fault: str = ""


@dataclass(frozen=True, slots=True)
class Postponed:
    """The notice of a release that is postponed until a time, in seconds since the epoch."""

    version: str
    until: float
    by: str


@dataclass(frozen=True, slots=True)
class Machine:
    """What was read last. `weaknesses` is None without a VEX file, `release` without a newer one, and
    `room` before the log has a day of entries. `postponed` may be about another release."""

    time: TimeSource = field(default_factory=TimeSource)
    weaknesses: Weaknesses | None = None
    release: NewRelease | None = None
    postponed: Postponed | None = None
    room: LogRoom | None = None

    def is_postponed(self, wall: float) -> bool:
        """Whether the notice of the newer release waits at this time."""
        about, release = self.postponed, self.release
        is_same = about is not None and release is not None and about.version == release.version
        return is_same and about is not None and wall < about.until


@dataclass(frozen=True, slots=True)
class MachineRow:
    """A row of the page of diagnostics: `text` stands beside the title, `reason` says what to do."""

    id: str
    state: State
    title: Text
    text: TextLike
    about: TextLike = ""
    reason: TextLike = ""


def machine_rows(machine: Machine, wall: float) -> Iterator[MachineRow]:
    """At `wall`, in seconds since the epoch."""
    yield _time_row(machine.time)
    if machine.room is not None:
        yield _room_row(machine.room)
    if machine.weaknesses is not None:
        yield _weakness_row(machine.weaknesses)
    if machine.release is not None:
        yield _release_row(machine, machine.release, wall)


def machine_notes(machine: Machine, wall: float) -> Iterator[TextLike]:
    """What those who maintain the panel are told on every page."""
    if machine.weaknesses is not None and machine.weaknesses.affected:
        yield weakness_text(machine.weaknesses)
    if machine.room is not None and machine.room.is_short:
        yield room_text(machine.room)
    release = machine.release
    if release is not None and not release.fault and not machine.is_postponed(wall):
        yield release_text(release)


# Its clock.


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


def _time_row(source: TimeSource) -> MachineRow:
    state, word = TIME_STATES[source.synchronised]
    about = say("diagnostics_time"), word, time_about(source), time_remedy(source)
    return MachineRow("time", state, *about)


# Known weaknesses of what is installed.


def weakness_text(weaknesses: Weaknesses) -> Text:
    """Which weaknesses concern what is installed, or that none does, or why that is not known."""
    if weaknesses.fault:
        return say("vex_unusable", why=weaknesses.fault)
    if not weaknesses.affected:
        return say("vex_none")
    names = tuple(f"{each.weakness} ({each.component})" for each in weaknesses.affected[:NAMED_MOST])
    more = len(weaknesses.affected) - NAMED_MOST
    named: TextLike | tuple[TextLike, ...] = names
    if more > 0:
        named = say("and_more", names=names, number=more)
    return say("vex_affected", names=named)


def _weakness_row(weaknesses: Weaknesses) -> MachineRow:
    count = len(weaknesses.affected)
    state: State = "problem" if count else "unknown" if weaknesses.fault else "ok"
    about: TextLike = ""
    if weaknesses.investigated:
        about = say("vex_investigated", count=number(str(weaknesses.investigated)))
    reason: TextLike = weakness_text(weaknesses) if state != "ok" else ""
    if count:
        details = (each.detail for each in weaknesses.affected[:NAMED_MOST])
        command = say("vex_do", file=str(weaknesses.file))
        reason = joined((reason, *dict.fromkeys(details), command))
    text = say("diagnostics_vex_unknown") if weaknesses.fault else number(str(count))
    return MachineRow("weaknesses", state, say("diagnostics_vex"), text, about, reason)


# A newer release.


def release_text(release: NewRelease) -> Text:
    """That it is there, or why it can't be installed."""
    if release.fault:
        return say("release_unusable", version=release.version, why=release.fault)
    return say("release_there", version=release.version)


def _release_row(machine: Machine, release: NewRelease, wall: float) -> MachineRow:
    title = say("diagnostics_release")
    if release.fault:
        return MachineRow("release", "unknown", title, release.version, "", release_text(release))
    about: TextLike = ""
    if machine.is_postponed(wall) and machine.postponed is not None:
        until, by = format_datetime(machine.postponed.until), machine.postponed.by
        about = say("release_postponed", until=until, by=by)
    reason = say("release_do", file=str(release.file))
    return MachineRow("release", "note", title, release.version, about, reason)


# The room of the operator's log.


def room_text(room: LogRoom) -> Text:
    """That the room is short, with its figures."""
    return say(
        "log_room_short",
        days=number(f"{room.days:g}"),
        needed=number(f"{room.needed_mb:,.0f}", "MB"),
        room=number(f"{room.room_mb:,.0f}", "MB"),
        kept=number(f"{room.days_kept:,.0f}"),
        rate=number(f"{room.entries_per_day:,.0f}"),
    )


def _room_row(room: LogRoom) -> MachineRow:
    reason = joined((room_text(room), say("log_room_do"))) if room.is_short else ""
    about = say(
        "log_room_rate",
        rate=number(f"{room.entries_per_day:,.0f}"),
        size=number(f"{room.entry_bytes:,.0f}", "B"),
        kept=number(f"{room.days_kept:,.0f}"),
    )
    needed, most = (number(f"{megabytes:,.0f}", "MB") for megabytes in (room.needed_mb, room.room_mb))
    text = say("log_room_share", needed=needed, room=most)
    title = say("diagnostics_log_room")
    return MachineRow("log-room", "problem" if room.is_short else "ok", title, text, about, reason)
