"""What can be wrong in a panel file whose shape is right: names, types and templates."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import islice

from app.errors import Fault, InterfaceError
from app.interfaces import Interfaces
from app.panel.base import Placed
from app.panel.checks.calls import answer_faults, sent
from app.panel.checks.confirm import confirm_faults
from app.panel.checks.holds import hold_faults
from app.panel.checks.interlocks import interlock_faults
from app.panel.checks.templates import NOW_IS, template_faults
from app.panel.checks.types import own_type_faults, type_fault
from app.panel.faults.wording import listing
from app.panel.interlock import Interlock
from app.panel.model import Display, Input, Panel, Pressed, Published, RobotEntry
from app.panel.template import NOW
from app.panel.widgets.check_displays import display_faults
from app.panel.widgets.check_inputs import input_faults
from app.panel.widgets.check_parameters import parameter_faults, type_faults
from app.panel.widgets.displays import Indicator, Readout
from app.panel.widgets.hold import Hold
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.publish import Confirm, Publish
from app.panel.widgets.service_action import Action, Call


def faults_in(panel: Panel, interfaces: Interfaces, faulty: Collection[str] = ()) -> Iterator[Fault]:
    """Every fault of names, types and templates; of each message the first that its type has.

    `faulty` are ids of widgets whose faults are told already: what depends on them is not judged.
    """
    yield from own_type_faults(panel, interfaces)
    yield from _robots(panel)
    if not panel.pages:
        yield Fault("page", "is missing: a panel has one page at least")
    yield from _repeated("page", [page.id for page in panel.pages])
    ids, inputs = list(_of_ids(panel)), list(_of_inputs(panel))
    yield from (*ids, *inputs)
    told = [fault.place for fault in (*ids, *inputs)]
    faulty = {*faulty, *(widget.id for place, widget in _placed(panel) if _within(place, told))}
    judged = [*_of_interlocks(panel, interfaces), *_of_widgets(panel, interfaces, faulty)]
    missed = {"interlock" if fault.place.startswith("interlock") else "input" for fault in ids}
    judged = [fault for fault in judged if fault.cause.partition(" ")[0] not in missed]
    yield from judged
    yield from _topics_of_two_kinds(panel, [fault.place for fault in judged])
    yield from type_faults(panel)
    yield from _recorded(panel)


def _of_ids(panel: Panel) -> Iterator[Fault]:
    """Ids that can't be: what is meant by such a one may be missed elsewhere by its right name."""
    yield from _repeated("interlock", [interlock.id for interlock in panel.interlocks])
    yield from _repeated_widgets(panel)
    for place, widget in _placed(panel):
        if isinstance(widget, Input | Parameter) and widget.id == NOW:
            yield Fault(f"{place}.id", f'"{NOW}" is reserved, as {NOW_IS}: choose another id')


def _within(place: str, told: Iterable[str]) -> bool:
    """Whether one of the places told is in another one."""
    return any(each.startswith(f"{place}.") for each in told)


def _placed(panel: Panel) -> Iterator[tuple[str, Placed]]:
    """Every widget, with its place."""
    for p, page in enumerate(panel.pages):
        yield from ((f"page[{p}].widget[{w}]", widget) for w, widget in enumerate(page.widgets))


def _of_inputs(panel: Panel) -> Iterator[Fault]:
    for place, widget in _placed(panel):
        if isinstance(widget, Input):
            yield from input_faults(place, widget)


def _of_interlocks(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    for i, interlock in enumerate(panel.interlocks):
        yield from interlock_faults(f"interlock[{i}]", interlock, interfaces)


def _of_widgets(panel: Panel, interfaces: Interfaces, faulty: Collection[str]) -> Iterator[Fault]:
    anywhere = [widget.id for widget in panel.widgets() if isinstance(widget, Input)]
    for p, page in enumerate(panel.pages):
        inputs = {w.id: w for w in page.widgets if isinstance(w, Input)}
        for w, widget in enumerate(page.widgets):
            place = f"page[{p}].widget[{w}]"
            if isinstance(widget, Pressed | Hold):
                yield from _interlocked(place, widget, panel)
            match widget:
                case Publish() | Call() | Action():
                    yield from _sent(place, widget, panel, inputs, anywhere, interfaces, faulty)
                case Parameter():
                    yield from parameter_faults(place, widget)
                case Hold():
                    yield from hold_faults(place, widget, inputs, anywhere, interfaces, faulty)
                case Readout() | Indicator():
                    yield from display_faults(place, widget, interfaces)


def _sent(
    place: str,
    widget: Publish | Call | Action,
    panel: Panel,
    inputs: Mapping[str, Input],
    anywhere: Collection[str],
    interfaces: Interfaces,
    faulty: Collection[str],
) -> Iterator[Fault]:
    try:
        part, type_name = sent(widget, interfaces)
    except InterfaceError as error:
        yield type_fault(f"{place}.type", error)
        return
    yield from template_faults(
        f"{place}.{part}", widget.template, type_name, inputs, anywhere, interfaces, faulty
    )
    yield from answer_faults(place, widget, interfaces)
    if isinstance(widget, Publish):
        yield from confirm_faults(place, widget, panel, inputs, anywhere, interfaces, faulty)


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


def _interlocked(place: str, widget: Pressed | Hold, panel: Panel) -> Iterator[Fault]:
    if isinstance(widget, Published) and widget.topic == "/rosout":
        yield Fault(f"{place}.topic", "/rosout is where the kiosk's own log goes: choose another")
    known = [one.id for one in panel.interlocks]
    for i, name in enumerate(widget.interlocks):
        if name not in known:
            at = f"[{i}]" if len(widget.interlocks) > 1 else ""
            what = f'no interlock "{name}"; there is {listing(known)}'
            yield Fault(f"{place}.interlock{at}", what, cause=f"interlock {name}")


def _topics_of_two_kinds(panel: Panel, told: Sequence[str]) -> Iterator[Fault]:
    """A topic has one type and one QoS, wherever the panel names it. Where a fault of either place is
    `told` already, its type may be the mistake."""
    places: list[tuple[str, Interlock | Published | Display | Confirm]] = []
    confirms: list[tuple[str, Confirm]] = []
    places += [(f"interlock[{i}]", one) for i, one in enumerate(panel.interlocks)]
    for p, page in enumerate(panel.pages):
        for w, widget in enumerate(page.widgets):
            if isinstance(widget, Published | Display):
                places.append((f"page[{p}].widget[{w}]", widget))
            if isinstance(widget, Publish) and widget.confirm and widget.confirm.type:
                confirms.append((f"page[{p}].widget[{w}].confirm", widget.confirm))
    firsts: dict[str, tuple[str, Interlock | Published | Display | Confirm]] = {}
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
