"""Checks of a panel file with valid keys and values: those of each widget, and ids, types and topics
across widgets."""

from collections.abc import Collection, Iterable, Iterator, Sequence

from app.errors import Fault, InterfaceError
from app.interfaces import Interfaces
from app.panel.checks.alarms import alarm_faults
from app.panel.checks.conditions import condition_faults_of, condition_id_faults
from app.panel.checks.languages import language_faults
from app.panel.checks.look import brand_faults, grow_faults, help_faults, label_faults
from app.panel.checks.names import spelling_faults
from app.panel.checks.needs import confirmation_faults, needs_faults
from app.panel.checks.page_templates import page_template_faults
from app.panel.checks.recipes import recipe_faults
from app.panel.checks.robots import (
    choice_faults,
    duplicate_ids,
    figure_faults,
    overview_faults,
    robot_faults,
    robot_name_faults,
)
from app.panel.checks.story import story_faults
from app.panel.checks.templates import NOW_RULE
from app.panel.checks.types import ROSOUT
from app.panel.condition import Condition
from app.panel.faults.wording import list_names
from app.panel.machine_state import STATE_ID
from app.panel.model import Panel
from app.panel.template import NOW
from app.panel.widgets.families import (
    BaseWidget,
    CheckContext,
    Command,
    DisplayWidget,
    EntryWidget,
    Input,
    TopicSource,
    TopicWidget,
)
from app.panel.widgets.inputs import TextInput
from app.panel.widgets.parameter import Parameter, type_faults
from app.panel.widgets.parts import parts_of
from app.panel.widgets.publish import Confirm, PublishPress
from app.panel.widgets.trend import MAX_BYTES, Trend, memory_of, trends_of


def find_faults(panel: Panel, interfaces: Interfaces, faulty: Collection[str] = ()) -> Iterator[Fault]:
    """All faults of names, types and templates; at most one for each message.

    `faulty` are the ids of widgets whose faults are reported already: checks that depend on them are
    skipped.
    """
    yield from _required_type_faults(panel, interfaces)
    yield from robot_faults(panel)
    yield from robot_name_faults(panel)
    yield from overview_faults(panel)
    yield from choice_faults(panel)
    if not panel.pages:
        yield Fault("page", "is missing: a panel has one page at least")
    yield from duplicate_ids("page", [page.id for page in panel.pages])
    ids, inputs = list(_id_faults(panel)), list(_input_faults(panel, interfaces))
    yield from (*ids, *inputs)
    reported = [fault.place for fault in (*ids, *inputs)]
    faulty = {*faulty, *_ids_at(panel, reported)}
    of_widgets = list(_widget_faults(panel, interfaces, faulty))
    with_faults = {*faulty, *_ids_at(panel, [fault.place for fault in of_widgets])}
    faults = [
        *condition_faults_of(panel, interfaces),
        *of_widgets,
        *alarm_faults(panel, interfaces, with_faults),
    ]
    missed = {fault.place.partition("[")[0] for fault in ids}
    missed |= {"input", "control"} if missed - {"interlock", "condition", "alarm", "recipe"} else set()
    faults = [fault for fault in faults if fault.cause.partition(" ")[0] not in missed]
    yield from faults
    yield from _topic_conflicts(panel, [fault.place for fault in faults])
    yield from type_faults((at, w) for at, w in _widgets_with_places(panel) if isinstance(w, Parameter))
    yield from spelling_faults(panel, _widgets_with_places(panel))
    yield from _record_faults(panel)
    yield from _trend_faults(panel)
    yield from page_template_faults(panel)
    yield from _scan_faults(panel)
    yield from grow_faults(panel)
    yield from label_faults(panel)
    yield from needs_faults(panel)
    yield from confirmation_faults(panel)
    yield from brand_faults(panel)
    yield from help_faults(panel)
    yield from language_faults(panel)
    if not (faults or ids or inputs or faulty):  # else they may be consequences
        yield from _demo_faults(panel, interfaces)


