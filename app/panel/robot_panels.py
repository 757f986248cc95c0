"""What of a panel is of which robot: the robots of widgets, and the panel of one robot."""

from collections.abc import Iterable, Mapping

from app.panel.layout import Group, Page
from app.panel.model import Panel
from app.panel.widgets.displays import Static
from app.panel.widgets.families import BaseWidget, Command, DisplayWidget, EntryWidget, Input
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.place import MapInput


def widget_robots(panel: Panel) -> Mapping[str, str]:
    """The robot of each widget that is of one robot on every page, by the widget's id."""
    known = {widget.id: widget.robot for widget in panel.frame.widgets if widget.robot}
    known |= {robot.figure.id: str(robot.id) for robot in panel.robots if robot.figure}
    for p, page in enumerate(panel.pages):
        for place, widget, robot in page.robots():
            if robot and f"page[{p}].{place}" not in panel.copies and not is_shared(widget):
                known[widget.id] = robot
    return known


def recipe_robots(panel: Panel) -> Mapping[str, frozenset[str]]:
    """The robots of each set of recipes: those of the inputs that it names. Sets whose inputs are of no
    robot are left out: every robot has them."""
    robots: dict[str, set[str | None]] = {}
    for page in panel.pages:
        for _, widget, robot in page.robots():
            if isinstance(widget, Input):
                robots.setdefault(widget.id, set()).add(robot)
    # An input that is also on a page of no robot is of none.
    named = {name: {each for each in its if each} for name, its in robots.items() if None not in its}
    of_sets = {
        table.id: frozenset[str]().union(*(named.get(name, ()) for name in table.fields))
        for table in panel.recipes
    }
    return {name: its for name, its in of_sets.items() if its}


def page_for(panel: Panel, robot_id: str | None, page: Page) -> Page:
    """The page itself if the robot has it, else the first that it has; the first of all if none."""
    own = (each for each in (page, *panel.pages) if each.robot in (None, robot_id))
    return next(own, panel.pages[0])


def opened_page(panel: Panel, robot_id: str) -> Page:
    """The page that a robot's tile opens: the first of this robot alone, else the first of any."""
    plain = [page for page in panel.pages if not page.overview]
    own = [page for page in plain if page.robot == robot_id]
    return next(iter([*own, *(page for page in plain if page.robot is None)]), panel.pages[0])


def is_shared(widget: BaseWidget) -> bool:
    """Whether it is of no robot: an input, whose value goes to any, or a text. A select whose options a
    robot has is that robot's, and so is a place on its map."""
    if isinstance(widget, SelectInput) and widget.options_from is not None:
        return False
    return isinstance(widget, Input | Static) and not isinstance(widget, MapInput)


def panel_of(panel: Panel, robot_id: str | None) -> Panel:
    """The panel of one robot: the widgets, interlocks, conditions and recipes of other robots are left
    out."""
    robots = widget_robots(panel)
    others = [c for c in panel.named_conditions if c.robot not in (None, robot_id)]
    recipes = recipe_robots(panel)
    placed = [table for table in (*panel.places, *panel.zones) if table.robot not in (None, robot_id)]
    if robot_id is None or not (robots or others or recipes or placed):
        return panel

    def own(widgets: Iterable[BaseWidget], place: str) -> tuple[BaseWidget, ...]:
        return tuple(
            widget
            for number, widget in enumerate(widgets)
            if robots.get(widget.id) in (None, robot_id)
            and f"{place}widget[{number}]" not in panel.copies
        )

    pages = []
    for p, page in enumerate(panel.pages):
        groups: list[Group] = [
            group.model_copy(update={"widgets": own(group.widgets, f"page[{p}].group[{g}].")})
            for g, group in enumerate(page.groups)
        ]
        update = {"own": own(page.own, f"page[{p}]."), "groups": tuple(groups)}
        pages.append(page.model_copy(update=update))
    frame = panel.frame.model_copy(update={"widgets": own(panel.frame.widgets, "frame.")})
    parts = {
        "robots": tuple(
            robot if robot.id == robot_id else robot.model_copy(update={"overview": None})
            for robot in panel.robots
        ),
        "pages": tuple(pages),
        "frame": frame,
        "copies": frozenset(),
        "inputs_of_others": frozenset(
            widget.id
            for widget in panel.widgets()
            if isinstance(widget, EntryWidget) and robots.get(widget.id) not in (None, robot_id)
        ),
        "interlocks": tuple(i for i in panel.interlocks if i.robot in (None, robot_id)),
        "places": tuple(place for place in panel.places if place.robot in (None, robot_id)),
        "zones": tuple(zone for zone in panel.zones if zone.robot in (None, robot_id)),
        "recipes": tuple(r for r in panel.recipes if robot_id in recipes.get(r.id, {robot_id})),
        "own_conditions": tuple(c for c in panel.own_conditions if c.robot in (None, robot_id)),
    }
    restricted = panel.model_copy(update=parts)
    named = _named(restricted)
    restricted = restricted.model_copy(update={"of_others": tuple(c for c in others if c.id in named)})
    if panel.record is None:
        return restricted
    known = restricted.subscriptions()
    topics = tuple(topic for topic in panel.record.topics or () if topic in known)
    record = panel.record.model_copy(update={"topics": topics}) if panel.record.topics else panel.record
    return restricted.model_copy(update={"record": record})


def _named(panel: Panel) -> set[str]:
    """The ids of the conditions that its widgets name."""
    locking = {
        name for widget in panel.widgets() if isinstance(widget, Command) for name in widget.interlocks
    }
    shown = (widget.named_conditions for widget in panel.widgets() if isinstance(widget, DisplayWidget))
    return locking.union(*shown)
