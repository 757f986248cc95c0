"""The states of an alarm after ISA-18.2-2016 and IEC 62682, as one table.

The table is for an alarm that is not shelved, suppressed or out of service; under one of these it runs
on unseen (`app/alarms/status.py`).
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, NamedTuple

from app.i18n import Text, say


class State(StrEnum):
    NORMAL = "normal"
    UNACKNOWLEDGED = "unacknowledged"
    ACKNOWLEDGED = "acknowledged"
    RETURNED_UNACKNOWLEDGED = "returned_unacknowledged"
    LATCHED_UNACKNOWLEDGED = "latched_unacknowledged"
    LATCHED_ACKNOWLEDGED = "latched_acknowledged"


class Event(StrEnum):
    """`ACTIVE`: the condition is met, after its on-delay. `RISES`: a level above the one raised is
    reached. `CLEAR`: the condition is no longer met, after its off-delay."""

    ACTIVE = "active"
    RISES = "rises"
    CLEAR = "clear"
    ACKNOWLEDGE = "acknowledge"
    RESET = "reset"


@dataclass(frozen=True, slots=True)
class AlarmKind:
    """`acknowledge`: the alarm needs to be acknowledged. `latched`: it needs a reset after its return
    to normal."""

    acknowledge: bool = True
    latched: bool = False


PLAIN: Final = AlarmKind()


class Row(NamedTuple):
    """A row of the table: what an event does in a state, for the kinds of alarm that `acknowledge` and
    `latched` select; None selects both. `occurrence`: a new one begins, with its sound."""

    state: State
    event: Event
    next: State
    acknowledge: bool | None = None
    latched: bool | None = None
    occurrence: bool = False
    refusal: Text | None = None

    def selects(self, kind: AlarmKind) -> bool:
        """Whether it is for this kind of alarm."""
        return self.acknowledge in (None, kind.acknowledge) and self.latched in (None, kind.latched)


STILL_ACTIVE: Final = say("alarm_still_active")
NOT_LATCHED: Final = say("alarm_not_latched")
N, UA, AA, RU, LU, LA = State
_RAISED: Final = tuple(
    Row(state, event, UA if needed else AA, acknowledge=needed, occurrence=True)
    for state, event in (
        *((state, Event.ACTIVE) for state in (N, RU, LU, LA)),
        *((state, Event.RISES) for state in (UA, AA)),
    )
    for needed in (True, False)
)
_REFUSED: Final = tuple(
    Row(state, Event.RESET, state, latched=latched, refusal=refusal)
    for state, latched, refusal in (
        (UA, True, STILL_ACTIVE),
        (AA, True, STILL_ACTIVE),
        (LU, True, say("alarm_acknowledge_first")),
        *((state, False, NOT_LATCHED) for state in (UA, AA, RU)),
    )
)
TABLE: Final = (
    *_RAISED,
    Row(UA, Event.CLEAR, RU, latched=False),
    Row(UA, Event.CLEAR, LU, latched=True),
    Row(AA, Event.CLEAR, N, latched=False),
    Row(AA, Event.CLEAR, LA, latched=True),
    Row(UA, Event.ACKNOWLEDGE, AA),
    Row(RU, Event.ACKNOWLEDGE, N),
    Row(LU, Event.ACKNOWLEDGE, LA),
    Row(LA, Event.RESET, N),
    *_REFUSED,
)
KINDS: Final = tuple(AlarmKind(ack, latched) for ack in (True, False) for latched in (True, False))
_ROWS: Final = {
    (row.state, row.event, kind): row for row in TABLE for kind in KINDS if row.selects(kind)
}


def find_row(state: State, event: Event, kind: AlarmKind) -> Row:
    """The row for an event in a state. Without one in the table, the state stays: an act is done
    already."""
    return _ROWS.get((state, event, kind)) or Row(state, event, state)
