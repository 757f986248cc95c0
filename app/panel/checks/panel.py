"""Checks of a panel file with valid keys and values: those of each widget, and ids, types and topics
across widgets."""

import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

from app.panel.checks.alarms import alarm_faults, oee_faults, stop_faults
from app.panel.checks.conditions import condition_faults_of, condition_id_faults
from app.panel.checks.look import (
    brand_faults,
    grow_faults,
    help_faults,
    label_faults,
    page_template_faults,
)
from app.panel.checks.memory import NO_MEMORY, CheckMemory
from app.panel.checks.places import place_faults
from app.panel.checks.recipes import recipe_faults
from app.panel.checks.robot_texts import robot_text_faults
from app.panel.checks.robots import (
    choice_faults,
    duplicate_ids,
    figure_faults,
    map_faults,
    overview_faults,
    robot_faults,
    robot_name_faults,
)
from app.panel.checks.templates import NOW_RULE
from app.panel.checks.types import ROSOUT
from app.panel.condition import Condition
from app.panel.demo import STORIES
from app.panel.file.wording import closest_name, known_hint, list_names
from app.panel.layout import Page
from app.panel.model import Panel
from app.panel.roles import ROLES
from app.panel.rules import CHUNK, STATE_ID
from app.panel.template import NOW
from app.panel.used import used_names
from app.panel.widgets.displays import Readout
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
from app.panel.widgets.hold import Joystick
from app.panel.widgets.inputs import TextInput
from app.panel.widgets.key_parts import confirmation_of
from app.panel.widgets.parameter import Parameter, type_faults
from app.panel.widgets.parts import parts_of
from app.panel.widgets.place import PlaceInput
from app.panel.widgets.publish import Confirm, PublishPress
from app.panel.widgets.templated import is_stop
from app.panel.widgets.trend import MAX_BYTES, Trend, memory_of, trends_of
from app.ros.messages import Interfaces
from app.ros.messages.names import GLOBAL, key_of
from app.system.errors import Fault, InterfaceError, Note
from app.system.texts.catalogue import files

# Faults of names that are written in two ways.

NAME_KEYS = ("topic", "service", "action", "node")


def spelling_faults(panel: Panel, widgets: Iterator[tuple[str, BaseWidget]]) -> Iterator[Fault]:
    """Faults of names that are below the namespace and written as if they were not, beside the other
    way: what the panel knows of a topic, it knows by one name."""
    names = [(f"interlock[{i}].topic", interlock.topic) for i, interlock in enumerate(panel.interlocks)]
    for c, condition in enumerate(panel.own_conditions):
        names.append((f"condition[{c}].topic", condition.topic))
    for i, alarm in enumerate(panel.alarms):
        named = (("topic", alarm.topic), ("node", alarm.node))
        names += [(f"alarm[{i}].{key}", name) for key, name in named if name]
    for n, counter in enumerate(panel.oee.counters if panel.oee else ()):
        names.append((f"oee.counter[{n}].topic", counter.topic))
    for place, widget in widgets:
        names += _names(place, widget)
    if not any(name.startswith(GLOBAL) for _, name in names):
        return
    for namespace in {robot.namespace for robot in panel.robots} or {panel.namespace}:
        firsts: dict[str, tuple[str, str]] = {}
        for place, name in names:
            above, first = firsts.setdefault(key_of(name, namespace), (place, name))
            if name != first:
                yield Fault(place, f'"{name}" is "{first}" at {above}: write it in the same way')


def _names(place: str, widget: BaseWidget) -> Iterator[tuple[str, str]]:
    """(place, name) of each topic, service, action and node of a widget."""
    for key in NAME_KEYS:
        if isinstance(name := getattr(widget, key, None), str):
            yield f"{place}.{key}", name
    if isinstance(widget, DisplayWidget | Command):
        for source in widget.sources():
            if source.place:
                yield f"{place}.{source.place}.topic", source.topic
    if isinstance(widget, PublishPress) and widget.confirm is not None:
        yield f"{place}.confirm.topic", widget.confirm.topic


# Checks of the roles and groups of users that a panel file names.


def needs_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of `needs` that name neither a role nor a group of `[access]`."""
    known = [*ROLES, *panel.access.groups]
    for place, need in _needs(panel):
        if need and need not in known:
            meant = closest_name(need.lower(), known)
            hint = f'; did you mean "{meant}"?' if meant else ""
            message = f'"{need}" is neither a role nor a group: there is {list_names(known)}{hint}'
            own = ', and groups of your own by `groups = ["…"]` in [access]' if not meant else ""
            yield Fault(f"{place}.needs", message + own, cause=f"needs {need}")


def confirmation_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of stop buttons that ask for a PIN."""
    for place, widget in _commands(panel):
        if is_stop(widget) and confirmation_of(widget):
            message = "is not for a stop button: whoever stands at the screen can stop"
            yield Fault(f"{place}.confirm_press", message)


