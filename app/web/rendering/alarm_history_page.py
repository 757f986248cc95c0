"""The page of the history of alarms: its filter, its rows and the way to older ones."""

import math
import time
from collections.abc import Callable
from typing import Annotated, Final, Literal, TypedDict
from urllib.parse import urlencode

from pydantic import BaseModel, ConfigDict, Field

from app.alarms.figures import Figures
from app.alarms.history import NEWEST, HistoryFilter, HistoryPage
from app.alarms.rows import PRIORITY_WORDS
from app.i18n import Text, TextLike, number, say
from app.panel.model import Panel
from app.printable import printable_texts
from app.web.rendering.alarm_events import ShownEvent, events_by_day, shown_events
from app.web.rendering.alarm_figures import FiguresContext, figures_context
from app.web.rendering.alarms_page import word
from app.web.typed_times import TypedTime, typed_ms

DAY_S: Final = 86_400
ROWS_ON_PAGE: Final = 50
Span = Literal["24h", "7d", "30d", "all"]
SPANS: Final[dict[Span, float]] = {"24h": DAY_S, "7d": 7 * DAY_S, "30d": 30 * DAY_S, "all": math.inf}


class TimesQuery(BaseModel):
    """A `span` up to now, or the time from `since` on and before `until` if one of these is there."""

    model_config = ConfigDict(extra="forbid")

    span: Span = "24h"
    since: TypedTime = ""
    until: TypedTime = ""

    def times(self, now: float) -> tuple[float, float]:
        """From when and to when, in seconds since the epoch; InputError for what is no time."""
        since, until = typed_ms("since", self.since), typed_ms("until", self.until, fold=1)
        if since is None and until is None:
            return now - SPANS[self.span], math.inf
        return (
            -math.inf if since is None else since / 1000,
            math.inf if until is None else until / 1000,
        )


class HistoryQuery(TimesQuery):
    """What the page shows: the transitions of a time, with `text` in the alarm's id, texts or group or
    in the name of who acted; of a `priority` (0: all), `group`, `robot` and `alarm`; before the number
    `before`. `act` is the id of an act whose receipt is shown."""

    text: Annotated[str, Field(max_length=100)] = ""
    priority: Annotated[int, Field(ge=0, le=4)] = 0
    group: Annotated[str, Field(max_length=400)] = ""
    robot: Annotated[str, Field(max_length=64)] = ""
    alarm: Annotated[str, Field(max_length=300)] = ""
    before: Annotated[int, Field(ge=1, lt=NEWEST)] | None = None
    act: Annotated[str, Field(max_length=400)] = ""

    def filter(self, now: float) -> HistoryFilter:
        return HistoryFilter(
            self.before or NEWEST,
            *self.times(now),
            self.text,
            self.alarm,
            self.priority,
            self.robot,
            self.group,
        )

    def address(self, **changed: str | int | None) -> str:
        """The same as the query of an address, with other values."""
        values = {**self.model_dump(exclude={"act"}), **changed}
        defaults = type(self).model_fields
        return urlencode({k: v for k, v in values.items() if v and v != defaults[k].default})


class HistoryContext(TypedDict):
    """The variables of `alarm-history.html`, beside those of the frame."""

    wanted: HistoryQuery
    typed: dict[str, str]
    has_times: bool
    spans: list[tuple[Text, str, bool]]
    priorities: list[Text]
    groups: list[tuple[str, TextLike]]
    robots: dict[str, TextLike]
    days: list[tuple[Text, list[ShownEvent]]]
    count: TextLike
    order: Text
    older: str
    newest: str
    query: str
    without_alarm: str
    of_time: FiguresContext
    address_of: Callable[[str], str]


def history_context(
    panel: Panel, wanted: HistoryQuery, shown: HistoryPage, figures: Figures
) -> HistoryContext:
    """The history as it is now."""
    rows = shown.rows[:ROWS_ON_PAGE]
    has_times = bool(wanted.since or wanted.until)
    newest = wanted.address(before=None)
    return HistoryContext(
        wanted=wanted,
        typed=printable_texts(wanted.model_dump()),
        has_times=has_times,
        spans=[
            (
                word(f"span_{span}"),
                wanted.address(span=span, since="", until="", before=None),
                span == wanted.span and not has_times,
            )
            for span in SPANS
        ],
        priorities=[say(code) for code in PRIORITY_WORDS[1:]],
        groups=_groups(panel),
        robots={str(robot.id): robot.name for robot in panel.robots},
        days=list(events_by_day(shown_events(rows))),
        count=_count(shown, len(rows)),
        order=word("clock_was_set_back" if shown.set_back else "clock_never_set_back"),
        older=wanted.address(before=rows[-1].seq) if len(shown.rows) > ROWS_ON_PAGE else "",
        newest=newest,
        query=newest,
        without_alarm=wanted.address(before=None, alarm=""),
        of_time=figures_context(figures),
        address_of=lambda alarm: wanted.address(before=None, alarm=alarm),
    )


def _groups(panel: Panel) -> list[tuple[str, TextLike]]:
    """The groups of the panel's alarms: their texts in the panel's language, and in all."""
    return list({str(alarm.group): alarm.group for alarm in panel.alarms if alarm.group}.items())


def _count(shown: HistoryPage, rows: int) -> TextLike:
    if not rows:
        return ""
    first, last, total = (
        number(f"{value:,d}") for value in (shown.newer + 1, shown.newer + rows, shown.total)
    )
    return say("alarms_history_count", first=first, last=last, total=total)


def now() -> float:
    """Seconds since the epoch."""
    return time.time()
