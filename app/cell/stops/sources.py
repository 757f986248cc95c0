"""The events of stories, and the stops, from the stores that have them: the journal of changes, the
history of alarms and the operator's log. Texts are those of the panel file as it is now."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from app.cell.alarms.history import HistoryRow
from app.cell.alarms.records import text_of, written_limit, written_value
from app.cell.alarms.shown import panel_id
from app.cell.stops.changes import Change, text_in_json
from app.cell.stops.story import AFTER_S, Event, Sort, Source, Stop
from app.panel.alarm import STOPPING_PRIORITY, Alarm
from app.panel.model import Panel
from app.panel.widgets.families import Command
from app.panel.widgets.service_action import Action
from app.panel.widgets.templated import is_stop
from app.records import LogRow
from app.records.entry import GOOD_OUTCOMES
from app.system.printable import printable
from app.system.texts import TextLike, joined, say

NODE, LINK = "node", "link"  # the names of sources that are no topics
CHANGE_WORDS: Final[Mapping[tuple[str, bool], str]] = {
    ("link", True): "story_link_lost",
    ("link", False): "story_link_back",
    ("publisher", True): "story_publisher_lost",
    ("publisher", False): "story_publisher_back",
    ("node", True): "story_node_lost",
    ("node", False): "story_node_back",
}
ALARM_WORDS: Final[Mapping[str, str]] = {
    "returned": "story_alarm_returned",
    "unknown": "story_alarm_unknown",
}
TOLD_FIRST: Final[Mapping[str, int]] = {"state": 1, "interlock": 2, "condition": 3}
# Kinds of entries without a control: the sort of the event, and the code of its text.
CONTROL_KINDS: Final[Mapping[str, tuple[Sort, str]]] = {
    "control": ("control", "story_control"),
    "recipe": ("recipe", "story_recipe"),
    "began": ("server", "story_server_began"),
}


@dataclass(frozen=True)
class PanelNames:
    """What a panel calls its conditions, alarms and controls, and the values that they are about."""

    panel: Panel

    @cached_property
    def conditions(self) -> Mapping[str, TextLike]:
        return {condition.id: condition.name for condition in self.panel.named_conditions}

    @cached_property
    def sources(self) -> Mapping[str, frozenset[Source]]:
        """The values that an interlock or condition is about, by its id."""
        named = self.panel.named_conditions
        return {each.id: frozenset({(each.topic, each.field)}) for each in named}

    @cached_property
    def alarms(self) -> Mapping[str, Alarm]:
        return {str(alarm.id): alarm for alarm in self.panel.alarms}

    @cached_property
    def commands(self) -> Mapping[str, Command]:
        return {str(w.id): w for w in self.panel.widgets() if isinstance(w, Command)}

    @cached_property
    def every_source(self) -> frozenset[Source]:
        """All values that are judged, with the link itself: what a lost link takes."""
        alarms = (source for alarm in self.panel.alarms for source in alarm_sources(alarm))
        own = (source for sources in self.sources.values() for source in sources)
        return frozenset({*own, *alarms, (LINK, "")})

    def of_topic(self, topic: str) -> frozenset[Source]:
        """The values of a topic that are judged."""
        return frozenset(source for source in self.every_source if source[0] == topic)

    @cached_property
    def running(self) -> frozenset[str]:
        """The states in which the machine produces."""
        state, oee = self.panel.state, self.panel.oee
        if state is None:
            return frozenset()
        values = oee.running_values(state) if oee else state.playing_values
        return frozenset(map(str, values))

    @cached_property
    def state_sources(self) -> frozenset[Source]:
        state = self.panel.state
        return frozenset({(state.topic, state.field)}) if state else frozenset()


def alarm_sources(alarm: Alarm) -> frozenset[Source]:
    """The values that raise an alarm; of one about a node or the link its name."""
    values: set[Source] = {*alarm.marked_values}
    if alarm.node:
        values.add((NODE, alarm.node))
    if alarm.lost:
        values.add((LINK, ""))
    if alarm.source in ("stale", "list", "diagnostics") and alarm.topic_name:
        values.add((alarm.topic_name, ""))
    return frozenset(values)


# Events.


def change_events(names: PanelNames, changes: Iterable[Change]) -> Iterator[Event]:
    """The events of changes of one robot, in their order. What a lost node published is not known from
    then on: they are about the same values. A message that changes several tells the machine's state,
    or else an interlock, before conditions of the same value."""
    rows = list(changes)
    changed: set[tuple[float, frozenset[Source]]] = set()
    for row in sorted(rows, key=lambda row: (row.at, TOLD_FIRST.get(row.sort, 0))):
        if row.sort in TOLD_FIRST:
            sources = _change_sources(names, row, ())
            if sources and (row.at, sources) in changed:
                continue
            changed.add((row.at, sources))
        together = [other for other in rows if other.sort == "publisher" and other.at == row.at]
        yield Event(
            row.at,
            row.sort,
            row.id,
            _change_text(names, row),
            text_in_json(row.reason),
            text_in_json(row.before),
            text_in_json(row.after),
            row.sent,
            row.clock,
            breaks=row.breaks and row.sort != "state",
            heals=row.heals or (row.sort == "state" and row.id in names.running),
            sources=_change_sources(names, row, together),
        )


def _change_sources(names: PanelNames, row: Change, together: Sequence[Change]) -> frozenset[Source]:
    if row.sort == "link":
        return names.every_source
    if row.sort == "publisher":
        return names.of_topic(row.id)
    if row.sort == "node":
        lost = (names.of_topic(other.id) for other in together)
        return frozenset({(NODE, row.id)}).union(*lost)
    return names.state_sources if row.sort == "state" else names.sources.get(row.id, frozenset())


def _change_text(names: PanelNames, row: Change) -> TextLike:
    if row.sort == "state":
        return say("story_state", state=text_in_json(row.after))
    if row.sort == "clock":
        return say("story_clock", by=row.after)
    if row.sort in ("interlock", "condition"):
        name = names.conditions.get(row.id, row.id)
        code = "story_met" if row.heals else "story_unmet" if row.breaks else "story_unknown"
        return say(code, name=name)
    return say(CHANGE_WORDS[row.sort, row.breaks], name=printable(row.id))


def alarm_events(names: PanelNames, rows: Iterable[HistoryRow]) -> Iterator[Event]:
    """The events of an alarm's transitions: raised, returned."""
    for row in rows:
        if row.event != "raised" and row.event not in ALARM_WORDS:
            continue
        record = json.loads(row.record)
        alarm = names.alarms.get(panel_id(row.id))
        is_raise = row.event == "raised"
        text = text_of(record.get("about", {}).get("text", row.id))
        yield Event(
            row.at,
            "alarm",
            row.id,
            text if is_raise else say(ALARM_WORDS[row.event], alarm=text),
            joined(filter(None, [written_value(record), _limit(record)]), "between_names"),
            began_s=alarm.on_delay_s if alarm and is_raise else 0.0,
            breaks=is_raise,
            heals=row.event == "returned",
            sources=alarm_sources(alarm) if alarm else frozenset(),
            follows=(record.get("leader") or {}).get("id", ""),
            priority=row.priority,
        )