def _id_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of ids. Their items may be missing elsewhere under the correct id."""
    yield from duplicate_ids("interlock", [interlock.id for interlock in panel.interlocks])
    yield from condition_id_faults(panel)
    yield from duplicate_ids("alarm", [alarm.id for alarm in panel.alarms])
    yield from _duplicate_widget_ids(panel)
    for place, widget in _widgets_with_places(panel):
        if isinstance(widget, EntryWidget) and widget.id == NOW:
            yield Fault(f"{place}.id", f'"{NOW}" is reserved, as {NOW_RULE}: choose another id')


def _scan_faults(panel: Panel) -> Iterator[Fault]:
    """A bar code goes to one input of the page that is open."""
    for p, page in enumerate(panel.pages):
        asking = [(at, w) for at, w in page.placed() if isinstance(w, TextInput) and w.scan]
        for place, _ in asking[1:]:
            message = f'"{asking[0][1].id}" has it already: a bar code goes to one input of a page'
            yield Fault(f"page[{p}].{place}.scan", message)


def _ids_at(panel: Panel, places: Sequence[str]) -> Iterator[str]:
    """The ids of the widgets in which these places are."""
    yield from (w.id for place, w in _widgets_with_places(panel) if _contains_any(place, places))


def _contains_any(place: str, places: Iterable[str]) -> bool:
    """Whether `place` contains one of `places`."""
    return any(each.startswith(f"{place}.") for each in places)


def _widgets_with_places(panel: Panel) -> Iterator[tuple[str, BaseWidget]]:
    """(place, widget) of every widget."""
    for p, page in enumerate(panel.pages):
        yield from ((f"page[{p}].{place}", widget) for place, widget in page.placed())
    yield from ((f"frame.widget[{w}]", widget) for w, widget in enumerate(panel.frame.widgets))
    if panel.state:
        yield "state", panel.state.display
    yield from ((f"recipe[{r}]", load) for r, load in enumerate(panel.recipe_loads))


def _required_type_faults(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    """A fault for the first type that the server needs and can't use. A folder of interfaces may define
    such a type incorrectly."""
    of_kinds = (name for widget in panel.widgets() for name in widget.required_types)
    for name in dict.fromkeys((ROSOUT, *of_kinds)):
        try:
            interfaces.require(name)
        except InterfaceError as error:
            source = error.source
            folders = enumerate(panel.interfaces)
            at = next((i for i, folder in folders if source and source.is_relative_to(folder)), 0)
            yield Fault(f"interfaces[{at}]", f"the panel needs this type: {error}")
            return


def _check_context(
    panel: Panel,
    interfaces: Interfaces,
    widgets: Sequence[BaseWidget] = (),
    faulty: Collection[str] = (),
) -> CheckContext:
    """The context for the checks of a page's widgets."""
    return CheckContext(
        interfaces,
        inputs={w.id: w for w in widgets if isinstance(w, Input)},
        all_inputs=[w.id for w in panel.widgets() if isinstance(w, Input)],
        interlocks=[interlock.id for interlock in panel.interlocks],
        conditions={c.id: c.action is not None for c in panel.named_conditions},
        types=panel.subscriptions(),
        faulty=faulty,
        pages=[page.id for page in panel.pages],
        pictures=panel.shown_pictures,
        alarms={alarm.id: alarm.has_action for alarm in panel.alarms},
        alarm_groups=tuple(dict.fromkeys(str(a.group) for a in panel.alarms if a.group)),
    )


