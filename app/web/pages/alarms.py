"""The page of alarms: its list, the choice of alarms, and the details of one alarm."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, Literal, NamedTuple, TypedDict
from urllib.parse import urlencode

from app.cell.alarms.shown import (
    MAX_ROWS,
    PRIORITY_WORDS,
    AlarmRow,
    more_text,
    value_text,
)
from app.cell.alarms.states import AlarmInstance
from app.cell.commands.alarm_acts import ALARM_ACTS
from app.cell.permission.roles import role_verdict
from app.cell.robot.history import Column
from app.cell.session.alarm_curves import AFTER_S, BEFORE_S, COLUMNS, WIDTH_S, Curve
from app.cell.view.trend import Plot, draw, scaled_columns
from app.panel.alarm import Alarm
from app.panel.alarm_places import AlarmPlace, alarm_place
from app.panel.model import Panel
from app.panel.widgets.trend import Pen, Trend
from app.records.principal import Principal
from app.system.clock import format_time
from app.system.texts import Text, TextLike, joined, number, render, say
from app.system.texts.locales import MINUS
from app.system.texts.text import together
from app.web.app_state import AppState

# Which alarms the page lists, and in which order: as its address says.

Show = Literal[
    "all",
    "unacknowledged",
    "shelved",
    "active",
    "returned",
    "latched",
    "unknown",
    "suppressed",
    "out_of_service",
]
Sort = Literal["urgent", "newest", "priority", "group"]
SHOW_WORDS: Final[Mapping[Show, str]] = {
    "all": "alarms_show_all",
    "unacknowledged": "alarms_show_unacknowledged",
    "active": "alarms_show_active",
    "returned": "alarms_show_returned",
    "latched": "alarms_show_latched",
    "shelved": "alarms_show_shelved",
    "suppressed": "alarms_show_suppressed",
    "out_of_service": "alarms_show_out_of_service",
    "unknown": "alarms_show_unknown",
}
SEGMENTS: Final[tuple[Show, ...]] = ("all", "unacknowledged", "shelved")  # have a button each
SORT_WORDS: Final[Mapping[Sort, str]] = {
    "urgent": "alarms_sort_urgent",
    "newest": "alarms_sort_newest",
    "priority": "alarms_sort_priority",
    "group": "alarms_sort_group",
}


class AlarmChoice(NamedTuple):
    """`show` is a state or several, `priority` 0 is all, `group` is its text in the panel's language;
    "" is all groups or robots. `alarm` is the id of the alarm whose details are shown, "" for none."""

    show: Show = "all"
    priority: int = 0
    group: str = ""
    robot: str = ""
    sort: Sort = "urgent"
    alarm: str = ""

    def address(self, **changed: Any) -> str:
        """The same as the query of an address, with other values."""
        values = {**self._asdict(), **changed}
        defaults = self._field_defaults
        return urlencode({name: value for name, value in values.items() if value != defaults[name]})

    def takes(self, row: AlarmRow) -> bool:
        """Whether the priority, group and robot of an alarm are those to be listed."""
        return (
            self.priority in (0, row["priority"])
            and self.group in ("", str(row["group"]))
            and self.robot in ("", row["robot"])
        )

    def sorted(self, rows: Iterable[AlarmRow], language: str) -> list[AlarmRow]:
        """The rows in the chosen order; those that are alike stay as they are."""
        keys: Mapping[Sort, Callable[[AlarmRow], Any]] = {
            "newest": lambda row: row["order"][-1],
            "priority": lambda row: (row["priority"], row["order"][-1]),
            "group": lambda row: render(row["group"], language),
        }
        key = keys.get(self.sort)
        return list(rows) if key is None else sorted(rows, key=key)


class Selection(NamedTuple):
    """The alarms of a choice: `taken` have its priority, group and robot, in all states; `rows` are the
    first of those that it lists, in its order, and `more` is how many follow."""

    taken: list[AlarmRow]
    rows: list[AlarmRow]
    more: int


def chosen_rows(choice: AlarmChoice, rows: Iterable[AlarmRow], language: str, limit: int) -> Selection:
    """The first `limit` rows of a choice, of all that there are."""
    taken = [row for row in rows if choice.takes(row)]
    listed = choice.sorted((row for row in taken if shows(choice.show, row)), language)
    return Selection(taken, listed[:limit], max(0, len(listed) - limit))


def segment_counts(taken: Iterable[AlarmRow]) -> dict[str, int]:
    """How many of the rows each button would list."""
    rows = list(taken)
    return {show: sum(shows(show, row) for row in rows) for show in SEGMENTS}


def shows(show: Show, row: AlarmRow) -> bool:
    """Whether an alarm has a state that `show` lists."""
    if show == "unacknowledged":
        return not (row["acknowledged"] or row["order"][0])
    return show in ("all", row["state"])


class ChoiceContext(TypedDict):
    """What the page shows of a choice. `counts` are those of the buttons. Each option is its value and
    its text; there are none where there is nothing to choose. `chosen_group` is the group in the
    reader's language, `filtered` the names of what is chosen beside the buttons."""

    choice: AlarmChoice
    segments: list[tuple[Show, str, int]]
    states: list[tuple[Show, Text]]
    priorities: list[Text]
    groups: list[tuple[str, TextLike]]
    robots: list[tuple[str, TextLike]]
    sorts: list[tuple[Sort, Text]]
    chosen_group: TextLike
    filtered: TextLike


