"""What clients send to `/alarms` and get from it."""

import math
import sys
from typing import Annotated, Any, Final

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field

from app.cell.alarms.history import EVENT_NAMES, MAX_PAGE, NEWEST, HistoryFilter
from app.cell.commands.acts import ActReceipt
from app.cell.commands.alarm_acts import ALARM_ACTS
from app.cell.commands.receipts import Receipt
from app.system.clock import iso_time
from app.web.acts import ActBody
from app.web.answers import ActAnswer, ReceiptAnswer
from app.web.pages.alarms import AlarmChoice, Show, Sort
from app.web.requests import Moment

MANY: Final = sys.maxsize
MAX_ACKNOWLEDGED: Final = 500  # alarms in one request
MAX_OCCURRENCE: Final = 2**53
Occurrence = Annotated[int, Field(ge=0, le=MAX_OCCURRENCE)]


class AlarmQuery(BaseModel):
    """`history`: transitions, the newest first, instead of what is not normal now. The other fields are
    for the history: of transitions before the number `before`, from `since` on and before `until`, with
    `text` in the alarm's id, texts or group or in the name of who acted, of a `priority` (0: all), a
    `robot` and a `group`. `alarm` is the id of one alarm: of the history, or whose details the page
    shows. What is listed is of such a `priority`, `robot` and `group` too, `show` chooses its states
    and `sort` the order; without `history` all is listed unless `limit` is given. For the page only:
    `act` the act whose receipt is shown, `sheet` opens the sheet of the alarm's row."""

    model_config = ConfigDict(extra="forbid")

    history: bool = False
    before: Annotated[int, Field(ge=1, lt=2**62)] | None = None
    limit: Annotated[int, Field(ge=1, le=MAX_PAGE)] = 100
    since: Moment | None = None
    until: Moment | None = None
    text: Annotated[str, Field(max_length=100)] = ""
    priority: Annotated[int, Field(ge=0, le=4)] = 0
    robot: Annotated[str, Field(max_length=64)] = ""
    group: Annotated[str, Field(max_length=400)] = ""
    show: Show = "all"
    sort: Sort = "urgent"
    alarm: Annotated[str, Field(max_length=300)] = ""
    act: Annotated[str, Field(max_length=400)] = ""
    sheet: bool = False

    def filter(self) -> HistoryFilter:
        return HistoryFilter(
            self.before or NEWEST,
            self.since.timestamp() if self.since else -math.inf,
            self.until.timestamp() if self.until else math.inf,
            self.text,
            self.alarm,
            self.priority,
            self.robot,
            self.group,
        )

    @property
    def rows_limit(self) -> int:
        """How many alarms are listed: all, if the client does not say."""
        return self.limit if "limit" in self.model_fields_set else MANY

    def choice(self) -> AlarmChoice:
        """What is listed."""
        return AlarmChoice(self.show, self.priority, self.group, self.robot, self.sort, self.alarm)


class AlarmActBody(ActBody):
    """`occurrence` is what the screen showed, for `acknowledge`; `reason` is needed for `shelve` and
    `out_of_service`, and `until` or `for_s` (seconds) for `shelve`. `at` is when it was touched, in the
    server's own time. The same `id` again is the same act. `seen` is the id of the last event."""

    occurrence: Occurrence | None = None
    reason: Annotated[str, Field(max_length=200)] = ""
    until: Moment | None = None
    for_s: Annotated[float, Field(gt=0, le=86_400)] | None = None
    seen: Annotated[str, Field(max_length=40)] = ""

    def values(self, alarm: str, now: float) -> dict[str, Any]:
        """The values of the act on an alarm at `now` (seconds since the epoch)."""
        values: dict[str, Any] = {"alarm": alarm}
        if self.occurrence is not None:
            values["occurrence"] = self.occurrence
        if self.reason:
            values["reason"] = self.reason
        if self.until is not None:
            values["until"] = self.until.isoformat()
        elif self.for_s is not None:
            values["until"] = iso_time(now + self.for_s)
        if self.seen:
            values["seen"] = self.seen
        return values


class AcknowledgeBody(ActBody):
    """`alarms` has the occurrences that the screen showed, by the alarms' ids."""

    alarms: Annotated[dict[str, Occurrence], Field(max_length=MAX_ACKNOWLEDGED)]
    seen: Annotated[str, Field(max_length=40)] = ""


class TakenOutAnswer(BaseModel):
    since: AwareDatetime
    since_text: str
    until: str
    until_text: str
    reason: str
    who: str


class AlarmAnswer(BaseModel):
    """An alarm that is not normal, or is shelved, suppressed or out of service."""

    id: str
    robot: str
    source: str
    group: str
    priority: Annotated[int, Field(ge=1, le=4)]
    priority_text: str
    state: str
    before_unknown: str
    state_text: str
    acknowledged: bool
    known: bool
    occurrence: int
    since: Annotated[str, Field(description='RFC 3339, "" if it was not raised')]
    since_text: str
    text: str
    cause: str
    consequence: str
    action: str
    details: str
    picture: str
    topic: str
    field: str
    value: float | None
    value_text: str
    limit: float | None
    limit_text: str
    shelf: TakenOutAnswer | None
    out_of_service: TakenOutAnswer | None
    acts: list[str]
    follows: str
    follows_text: str
    order: list[float]


class TransitionAnswer(BaseModel):
    """A row of the history: `state` is the one after it, `act` the act that caused it, "" for none.
    `since` is when the alarm was raised and `lasted_s` the time since then; `clock_back_s` is by how
    much the clock was set back since the row before, 0 if it was not. `follows` is the id of the alarm
    of its group that it followed, "" for none. `source` is "" in rows of earlier versions."""

    seq: int
    at: AwareDatetime
    clock_back_s: float
    id: str
    robot: str
    source: str
    event: Annotated[str, Field(description=f"one of {', '.join(EVENT_NAMES)}")]
    state: str
    acknowledged: bool
    known: bool
    occurrence: int
    since: Annotated[str, Field(description='RFC 3339, "" if it was not raised')]
    lasted_s: float | None
    act: Annotated[str, Field(description=f'one of {", ".join(ALARM_ACTS)}, or ""')]
    who: str
    text: str
    action: str
    group: str
    priority: int
    value: float | None
    limit: float | None
    follows: str
    follows_text: str


class AlarmsAnswer(BaseModel):
    """What is not normal now, the most urgent first or as `sort` says. `more` follow after `limit`, in
    `more_text` as a sentence. `counts`: how many there would be with each of these values of `show`.
    `alarm` is that of the query's `alarm`, null for none."""

    alarms: list[AlarmAnswer]
    more: int
    more_text: str
    counts: dict[str, int]
    alarm: AlarmAnswer | None


class HistoryAnswer(BaseModel):
    """`older` is the `before` of the next page, null if there is none."""

    history: list[TransitionAnswer]
    older: int | None


class AlarmReceipt(ActAnswer):
    """The receipt of an act: `reason` is "" where it was done, `code` is its stable name. `command` is
    the receipt of the alarm's `ack_command`, null if none was sent or answered; `reason` then says
    what became of it."""

    alarm: str
    command: ReceiptAnswer | None


class AlarmReceipts(BaseModel):
    receipts: list[AlarmReceipt]


def receipt_json(alarm: str, receipt: ActReceipt, command: Receipt | None) -> dict[str, Any]:
    sent = command and command.as_json()
    return {**receipt.as_json(), "alarm": alarm, "done": receipt.done, "command": sent}