def _commands(panel: Panel) -> Iterator[tuple[str, Command]]:
    """(place, command) of each command on a page and in the frame, once."""
    for p, page in enumerate(panel.pages):
        for place, widget in page.placed():
            at = f"page[{p}].{place}"
            if isinstance(widget, Command) and at not in panel.copies:
                yield at, widget
    for w, widget in enumerate(panel.frame.widgets):
        if isinstance(widget, Command):
            yield f"frame.widget[{w}]", widget


def _needs(panel: Panel) -> Iterator[tuple[str, str | None]]:
    """(place, what it needs) of all that may say so."""
    for p, page in enumerate(panel.pages):
        yield f"page[{p}]", page.needs
        for g, group in enumerate(page.groups):
            yield f"page[{p}].group[{g}]", group.needs
    for place, widget in _commands(panel):
        yield place, widget.needs
    for p, page in enumerate(panel.pages):
        placed = ((place, w) for place, w in page.placed() if isinstance(w, PlaceInput))
        yield from ((f"page[{p}].{place}", w.needs) for place, w in placed)
    for a, alarm in enumerate(panel.alarms):
        yield f"alarm[{a}]", alarm.needs
    if panel.oee:
        yield "oee", panel.oee.needs


# Checks of `demo_story`: names with other types than the story plays, or none that the panel uses.


def story_faults(panel: Panel) -> Iterator[Fault]:
    """The faults of a story. By their cause they are consequences of faults of subscriptions."""
    if panel.demo_story is None:
        return
    names = used_names(panel)
    played = list(STORIES[panel.demo_story].types)
    used = False
    for use, name, wanted in played:
        panel_type = names[use].get(name)
        if panel_type is None or name in panel.demo:
            continue
        used = True
        if panel_type != wanted:
            message = (
                f"plays {name} as {wanted}, and the panel has {panel_type}; rename it or use that type"
            )
            yield Fault("demo_story", message, cause=f"listens {name}")
    if not used:
        some = list_names(sorted(name for _, name, _ in played))
        yield Fault("demo_story", f"the panel uses no name of the story; there is {some}")


# Checks of texts in several languages: each language has a catalogue, each text each language.


def language_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of languages that no reader can choose, and of texts that the panel's own lacks."""
    if panel.languages and panel.language not in panel.languages:
        message = f'lacks the panel\'s own language, "{panel.language}"'
        yield Fault("languages", message, cause="language")
    for place, text in panel.written_texts:
        for tag in text.texts:
            if tag not in files():
                message = f"is no language with a catalogue; there is {list_names(files())}"
                yield Fault(f"{place}.{tag}", message)
        if panel.language not in text.texts:
            message = f'has no text in the panel\'s language: add {panel.language} = "…"'
            yield Fault(place, f"{message}, or set `language` of the panel to another one")


def untranslated_notes(panel: Panel) -> Iterator[Note]:
    """Texts that lack a language that other texts of the panel have. A text that is no table is meant
    to be the same in every language."""
    texts = panel.written_texts
    known = {tag for _, text in texts for tag in text.texts}
    wanted = sorted(known & set(panel.languages) if panel.languages else known)
    for place, text in texts:
        if missing := [tag for tag in wanted if tag not in text.texts]:
            named = " and no ".join(missing)
            yield Note(place, f'has no {named}; it is shown in "{panel.language}"')


def find_faults(
    panel: Panel,
    interfaces: Interfaces,
    faulty: Collection[str] = (),
    memory: CheckMemory = NO_MEMORY,
) -> Iterator[Fault]:
    """All faults of names, types and templates; at most one for each message.

    `faulty` are the ids of widgets whose faults are reported already: checks that depend on them are
    skipped.
    """
    yield from _required_type_faults(panel, interfaces)
    yield from robot_faults(panel)
    yield from robot_name_faults(panel)
    yield from overview_faults(panel)
    yield from choice_faults(panel)
    yield from map_faults(panel)
    yield from robot_text_faults(panel)
    if not panel.pages:
        yield Fault("page", "is missing: a panel has one page at least")
    yield from duplicate_ids("page", [page.id for page in panel.pages])
    checking = _check_context(panel, interfaces)
    ids, inputs = list(_id_faults(panel)), list(_input_faults(panel, checking))
    yield from (*ids, *inputs)
    reported = [fault.place for fault in (*ids, *inputs)]
    faulty = {*faulty, *_ids_at(panel, reported)}
    of_widgets = list(_widget_faults(panel, replace(checking, faulty=faulty), memory))
    with_faults = {*faulty, *_ids_at(panel, [fault.place for fault in of_widgets])}
    faults = [
        *condition_faults_of(panel, interfaces),
        *of_widgets,
        *alarm_faults(panel, interfaces, with_faults),
        *stop_faults(panel),
        *_site_faults(panel, faulty),
        *oee_faults(panel, interfaces),
    ]
    missed = {fault.place.partition("[")[0] for fault in ids}
    missed |= (
        {"input", "control"}
        if missed - {"interlock", "condition", "alarm", "recipe", "place", "zone"}
        else set()
    )
    faults = [fault for fault in faults if fault.cause.partition(" ")[0] not in missed]
    yield from faults
    yield from _topic_conflicts(panel, [fault.place for fault in faults])
    yield from type_faults((at, w) for at, w in _widgets_with_places(panel) if isinstance(w, Parameter))
    yield from spelling_faults(panel, _widgets_with_places(panel))
    yield from _record_faults(panel)
    yield from _trend_faults(panel)
    yield from page_template_faults(panel)
    yield from _page_faults(panel)
    yield from (fault for fault in place_faults(panel) if fault.cause.partition(" ")[0] not in missed)
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
    yield from duplicate_ids("place", [place.id for place in panel.places])
    yield from duplicate_ids("zone", [zone.id for zone in panel.zones])
    yield from _duplicate_widget_ids(panel)
    for place, widget in _widgets_with_places(panel):
        if isinstance(widget, EntryWidget) and widget.id == NOW:
            yield Fault(f"{place}.id", f'"{NOW}" is reserved, as {NOW_RULE}: choose another id')