def _limit(record: Mapping[str, object]) -> TextLike:
    limit = written_limit(record)
    return say("alarms_event_limit", limit=limit) if limit else ""


def log_events(names: PanelNames, rows: Iterable[LogRow]) -> Iterator[Event]:
    """The events of the operator's log: presses with their results, goals that ended, changes of
    control, loads of recipes, starts of the server."""
    for row in rows:
        entry = row.entry
        at = (row.pressed_at or entry.at) / 1000
        by, reason = printable(entry.who), entry.reason_text
        if entry.kind in CONTROL_KINDS:
            sort, code = CONTROL_KINDS[entry.kind]
            detail = "" if sort == "server" else reason
            yield Event(entry.at / 1000, sort, entry.action, say(code), detail, by=by)
            continue
        if not entry.widget:
            continue
        widget = names.commands.get(entry.widget)
        label = widget.label if widget is not None else printable(entry.widget)
        if isinstance(widget, Action) and entry.outcome in ("aborted", "rejected"):
            text = say("story_goal_aborted", goal=label)
            yield Event(entry.at / 1000, "goal", entry.widget, text, reason, by=by)
        elif entry.outcome == "refused":
            yield Event(at, "refused", entry.widget, say("story_refused", label=label), reason, by=by)
        elif entry.kind != "corrected" or entry.outcome != "unknown":
            stops = widget is not None and is_stop(widget) and entry.outcome in GOOD_OUTCOMES
            text = say("story_pressed", label=label)
            yield Event(at, "press", entry.widget, text, reason, by=by, breaks=stops)


# Stops.


def change_stops(
    names: Callable[[str], PanelNames], rows: Iterable[Change], every_state: bool = False
) -> Iterator[Stop]:
    """The stops among changes: states that are stops, and lost links. `names` are those of a robot.
    `every_state`: any change of the state, as one of them ended production."""
    for row in rows:
        if row.sort not in ("state", "link") or not (
            row.breaks or (every_state and row.sort == "state")
        ):
            continue
        known = names(row.robot)
        text = text_in_json(row.after) if row.sort == "state" else say("story_link_lost", name="")
        sources = _change_sources(known, row, ())
        yield Stop(row.at, row.robot, row.sort, row.seq, row.id, text, row.sent, row.clock, sources)


def alarm_stops(rows: Iterable[HistoryRow]) -> Iterator[Stop]:
    """The raises of alarms of high priority."""
    for row in rows:
        if row.event == "raised" and row.priority <= STOPPING_PRIORITY:
            text = text_of(json.loads(row.record).get("about", {}).get("text", row.id))
            yield Stop(row.at, row.robot, "alarm", row.seq, row.id, text)


def goal_stops(names: PanelNames, robot: str, rows: Iterable[LogRow]) -> Iterator[Stop]:
    """The goals that a robot has aborted."""
    for row in rows:
        widget = names.commands.get(row.entry.widget)
        if row.entry.outcome == "aborted" and isinstance(widget, Action):
            text = say("story_goal_aborted", goal=widget.label)
            yield Stop(row.entry.at / 1000, robot, "goal", row.entry.seq, str(widget.id), text)


def separate(stops: Iterable[Stop]) -> list[Stop]:
    """The stops, the newest first, without those that belong to another one: of what happens to a robot
    within some seconds the state is the stop, or else what was first."""
    kept: list[Stop] = []
    for stop in sorted(stops, key=lambda each: each.at):
        near = next(
            (each for each in kept if each.robot == stop.robot and stop.at - each.at <= AFTER_S), None
        )
        if near is None:
            kept.append(stop)
        elif stop.sort == "state" and near.sort != "state":
            kept[kept.index(near)] = stop
    return kept[::-1]
