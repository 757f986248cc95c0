"""A panel: its keys, and what follows from them."""

from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from app.panel.alarm import Alarm, inhibited_name
from app.panel.base import FileContext, TopicQos
from app.panel.condition import Condition, Interlock, NamedCondition
from app.panel.keys import SUMS, PanelKeys
from app.panel.keys import RobotEntry as RobotEntry
from app.panel.layout import FRAMES, Page
from app.panel.needs import PanelNeeds, needs_of
from app.panel.template import uses_now
from app.panel.texts import panel_texts
from app.panel.widgets.displays import LogView
from app.panel.widgets.families import (
    BaseWidget,
    Command,
    DisplayWidget,
    PublishCommand,
    TopicSource,
    TopicWidget,
)
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.map_layers import GRID_TYPE, updates_of
from app.panel.widgets.map_view import MapView
from app.panel.widgets.parameter import (
    EVENT_TYPE,
    EVENTS,
    EVENTS_QOS,
    SERVICES,
    SET_ATOMICALLY,
    Parameter,
    listed_parameter,
)
from app.panel.widgets.parts import parts_of
from app.panel.widgets.place import MapInput, PlaceInput
from app.panel.widgets.publish import Confirm, PublishPress
from app.panel.widgets.recipe_load import RecipeLoad, loads_of
from app.panel.widgets.robot_options import ListingService
from app.panel.widgets.service_action import Action, Call
from app.panel.widgets.switch import confirms_of
from app.panel.widgets.templated import is_stop
from app.panel.widgets.tour import PATH_TYPE, Tour
from app.system.errors import NotFound
from app.system.pictures import picture_files, shipped_pictures
from app.system.texts import PanelText, TextLike
from app.system.texts.catalogue import files

if TYPE_CHECKING:
    from app.panel.geojson import FileZones

# Buttons that are judged as one.

UniformButtons = dict[tuple[tuple[str, ...], bool], tuple[PublishPress, ...]]


def uniform_buttons(commands: Iterable[Command], alarms: Iterable[Alarm]) -> UniformButtons:
    """Buttons that publish, that no alarm locks and that no person confirms, by their interlocks and
    whether they stop: many are judged as one, as these and the graph decide their lock, which is all
    that is shown."""
    inhibited = {inhibited_name(name).control for alarm in alarms for name in alarm.inhibits}
    groups: UniformButtons = {}
    for widget in commands:
        if not isinstance(widget, PublishPress) or widget.shows_more:
            continue
        if any(map(uses_now, widget.templates())):  # a simulated time that is not known locks them
            continue
        if widget.id not in inhibited and not widget.confirmation:
            key = widget.interlocks, widget.role == "stop"
            groups[key] = (*groups.get(key, ()), widget)
    return groups


Kind = TypeVar("Kind", bound=BaseWidget)


