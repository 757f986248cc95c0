"""What can be wrong in a panel file whose shape is right: what each widget checks itself, and names,
types and topics across widgets."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import islice

from app.errors import Fault, InterfaceError
from app.interfaces import Interfaces
from app.panel.checks.interlocks import interlock_faults
from app.panel.checks.templates import NOW_IS
from app.panel.checks.types import ROSOUT
from app.panel.faults.wording import listing
from app.panel.interlock import Interlock
from app.panel.model import Panel, RobotEntry
from app.panel.template import NOW
from app.panel.widgets.families import Checking, Entered, Input, OnTopic, Placed
from app.panel.widgets.parameter import Parameter, type_faults
from app.panel.widgets.publish import Confirm, Publishing


def faults_in(panel: Panel, interfaces: Interfaces, faulty: Collection[str] = ()) -> Iterator[Fault]:
    """Every fault of names, types and templates; of each message the first that its type has.

    `faulty` are ids of widgets whose faults are told already: what depends on them is not judged.
    """
    yield from _own_types(panel, interfaces)
    yield from _robots(panel)
    if not panel.pages:
        yield Fault("page", "is missing: a panel has one page at least")
    yield from _repeated("page", [page.id for page in panel.pages])
    ids, inputs = list(_of_ids(panel)), list(_of_inputs(panel, interfaces))
    yield from (*ids, *inputs)
    told = [fault.place for fault in (*ids, *inputs)]
    faulty = {*faulty, *(widget.id for place, widget in _placed(panel) if _within(place, told))}
    judged = [*_of_interlocks(panel, interfaces), *_of_widgets(panel, interfaces, faulty)]
    missed = {"interlock" if fault.place.startswith("interlock") else "input" for fault in ids}
    judged = [fault for fault in judged if fault.cause.partition(" ")[0] not in missed]
    yield from judged
    yield from _topics_of_two_kinds(panel, [fault.place for fault in judged])
    yield from type_faults((at, w) for at, w in _placed(panel) if isinstance(w, Parameter))
    yield from _recorded(panel)


def _of_ids(panel: Panel) -> Iterator[Fault]:
    """Ids that can't be: what is meant by such a one may be missed elsewhere by its right name."""
    yield from _repeated("interlock", [interlock.id for interlock in panel.interlocks])
    yield from _repeated_widgets(panel)
    for place, widget in _placed(panel):
        if isinstance(widget, Entered) and widget.id == NOW:
            yield Fault(f"{place}.id", f'"{NOW}" is reserved, as {NOW_IS}: choose another id')


def _within(place: str, told: Iterable[str]) -> bool:
    """Whether one of the places told is in another one."""
    return any(each.startswith(f"{place}.") for each in told)


def _placed(panel: Panel) -> Iterator[tuple[str, Placed]]:
    """Every widget, with its place."""
    for p, page in enumerate(panel.pages):
        yield from ((f"page[{p}].widget[{w}]", widget) for w, widget in enumerate(page.widgets))


