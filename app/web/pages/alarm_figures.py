"""Figures of the history of alarms, as their page and JSON have them."""

import json
import math
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Annotated, Any, Final, NamedTuple

from pydantic import AwareDatetime, BaseModel, Field

from app.cell.alarms.figures import HOUR_S, HOURLY_LIMIT, SLOT_LIMIT, Burst, Figures, Suggestion
from app.cell.alarms.history import HistoryRow
from app.cell.alarms.records import text_of
from app.cell.view.times import duration_text
from app.panel.numbers import decimal_text
from app.system.clock import format_time, iso_time
from app.system.texts import TextLike, joined, number, say, short_day, time_of_day
from app.web.pages.alarms import word

HOURS_AS_BARS: Final = 48.0  # a longer time is shown by days
MAX_BARS: Final = 62
MARKS: Final = 4  # below the bars
PLOT_HEIGHT: Final = 100.0


class AlarmFigure(NamedTuple):
    """A number with its name, and what stands beside it."""

    name: TextLike
    value: TextLike
    beside: TextLike
    over: bool = False


class Bar(NamedTuple):
    """Raises in a time that begins at `at`: `x`, `width` and `height` in percent of the plot."""

    at: TextLike
    raises: int
    x: float
    width: float
    height: float


class Ranked(NamedTuple):
    """An alarm among the most frequent: `share` of all raises and `length` of its bar in percent."""

    id: str
    priority: int
    text: TextLike
    raises: int
    share: TextLike
    length: float


class Calmed(NamedTuple):
    """An alarm that chatters: its worst burst, and the delays that would calm it."""

    id: str
    priority: int
    text: TextLike
    burst: TextLike
    delays: TextLike


class FiguresContext(NamedTuple):
    """`limit` is the height of the limit per hour in percent of the plot, None without one."""

    figures: list[AlarmFigure]
    bars: list[Bar]
    marks: list[TextLike]
    limit: float | None
    by: TextLike
    counted: TextLike
    top: list[Ranked]
    of_all: TextLike
    chattering: list[Calmed]


class RankedAnswer(BaseModel):
    """`share` of all raises, from 0 to 1."""

    id: str
    text: str
    priority: int
    raised: int
    share: float


class ChatteringAnswer(BaseModel):
    """The worst burst of an alarm: `raises` within `span_s` from `at` on. With `on_delay_s` of so many
    seconds it would have been `on_delay_leaves` raises; null where no such delay would do."""

    id: str
    text: str
    priority: int
    raised: int
    at: AwareDatetime
    raises: int
    span_s: float
    on_delay_s: float | None
    on_delay_leaves: int | None
    off_delay_s: float | None
    off_delay_leaves: int | None


class FiguresAnswer(BaseModel):
    """Figures after EEMUA 191. `by_hour` has the hours in which alarms were raised, by when they began.
    `standing_24_h`: alarms that had stood for 24 h at the end."""

    since: AwareDatetime
    until: AwareDatetime
    raised: int
    by_priority: dict[str, int]
    per_hour: float
    worst_hour: int
    hours_over_limit: int
    per_10_min: float
    worst_10_min: int
    standing_24_h: int
    acknowledge_median_s: Annotated[float | None, Field(description="null without an acknowledgement")]
    by_hour: dict[str, int]
    top: list[RankedAnswer]
    chattering: list[ChatteringAnswer]


def figures_json(figures: Figures) -> dict[str, Any]:
    """The figures as JSON, with texts that are not rendered yet."""
    return {
        "since": iso_time(figures.since),
        "until": iso_time(figures.until),
        "raised": figures.raised,
        "by_priority": {str(level): figures.by_priority.get(level, 0) for level in range(1, 5)},
        "per_hour": figures.per_hour,
        "worst_hour": figures.worst_hour,
        "hours_over_limit": figures.hours_over,
        "per_10_min": figures.per_10_min,
        "worst_10_min": figures.worst_10_min,
        "standing_24_h": figures.standing,
        "acknowledge_median_s": figures.acknowledge_s,
        "by_hour": {
            iso_time(hour * HOUR_S): raises for hour, raises in sorted(figures.by_hour.items())
        },
        "top": [
            {**_about(row), "raised": raises, "share": raises / figures.raised}
            for row, raises in figures.top
        ],
        "chattering": [
            {
                **_about(row),
                "raised": raises,
                "at": iso_time(burst.first),
                "raises": burst.raises,
                "span_s": burst.span_s,
                **_delay_json("on_delay", burst.on_delay),
                **_delay_json("off_delay", burst.off_delay),
            }
            for row, raises, burst in figures.chattering
        ],
    }


def _delay_json(name: str, delay: Suggestion | None) -> dict[str, Any]:
    return {
        f"{name}_s": delay.delay_s if delay else None,
        f"{name}_leaves": delay.raises if delay else None,
    }