def _input_faults(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    checking = _check_context(panel, interfaces)
    for place, widget in _widgets_with_places(panel):
        if isinstance(widget, Input):
            yield from widget.faults(place, checking)


def _widget_faults(panel: Panel, interfaces: Interfaces, faulty: Collection[str]) -> Iterator[Fault]:
    for p, page in enumerate(panel.pages):
        checking = _check_context(panel, interfaces, page.widgets, faulty)
        for place, widget in page.placed():
            if not isinstance(widget, Input):
                yield from widget.faults(f"page[{p}].{place}", checking)
    checking = _check_context(panel, interfaces, (), faulty)
    yield from _frame_faults(panel, checking, faulty)
    yield from figure_faults(panel, checking)
    if panel.state:
        yield from panel.state.display.faults("state", checking)
    yield from recipe_faults(panel.recipes, panel.recipe_loads, checking)


def _frame_faults(panel: Panel, checking: CheckContext, faulty: Collection[str]) -> Iterator[Fault]:
    for w, widget in enumerate(panel.frame.widgets):
        place = f"frame.widget[{w}]"
        if widget.allowed_in_frame:
            yield from widget.faults(place, checking)
        elif widget.id not in faulty:
            message = (
                f'"{widget.kind}" is not for the frame: it has keys of the kinds publish, call and hold'
            )
            yield Fault(f"{place}.kind", message)


def _trend_faults(panel: Panel) -> Iterator[Fault]:
    """The histories of all trends have a limit together."""
    size = memory_of(trends_of(panel), len(panel.robots) or 1)
    for place, widget in _widgets_with_places(panel):
        if isinstance(widget, Trend) and size > MAX_BYTES:
            message = f"all trends together would take {size / 1e6:.0f} MB of memory"
            yield Fault(f"{place}.keep", f"{message}, and may take {MAX_BYTES / 1e6:.0f}: keep less")
            return


def _record_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of recorded topics that the panel does not subscribe to."""
    known = panel.subscriptions()
    for t, topic in enumerate((panel.record and panel.record.topics) or ()):
        if topic not in known:
            message = f"{topic} is no topic that this panel listens to; there is {list_names(known)}"
            yield Fault(f"record.topics[{t}]", message, cause=f"listens {topic}")


def _demo_faults(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    """Imported only where a panel has the table, for a faster start."""
    yield from story_faults(panel)
    if panel.demo:
        from app.panel.checks.demo import demo_faults

        yield from demo_faults(panel, interfaces)


def _duplicate_widget_ids(panel: Panel) -> Iterator[Fault]:
    places = {STATE_ID: "[state]"} if panel.state else {}
    ids = [page.id for page in panel.pages]
    for p, page in enumerate(panel.pages):
        for at, widget in page.placed():
            place = f"page[{p}].{at}"
            if place in panel.copies:
                continue
            if widget.id in places and page.id not in ids[:p]:  # not in a page with a duplicate id
                yield Fault(f"{place}.id", f'"{widget.id}" is already the id of {places[widget.id]}')
            places.setdefault(widget.id, place)
    for w, widget in enumerate(panel.frame.widgets):
        if widget.id in places:
            already = f'"{widget.id}" is already the id of {places[widget.id]}'
            yield Fault(f"frame.widget[{w}].id", already)
        places.setdefault(widget.id, f"frame.widget[{w}]")
    for r, recipes in enumerate(panel.recipes):
        if recipes.id in places:
            message = f'"{recipes.id}" is already the id of {places[recipes.id]}'
            yield Fault(f"recipe[{r}].id", message)
        places.setdefault(recipes.id, f"recipe[{r}]")


def _topic_conflicts(panel: Panel, reported: Sequence[str]) -> Iterator[Fault]:
    """Faults of topics with several types or QoS in the panel. Places that are `reported` already are
    skipped: their type may be the mistake."""
    places: list[tuple[str, Condition | TopicWidget | TopicSource | Confirm]] = []
    confirms: list[tuple[str, Confirm]] = []
    places += [(f"interlock[{i}]", interlock) for i, interlock in enumerate(panel.interlocks)]
    places += [(f"condition[{c}]", condition) for c, condition in enumerate(panel.own_conditions)]
    for i, alarm in enumerate(panel.alarms):
        places.extend((f"alarm[{i}]", source) for source in alarm.sources())
        conditions = {"when": alarm.when, "while": alarm.suppressed_while}
        places.extend((f"alarm[{i}].{key}", part) for key, part in conditions.items() if part)
    for place, widget in _widgets_with_places(panel):
        if isinstance(widget, DisplayWidget | Command):
            at = ((f"{place}.{source.place}".rstrip("."), source) for source in widget.sources())
            places.extend(at)
        for part in parts_of(widget)[:1] if isinstance(widget, Command) else ():
            places += [(place, part)] if isinstance(part, TopicWidget) else []
        if isinstance(widget, PublishPress) and widget.confirm and widget.confirm.type:
            confirms.append((f"{place}.confirm", widget.confirm))
    firsts: dict[str, tuple[str, Condition | TopicWidget | TopicSource | Confirm]] = {}
    for place, topic_user in (*places, *confirms):
        above, first = firsts.setdefault(topic_user.topic, (place, topic_user))
        if topic_user.type != first.type:
            if not _contains_any(place, reported) and not _contains_any(above, reported):
                message = f"{topic_user.topic} is {topic_user.type} here but {first.type} above"
                yield Fault(f"{place}.type", message, cause=f"topic {topic_user.topic}")
            continue
        if isinstance(topic_user, Confirm) or isinstance(first, Confirm):
            continue  # it has no QoS of its own
        if (topic_user.qos.wire_qos, topic_user.qos.durability) != (
            first.qos.wire_qos,
            first.qos.durability,
        ):
            message = f"{topic_user.topic} has another QoS at {above}: a topic has one"
            yield Fault(f"{place}.qos", message, cause=f"topic {topic_user.topic}")
