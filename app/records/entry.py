"""An entry of the operator's log with the hash chain, and the status of a command."""

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, Literal, NamedTuple, Self

from app.system.public import PublicCode, PublicHash, PublicNumber
from app.system.texts import ENGLISH, TextLike, render, rendered_if_known, text_in

# One entry of the operator's log, with the hash chain.
#
# An entry's hash is SHA-256 of a JSON array of all its fields except the hash, in order, in UTF-8,
# without spaces, with minimal escapes. `prev`, the last of these fields, is the hash of the previous
# entry; for the first entry it is the log's genesis, 32 random bytes. An empty `text` is left out, as
# in entries written before this field existed.

Kind = Literal[
    "began",
    "changed",
    "signed",
    "pressed",
    "closed",
    "corrected",
    "refused",
    "control",
    "alarm",
    "diagnostics",
    "recipe",
    "place",
    "access",
    "panel",
    "clock",
    "removed",
    "resumed",
]

LONGEST_VALUES: Final = 2000
LONGEST_TEXT: Final = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """The origin of a press: the browser's address and id, its user, and the id of the last event seen.
    "" stands for unknown."""

    address: str
    browser: str = ""
    who: str = ""
    seen: str = ""


class Entry(NamedTuple):
    """An entry. `at` is milliseconds since 1970 (UTC); `monotonic` is microseconds of a clock that is
    never set, comparable within one `boot` of the server; `of` is the number of the press that it is
    about.

    `values` is JSON, `verdict` the code of the permission's verdict, `board` the id of the view at
    that moment. `reason` is in English; `text` is the same as JSON with code and parameters, "" for a
    reason without a sentence of the catalogue. `seq`, `boot`, `prev` and `hash` are set when it is
    written.
    """

    seq: PublicNumber
    at: PublicNumber
    boot: PublicHash
    monotonic: PublicNumber
    kind: Kind
    of: PublicNumber | None = None
    address: str = ""
    browser: str = ""
    who: str = ""
    robot: PublicCode = ""
    press: PublicHash = ""
    widget: PublicCode = ""
    action: PublicCode = ""
    values: str = "{}"
    seen: PublicHash = ""
    verdict: PublicCode = ""
    board: PublicHash = ""
    outcome: PublicCode = ""
    reason: str = ""
    text: str = ""
    prev: PublicHash = ""
    hash: PublicHash = ""

    def sealed(self, seq: int, boot: str, prev: str) -> "Entry":
        """The entry as written, after the entry with the hash `prev`."""
        row = (seq, self.at, boot, *self[MONOTONIC:PREV], prev)
        return Entry._make((*row, _hash(row)))

    @property
    def is_press(self) -> bool:
        """Whether this is the first entry of a press with an id."""
        return self.kind == "pressed" and self.action == "press" and self.press != ""

    def computed_hash(self) -> str:
        """The correct hash."""
        return _hash(self[:-1])

    @property
    def reason_text(self) -> TextLike:
        """The reason as a sentence to be rendered, or in English if there is no code."""
        try:
            return text_in(self.text) if self.text else self.reason
        except ValueError:
            return self.reason

    def reason_in(self, language: str) -> str:
        """The reason in a language; in English as it was written."""
        if language == ENGLISH or isinstance(text := self.reason_text, str):
            return self.reason
        known = rendered_if_known(text, language)
        return self.reason if known is None else clean_text(known)

    def follow_up(self, kind: Kind, outcome: str, reason: TextLike, **more: str) -> Self:
        """A new entry about this press, with its result."""
        at, monotonic = _now()
        return self._replace(
            seq=0,
            at=at,
            monotonic=monotonic,
            kind=kind,
            of=self.seq,
            outcome=outcome,
            reason=clean_text(render(reason)),
            text=reason_as_json(reason),
            **{name: clean_text(text) for name, text in more.items()},
        )


FIELDS: Final = Entry._fields
MONOTONIC: Final = FIELDS.index("monotonic")
PREV: Final = FIELDS.index("prev")
TEXT: Final = FIELDS.index("text")
ORIGIN: Final = tuple(field.name for field in fields(Origin))
_as_text: Final = json.JSONEncoder(ensure_ascii=False, separators=(",", ":")).encode
_in_order: Final = json.JSONEncoder(sort_keys=True).encode
_as_json: Final = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode


