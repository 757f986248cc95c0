"""What each kind of widget needs of the simulated robot: a row for each kind or family.

A kind without a row has that of its family. A display with keys `min`, `max`, `unit`, `scale` or
`offset` needs none: its numbers move within them.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Final

from app.panel.constants import parent_type, resolve_names
from app.panel.numbers import scaling_beside
from app.panel.response_text import response_paths
from app.panel.rules import MachineState, OeeRules
from app.panel.widgets.alarm_views import AlarmView
from app.panel.widgets.displays import (
    Camera,
    Conditions,
    Indicator,
    LampCommand,
    LogView,
    Pallet,
    Readout,
    Static,
)
from app.panel.widgets.families import BaseWidget, Display, Input, PublishCommand, TopicField
from app.panel.widgets.gauge import Figure, Gauge, SetpointField, TargetField
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.joints import Joints
from app.panel.widgets.kinds import find_row, require_rows
from app.panel.widgets.map_layers import INFO_FIELDS, INFO_TYPE
from app.panel.widgets.map_view import MapView
from app.panel.widgets.parameter import Parameter, listed_parameter
from app.panel.widgets.place import MapInput
from app.panel.widgets.publish import PublishPress, Step
from app.panel.widgets.recipe_load import RecipeLoad
from app.panel.widgets.sequence import Sequence
from app.panel.widgets.service_action import Action, Call, ServerCommand
from app.panel.widgets.switch import Switch
from app.panel.widgets.table import Table
from app.panel.widgets.trend import Trend
from app.ros.messages import Interfaces, Type
from app.system.texts import render
from app.tools.simulator.needs import Acted, Declared, DisplayedField, Need, Published, Served

NUMBERS: Final = 3  # of the range of a parameter that is chosen from


def needs_of(widget: BaseWidget, interfaces: Interfaces) -> Iterator[Need]:
    """What a widget needs of the robot."""
    if (simulated := find_row(SIMULATED, widget)) is not None:
        yield from simulated(widget, interfaces)


def _fields_of(display: Display, values: tuple[Any, ...] = ()) -> Iterator[DisplayedField]:
    limits = {key: getattr(display, key, None) for key in ("min", "max")}
    numbers = {key: limit for key, limit in limits.items() if isinstance(limit, int | float)}
    scale, offset = getattr(display, "scale", 1.0) or 1.0, getattr(display, "offset", 0.0)
    low, high = ((numbers[k] - offset) / scale if k in numbers else None for k in ("min", "max"))
    if scale < 0:
        low, high = high, low
    yield DisplayedField(
        topic=display.topic,
        type=display.type,
        field=display.field,
        label=render(display.label),
        unit=render(getattr(display, "unit", "")),
        scale=scale,
        offset=offset,
        low=low,
        high=high,
        values=values,
        max_age_s=display.max_age_s,
    )


def _of_field(source: TopicField) -> DisplayedField:
    return DisplayedField(
        topic=source.topic, type=source.type, field=source.field, max_age_s=source.max_age_s
    )


COUNT_S: Final = 12.0  # in which a part is made where the panel file has no ideal cycle
GOOD_SHARE: Final = 50  # of so many parts one is bad


def counters_of(rules: OeeRules | None) -> Iterator[DisplayedField]:
    """The counters of `[oee]`: a part in a little more than the ideal cycle."""
    if rules is None:
        return
    cycle_s = (rules.ideal_cycle_s or COUNT_S) * 1.2
    for counter in rules.counters:
        share = GOOD_SHARE if counter.parts == "bad" else 1
        yield replace(_of_field(counter), counts_s=cycle_s * share)


def _readout(readout: Readout, interfaces: Interfaces) -> Iterator[DisplayedField]:
    if readout.constants is None:
        return _fields_of(readout)
    constants = interfaces.constants(parent_type(readout, interfaces))
    named = (value for name, value in constants.items() if name.startswith(readout.constants or ""))
    return _fields_of(readout, tuple(dict.fromkeys(named)))


def _indicator(indicator: Indicator, _: Interfaces) -> Iterator[Need]:
    return _fields_of(indicator, tuple(state.value for state in indicator.states))


def _machine_state(display: MachineState, _: Interfaces) -> Iterator[Need]:
    yield from _fields_of(display, tuple(state.value for state in display.states))
    for detail in display.details:
        yield _of_field(detail)


def _figure(figure: Figure, _: Interfaces) -> Iterator[Need]:
    """Between nothing and its target."""
    scale, most = figure.scale or 1.0, figure.target
    end = (most - figure.offset) / scale if isinstance(most, float) else None
    for shown in _fields_of(figure):
        yield shown if end is None else replace(shown, low=min(0.0, end), high=max(0.0, end))
    if isinstance(most, TargetField):
        yield _of_field(most)
    for line in figure.lines:
        yield replace(_of_field(line), scale=line.scale, offset=line.offset)


def _pallet(pallet: Pallet, _: Interfaces) -> Iterator[Need]:
    """From an empty pallet to a full one."""
    for shown in _fields_of(pallet):
        yield replace(shown, low=0.0, high=float(pallet.in_layer * pallet.layers))


def _sequence(sequence: Sequence, _: Interfaces) -> Iterator[Need]:
    """From the first step to the last one."""
    if (current := sequence.current) is not None:
        yield replace(_of_field(current), values=sequence.values)


def _gauge(gauge: Gauge, _: Interfaces) -> Iterator[Need]:
    """In its normal range for the most part, and at times beyond the limit above."""
    low, high = gauge.normal or (gauge.min, gauge.max)
    if gauge.high is not None:
        high = (gauge.high + (gauge.high_high or gauge.max)) / 2
    ends = sorted((end - gauge.offset) / (gauge.scale or 1.0) for end in (low, high))
    for shown in _fields_of(gauge):
        yield replace(shown, low=ends[0], high=ends[1])
    if isinstance(setpoint := gauge.setpoint, SetpointField):
        scale, offset = scaling_beside(gauge, setpoint)
        middle = (sum(gauge.normal or (gauge.min, gauge.max)) / 2 - offset) / (scale or 1.0)
        yield DisplayedField(
            topic=setpoint.topic, type=setpoint.type, field=setpoint.field, low=middle, high=middle
        )


def _joints(widget: Joints, _: Interfaces) -> Iterator[Need]:
    """Within the soft limits, and at times a little beyond the one above."""
    for joint in widget.joints:
        low, high = joint.low, joint.high
        low = joint.min if low is None else low
        high = joint.max if high is None else high + (joint.max - high) / 4
        room, factor = 0.2 * (high - low), joint.shown_unit.factor
        yield DisplayedField(
            topic=widget.topic,
            type=widget.type,
            field=widget.path(joint),
            label=joint.name,
            low=(low + room) / factor,
            high=high / factor,
            max_age_s=widget.max_age_s,
        )


def _camera(camera: Camera, _: Interfaces) -> Iterator[Need]:
    yield DisplayedField(
        topic=camera.topic,
        type=camera.type,
        field="",
        label=render(camera.label),
        max_age_s=camera.max_age_s,
    )


def _map(view: MapView, _: Interfaces) -> Iterator[Need]:
    """From level to level."""
    if view.robot_level is not None:
        values = tuple(level.compared for level in view.levels)
        yield replace(_of_field(view.robot_level), values=values)
    for layer in view.layers:
        if layer.info is not None:
            said = (int(layer.shows == "speed"), layer.topic, 0.0, 1.0)
            for field, value in zip(INFO_FIELDS, said, strict=True):
                yield DisplayedField(topic=layer.info, type=INFO_TYPE, field=field, values=(value,))


def _trend(trend: Trend, _: Interfaces) -> Iterator[Need]:
    for readout in trend.readouts:
        yield from _fields_of(readout)


def _published(command: PublishCommand, _: Interfaces) -> Iterator[Need]:
    yield Published(topic=command.topic, type=command.type, qos=command.qos)


def _pressed(command: PublishPress, interfaces: Interfaces) -> Iterator[Need]:
    yield Published(
        topic=command.topic,
        type=command.type,
        qos=command.qos,
        template=resolve_names(command.template, Type(command.type), interfaces),
        confirm=command.confirm,
    )
    yield from _lamp(command)


def _lamp(command: ServerCommand | PublishPress) -> Iterator[Need]:
    if isinstance(command, LampCommand) and command.lamp is not None:
        values = tuple(state.value for state in command.lamp.states)
        yield replace(_of_field(command.lamp), values=values)


def _stepped(widget: Step, interfaces: Interfaces) -> Iterator[Need]:
    yield from _pressed(widget, interfaces)
    source, middle = widget.value, (widget.min + widget.max) / 2
    yield DisplayedField(
        topic=source.topic, type=source.type, field=source.field, low=middle, high=middle
    )


def _switched(switch: Switch, interfaces: Interfaces) -> Iterator[Need]:
    for part in switch.parts:
        yield from needs_of(part, interfaces)
    yield replace(_of_field(switch.reported), values=(switch.off_value, switch.on_value))


def _recipe(load: RecipeLoad, interfaces: Interfaces) -> Iterator[Need]:
    for part in load.parts:
        yield from needs_of(part, interfaces)
    yield from (Declared(widget=parameter) for parameter in load.reads)
    readback = load.set.readback
    if readback is None or readback.topic is None or readback.type is None:
        return
    for field in load.fields:
        first = field.examples()[0] if field.default_value is None else field.default_value
        path, values = readback.fields[field.id], (field.sent_value(first),)
        yield DisplayedField(topic=readback.topic, type=readback.type, field=path, values=values)


def _server(command: ServerCommand, _: Interfaces) -> Iterator[Need]:
    if command.server_role == "SS":
        yield Served(service=command.server_name, type=command.type)
    else:
        yield Acted(action=command.server_name, type=command.type)


def _call(call: Call, _: Interfaces) -> Iterator[Need]:
    yield Served(service=call.service, type=call.type, success=call.success, message=call.message)
    yield from _lamp(call)


def _action(action: Action, _: Interfaces) -> Iterator[Need]:
    yield Acted(
        action=action.action,
        type=action.type,
        progress=action.progress,
        ends=action.progress_ends,
        shown=tuple(response_paths(action.feedback)),
    )


def _parameter(parameter: Parameter, _: Interfaces) -> Iterator[Need]:
    yield Declared(widget=parameter)


def _select(select: SelectInput, _: Interfaces) -> Iterator[Need]:
    """The list of its options; a topic has texts of its type."""
    source = select.options_from
    if source is not None and (service := source.listing) is not None:
        yield Served(service=service.name, type=service.type, listed=service.field)
    if (parameter := listed_parameter(select)) is not None:
        limits = {"min": 1, "max": NUMBERS} if parameter.is_whole else {}
        yield Declared(widget=parameter.model_copy(update=limits))


# None: it needs no topic, or its topics need no more than values of their types.
SIMULATED: Final[Mapping[type[BaseWidget], Callable[[Any, Interfaces], Iterator[Need]] | None]] = {
    Static: None,
    Input: None,
    SelectInput: _select,
    Display: lambda display, _: _fields_of(display),
    Readout: _readout,
    Indicator: _indicator,
    MachineState: _machine_state,
    Figure: _figure,
    Pallet: _pallet,
    Conditions: None,
    Sequence: _sequence,
    Gauge: _gauge,
    Joints: _joints,
    Table: None,
    LogView: None,
    MapView: _map,
    MapInput: None,
    AlarmView: None,
    Camera: _camera,
    Trend: _trend,
    PublishCommand: _published,
    PublishPress: _pressed,
    Step: _stepped,
    Switch: _switched,
    RecipeLoad: _recipe,
    ServerCommand: _server,
    Call: _call,
    Action: _action,
    Parameter: _parameter,
}
require_rows("simulation", SIMULATED, BaseWidget)
