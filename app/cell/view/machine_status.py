"""What is said of the machine that the server runs on: pure, from what was read of it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal

from app.system.texts import Text, TextLike, joined, number, say
from app.system.time_source import TimeSource
from app.system.vex import Verdict

State = Literal["ok", "problem", "unknown"]
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
class Machine:
    """What was read last. `weaknesses` is None without a VEX file."""

    time: TimeSource = field(default_factory=TimeSource)
    weaknesses: Weaknesses | None = None


@dataclass(frozen=True, slots=True)
class MachineRow:
    """A row of the page of diagnostics: `text` stands beside the title, `reason` says what to do."""

    id: str
    state: State
    title: Text
    text: TextLike
    about: TextLike = ""
    reason: TextLike = ""


def machine_rows(machine: Machine) -> Iterator[MachineRow]:
    yield _time_row(machine.time)
    if machine.weaknesses is not None:
        yield _weakness_row(machine.weaknesses)


def machine_notes(machine: Machine) -> Iterator[TextLike]:
    """What those who maintain the panel are told on every page."""
    if machine.weaknesses is not None and machine.weaknesses.affected:
        yield weakness_text(machine.weaknesses)


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