def choice_context(panel: Panel, choice: AlarmChoice, rows: Iterable[AlarmRow]) -> ChoiceContext:
    """`rows` are the alarms of the chosen priority, group and robot, in all states."""
    counts = segment_counts(rows)
    states = [(show, say(code)) for show, code in SHOW_WORDS.items()]
    priorities = [say(code) for code in PRIORITY_WORDS[1:]]
    groups = {str(alarm.group): alarm.group for alarm in panel.alarms if alarm.group}
    robots = panel.robot_names
    filtered: list[TextLike] = []
    if choice.show not in SEGMENTS:
        filtered.append(dict(states)[choice.show])
    if choice.priority:
        filtered.append(priorities[choice.priority - 1])
    if choice.group:
        filtered.append(groups.get(choice.group, choice.group))
    if choice.robot:
        filtered.append(robots.get(choice.robot, choice.robot))
    if choice.sort != "urgent":
        filtered.append(say(SORT_WORDS[choice.sort]))
    return ChoiceContext(
        choice=choice,
        segments=[(show, choice.address(show=show, alarm=""), counts[show]) for show in SEGMENTS],
        states=states,
        priorities=priorities,
        groups=list(groups.items()),
        robots=list(robots.items()),
        sorts=[(sort, say(code)) for sort, code in SORT_WORDS.items()],
        chosen_group=groups.get(choice.group, choice.group),
        filtered=joined(filtered, "between_names") if filtered else "",
    )


# The curve of a value around the raise of its alarm, as an SVG has it.


class ShownCurve(NamedTuple):
    """`raise_at` is where the raise stands, in percent of the width; `times` are the texts at the left
    end, at the raise and at the right end. `value` is that at the raise, "" if it was not known."""

    plot: Plot
    raise_at: float
    times: tuple[TextLike, TextLike, TextLike]
    value: TextLike


def shown_curve(alarm: AlarmInstance, curve: Curve) -> ShownCurve:
    """What the details of an alarm show of its curve."""
    described = alarm.definition.alarm
    trend = trend_of(described)
    columns = scaled_columns(curve.columns, trend.pens[0])
    begin, end = curve.raised_at - BEFORE_S, curve.raised_at + AFTER_S
    return ShownCurve(
        draw(trend, [columns], begin, end, COLUMNS),
        round(100 * BEFORE_S / (BEFORE_S + AFTER_S), 2),
        (
            number(f"{MINUS}{BEFORE_S:g}", "s"),
            format_time(curve.raised_at),
            together(("+", number(f"{AFTER_S:g}", "s"))),
        ),
        _value_at(columns, curve.raised_at, described),
    )


def trend_of(alarm: Alarm) -> Trend:
    """The trend whose one pen has the alarm's value and its limits nearest to what is normal."""
    low = alarm.low_low if alarm.low is None else alarm.low
    high = alarm.high_high if alarm.high is None else alarm.high
    keys = {key: getattr(alarm, key) for key in ("unit", "scale", "offset")}
    pen = Pen.model_construct(None, low=low, high=high, **keys)
    return Trend.model_construct(None, pens=(pen,))


def _value_at(columns: Sequence[Column], at: float, described: Alarm) -> TextLike:
    """The last value that was there at a time."""
    before = [column for column in columns if column.number <= math.floor(at / WIDTH_S)]
    if not before:
        return ""
    return value_text(before[-1].last, described.unit, described.format)