class Panel(PanelKeys):
    @cached_property
    def readers_languages(self) -> tuple[str, ...]:
        """The languages that a reader can choose: the file's; else those with a catalogue or texts."""
        if self.languages:
            return self.languages
        texts = [set(text.texts) for _, text in self.written_texts]
        known = set(files()) & set().union(*texts) if texts else set(files())
        return tuple(tag for tag in files() if tag in known or tag == self.language)

    @cached_property
    def written_texts(self) -> tuple[tuple[str, PanelText], ...]:
        """(place in the panel file, text) of every text in several languages."""
        return tuple(panel_texts(self))

    @cached_property
    def picture_files(self) -> dict[str, Path]:
        """The files of the folder of pictures by their names."""
        return picture_files(self.pictures) if self.pictures else {}

    @cached_property
    def shown_pictures(self) -> dict[str, Path]:
        """The pictures that it may show, by their names: its own and the shipped ones."""
        return self.picture_files | {
            name: file for name, file in shipped_pictures().items() if name not in self.picture_files
        }

    @property
    def font_files(self) -> tuple[Path, ...]:
        """The files of its fonts, each once."""
        return tuple(dict.fromkeys(file for font in self.fonts for file in font.files.values()))

    @cached_property
    def styles(self) -> tuple[Path, ...]:
        """The stylesheets of its pages, each once."""
        return tuple(dict.fromkeys(page.styles for page in self.pages if page.styles))

    @cached_property
    def templates(self) -> tuple[Path, ...]:
        """The templates of its pages, each once."""
        return tuple(dict.fromkeys(page.template for page in self.pages if page.template))

    @property
    def frame_widgets(self) -> tuple[BaseWidget, ...]:
        """What every page shows: the keys of the frame and the machine's state."""
        return (*self.frame.widgets, *([self.state.display] if self.state else []))

    def widgets(self) -> Iterator[BaseWidget]:
        """Each once."""
        for p, page in enumerate(self.pages):
            if not self.copies:
                yield from page.widgets
                continue
            placed = ((f"page[{p}].{place}", widget) for place, widget in page.placed())
            yield from (widget for place, widget in placed if place not in self.copies)
        yield from self.frame_widgets
        yield from self.recipe_loads
        yield from (robot.figure for robot in self.robots if robot.figure)

    @property
    def robot_names(self) -> dict[str, TextLike]:
        """The names of its robots by their ids, in the order of the file; {} without `[[robot]]`."""
        return {str(robot.id): robot.name for robot in self.robots}

    @property
    def site_cell(self) -> str:
        """The cell's name in its site."""
        return (self.site and self.site.cell) or str(self.title)

    @cached_property
    def recipe_loads(self) -> tuple[RecipeLoad, ...]:
        """The commands that load a recipe, of each set; they are on the page of recipes."""
        return loads_of(self.recipes, (widget for page in self.pages for widget in page.widgets))

    def senders(self) -> Iterator[Command]:
        """The commands that send something: its parts in its place."""
        return (part for command in self.commands for part in parts_of(command))

    def widget(self, widget_id: str, kind: type[Kind]) -> Kind:
        """The widget of a kind with this id; NotFound for every other id."""
        for widget in self.widgets():
            if widget.id == widget_id and isinstance(widget, kind):
                return widget
        raise NotFound(f'there is no widget "{widget_id:.64}" of the kind {kind.__name__}')

    @cached_property
    def widgets_by_page(self) -> dict[str, frozenset[str]]:
        """The ids of the widgets that each page shows, those of the frame too, by the page's id."""
        frame = {widget.id for widget in self.frame_widgets}
        tiles = {SUMS, *(robot.tile_id for robot in self.robots)}
        pages = {
            page.id: frozenset(
                frame | {w.id for w in page.widgets} | (tiles if page.overview else set())
            )
            for page in self.pages
        }
        own = frozenset(frame) | {load.id for load in self.recipe_loads}
        return pages | dict.fromkeys(FRAMES, own)

    @property
    def has_alarms(self) -> bool:
        """Whether its pages always have the line of alarms, and a tab for their list."""
        return bool(self.alarms)

    @property
    def may_raise(self) -> bool:
        """Whether there may be alarms, if only those of the panel itself."""
        return self.has_alarms or self.alarm_rules.panel

    @property
    def has_rail(self) -> bool:
        """Whether tabs or buttons of the frame stand at the side of its pages."""
        return len(self.pages) > 1 or bool(self.frame.widgets or self.recipes)

    @cached_property
    def commands(self) -> tuple[Command, ...]:  # the widgets that can be pressed or held
        return tuple(w for w in self.widgets() if isinstance(w, Command))

    @cached_property
    def stops(self) -> tuple[Command, ...]:  # those that stop the machine
        return tuple(widget for widget in self.commands if is_stop(widget))

    @cached_property
    def needs(self) -> PanelNeeds:
        """The roles and groups that its pages, commands and alarms need."""
        return needs_of(self.pages, self.frame_widgets, self.commands, self.alarms)

    @cached_property
    def uniform_buttons(self) -> UniformButtons:
        """Buttons that are judged as one."""
        return uniform_buttons(self.commands, self.alarms)

    @cached_property
    def displays(self) -> tuple[DisplayWidget, ...]:
        """The widgets that show topics."""
        return tuple(w for w in self.widgets() if isinstance(w, DisplayWidget))

    def page(self, page_id: str) -> Page | None:
        return next((page for page in self.pages if page.id == page_id), None)

    def interlock(self, interlock_id: str) -> Interlock | None:
        return next((i for i in self.interlocks if i.id == interlock_id), None)

    @property
    def every_interlock(self) -> tuple[Interlock, ...]:
        """Those of other robots too, in the panel of one robot."""
        return (*self.interlocks, *(c for c in self.of_others if isinstance(c, Interlock)))

    @property
    def named_conditions(self) -> tuple[NamedCondition, ...]:
        """Those with an id, interlocks first."""
        return (*self.interlocks, *self.own_conditions)

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """All that are judged: each message counts, and a value of unknown age is known to be one."""
        return (*self.named_conditions, *(c for alarm in self.alarms for c in alarm.conditions))

    def interlocks_of(self, widget: Command) -> tuple[Interlock, ...]:
        """The interlocks that must permit a press, in the widget's order."""
        known = {interlock.id: interlock for interlock in self.every_interlock}
        return tuple(known[name] for name in widget.interlocks)

    def subscriptions(self) -> dict[str, str]:
        """Topic → type of all subscriptions."""
        own = {confirm.topic: confirm.type for confirm in self.confirmations() if confirm.type}
        events = {EVENTS: EVENT_TYPE} if any(self.parameters()) else {}
        shown = {source.topic: source.type for source in self.monitored if not source.on_demand}
        return own | shown | events

    def on_demand(self) -> dict[str, str]:
        """Topic → type of all topics that are subscribed to only while a browser shows them."""
        return {source.topic: source.type for source in self.monitored if source.on_demand}

    def listened(self) -> dict[str, str]:
        """Topic → type of all subscriptions, also of those that are there only at times."""
        return self.subscriptions() | self.on_demand()

    def subscribed_fields(self) -> dict[str, list[str]]:
        """Topic → paths of the fields that the panel reads."""
        paths: dict[str, list[str]] = {}
        for source in self.monitored:
            if not source.on_demand:
                paths.setdefault(source.topic, []).extend(source.fields)
        for confirm in self.confirmations():
            paths.setdefault(confirm.topic, []).append(confirm.field)
        return paths

    def confirmations(self) -> Iterator[Confirm]:
        """The topics that confirm commands."""
        return (confirm for command in self.commands for confirm in confirms_of(command))

    @cached_property
    def monitored(self) -> tuple[TopicSource, ...]:
        """What conditions, alarms and displays listen to, each once."""
        judged = (TopicSource(c.topic, c.type, c.qos, (c.field,)) for c in self.conditions)
        alarmed = (source for alarm in self.alarms for source in alarm.sources())
        shown = (source for widget in self.displays for source in widget.sources())
        pressed = (source for command in self.commands for source in command.sources())
        counted = self.oee.sources() if self.oee else ()
        return tuple(dict.fromkeys((*judged, *alarmed, *shown, *pressed, *counted)))

    def actions(self) -> dict[str, str]:
        """Action → type of all actions that the panel may send goals to."""
        return {w.action: w.type for w in self.widgets() if isinstance(w, Action)}

    @cached_property
    def listed_selects(self) -> tuple[SelectInput, ...]:
        """The selects whose options the robot lists."""
        selects = (w for w in self.widgets() if isinstance(w, SelectInput))
        return tuple(select for select in selects if select.options_from is not None)

    def option_services(self) -> dict[ListingService, float]:
        """The services that list options of selects, and every how many seconds each is called."""
        services: dict[ListingService, float] = {}
        for source in (select.options_from for select in self.listed_selects):
            if source is not None and (service := source.listing) is not None:
                services[service] = min(source.every_s, services.get(service, source.every_s))
        return services

    def called_services(self) -> dict[str, str]:
        """Service → type of all services that the panel calls by itself or at a press."""
        listing = {service.name: service.type for service in self.option_services()}
        return listing | {w.service: w.type for w in self.senders() if isinstance(w, Call)}

    def services(self) -> dict[str, str]:
        """Service → type of all services that the panel calls, with those of parameters. What a
        session, its node and a robot's configuration declare is made from this list."""
        nodes = dict.fromkeys(widget.node for widget in self.parameters())
        of_nodes = {f"{node}/{name}": kind for node in nodes for name, kind in SERVICES}
        name, kind = SET_ATOMICALLY
        of_loads = {f"{load.set.node}/{name}": kind for load in self.recipe_loads if load.parameters}
        return self.called_services() | of_nodes | of_loads

    def parameters(self) -> Iterator[Parameter]:
        yield from (w for w in self.widgets() if isinstance(w, Parameter))
        yield from (parameter for load in self.recipe_loads for parameter in load.reads)
        yield from filter(None, map(listed_parameter, self.listed_selects))

    def logs(self) -> dict[str, int]:
        """Topic → number of lines to keep, of all logs that the panel shows."""
        kept: dict[str, int] = {}
        for w in (w for w in self.widgets() if isinstance(w, LogView)):
            kept[w.topic] = max(w.keep, kept.get(w.topic, 0))
        return kept

    @property
    def maps(self) -> tuple[str, ...]:
        """The topics of the maps that the panel shows, and of costmaps over them."""
        grids = (topic for view in self.map_views.values() for topic in view.grids)
        return tuple(dict.fromkeys(grids))

    @property
    def map_updates(self) -> tuple[str, ...]:
        """The topics of the updates of `maps`."""
        return tuple(updates_of(topic).topic for topic in self.maps)

    @cached_property
    def map_views(self) -> dict[str, MapView]:
        """The maps by their ids."""
        return {str(w.id): w for w in self.widgets() if isinstance(w, MapView)}

    @cached_property
    def zones_of_files(self) -> "tuple[FileZones, ...]":
        """The zones of each GeoJSON file of zones."""
        if not self.zone_files:
            return ()
        from app.panel.geojson import read_zones

        read = []
        for table in self.zone_files:
            context = FileContext(table.file.parent, self.language)
            beside = table.model_dump(include={"level", "map_version", "robot"})
            read.append(read_zones(table.file, context, beside))
        return tuple(read)

    @cached_property
    def geojson_files(self) -> tuple[Path, ...]:
        """The files of zones and route graphs, each once."""
        graphs = (view.routes.file for view in self.map_views.values() if view.routes)
        return tuple(dict.fromkeys((*(table.file for table in self.zone_files), *graphs)))

    @property
    def map_shapes(self) -> dict[str, str]:
        """Topic → type of the layers of maps that are shapes, not grids."""
        layers = (layer for view in self.map_views.values() for layer in view.layers)
        tours = {tour.topic: PATH_TYPE for tour in self.tours if tour.topic is not None}
        return {layer.topic: layer.type for layer in layers if layer.type != GRID_TYPE} | tours

    @cached_property
    def map_inputs(self) -> tuple[MapInput, ...]:
        """The inputs whose value is a place or several."""
        return tuple(w for w in self.widgets() if isinstance(w, MapInput))

    @cached_property
    def place_inputs(self) -> tuple[PlaceInput, ...]:
        """Of these, those whose value is a place."""
        return tuple(w for w in self.map_inputs if isinstance(w, PlaceInput))

    @cached_property
    def tours(self) -> tuple[Tour, ...]:
        """Of these, those whose value is several places."""
        return tuple(w for w in self.map_inputs if isinstance(w, Tour))

    def publications(self) -> dict[str, str]:
        """Topic → type of all topics that the panel publishes."""
        return {w.topic: w.type for w in self.senders() if isinstance(w, PublishCommand)}

    @cached_property
    def adaptive_topics(self) -> frozenset[str]:
        """Topics that are only shown, and whose reliability is their publisher's."""
        needed = [source for command in self.commands for source in command.sources()]
        explicit = [source for source in self.monitored if source.qos.reliability is not None]
        strict = {source.topic for source in (*needed, *explicit)} | {c.topic for c in self.conditions}
        return frozenset(source.topic for source in self.monitored) - strict

    def qos(self, topic: str) -> TopicQos:
        """A topic's QoS, the same in all places of the panel file."""
        heard = (source.qos for source in self.monitored if source.topic == topic)
        sent = (w.qos for w in self.senders() if isinstance(w, TopicWidget) and w.topic == topic)
        return (*heard, *sent, EVENTS_QOS if topic == EVENTS else TopicQos())[0]