def _about(row: HistoryRow) -> dict[str, Any]:
    return {"id": row.id, "text": _text(row), "priority": row.priority}


def _text(row: HistoryRow) -> TextLike:
    return text_of(json.loads(row.record).get("about", {}).get("text", row.id))


def figures_context(figures: Figures) -> FiguresContext:
    """The figures for their page."""
    by_days = figures.hours > HOURS_AS_BARS
    counts = list(_by_days(figures) if by_days else _by_hours(figures))
    limit = None if by_days else HOURLY_LIMIT
    most = max([raises for _, raises in counts] + ([limit] if limit else [1]))
    width = 100.0 / max(1, len(counts))
    bars = [
        Bar(at, raises, round(n * width, 3), round(0.75 * width, 3), round(100 * raises / most, 1))
        for n, (at, raises) in enumerate(counts)
    ]
    return FiguresContext(
        figures=list(_figures(figures)),
        bars=bars,
        marks=[bars[n * len(bars) // MARKS].at for n in range(MARKS)] if len(bars) >= MARKS else [],
        limit=None if limit is None else round(100 * limit / most, 1),
        by=word("raised_each_day" if by_days else "raised_each_hour"),
        counted=say(
            "alarms_raised_count",
            count=number(f"{figures.raised:,d}"),
            over=number(f"{figures.hours_over:,d}"),
        ),
        top=[
            Ranked(
                row.id,
                row.priority,
                _text(row),
                raises,
                number(f"{100 * raises / figures.raised:.0f}", "%"),
                round(100 * raises / figures.top[0].raises, 1),
            )
            for row, raises in figures.top
        ],
        of_all=say(
            "alarms_top_of_all",
            count=number(f"{sum(raises for _, raises in figures.top):,d}"),
            total=number(f"{figures.raised:,d}"),
        ),
        chattering=[
            Calmed(row.id, row.priority, _text(row), _burst(burst), _delays(burst))
            for row, _, burst in figures.chattering
        ],
    )


def _figures(figures: Figures) -> Iterator[AlarmFigure]:
    yield AlarmFigure(
        say("alarms_figure_per_hour", limit=HOURLY_LIMIT),
        rate_text(figures.per_hour),
        say("alarms_figure_most", count=number(f"{figures.worst_hour:,d}")),
        figures.per_hour > HOURLY_LIMIT,
    )
    yield AlarmFigure(
        say("alarms_figure_per_10_min", limit=SLOT_LIMIT),
        rate_text(figures.per_10_min),
        say("alarms_figure_most", count=number(f"{figures.worst_10_min:,d}")),
        figures.worst_10_min > SLOT_LIMIT,
    )
    yield AlarmFigure(
        word("figure_standing"), number(f"{figures.standing:,d}"), word("figure_standing_now")
    )
    yield AlarmFigure(word("figure_acknowledge"), median_text(figures), word("figure_median"))


def median_text(figures: Figures) -> TextLike:
    """The median of the times until alarms were acknowledged; a dash without one."""
    return "–" if figures.acknowledge_s is None else duration_text(figures.acknowledge_s)


def rate_text(rate: float) -> TextLike:
    """A number of alarms in a time."""
    return number(decimal_text(round(rate, 2 if rate < 1 else 1)))


def _by_hours(figures: Figures) -> Iterator[tuple[TextLike, int]]:
    first, last = int(figures.since // HOUR_S), math.ceil(figures.until / HOUR_S)
    for hour in range(first, last):
        yield clock_text(hour * HOUR_S), figures.by_hour.get(hour, 0)


def clock_text(at: float) -> TextLike:
    """The time of day without seconds."""
    return time_of_day(datetime.fromtimestamp(at).strftime("%H:%M"))


def _by_days(figures: Figures) -> Iterator[tuple[TextLike, int]]:
    """The raises of each day, or of several days together if there are too many."""
    first = datetime.fromtimestamp(figures.since).date()
    days = (datetime.fromtimestamp(figures.until).date() - first).days + 1
    together = math.ceil(days / MAX_BARS)
    counts = [0] * math.ceil(days / together)
    for hour, raises in figures.by_hour.items():
        counts[(datetime.fromtimestamp(hour * HOUR_S).date() - first).days // together] += raises
    for n, raises in enumerate(counts):
        yield short_day((first + timedelta(days=n * together)).isoformat()), raises


def _burst(burst: Burst) -> TextLike:
    return say(
        "alarms_chatter_burst",
        count=burst.raises,
        duration=duration_text(burst.span_s),
        time=format_time(burst.first),
    )


def _delays(burst: Burst) -> TextLike:
    """As they are written in the panel file."""
    named = (("off_delay_s", burst.off_delay), ("on_delay_s", burst.on_delay))
    sentences = [
        say("alarms_chatter_delay", key=f"{key} = {delay.delay_s:g}", left=delay.raises)
        for key, delay in named
        if delay
    ]
    return joined(sentences) or word("chatter_no_delay")