class AlarmsContext(ChoiceContext):
    """The variables of `alarms.html`, beside those of the frame. `rows_query` asks for the rows as
    JSON. `details` is the address of an alarm's details, up to its id, and `list_address` that of the
    list. `chosen` is the alarm whose details are shown, None for none; `gone`: it was asked for and is
    no longer listed. `place` is where a page shows what it is about, `curve` that of its value.
    `firsts` are the ids of alarms that others followed, `followers` those that followed the chosen
    one. `with_sheet`: the sheet of its row is open."""

    rows: list[AlarmRow]
    rows_query: str
    details: str
    list_address: str
    chosen: AlarmRow | None
    gone: bool
    place: AlarmPlace | None
    place_address: str
    curve: ShownCurve | None
    firsts: set[str]
    followers: list[AlarmRow]
    more: TextLike
    steps: list[str]
    with_sheet: bool


def word(name: str) -> Text:
    return say(f"alarms_{name}")


def alarms_context(
    state: AppState, choice: AlarmChoice, language: str, *, with_sheet: bool = False
) -> AlarmsContext:
    """The alarms as they are now. `with_sheet`: the sheet of the chosen alarm's row is open."""
    rows = state.fleet.alarms.rows()
    row = next((row for row in rows if row["id"] == choice.alarm), None)
    listed = chosen_rows(choice, rows, language, MAX_ROWS)
    address = choice.address(alarm="")
    alarm = state.fleet.alarms.engine.alarms.get(choice.alarm) if row else None
    place = (
        alarm_place(state.fleet.panel, alarm.definition.alarm, alarm.definition.robot)
        if alarm
        else None
    )
    curve = state.fleet.alarms.curves.of_alarm(alarm) if alarm else None
    return AlarmsContext(
        **choice_context(state.fleet.panel, choice, listed.taken),
        rows=listed.rows,
        rows_query="&".join(filter(None, (choice.address(), f"limit={MAX_ROWS}"))),
        details=f"alarms?{address}{'&' if address else ''}alarm=",
        list_address=f"alarms?{address}" if address else "alarms",
        chosen=row,
        gone=bool(choice.alarm) and row is None,
        place=place,
        place_address=_address(state, place, row["robot"]) if place and row else "",
        curve=shown_curve(alarm, curve) if alarm and curve else None,
        firsts={follower["follows"] for follower in rows},
        followers=[follower for follower in rows if follower["follows"] == row["id"]] if row else [],
        more=more_text(listed.more),
        steps=_lines(row["action"], language) if row else [],
        with_sheet=with_sheet and row is not None,
    )


def _address(state: AppState, place: AlarmPlace, robot: str) -> str:
    """The path of a widget on its page, of a robot."""
    base = state.fleet.of_robot(robot).base
    return f"{base}/pages/{place.page.id}#at-{place.widget.id}"


def _lines(text: TextLike, language: str) -> list[str]:
    """The lines of what to do: its steps."""
    return [line.strip() for line in render(text, language).splitlines() if line.strip()]


# The sheet of an alarm's row: for how long and why it is shelved, or why it is out of service.

SHELF_MINUTES: Final = (15, 60, 120)
REASON_WORDS: Final = (
    "alarms_reason_maintenance",
    "alarms_reason_repair",
    "alarms_reason_sensor",
    "alarms_reason_known",
)
WORDS: Final = (
    "alarms_more_acts",
    "alarms_for",
    "alarms_reason",
    "alarms_taken_since",
    "alarms_until",
    "alarms_who",
    "alarms_shelve",
    "alarms_unshelve",
    "alarms_out_of_service",
    "alarms_in_service",
    "alarms_not_high",
)


def sheet_words(who: Principal) -> dict[str, Any]:
    """What the sheet shows a client. `shelve_lock`: why it may not shelve, "" if its role is enough."""
    verdict = role_verdict((ALARM_ACTS["shelve"].needs,), who)
    return {
        **{word: say(word) for word in WORDS},
        "shelf_times": shelf_times(),
        "shelf_reasons": [say(code) for code in REASON_WORDS],
        "shelve_lock": (verdict.reason if verdict else None) or "",
    }


def shelf_times() -> list[tuple[int, Text]]:
    """The times to choose from: seconds, and the text."""
    return [
        (60 * minutes, say("alarms_minutes", count=number(str(minutes)))) for minutes in SHELF_MINUTES
    ]