def new_entry(
    kind: Kind,
    origin: Origin | None = None,
    values: Mapping[str, Any] | None = None,
    reason: TextLike = "",
    **texts: str,
) -> Entry:
    """A new entry, dated now; texts are cleaned and shortened."""
    at, monotonic = _now()
    if origin is not None:
        texts |= {name: getattr(origin, name) for name in ORIGIN}
    texts |= {"reason": render(reason)}
    cleaned: dict[str, Any] = {name: clean_text(text) for name, text in texts.items()}
    cleaned["text"] = reason_as_json(reason)
    return Entry(0, at, "", monotonic, kind, values=as_json(values or {}), **cleaned)


def reason_as_json(reason: TextLike) -> str:
    """A reason as JSON; "" if it has no code, or its parameters are too long."""
    if isinstance(reason, str):
        return ""
    text = _as_text(reason.as_json())
    return clean_text(text, len(text)) if len(text) <= LONGEST_VALUES else ""


def clean_text(text: str, longest: int = LONGEST_TEXT) -> str:
    """The text as valid Unicode, without NUL, shortened with "…" to `longest` characters."""
    if len(text) <= longest and text.isprintable():
        return text
    cut = text if len(text) <= longest else text[: longest - 1] + "…"
    return cut.replace("\0", "\\0").encode("utf-8", "backslashreplace").decode()


def as_json(values: Mapping[str, Any]) -> str:
    """The values of a press; too long ones as `{"…": "<their first 2000 characters>", …}`."""
    try:
        text = _as_json(values)
    except (TypeError, ValueError):
        text = json.dumps({"…": repr(values)}, ensure_ascii=False)
    if len(text) > LONGEST_VALUES:
        cut = {"…": text[:LONGEST_VALUES], "… of": len(text)}
        text = json.dumps(cut, ensure_ascii=False)
    return clean_text(text, len(text))


def same_values(text: str, values: Mapping[str, Any]) -> bool:
    """Whether an entry's values equal these, after the same shortening."""
    return _in_order(json.loads(text)) == _in_order(json.loads(as_json(values)))


def _hash(row: tuple[Any, ...]) -> str:
    """The hash of a row (without its hash field); an empty `text` is left out."""
    counted = row if row[TEXT] else (*row[:TEXT], *row[TEXT + 1 :])
    return hashlib.sha256(_as_text(counted).encode()).hexdigest()


def _now() -> tuple[int, int]:
    return time.time_ns() // 1_000_000, time.monotonic_ns() // 1000


# The status of the latest command of each widget.

OutcomeCode = Literal[
    "published",
    "confirmed",
    "accepted",
    "succeeded",
    "rejected",
    "canceled",
    "aborted",
    "timed_out",
    "refused",
    "unknown",
]


GOOD_OUTCOMES: Final = frozenset({"published", "confirmed", "accepted", "succeeded"})


@dataclass(frozen=True, slots=True)
class CommandStatus:
    """`busy` while a response is awaited; then `outcome` and `text` are the result.

    `fraction` (0 to 1) is an action's progress, None if unknown. `can_cancel` is true while a goal can
    be canceled; `press` is then the id of its press. `goal` is the goal's state, named as in
    action_msgs/msg/GoalStatus.
    """

    busy: bool = False
    outcome: OutcomeCode | Literal[""] = ""
    text: TextLike = ""
    fraction: float | None = None
    can_cancel: bool = False
    goal: str = ""
    press: str = ""


IDLE = CommandStatus()


class CommandStatuses(dict[str, CommandStatus]):
    """The statuses by widget id. `set_at` has when each was set: monotonic seconds, and seconds since
    the epoch."""

    def __init__(
        self,
        monotonic: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        super().__init__()
        self.set_at: dict[str, tuple[float, float]] = {}
        self._clocks = monotonic, wall

    def __setitem__(self, widget: str, status: CommandStatus) -> None:
        if self.get(widget) != status:
            monotonic, wall = self._clocks
            self.set_at[widget] = monotonic(), wall()
        super().__setitem__(widget, status)


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a call or a goal; `text` is a sentence for the operator."""

    outcome: OutcomeCode
    text: TextLike


OnCorrection = Callable[[Outcome], None]  # called with the new outcome of a press
FinalCheck = Callable[
    [], None
]  # called right before sending; raises PressRefused if no longer permitted


def no_check() -> None:
    """The check of a message that needs no permission."""
