"""The curve of an alarm's value beside its form, with the limits as flags: what the editor has seen of
the topic, and how often the alarm would have come in it, by the evaluation of the panel itself."""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

from app.cell.alarms.engine import levels_of, steady_range
from app.cell.alarms.shown import AlarmRow, row_of
from app.cell.alarms.sources import UNKNOWN, SourceReading
from app.cell.alarms.states import (
    NORMAL,
    AlarmInstance,
    AlarmLimit,
    Definition,
    Delays,
    Moment,
    define,
    update_level,
)
from app.cell.view.trend import axis_range, time_ticks, value_ticks
from app.panel.alarm import LIMIT_KEYS, Alarm
from app.panel.file.toml_lines import Path
from app.panel.numbers import shown_number
from app.system.clock import format_age, format_time
from app.system.texts import TextLike, number, say
from app.system.toml_values import value_text
from app.tools.editor.editor import Editor, PartRequest
from app.tools.editor.paths import at as value_at
from app.tools.editor.robot_list import Sample

LENGTH_S: Final = 600.0  # of the curve at most
LEAST_S: Final = 60.0
GAP_S: Final = 5.0  # without a sample: the line has a gap
COLUMNS: Final = 600  # of the line: each has its lowest and highest value
STEPS: Final = 200  # of a flag from the bottom to the top
LETTERS: Final = {"low_low": "LL", "low": "L", "high": "H", "high_high": "HH"}


class Evaluation(NamedTuple):
    """How often an alarm was raised in samples, when it was active, and the alarm while it last was."""

    raised: int
    spans: Sequence[tuple[float, float]]
    last: AlarmInstance


def evaluate(definition: Definition, samples: Sequence[Sample]) -> Evaluation:
    """What the panel would have made of the samples. Times are those of the samples."""
    alarm = AlarmInstance(definition)
    spans: list[list[float]] = []
    shown = alarm

    def observe(reading: SourceReading, now: float) -> None:
        nonlocal shown
        levels, conditions = levels_of(alarm, reading, now)
        alarm.value = reading.value
        alarm.set_conditions(conditions)
        for level in levels:
            was_active = alarm.status.level > 0
            alarm.status = update_level(alarm.status, definition.rules, level, Moment(now, now))
            if alarm.status.level and not was_active:
                spans.append([now, now])
            if spans and was_active:
                spans[-1][1] = now
        alarm.steady = steady_range(alarm)
        if alarm.status.level:
            shown = _copy(alarm)

    max_age_s = definition.alarm.max_age_s or math.inf
    before, reading = -math.inf, UNKNOWN
    for now, value in samples:
        if now - before > max_age_s and reading.is_known:
            observe(UNKNOWN, before + max_age_s)
        while reading.is_known and (due := _due(alarm)) <= min(now, before + max_age_s):
            observe(reading, due)
        lowest, highest = alarm.steady
        before, reading = now, SourceReading(value=value)
        if not lowest <= value <= highest:
            observe(reading, now)
    if spans and alarm.status.level:
        spans[-1][1] = before
    return Evaluation(alarm.status.occurrence, [(begin, end) for begin, end in spans], shown)


def _copy(alarm: AlarmInstance) -> AlarmInstance:
    """The alarm as it is now."""
    copy = AlarmInstance(alarm.definition, alarm.status)
    copy.value, copy.limit = alarm.value, alarm.limit
    return copy


def _due(alarm: AlarmInstance) -> float:
    delays = alarm.definition.delays
    return min((condition.due(delays) for condition in alarm.conditions), default=math.inf)


# What is drawn.


@dataclass(frozen=True, slots=True)
class Flag:
    """A limit. `place` is in percent of the plot's height from above, that of `back` is where it is no
    longer exceeded. It may be dragged from `low` to `high`."""

    name: str
    letter: str
    value: float
    text: str
    place: float
    priority: int
    low: float
    high: float
    path: Path
    back: float | None = None
    back_text: TextLike = ""


class Figure(NamedTuple):
    """How often the alarm would have come, and under what."""

    number: int
    about: TextLike


