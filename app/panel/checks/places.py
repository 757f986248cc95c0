"""Checks of places, zones, and of inputs whose value is a place."""

from collections.abc import Iterator, Sequence

from app.panel.base import TopicQos
from app.panel.file.wording import no_such
from app.panel.model import Panel
from app.panel.places import MAX_ZONES, OnMapKeys, Place
from app.panel.robot_panels import widget_robots
from app.panel.template import input_ids
from app.panel.widgets.families import BaseWidget, Command, PressCommand
from app.panel.widgets.map_layers import level_key_faults
from app.panel.widgets.place import MapInput, PlaceInput
from app.panel.widgets.service_action import Action
from app.panel.widgets.tour import Tour
from app.system.errors import Fault
from app.system.texts.text import alike


def place_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of places and zones, and of maps, places and commands that do not belong together."""
    for p, place in enumerate(panel.places):
        first = next((n for n in range(p) if _is_same(panel, n, p)), None)
        if first is not None:
            message = f'"{place.label}" is already the label of place[{first}]'
            yield Fault(f"place[{p}].label", message)
    for z, zone in enumerate(panel.zones):
        if zone.yaw_fault:
            yield Fault(f"zone[{z}].yaw", zone.yaw_fault)
    yield from _level_faults(panel)
    yield from _zone_file_faults(panel)
    for p, page in enumerate(panel.pages):
        for place_of, widget in page.placed():
            yield from _widget_faults(f"page[{p}].{place_of}", widget, panel)
    for r, table in enumerate(panel.recipes):
        chosen = {widget.id for widget in panel.map_inputs}
        for f, name in enumerate(table.fields):
            if name in chosen:
                message = f'"{name}" is a place, of the moment: a recipe has other inputs'
                yield Fault(f"recipe[{r}].fields[{f}]", message)


def _level_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of levels that no map has, and of places that would be on any level."""
    known = {str(level.id): None for view in panel.map_views.values() for level in view.levels}
    tables: dict[str, Sequence[OnMapKeys]] = {
        "place": panel.places,
        "zone": panel.zones,
        "zone_file": panel.zone_files,
    }
    for name, rows in tables.items():
        for n, row in enumerate(rows):
            required = isinstance(row, Place) and row.map_version is None and _needs_level(row, panel)
            yield from level_key_faults(f"{name}[{n}]", row.level, tuple(known), required=required)


def _needs_level(place: Place, panel: Panel) -> bool:
    """Whether each map that is to offer the place has levels."""
    inputs = (each for each in panel.place_inputs if each.places is None)
    views = [view for each in inputs if (view := panel.map_views.get(each.map)) is not None]
    return bool(views) and all(view.levels for view in views)


def _offered_level_faults(place: str, widget: MapInput, panel: Panel) -> Iterator[Fault]:
    """Faults of places that the input offers, and whose level its map does not have."""
    if (view := panel.map_views.get(widget.map)) is None:
        return
    known = {str(each.id): each for each in panel.places}
    for n, name in enumerate(widget.places or ()):
        if name not in known or view.offers(known[name]):
            continue
        level = known[name].level
        message = f'"{name}" is on the level {level}, and the map {widget.map} has none of it'
        if level is None:
            message = f'"{name}" names no level, and the map {widget.map} has levels'
        yield Fault(f"{place}.places[{n}]", message, cause=f"level {name}")


def _zone_file_faults(panel: Panel) -> Iterator[Fault]:
    number = len(panel.zones)
    for z, read in enumerate(panel.zones_of_files):
        yield from (Fault(f"zone_file[{z}].file", message) for message in read.faults)
        number += len(read.zones)
        if number > MAX_ZONES:
            message = f"the panel has {number} zones with those of this file: {MAX_ZONES} at most"
            yield Fault(f"zone_file[{z}].file", message)
            return


def _is_same(panel: Panel, first: int, second: int) -> bool:
    """Whether an operator could not tell two places apart, which one robot may have."""
    above, below = panel.places[first], panel.places[second]
    robots = {above.robot, below.robot}
    shared = len(robots) == 1 or None in robots
    return above.id != below.id and shared and alike(above.label, below.label)


def _widget_faults(place: str, widget: BaseWidget, panel: Panel) -> Iterator[Fault]:
    if isinstance(widget, MapInput):
        yield from _input_faults(place, widget, panel)
        if isinstance(widget, Tour):
            yield from _tour_faults(place, widget, panel)
    elif isinstance(widget, Command) and not isinstance(widget, PressCommand):
        chosen = {each.id for each in panel.map_inputs}
        for name in input_ids(widget):
            if name in chosen:
                message = f'sends the place "{name}" again and again: only a press may send one'
                yield Fault(place, message, cause=f"input {name}")


def _input_faults(place: str, widget: MapInput, panel: Panel) -> Iterator[Fault]:
    if widget.map not in panel.map_views:
        message = no_such("map", widget.map, panel.map_views)
        if not panel.map_views:
            message = 'is the id of a map, and the panel has none: add a widget with kind = "map"'
        yield Fault(f"{place}.map", message, cause=f"map {widget.map}")
    robots = widget_robots(panel)
    own, other = robots.get(str(widget.id)), robots.get(widget.map)
    if widget.map in panel.map_views and own != other:
        message = f'is the map of "{other}"' if other else "is the map of each robot"
        message = f"{message}: an input and its map are of one robot"
        yield Fault(f"{place}.map", message, cause=f"robot {widget.map}")
    known = [str(each.id) for each in panel.places]
    for n, name in enumerate(widget.places or ()):
        if name not in known:
            yield Fault(f"{place}.places[{n}]", no_such("place", name, known), cause=f"place {name}")
    yield from _offered_level_faults(place, widget, panel)
    if not isinstance(widget, PlaceInput):
        return
    if widget.needs and not widget.save:
        yield Fault(f"{place}.needs", "is for saving places: add save = true", cause="save")
    if not known and not widget.touch and not widget.save:
        message = "has nothing to choose: write [[place]] tables, or touch = true or save = true"
        yield Fault(f"{place}.touch", message, cause="place")


def _tour_faults(place: str, widget: Tour, panel: Panel) -> Iterator[Fault]:
    """Faults of the actions whose goals a tour shows, and of commands that send one without places."""
    actions = {str(each.id): each for each in panel.commands if isinstance(each, Action)}
    sent_by = [each for each in actions.values() if widget.id in input_ids(each)]
    if widget.action is not None and widget.action not in actions:
        message = no_such("action", widget.action, actions)
        if not actions:
            message = 'is the id of an action, and the panel has none: add one with kind = "action"'
        yield Fault(f"{place}.action", message, cause=f"control {widget.action}")
    elif widget.action is None and not sent_by:
        message = "is missing: the id of the action whose goals it shows, or an action that sends"
        yield Fault(f"{place}.action", f'{message} "{{{widget.id}.poses}}"', cause="tour")
    if widget.places is None and any(widget.id in input_ids(each) for each in panel.commands):
        message = "is missing: the ids of the places that it sends, in their order"
        yield Fault(f"{place}.places", message, cause="tour")
    if widget.qos != TopicQos() and widget.topic is None:
        yield Fault(f"{place}.qos", "is of topic, which is missing")
