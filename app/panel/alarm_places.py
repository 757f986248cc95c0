"""Where a page shows what an alarm is about."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from app.panel.alarm import Alarm, inhibited_controls
from app.panel.layout import Page
from app.panel.model import Panel
from app.panel.robot_panels import widget_robots
from app.panel.widgets.families import BaseWidget, DisplayWidget


class AlarmPlace(NamedTuple):
    """A widget and its page."""

    page: Page
    widget: BaseWidget


def alarm_place(panel: Panel, alarm: Alarm, robot: str) -> AlarmPlace | None:
    """The first widget of a page that shows a value that the alarm is about, else another field of its
    topic, else the first of its robot that it inhibits; None where no page has any. `robot` is the
    alarm's, "" for the only one."""
    values = set(alarm.marked_values)
    topics = {topic for topic, _ in values} | ({alarm.topic_name} - {None})
    robots = tuple(str(entry.id) for entry in panel.robots)
    locked = set(inhibited_controls(alarm.inhibits, robot, robots, widget_robots(panel)))
    tests: tuple[Callable[[BaseWidget], bool], ...] = (
        lambda widget: not values.isdisjoint(_values(widget)),
        lambda widget: not topics.isdisjoint(topic for topic, _ in _values(widget)),
        lambda widget: (robot, widget.id) in locked,
    )
    places = list(_places(panel, robot))
    return next((place for test in tests for place in places if test(place.widget)), None)


def _places(panel: Panel, robot: str) -> Iterator[AlarmPlace]:
    """The widgets of the robot's pages, in their order."""
    for page in panel.pages:
        for _, widget, named in page.robots():
            if named in (None, robot or None):
                yield AlarmPlace(page, widget)


def _values(widget: BaseWidget) -> Iterator[tuple[str, str]]:
    """The topics and fields that a widget shows."""
    if isinstance(widget, DisplayWidget):
        for source in widget.sources():
            yield from ((source.topic, field) for field in source.fields or ("",))