@dataclass(frozen=True, slots=True)
class Curve:
    """`path` is a line as an SVG path in a square of 1000 units, `spans` are (left, width, text) in
    percent, where the alarm was active. `axis` are the ends of the values, `step` that of a flag."""

    axis: tuple[float, float]
    step: float
    line: str = ""
    values: Sequence[tuple[float, str]] = ()
    times: Sequence[tuple[float, TextLike]] = ()
    spans: Sequence[tuple[float, float, TextLike]] = ()
    flags: Sequence[Flag] = ()
    band: tuple[float, float] | None = None
    now: float | None = None
    figures: Sequence[Figure] = ()
    seen: TextLike = ""


def curve_pane(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    """The curve of the alarm at a path, with other limits where the query has them; nothing for what is
    not an alarm with limits. `axis` keeps the ends of the values while a flag is dragged."""
    editor, path = request.editor, request.path
    table = value_at(editor.document.tables, path)
    named = [key for key in LIMIT_KEYS if isinstance(table, dict) and _is_number(table.get(key))]
    if len(path) != 2 or path[0] != "alarm" or not named:
        return "_curve.html", {"title": ""}
    definition = _definition(editor, str(table.get("id")))
    if definition is None:
        return "_curve.html", {"title": say("editor_curve_faulty", name=str(table.get("id", "")))}
    alarm = definition.alarm
    topic = str(alarm.topic)
    samples = recorded(editor, alarm)
    others = {key: float(request.query[key]) for key in named if _is_float(request.query.get(key))}
    changed = with_limits(definition, others)
    ends = [*map(float, request.query.get("axis", "").split())][:2]
    axis = (ends[0], ends[1]) if len(ends) == 2 and ends[0] < ends[1] else None
    result = evaluate(changed, samples)
    curve = _curve(changed, definition, samples, result, path, axis)
    return "_curve.html", {
        "title": say("editor_curve_title", name=alarm.id, topic=topic),
        "curve": curve,
        "unit": alarm.unit,
        "row": _row(changed, result.last),
        "words": {
            "drag": say("editor_curve_drag"),
            "line": say("editor_curve_line"),
            "acknowledge": say("alarm_acknowledge"),
            "close": say("editor_curve_close"),
        },
    }


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_float(text: str | None) -> bool:
    try:
        return text is not None and math.isfinite(float(text))
    except ValueError:
        return False


def _definition(editor: Editor, alarm_id: str) -> Definition | None:
    """Of the alarm as the document has it now; None while the file has a fault."""
    panel = editor.checked.panel
    if panel is None:
        return None
    robot = str(panel.robots[0].id) if panel.robots else ""
    return next((each for each in define(panel, robot) if each.alarm.id == alarm_id), None)


def with_limits(definition: Definition, limits: Mapping[str, float]) -> Definition:
    """The definition with other values of its limits."""
    thresholds = tuple(
        limit and limit._replace(value=limits.get(limit.name, limit.value))
        for limit in definition.thresholds
    )
    return replace(definition, thresholds=thresholds)


def recorded(editor: Editor, alarm: Alarm) -> list[Sample]:
    """What the editor has seen of the value of an alarm in the last minutes; from now on it listens."""
    panel = editor.preview.panel
    robots = editor.robots
    robots.look()
    recording = robots.recording(str(alarm.topic), panel)
    if recording is None or panel is None:
        return []
    since = time.monotonic() - LENGTH_S
    offset = time.time() - time.monotonic()
    values = recording.values(alarm.field, robots.interfaces(panel))
    return [
        (at + offset, shown_number(alarm, value))
        for at, value in values
        if at >= since and math.isfinite(value)
    ]


def _curve(
    changed: Definition,
    written: Definition,
    samples: Sequence[Sample],
    result: Evaluation,
    path: Path,
    axis: tuple[float, float] | None,
) -> Curve:
    limits = [limit for limit in changed.thresholds if limit is not None]
    values = [*(value for _, value in samples), *(limit.value for limit in limits)]
    span = max(values) - min(values)
    room = span * 0.1 or max(1.0, abs(values[0]) * 0.1)
    low, high = axis or axis_range(min(values) - room, max(values) + room, None, None)
    end = time.time()
    begin = end - (min(LENGTH_S, max(LEAST_S, end - samples[0][0])) if samples else LEAST_S)

    def y(value: float) -> float:
        return round((high - value) / (high - low) * 100, 3)

    def x(at: float) -> float:
        return round((at - begin) / (end - begin) * 100, 3)

    flags = tuple(_flags(changed, limits, path, (low, high), y))
    inside = [*(f.place for f in flags if f.name == "high"), 0.0][0]
    bottom = [*(f.place for f in flags if f.name == "low"), 100.0][0]
    return Curve(
        axis=(low, high),
        step=_step((high - low) / STEPS),
        line=_line(samples, x, y),
        values=[(y(value), text) for value, text in value_ticks(low, high)],
        times=[(tick.place, tick.text) for tick in time_ticks(begin, end)],
        spans=[
            (x(a), round(x(b) - x(a), 3), say("editor_curve_active", time=format_age(b - a)))
            for a, b in result.spans
            if b >= begin
        ],
        flags=flags,
        band=(inside, bottom) if bottom > inside else None,
        now=y(samples[-1][1]) if samples else None,
        figures=[*_figures(changed, written, samples, result.raised)] if samples else (),
        seen=say("editor_curve_seen", since=format_time(samples[0][0]))
        if samples
        else say("editor_curve_nothing", topic=str(changed.alarm.topic)),
    )


def _flags(
    definition: Definition,
    limits: Sequence[AlarmLimit],
    path: Path,
    axis: tuple[float, float],
    y: Any,
) -> Iterator[Flag]:
    """The limits in their order, each between its neighbours."""
    order = sorted(limits, key=lambda limit: [*LETTERS].index(limit.name))
    for number_, limit in enumerate(order):
        level = 2 if limit.name in ("low_low", "high_high") else 1
        margin = limit.deadband
        back = limit.value - margin if limit.is_high else limit.value + margin
        code = "editor_curve_back_below" if limit.is_high else "editor_curve_back_above"
        yield Flag(
            limit.name,
            LETTERS[limit.name],
            limit.value,
            value_text(limit.value),
            y(limit.value),
            definition.rules.priority(min(level, len(definition.rules.priorities))),
            order[number_ - 1].value if number_ else axis[0],
            order[number_ + 1].value if number_ + 1 < len(order) else axis[1],
            (*path, limit.name),
            y(back) if margin else None,
            say(code, value=number(f"{back:.6g}")) if margin else "",
        )


def _step(width: float) -> float:
    """The next of 1, 2, 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(width))
    return next(float(f"{power * factor:.6g}") for factor in (1, 2, 5, 10) if power * factor >= width)


def _line(samples: Sequence[Sample], x: Any, y: Any) -> str:
    """The line: of many samples, the lowest and the highest of each column."""
    parts: list[str] = []
    column: list[float] = []
    at_column, before = -1, -math.inf
    for at, value in samples:
        place = x(at)
        number_ = int(place / 100 * COLUMNS)
        if at - before > GAP_S:
            parts.append(f"M{place * 10:.1f} {y(value) * 10:.1f}")
            column = [value]
        elif number_ != at_column or not column[0] <= value <= column[-1]:
            parts.append(f"L{place * 10:.1f} {y(value) * 10:.1f}")
            column = sorted((value, *column)) if number_ == at_column else [value]
        at_column, before = number_, at
    return "".join(parts)


def _figures(
    changed: Definition, written: Definition, samples: Sequence[Sample], raised: int
) -> Iterator[Figure]:
    """With the shown limits, with those of the file, without the delays, without the deadband."""
    is_dragged = changed != written
    yield Figure(raised, say("editor_curve_dragged" if is_dragged else "editor_curve_raised"))
    if is_dragged:
        yield Figure(evaluate(written, samples).raised, say("editor_curve_written"))
    delays, alarm = changed.delays, changed.alarm
    if delays.on_s or delays.off_s:
        prompt = evaluate(replace(changed, delays=Delays()), samples)
        longest = number(f"{max(delays):.6g}")
        yield Figure(prompt.raised, say("editor_curve_undelayed", delay=longest))
    if alarm.deadband:
        bare = tuple(limit and limit._replace(deadband=0.0) for limit in changed.thresholds)
        count = evaluate(replace(changed, thresholds=bare), samples).raised
        yield Figure(count, say("editor_curve_without_band", band=number(f"{alarm.deadband:.6g}")))


def _row(definition: Definition, last: AlarmInstance) -> AlarmRow:
    """The alarm as its line shows it: as it last was, or as if it came now."""
    moment = Moment(time.monotonic(), time.time())
    if last.status == NORMAL:
        last = AlarmInstance(definition)
        last.status = update_level(NORMAL, definition.rules, 1, moment)
    return row_of(last, moment)
