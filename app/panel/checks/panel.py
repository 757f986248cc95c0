"""What can be wrong in a panel file whose shape is right: what each widget checks itself, and names,
types and topics across widgets."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import islice

from app.errors import Fault, InterfaceError
from app.interfaces import Interfaces
from app.panel.checks.interlocks import interlock_faults
from app.panel.checks.templates import NOW_RULE
from app.panel.checks.types import ROSOUT
from app.panel.faults.wording import list_names
from app.panel.interlock import Interlock
from app.panel.model import Panel, RobotEntry
from app.panel.template import NOW
from app.panel.widgets.families import BaseWidget, CheckContext, EntryWidget, Input, TopicWidget
from app.panel.widgets.parameter import Parameter, type_faults
from app.panel.widgets.publish import Confirm, SinglePublish


def find_faults(panel: Panel, interfaces: Interfaces, faulty: Collection[str] = ()) -> Iterator[Fault]:
    """Every fault of names, types and templates; of each message the first that its type has.

    `faulty` are ids of widgets whose faults are told already: what depends on them is not judged.
    """
    yield from _required_type_faults(panel, interfaces)
    yield from _robot_faults(panel)
    if not panel.pages:
        yield Fault("page", "is missing: a panel has one page at least")
    yield from _duplicate_ids("page", [page.id for page in panel.pages])
    ids, inputs = list(_id_faults(panel)), list(_input_faults(panel, interfaces))
    yield from (*ids, *inputs)
    told = [fault.place for fault in (*ids, *inputs)]
    faulty = {
        *faulty,
        *(widget.id for place, widget in _widgets_with_places(panel) if _contains_any(place, told)),
    }
    judged = [*_interlock_faults(panel, interfaces), *_widget_faults(panel, interfaces, faulty)]
    missed = {"interlock" if fault.place.startswith("interlock") else "input" for fault in ids}
    judged = [fault for fault in judged if fault.cause.partition(" ")[0] not in missed]
    yield from judged
    yield from _topic_conflicts(panel, [fault.place for fault in judged])
    yield from type_faults((at, w) for at, w in _widgets_with_places(panel) if isinstance(w, Parameter))
    yield from _record_faults(panel)


def _id_faults(panel: Panel) -> Iterator[Fault]:
    """Ids that can't be: what is meant by such a one may be missed elsewhere by its right name."""
    yield from _duplicate_ids("interlock", [interlock.id for interlock in panel.interlocks])
    yield from _duplicate_widget_ids(panel)
    for place, widget in _widgets_with_places(panel):
        if isinstance(widget, EntryWidget) and widget.id == NOW:
            yield Fault(f"{place}.id", f'"{NOW}" is reserved, as {NOW_RULE}: choose another id')


def _contains_any(place: str, told: Iterable[str]) -> bool:
    """Whether one of the places told is in another one."""
    return any(each.startswith(f"{place}.") for each in told)


def _widgets_with_places(panel: Panel) -> Iterator[tuple[str, BaseWidget]]:
    """Every widget, with its place."""
    for p, page in enumerate(panel.pages):
        yield from ((f"page[{p}].widget[{w}]", widget) for w, widget in enumerate(page.widgets))