def _page_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of devices that one widget of the open page has: a bar code reader, a gamepad's stick."""
    for p, page in enumerate(panel.pages):
        firsts: dict[str, str] = {}
        for place, widget in page.placed():
            if (taken := _taken(widget)) is None:
                continue
            key, device, rule = taken
            first = firsts.setdefault(device, widget.id)
            if first != widget.id:
                message = f'"{first}" has it already: {rule} of a page'
                yield Fault(f"page[{p}].{place}.{key}", message)


def _taken(widget: BaseWidget) -> tuple[str, str, str] | None:
    """(key, the device that it takes, the rule) of a widget that takes one."""
    if isinstance(widget, TextInput) and widget.scan:
        return "scan", "reader", "a bar code goes to one input"
    if isinstance(widget, Joystick) and widget.gamepad:
        return "gamepad", widget.gamepad, f"the {widget.gamepad} stick moves one joystick"
    return None


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


def _check_context(panel: Panel, interfaces: Interfaces) -> CheckContext:
    """The context for the checks of widgets that are on no page."""
    return CheckContext(
        interfaces,
        inputs={},
        all_inputs=[w.id for w in panel.widgets() if isinstance(w, Input)],
        interlocks=[interlock.id for interlock in panel.interlocks],
        conditions={c.id: c.action is not None for c in panel.named_conditions},
        types=panel.subscriptions(),
        pages=[page.id for page in panel.pages],
        pictures=panel.shown_pictures,
        alarms={alarm.id: alarm.has_action for alarm in panel.alarms},
        alarm_groups=tuple(dict.fromkeys(str(a.group) for a in panel.alarms if a.group)),
    )


def _input_faults(panel: Panel, checking: CheckContext) -> Iterator[Fault]:
    for place, widget in _widgets_with_places(panel):
        if isinstance(widget, Input):
            yield from widget.faults(place, checking)


def _widget_faults(panel: Panel, checking: CheckContext, memory: CheckMemory) -> Iterator[Fault]:
    for p, page in enumerate(panel.pages):
        inputs = {widget.id: widget for widget in page.widgets if isinstance(widget, Input)}
        on_page = replace(checking, inputs=inputs)
        faults = partial(_faults_on_page, f"page[{p}]", page, on_page)
        yield from memory.results("widgets", p, page, (on_page,), faults)
    yield from _frame_faults(panel, checking)
    yield from figure_faults(panel, checking)
    if panel.state:
        yield from panel.state.display.faults("state", checking)
    yield from recipe_faults(panel.recipes, panel.recipe_loads, checking)


def _faults_on_page(at: str, page: Page, checking: CheckContext) -> Iterator[Fault]:
    for place, widget in page.placed():
        if not isinstance(widget, Input):
            yield from widget.faults(f"{at}.{place}", checking)


def _frame_faults(panel: Panel, checking: CheckContext) -> Iterator[Fault]:
    for w, widget in enumerate(panel.frame.widgets):
        place = f"frame.widget[{w}]"
        if widget.allowed_in_frame:
            yield from widget.faults(place, checking)
        elif widget.id not in checking.faulty:
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
            hint = known_hint(topic, known)
            message = f"{topic} is no topic that this panel listens to; {hint}"
            yield Fault(f"record.topics[{t}]", message, cause=f"listens {topic}")


def _site_faults(panel: Panel, faulty: Collection[str]) -> Iterator[Fault]:
    """Faults of what the cell tells of itself: its name, and figures that are no readouts."""
    if panel.site is None:
        return
    if not re.fullmatch(CHUNK, panel.site_cell):
        yield Fault(
            "site.cell",
            f'is missing: the title "{panel.site_cell}" has spaces at its ends, over 64 characters or'
            " one of / * $ ? # @, and can't be the cell's name in Zenoh",
        )
    readouts = [widget.id for widget in panel.widgets() if isinstance(widget, Readout)]
    for f, figure in enumerate(panel.site.figures):
        if figure not in readouts and figure not in faulty:
            hint = known_hint(figure, readouts)
            message = f'"{figure}" is no readout of this panel; {hint}'
            yield Fault(f"site.figures[{f}]", message, cause=f"input {figure}")


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
    counters = panel.oee.sources() if panel.oee else ()
    places += [(f"oee.{source.place}", source) for source in counters]
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
