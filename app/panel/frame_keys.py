"""Which robots a button of the frame is for. On a page of several robots a stop button is for all of
them; any other button is for one robot on every page."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from typing import Final, NamedTuple

from app.panel.layout import FRAME_OF_ALL, FRAME_ONLY, Page
from app.panel.model import Panel, RobotEntry
from app.panel.needs import PanelNeeds
from app.panel.robot_panels import widget_robots
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.templated import TemplateCommand, is_stop

STOPS_OF: Final = "-stops-"  # no widget has an id that begins like this


class FrameKey(NamedTuple):
    """A button of the frame on a page: the ids of the robots that it is for, in the order of the file;
    none on a panel of one robot without a name."""

    widget: BaseWidget
    robots: tuple[str, ...]

    @property
    def of_several(self) -> bool:
        """Whether one press of it stops several robots."""
        return len(self.robots) > 1

    @property
    def shown_id(self) -> str:
        """The id of its attributes in the view."""
        if not self.of_several:
            return self.widget.id
        return f"{STOPS_OF}{self.widget.id}-{'-'.join(self.robots)}"


def frame_keys(panel: Panel, robot_id: str | None, page_id: str) -> Iterator[FrameKey]:
    """The buttons of the frame on a page of the robot's."""
    own = {widget.id: widget.robot for widget in panel.frame.widgets}
    page = panel.page(page_id)
    for widget in panel.frame.widgets:
        if robot_id is None:
            yield FrameKey(widget, ())
        elif robot := own[widget.id]:
            yield FrameKey(widget, (robot,))
        elif isinstance(widget, TemplateCommand) and is_stop(widget):
            yield FrameKey(widget, robots_on_page(panel, robot_id, page or page_id))
        else:
            yield FrameKey(widget, (robot_id,))


def robots_on_page(panel: Panel, robot_id: str, page: Page | str) -> tuple[str, ...]:
    """The ids of the robots that a page of the robot `robot_id` shows."""
    every = tuple(str(robot.id) for robot in panel.robots)
    if isinstance(page, str):
        return every if page == FRAME_OF_ALL else (robot_id,)
    if page.overview:
        return every
    known = widget_robots(panel)
    shown = {robot_id} | {known[widget.id] for widget in page.widgets if widget.id in known}
    return tuple(robot for robot in every if robot in shown)


def stops_of_several(panel: Panel, robot_id: str) -> dict[str, FrameKey]:
    """The stop buttons of several robots on the pages of the robot, by the ids of their attributes."""
    pages = (*(str(page.id) for page in panel.pages), FRAME_ONLY, FRAME_OF_ALL)
    keys = (key for page in pages for key in frame_keys(panel, robot_id, page))
    return {key.shown_id: key for key in keys if key.of_several}


def shown_widgets(panel: Panel, robot_id: str | None) -> Mapping[str, Collection[str]]:
    """As `widgets_by_page`, on the pages of the robot, with the ids of the attributes."""

    def shown(page: str, widgets: Collection[str]) -> Collection[str]:
        keys = {key.widget.id: key.shown_id for key in frame_keys(panel, robot_id, page)}
        return frozenset(keys.get(widget, widget) for widget in widgets)

    return {page: shown(page, widgets) for page, widgets in panel.widgets_by_page.items()}


def needs_on_pages(panel: Panel, robot: RobotEntry | None) -> PanelNeeds:
    """What the pages and commands of the panel need, on the pages of the robot."""
    stops = stops_of_several(panel, robot.id) if robot else {}
    commands = panel.needs.commands
    own = {shown_id: commands[key.widget.id] for shown_id, key in stops.items()}
    return replace(panel.needs, commands={**commands, **own})