def _own_types(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    """The first type that the kiosk needs for this panel and can't use: a folder of interfaces may have
    these types too, and files of them that are wrong."""
    of_kinds = (name for widget in panel.widgets() for name in widget.own_types)
    for name in dict.fromkeys((ROSOUT, *of_kinds)):
        try:
            interfaces.require(name)
        except InterfaceError as error:
            source = error.source
            folders = enumerate(panel.interfaces)
            at = next((i for i, one in folders if source and source.is_relative_to(one)), 0)
            yield Fault(f"interfaces[{at}]", f"the panel needs this type: {error}")
            return


def _checking(
    panel: Panel,
    interfaces: Interfaces,
    widgets: Sequence[Placed] = (),
    faulty: Collection[str] = (),
) -> Checking:
    """What the widgets of a page are checked against."""
    return Checking(
        interfaces,
        inputs={w.id: w for w in widgets if isinstance(w, Input)},
        anywhere=[w.id for w in panel.widgets() if isinstance(w, Input)],
        interlocks=[one.id for one in panel.interlocks],
        types=panel.subscriptions(),
        faulty=faulty,
    )


def _of_inputs(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    checking = _checking(panel, interfaces)
    for place, widget in _placed(panel):
        if isinstance(widget, Input):
            yield from widget.faults(place, checking)


def _of_interlocks(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    for i, interlock in enumerate(panel.interlocks):
        yield from interlock_faults(f"interlock[{i}]", interlock, interfaces)


def _of_widgets(panel: Panel, interfaces: Interfaces, faulty: Collection[str]) -> Iterator[Fault]:
    for p, page in enumerate(panel.pages):
        checking = _checking(panel, interfaces, page.widgets, faulty)
        for w, widget in enumerate(page.widgets):
            if not isinstance(widget, Input):
                yield from widget.faults(f"page[{p}].widget[{w}]", checking)


def _recorded(panel: Panel) -> Iterator[Fault]:
    """What is recorded is what the panel listens to anyway."""
    known = panel.subscriptions()
    for t, topic in enumerate((panel.record and panel.record.topics) or ()):
        if topic not in known:
            what = f"{topic} is no topic that this panel listens to; there is {listing(known)}"
            yield Fault(f"record.topics[{t}]", what, cause=f"listens {topic}")


def _robots(panel: Panel) -> Iterator[Fault]:
    """Several robots are told apart by id, by name and by where their topics are."""
    yield from _repeated("robot", [robot.id for robot in panel.robots])
    if panel.robots and panel.namespace:
        yield Fault("namespace", "is of the one robot: with [[robot]] each has its own")
    for r, robot in enumerate(panel.robots):
        yield from islice(_like_another(f"robot[{r}]", robot, panel.robots[:r]), 1)


def _like_another(place: str, robot: RobotEntry, others: Sequence[RobotEntry]) -> Iterator[Fault]:
    """What it has as another one. A copy, which has the same id, is told elsewhere."""
    for a, above in enumerate(others if robot.id not in [one.id for one in others] else ()):
        if robot.name == above.name:
            yield Fault(f"{place}.name", f'"{robot.name}" is already the name of robot[{a}]')
        if (robot.namespace, robot.connect) == (above.namespace, above.connect):
            same = f"robot[{a}] has the same namespace and endpoints: it would be the same robot"
            yield Fault(f"{place}.namespace", same)


def _repeated(table: str, ids: list[str]) -> Iterator[Fault]:
    for i, one in enumerate(ids):
        if one in ids[:i]:
            yield Fault(f"{table}[{i}].id", f'"{one}" is already the id of {table}[{ids.index(one)}]')


def _repeated_widgets(panel: Panel) -> Iterator[Fault]:
    seen: dict[str, str] = {}
    ids = [page.id for page in panel.pages]
    for p, page in enumerate(panel.pages):
        for w, widget in enumerate(page.widgets):
            place = f"page[{p}].widget[{w}]"
            if widget.id in seen and page.id not in ids[:p]:  # of a page's copy that is told
                yield Fault(f"{place}.id", f'"{widget.id}" is already the id of {seen[widget.id]}')
            seen.setdefault(widget.id, place)


def _topics_of_two_kinds(panel: Panel, told: Sequence[str]) -> Iterator[Fault]:
    """A topic has one type and one QoS, wherever the panel names it. Where a fault of either place is
    `told` already, its type may be the mistake."""
    places: list[tuple[str, Interlock | OnTopic | Confirm]] = []
    confirms: list[tuple[str, Confirm]] = []
    places += [(f"interlock[{i}]", one) for i, one in enumerate(panel.interlocks)]
    for place, widget in _placed(panel):
        if isinstance(widget, OnTopic):
            places.append((place, widget))
        if isinstance(widget, Publishing) and widget.confirm and widget.confirm.type:
            confirms.append((f"{place}.confirm", widget.confirm))
    firsts: dict[str, tuple[str, Interlock | OnTopic | Confirm]] = {}
    for place, one in (*places, *confirms):
        above, first = firsts.setdefault(one.topic, (place, one))
        if one.type != first.type:
            if not _within(place, told) and not _within(above, told):
                what = f"{one.topic} is {one.type} here but {first.type} above"
                yield Fault(f"{place}.type", what, cause=f"topic {one.topic}")
            continue
        if isinstance(one, Confirm) or isinstance(first, Confirm):
            continue  # it takes the topic's, whatever that is
        if one.qos != first.qos:
            what = f"{one.topic} has another QoS at {above}: a topic has one"
            yield Fault(f"{place}.qos", what, cause=f"topic {one.topic}")