def _required_type_faults(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    """The first type that the kiosk needs for this panel and can't use: a folder of interfaces may have
    these types too, and files of them that are wrong."""
    of_kinds = (name for widget in panel.widgets() for name in widget.required_types)
    for name in dict.fromkeys((ROSOUT, *of_kinds)):
        try:
            interfaces.require(name)
        except InterfaceError as error:
            source = error.source
            folders = enumerate(panel.interfaces)
            at = next((i for i, one in folders if source and source.is_relative_to(one)), 0)
            yield Fault(f"interfaces[{at}]", f"the panel needs this type: {error}")
            return


def _check_context(
    panel: Panel,
    interfaces: Interfaces,
    widgets: Sequence[BaseWidget] = (),
    faulty: Collection[str] = (),
) -> CheckContext:
    """What the widgets of a page are checked against."""
    return CheckContext(
        interfaces,
        inputs={w.id: w for w in widgets if isinstance(w, Input)},
        all_inputs=[w.id for w in panel.widgets() if isinstance(w, Input)],
        interlocks=[one.id for one in panel.interlocks],
        types=panel.subscriptions(),
        faulty=faulty,
    )


def _input_faults(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    checking = _check_context(panel, interfaces)
    for place, widget in _widgets_with_places(panel):
        if isinstance(widget, Input):
            yield from widget.faults(place, checking)


def _interlock_faults(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    for i, interlock in enumerate(panel.interlocks):
        yield from interlock_faults(f"interlock[{i}]", interlock, interfaces)


def _widget_faults(panel: Panel, interfaces: Interfaces, faulty: Collection[str]) -> Iterator[Fault]:
    for p, page in enumerate(panel.pages):
        checking = _check_context(panel, interfaces, page.widgets, faulty)
        for w, widget in enumerate(page.widgets):
            if not isinstance(widget, Input):
                yield from widget.faults(f"page[{p}].widget[{w}]", checking)


def _record_faults(panel: Panel) -> Iterator[Fault]:
    """What is recorded is what the panel listens to anyway."""
    known = panel.subscriptions()
    for t, topic in enumerate((panel.record and panel.record.topics) or ()):
        if topic not in known:
            what = f"{topic} is no topic that this panel listens to; there is {list_names(known)}"
            yield Fault(f"record.topics[{t}]", what, cause=f"listens {topic}")


def _robot_faults(panel: Panel) -> Iterator[Fault]:
    """Several robots are told apart by id, by name and by where their topics are."""
    yield from _duplicate_ids("robot", [robot.id for robot in panel.robots])
    if panel.robots and panel.namespace:
        yield Fault("namespace", "is of the one robot: with [[robot]] each has its own")
    for r, robot in enumerate(panel.robots):
        yield from islice(_duplicate_robot_faults(f"robot[{r}]", robot, panel.robots[:r]), 1)


def _duplicate_robot_faults(
    place: str, robot: RobotEntry, others: Sequence[RobotEntry]
) -> Iterator[Fault]:
    """What it has as another one. A copy, which has the same id, is told elsewhere."""
    for a, above in enumerate(others if robot.id not in [one.id for one in others] else ()):
        if robot.name == above.name:
            yield Fault(f"{place}.name", f'"{robot.name}" is already the name of robot[{a}]')
        if (robot.namespace, robot.connect) == (above.namespace, above.connect):
            same = f"robot[{a}] has the same namespace and endpoints: it would be the same robot"
            yield Fault(f"{place}.namespace", same)


def _duplicate_ids(table: str, ids: list[str]) -> Iterator[Fault]:
    for i, one in enumerate(ids):
        if one in ids[:i]:
            yield Fault(f"{table}[{i}].id", f'"{one}" is already the id of {table}[{ids.index(one)}]')


def _duplicate_widget_ids(panel: Panel) -> Iterator[Fault]:
    seen: dict[str, str] = {}
    ids = [page.id for page in panel.pages]
    for p, page in enumerate(panel.pages):
        for w, widget in enumerate(page.widgets):
            place = f"page[{p}].widget[{w}]"
            if widget.id in seen and page.id not in ids[:p]:  # of a page's copy that is told
                yield Fault(f"{place}.id", f'"{widget.id}" is already the id of {seen[widget.id]}')
            seen.setdefault(widget.id, place)


def _topic_conflicts(panel: Panel, told: Sequence[str]) -> Iterator[Fault]:
    """A topic has one type and one QoS, wherever the panel names it. Where a fault of either place is
    `told` already, its type may be the mistake."""
    places: list[tuple[str, Interlock | TopicWidget | Confirm]] = []
    confirms: list[tuple[str, Confirm]] = []
    places += [(f"interlock[{i}]", one) for i, one in enumerate(panel.interlocks)]
    for place, widget in _widgets_with_places(panel):
        if isinstance(widget, TopicWidget):
            places.append((place, widget))
        if isinstance(widget, SinglePublish) and widget.confirm and widget.confirm.type:
            confirms.append((f"{place}.confirm", widget.confirm))
    firsts: dict[str, tuple[str, Interlock | TopicWidget | Confirm]] = {}
    for place, one in (*places, *confirms):
        above, first = firsts.setdefault(one.topic, (place, one))
        if one.type != first.type:
            if not _contains_any(place, told) and not _contains_any(above, told):
                what = f"{one.topic} is {one.type} here but {first.type} above"
                yield Fault(f"{place}.type", what, cause=f"topic {one.topic}")
            continue
        if isinstance(one, Confirm) or isinstance(first, Confirm):
            continue  # it takes the topic's, whatever that is
        if one.qos != first.qos:
            what = f"{one.topic} has another QoS at {above}: a topic has one"
            yield Fault(f"{place}.qos", what, cause=f"topic {one.topic}")
