"""What a press writes into the operator's log, and what it needs of that log."""

from collections.abc import Callable, Collection, Mapping
from contextlib import AbstractContextManager
from typing import Any, Protocol

from app.audit.entry import Entry, Origin, new_entry
from app.audit.queries import OpenPress
from app.errors import LogError
from app.i18n import TextLike, render, say
from app.permission.principal import Principal
from app.robot.command_status import Outcome


class Log(Protocol):
    """`fault` says that the log can't be written, `lock` that nothing may be pressed for it; both
    are "" while all is well."""

    @property
    def fault(self) -> TextLike: ...
    @property
    def lock(self) -> TextLike: ...
    def notifying(self, changed: Callable[[], None]) -> AbstractContextManager[None]: ...

    async def pressed(self, entry: Entry) -> Entry | None:
        """Returns when the entry is written; LogError when it can't be and must, Repeated where the log
        has a press of this id."""

    async def closed(self, entry: Entry) -> TextLike:
        """Returns when the entry is on the disk, or why it is not."""

    def add(self, entry: Entry) -> None:
        """Writes it, and no one waits."""

    def allowed(self, origin: Origin) -> bool:
        """Whether a refusal may be an entry; where not, it is left out."""

    def suppress(self, origin: Origin, limited: bool = False) -> None:
        """Counts a refusal that is no entry, `limited` one that was not even judged."""

    async def open_presses(self, robot: str, widgets: Collection[str], since: int) -> list[OpenPress]:
        """Presses of these widgets, not before `since` (ms), of which the end is not known, the newest
        first; LogError when that can't be read (yet)."""


class PendingEntry:
    """One press in the log; `entry` is None where it could not be written and need not be."""

    def __init__(
        self, log: Log, entry: Entry | None, board: Callable[[], str], fault: TextLike = ""
    ) -> None:
        self._log = log
        self._entry = entry
        self._board = board
        self._fault = fault
        self._verdict = {"verdict": "", "board": ""}
        self.corrected_to: Outcome | None = None

    @property
    def hash(self) -> str:
        """That of the press's entry: no other has it; "" where there is none."""
        return self._entry.hash if self._entry else ""

    def set_verdict(self, verdict: str) -> None:
        """By which verdict, and by which version of the board: the one that there is now."""
        self._verdict = {"verdict": verdict, "board": self._board()}

    async def close(self, outcome: str, reason: TextLike) -> TextLike:
        """Writes the result; returns when that is on the disk, or why it is not."""
        if self._entry is None:
            return self._fault
        return await self._log.closed(self._entry.follow_up("closed", outcome, reason, **self._verdict))

    def close_unknown(self, sentence: str) -> None:
        """No one will know the result."""
        if self._entry is not None:
            self._log.add(self._entry.follow_up("closed", "unknown", say(sentence), **self._verdict))

    def correct(self, answer: Outcome) -> None:
        """More is known now than when it was closed."""
        self.corrected_to = answer
        if self._entry is not None:
            text = answer.text
            self._log.add(self._entry.follow_up("corrected", answer.outcome, text, **self._verdict))


class PressLog:
    """The operator's log as the presses of one robot write it; `board` gives what is shown now."""

    def __init__(self, log: Log, robot: str = "", board: Callable[[], str] = str) -> None:
        self._log = log
        self._robot = robot
        self._board = board

    def has_room(self, origin: Origin) -> bool:
        """Whether a refusal may be an entry."""
        return self._log.allowed(origin)

    def count_unlogged(self, origin: Origin) -> None:
        """Counts a refusal that is no entry."""
        self._log.suppress(origin)

    async def pressed(
        self,
        widget: str,
        inputs: Mapping[str, Any],
        press_id: str,
        origin: Origin,
        action: str = "press",
    ) -> PendingEntry:
        """Written before anything is sent; LogError and Repeated as `Log` has them."""
        entry = new_entry("pressed", origin, inputs, **self._columns(widget, press_id, action))
        written = await self._log.pressed(entry)
        return PendingEntry(self._log, written, self._board, self._log.fault)

    async def canceled(self, widget: str, origin: Origin) -> PendingEntry:
        """A cancel is written if it can be: no log that fails keeps anyone from stopping a robot."""
        entry = new_entry("pressed", origin, {}, **self._columns(widget, "", "cancel"))
        try:
            written = await self._log.pressed(entry)
        except LogError as error:
            return PendingEntry(self._log, None, self._board, error.text)
        return PendingEntry(self._log, written, self._board, self._log.fault)

    @property
    def is_optional_and_down(self) -> bool:
        """Whether presses go on though the log can't be written."""
        return bool(self._log.fault) and not self._log.lock

    async def open_presses(
        self, widgets: Collection[str], since: int
    ) -> list[tuple[OpenPress, PendingEntry]]:
        """Presses whose end the log does not know, as `Log` has it, each with what corrects it."""
        found = await self._log.open_presses(self._robot, widgets, since)
        return [(one, PendingEntry(self._log, one.press, self._board)) for one in found]

    async def refused(
        self,
        widget: str,
        inputs: Mapping[str, Any],
        press_id: str,
        origin: Origin,
        reason: TextLike,
        action: str = "press",
    ) -> TextLike:
        """A press that was not even judged; returns when it is on the disk, or why it is not."""
        about = self._columns(widget, press_id, action)
        entry = new_entry("refused", origin, inputs, outcome="refused", reason=reason, **about)
        return await self._log.closed(entry)

    async def acted(
        self, action: str, act_id: str, origin: Origin, outcome: str, reason: TextLike
    ) -> TextLike:
        """An act that is no press; returns when it is on the disk, or why it is not."""
        about = self._columns("", act_id, action)
        return await self._log.closed(
            new_entry("control", origin, {}, outcome=outcome, reason=reason, **about)
        )

    def note(self, action: str, origin: Origin, reason: TextLike) -> None:
        """Control changed by no act."""
        self._log.add(new_entry("control", origin, {}, reason=reason, **self._columns("", "", action)))

    def _columns(self, widget: str, press_id: str, action: str) -> dict[str, str]:
        return {"widget": widget, "press": press_id, "action": action, "robot": self._robot}


def origin_of(who: Principal, seen: str = "") -> Origin:
    """Where a press comes from: the client, and who is logged in there or, without users, its name."""
    client = who.client
    return Origin(address=client.address, browser=client.id, who=render(who.name), seen=seen)
