"""The attributes of each kind of widget: pure, from (widget, robot, verdict, time). A row for each
kind."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, Final, TypedDict

from app.cell.permission.verdict import PERMITTED, Verdict
from app.cell.robot.state import RobotState
from app.cell.view.conditions import conditions, machine_state, sequence
from app.cell.view.displays import (
    alarm_line,
    alarm_list,
    camera,
    indicator,
    log,
    pallet,
    readout,
    recipe,
    select,
    step,
    switch,
    value,
)
from app.cell.view.gauges import figure, gauge, joints
from app.cell.view.parameter_values import parameter
from app.cell.view.stop_brief import stop_brief
from app.cell.view.table_values import table
from app.cell.view.times import result_age
from app.cell.view.trend import trend
from app.panel.rules import MachineState
from app.panel.widgets.alarm_views import AlarmLineView, AlarmListView
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
from app.panel.widgets.families import BaseWidget, Command, Display, Input, PressCommand
from app.panel.widgets.gauge import Figure, Gauge
from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.joints import Joints
from app.panel.widgets.kinds import find_row, require_rows
from app.panel.widgets.map_view import MapView
from app.panel.widgets.numbers import Numeric
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.place import PlaceInput
from app.panel.widgets.publish import PublishPress, Step
from app.panel.widgets.recipe_load import RecipeLoad
from app.panel.widgets.sequence import Sequence as SequenceWidget
from app.panel.widgets.switch import Switch
from app.panel.widgets.table import Table
from app.panel.widgets.templated import is_stop
from app.panel.widgets.tour import Tour
from app.panel.widgets.trend import Trend
from app.records.entry import IDLE, CommandStatus
from app.system.texts import TextLike, joined, say

# What an operator reads of a goal's state, named as in action_msgs/msg/GoalStatus.
UNDER_WAY: Final[Mapping[str, str]] = {
    "ACCEPTED": "goal_state_accepted",
    "EXECUTING": "goal_state_executing",
    "CANCELING": "goal_state_canceling",
}

# The attributes of a widget, and when (monotonic seconds) time alone would change them.
Attributes = dict[str, Any]
AttributesUntil = tuple[Attributes, float]
AttributesOf = Callable[[Any, RobotState, float], AttributesUntil]


class Enabled(TypedDict):
    enabled: bool
    reason: TextLike | None


def attributes_of(
    widget: BaseWidget, robot: RobotState, now: float, verdict: Verdict = PERMITTED
) -> AttributesUntil:
    """The attributes of a widget at `now` (monotonic seconds), and when time alone changes them;
    `verdict` is that of a command, whose own deadline is not counted here. A command that sends a place
    has `map_versions`. A value that alarms are about has `alarmed`, the priority of the most urgent
    active one, "" for none."""
    if isinstance(widget, Command):
        attributes, until = find_row(COMMANDS, widget)(widget, robot, verdict, now)
        if widget.id in robot.place_inputs:
            from app.cell.permission.goal_places import map_versions

            attributes = {**attributes, "map_versions": map_versions(widget.id, robot, now)}
    else:
        attributes, until = find_row(ATTRIBUTES, widget)(widget, robot, now)
    if isinstance(widget, Display):
        priority = robot.alarmed.priorities.get((widget.topic, widget.field))
        if priority is not None:
            attributes = {**attributes, "alarmed": str(priority or "")}
    if isinstance(widget, LampCommand) and widget.lamp is not None:
        lamp, lamp_until = indicator(widget.lamp, robot, now)
        attributes, until = {**attributes, **lamp}, min(until, lamp_until)
    return attributes, until


def enabled(verdict: Verdict) -> Enabled:
    return {"enabled": verdict.permitted, "reason": verdict.reason}


def lock(widget: Command, verdict: Verdict) -> Attributes:
    """Attributes of a control; one with several interlocks has all reasons. The same object for the
    same lock: what is alike is compared and encoded once. It must not be changed."""
    return _lock(verdict, len(widget.interlocks) > 1)


@lru_cache(maxsize=256)
def _lock(verdict: Verdict, has_several: bool) -> Attributes:
    return {**enabled(verdict), **(all_reasons(verdict.reasons) if has_several else {})}


def all_reasons(reasons: Sequence[TextLike]) -> dict[str, TextLike]:
    """`reasons` are all, a line each, and `more` says how many there are beside the first."""
    more: TextLike = say("more_reasons", number=len(reasons) - 1) if len(reasons) > 1 else ""
    return {"reasons": joined(reasons, "between_lines"), "more": more}


def progress(status: CommandStatus) -> Attributes:
    """Attributes of a call or an action: `progress` from 0 to 1, None where it is not known; `goal`
    is the state of an action's goal as ROS names it, `press` the id of the press that a cancel is for,
    both "" where there is none. `doing` says how far a goal is that is under way; `aged`: the result is
    an old one."""
    return {
        "busy": status.busy,
        "outcome": status.outcome,
        "result": status.text,
        "aged": False,
        "progress": status.fraction,
        "stoppable": status.can_cancel,
        "goal": status.goal,
        "doing": _doing(status),
        "press": status.press,
    }


def _doing(status: CommandStatus) -> TextLike:
    if not status.busy or status.goal not in UNDER_WAY:
        return ""
    state = say(UNDER_WAY[status.goal])
    if status.fraction is None:
        return state
    return say("goal_state_percent", state=state, percent=int(100 * status.fraction))


def _pressed(widget: PressCommand, robot: RobotState, verdict: Verdict, now: float) -> AttributesUntil:
    """The lock, and the result of the last press, for as long as it is shown."""
    status = robot.command_status.get(widget.id, IDLE)
    set_at = robot.command_status.set_at.get(widget.id, (now, 0.0))
    came, until = result_age(status, set_at, now)
    shown = {**lock(widget, verdict), **progress(status), **came}
    if shown["result"] and is_stop(widget) and status.outcome:
        shown["result"] = stop_brief(status.outcome, set_at[1])
    return shown, until


def _published(
    widget: PublishPress, robot: RobotState, verdict: Verdict, now: float
) -> AttributesUntil:
    if widget.confirm is not None:
        return _pressed(widget, robot, verdict, now)
    return lock(widget, verdict), math.inf


def _held(widget: HoldCommand, robot: RobotState, verdict: Verdict, _: float) -> AttributesUntil:
    holding = robot.held_since.get(widget.id, "")
    return {**lock(widget, verdict), "held": bool(holding), "holding": holding}, math.inf


def _parameter(widget: Parameter, robot: RobotState, verdict: Verdict, now: float) -> AttributesUntil:
    pressed, until = _pressed(widget, robot, verdict, now)
    return pressed | parameter(widget, robot), until


def _stepped(widget: Step, robot: RobotState, verdict: Verdict, now: float) -> AttributesUntil:
    pressed, ages = _pressed(widget, robot, verdict, now)
    reported, until = step(widget, robot, now)
    return pressed | reported, min(ages, until)


def _switched(widget: Switch, robot: RobotState, verdict: Verdict, now: float) -> AttributesUntil:
    pressed, ages = _pressed(widget, robot, verdict, now)
    reported, until = switch(widget, robot, now)
    return pressed | reported, min(ages, until)


def _recipe(widget: RecipeLoad, robot: RobotState, verdict: Verdict, now: float) -> AttributesUntil:
    pressed, ages = _pressed(widget, robot, verdict, now)
    reported, until = recipe(widget, robot, now)
    return pressed | reported, min(ages, until)


def _fixed(widget: BaseWidget, robot: RobotState, now: float) -> AttributesUntil:
    return {}, math.inf


# Maps and places are imported where a panel has one, for a faster start.


def _map_view(widget: MapView, robot: RobotState, now: float) -> AttributesUntil:
    from app.cell.view.map_values import map_view

    return map_view(widget, robot, now)


def _place_input(widget: PlaceInput, robot: RobotState, now: float) -> AttributesUntil:
    from app.cell.view.place_values import place_input

    return place_input(widget, robot, now)


def _tour(widget: Tour, robot: RobotState, now: float) -> AttributesUntil:
    from app.cell.view.tour_values import tour

    return tour(widget, robot, now)


# Of widgets that send nothing.
ATTRIBUTES: Final[Mapping[type[BaseWidget], AttributesOf]] = {
    Static: _fixed,
    Input: _fixed,
    SelectInput: select,
    Numeric: lambda widget, robot, now: ({"limits": widget.limits_text}, math.inf),
    Display: value,
    Readout: readout,
    Camera: camera,
    LogView: lambda widget, robot, now: log(widget, robot),
    Indicator: indicator,
    MachineState: machine_state,
    Figure: figure,
    Pallet: pallet,
    Conditions: conditions,
    SequenceWidget: sequence,
    Gauge: gauge,
    Joints: joints,
    MapView: _map_view,
    PlaceInput: _place_input,
    Tour: _tour,
    Table: table,
    AlarmListView: lambda widget, robot, now: alarm_list(widget, robot),
    AlarmLineView: lambda widget, robot, now: alarm_line(widget, robot),
    Trend: trend,
}
# Of commands, with their verdict.
COMMANDS: Final[
    Mapping[type[BaseWidget], Callable[[Any, RobotState, Verdict, float], AttributesUntil]]
] = {
    PressCommand: _pressed,
    PublishPress: _published,
    Step: _stepped,
    Switch: _switched,
    RecipeLoad: _recipe,
    HoldCommand: _held,
    Parameter: _parameter,
}
require_rows("attributes", {**ATTRIBUTES, **COMMANDS}, BaseWidget)
