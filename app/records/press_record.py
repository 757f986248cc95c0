"""The log entries of presses, and the interface of the log that they need."""

from collections.abc import Callable, Collection, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from app.records.database import OpenPress
from app.records.entry import Entry, Kind, Origin, Outcome, new_entry
from app.records.principal import Principal
from app.system.errors import LogError
from app.system.texts import TextLike, render, say

PressAction = Literal["press", "hold", "cancel"]


@dataclass(frozen=True, slots=True)
class LoggedPress:
    """A press as the log has it. `inputs` are those that its widget uses."""

    id: str
    widget: str
    inputs: Mapping[str, Any]
    origin: Origin
    action: PressAction = "press"


class Log(Protocol):
    """The operator's log. `fault` is the sentence if it can't be written, `lock` the reason if presses
    are locked because of that; both are "" otherwise."""

    @property
    def fault(self) -> TextLike: ...
    @property
    def lock(self) -> TextLike: ...
    def notifying(self, changed: Callable[[], None]) -> AbstractContextManager[None]: ...

    async def pressed(self, entry: Entry) -> Entry | None:
        """Returns when the entry is written; LogError if it can't be and the log is required, Repeated
        if the log already has a press with this id."""

    async def closed(self, entry: Entry) -> TextLike:
        """Returns "" when the entry is on the disk, else why it is not."""

    def add(self, entry: Entry) -> None:
        """Writes an entry without waiting."""

    def allowed(self, origin: Origin) -> bool:
        """Whether a refusal may have its own entry; if not, it is only counted."""

    def suppress(self, origin: Origin, limited: bool = False) -> None:
        """Counts a refusal without an entry; `limited`: it was over the rate limit."""

    async def open_presses(self, robot: str, widgets: Collection[str], since: int) -> list[OpenPress]:
        """Presses of these widgets since `since` (ms) without a known end, the newest first; LogError
        if the log can't be read (yet)."""


class PendingEntry:
    """The log entry of one press; `entry` is None if it could not be written and the log is
    optional."""

    def __init__(
        self, log: Log, entry: Entry | None, view_version: Callable[[], str], fault: TextLike = ""
    ) -> None:
        self._log = log
        self._entry = entry
        self._view_version = view_version
        self._fault = fault
        self._verdict = {"verdict": "", "board": ""}
        self.corrected_to: Outcome | None = None

    @property
    def hash(self) -> str:
        """The hash of the press's entry, which is unique; "" without an entry."""
        return self._entry.hash if self._entry else ""

    def set_verdict(self, verdict: str) -> None:
        """Sets the code of the permission's verdict, with the current version of the view."""
        self._verdict = {"verdict": verdict, "board": self._view_version()}

    async def close(self, outcome: str, reason: TextLike) -> TextLike:
        """Writes the result. Returns "" when it is on the disk, else why it is not."""
        if self._entry is None:
            return self._fault
        return await self._log.closed(self._entry.follow_up("closed", outcome, reason, **self._verdict))

    def close_unknown(self, sentence: str) -> None:
        """Writes that the result is unknown, without waiting."""
        if self._entry is not None:
            self._log.add(self._entry.follow_up("closed", "unknown", say(sentence), **self._verdict))

    def correct(self, answer: Outcome) -> None:
        """Writes a correction of the result, without waiting."""
        self.corrected_to = answer
        if self._entry is not None:
            text = answer.text
            self._log.add(self._entry.follow_up("corrected", answer.outcome, text, **self._verdict))


class PressLog:
    """Writes the log entries of one robot's presses; `view_version` returns the current version of the
    view."""

    def __init__(self, log: Log, robot: str = "", view_version: Callable[[], str] = str) -> None:
        self._log = log
        self._robot = robot
        self._view_version = view_version

    def has_room(self, origin: Origin) -> bool:
        """Whether a refusal may have its own entry."""
        return self._log.allowed(origin)

    def count_unlogged(self, origin: Origin) -> None:
        """Counts a refusal without an entry."""
        self._log.suppress(origin)

    async def pressed(self, press: LoggedPress) -> PendingEntry:
        """Writes the entry of a press before it is sent; LogError and Repeated as in `Log.pressed`."""
        entry = new_entry("pressed", press.origin, press.inputs, **self._columns(press))
        written = await self._log.pressed(entry)
        return PendingEntry(self._log, written, self._view_version, self._log.fault)

    async def canceled(self, cancel: LoggedPress) -> PendingEntry:
        """Writes the entry of a cancel if possible: a failing log never blocks a cancel."""
        try:
            return await self.pressed(cancel)
        except LogError as error:
            return PendingEntry(self._log, None, self._view_version, error.text)

    @property
    def is_bypassed(self) -> bool:
        """Whether the log can't be written, but presses are not locked because of that."""
        return bool(self._log.fault) and not self._log.lock

    async def open_presses(
        self, widgets: Collection[str], since: int
    ) -> list[tuple[OpenPress, PendingEntry]]:
        """Presses without a known end, as in `Log.open_presses`, each with its log entry to correct."""
        presses = await self._log.open_presses(self._robot, widgets, since)
        return [(open, PendingEntry(self._log, open.press, self._view_version)) for open in presses]

    async def refused(self, press: LoggedPress, reason: TextLike) -> TextLike:
        """Writes a refusal before the permission check. Returns "" when it is on the disk, else why it
        is not."""
        about = self._columns(press)
        entry = new_entry(
            "refused", press.origin, press.inputs, outcome="refused", reason=reason, **about
        )
        return await self._log.closed(entry)

    async def acted(
        self,
        kind: Kind,
        action: str,
        act_id: str,
        origin: Origin,
        outcome: str,
        reason: TextLike,
        values: Mapping[str, Any],
    ) -> TextLike:
        """Writes an operator's act. Returns "" when it is on the disk, else why it is not."""
        about = {"press": act_id, "action": action, "robot": self._robot}
        entry = new_entry(kind, origin, values, outcome=outcome, reason=reason, **about)
        return await self._log.closed(entry)

    def note(self, action: str, origin: Origin, reason: TextLike) -> None:
        """Writes a change of control that no act made, without waiting."""
        self._log.add(new_entry("control", origin, reason=reason, action=action, robot=self._robot))

    def _columns(self, press: LoggedPress) -> dict[str, str]:
        return {
            "widget": press.widget,
            "press": press.id,
            "action": press.action,
            "robot": self._robot,
        }


def origin_of(who: Principal, seen: str = "") -> Origin:
    """The origin of a press: its client, and the user or, without users, the client's name."""
    client = who.client
    return Origin(address=client.address, browser=client.id, who=render(who.name), seen=seen)
