"""The view: the state that pages and events show. Pure, from (panel, robot, time).

A view has JSON values, and texts (`i18n`) where a person reads; these are rendered for each language in
use when an event or a page is sent. The browser sets texts and attributes and composes none.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, Final, NamedTuple, TypedDict

from app.cell.alarms.shown import NO_ALARMS, AlarmsView
from app.cell.permission.control import IN_CONTROL, NO_CONTROL, ControlView, Role, for_role, role
from app.cell.permission.interlocks import interlock_verdict, link_verdict
from app.cell.permission.press_permission import (
    NO_CONDITIONS,
    ServerConditions,
    judged,
    permissions,
    with_hint,
)
from app.cell.permission.roles import UNKNOWN_USERS, ConfirmLocks, role_reason, strictest, unmet
from app.cell.permission.verdict import PERMITTED, Verdict
from app.cell.robot.state import RobotState
from app.cell.view.clock_status import simulation_banner
from app.cell.view.kinds import Attributes, AttributesUntil, Enabled, attributes_of, enabled
from app.cell.view.link_status import (
    UNKNOWN,
    Lamp,
    LinkStatus,
    RobotWord,
    link_statuses,
    robot_word,
    summary,
)
from app.panel.model import Panel
from app.panel.needs import NO_NEEDS, PanelNeeds
from app.panel.rules import ControlRules
from app.panel.widgets.families import BaseWidget, Command, DisplayWidget
from app.records.principal import Principal
from app.system.texts import ENGLISH, Text, TextLike, ended, joined, say

# Audiences: clients that see the same view.

NOTHING: Final[frozenset[str]] = frozenset()


class Audience(NamedTuple):
    """Clients that see the same view, but for the page. `has_control`: control authority locks none of
    their buttons. `role` decides what they read of control, `language` in which language. `without` are
    the other robots with widgets on the page which the clients do not control. `lacks` are the roles
    and groups named in the panel that the clients do not have."""

    has_control: bool = True
    role: Role = ""
    language: str = ENGLISH
    without: frozenset[str] = frozenset()
    lacks: frozenset[str] = NOTHING

    @property
    def sees_all(self) -> bool:
        """Whether the view is for it as it is."""
        return not self.role and not self.lacks


NO_OTHERS: Final[Mapping[str, ControlView]] = {}
EVERYONE: Final = Audience()  # where control is not required, in English


@lru_cache(maxsize=512)
def audience(
    role: Role,
    language: str = ENGLISH,
    without: frozenset[str] = NOTHING,
    lacks: frozenset[str] = NOTHING,
) -> Audience:
    """The audience of clients of a role in control; the same object for the same."""
    return Audience(role in IN_CONTROL, role, language, without, lacks)


def audience_of(
    who: Principal,
    control: ControlView,
    rules: ControlRules,
    language: str,
    others: Mapping[str, ControlView] = NO_OTHERS,
    needs: frozenset[str] = NOTHING,
) -> Audience:
    """The audience of a client now. `others` has the control of other robots by their ids; `needs` are
    the roles and groups named in the panel."""
    without = frozenset(
        robot for robot, view in others.items() if role(view, who, rules) not in IN_CONTROL
    )
    return audience(role(control, who, rules), language, without, unmet(needs, who))


RETRY_S: Final = 1.0  # after which a widget that can't be shown is tried again
NOTHING_KEPT: Final[Mapping[str, AttributesUntil]] = {}
NOTHING_OF_OTHERS: Final[Mapping[str, Mapping[str, Attributes]]] = {}
FAILURE: Final = say("widget_failed")
FAILED: Final[Attributes] = {"failed": FAILURE, "state": "unreadable", "note": FAILURE}
FAILED_COMMAND: Final[Attributes] = {
    **FAILED,
    "enabled": False,
    "reason": FAILURE,
    "reasons": FAILURE,
    "more": "",
}


class Notice(TypedDict):
    """The lines above all else on a page; "" for none."""

    banner: TextLike
    fault: TextLike


class View(TypedDict):
    """Everything that can change on a page; `widgets` has the attributes of each widget by its id,
    `robots` the lamp of each robot if the panel has several, `recipes` the revision of each set of
    recipes."""

    link: dict[str, LinkStatus]
    interlocks: dict[str, Enabled]
    widgets: dict[str, dict[str, Any]]
    notice: Notice
    state: RobotWord
    robots: dict[str, Lamp]
    control: ControlView
    alarms: AlarmsView
    recipes: dict[str, int]


class ViewWithDeadlines(NamedTuple):
    """A view and its deadlines in monotonic seconds: `displays` is when time alone changes a display,
    by its id, `rest` the same for all else. `robot` is the robot's lamp on the pages of others.
    `without_control` has the attributes of commands for clients without control, by their ids; it is
    empty if all clients have control. `failures` has the error of each widget that can't be shown, by
    its id."""

    view: View
    robot: Lamp
    rest: float
    displays: Mapping[str, float]
    without_control: Mapping[str, Attributes] = {}
    failures: Mapping[str, Exception] = {}

    def attributes(self, display: str) -> AttributesUntil:
        """The attributes of a display, and when time alone changes them."""
        return self.view["widgets"][display], self.displays[display]

    @property
    def until(self) -> float:
        """When time alone changes the view."""
        return min(self.rest, *self.displays.values()) if self.displays else self.rest


class ViewContext(NamedTuple):
    """What a view shows beside the panel and the state of its robot.

    `robots` has the lamp of each robot if the panel has several. `fault` is shown above the page,
    `log_lock` locks all commands; "" for none. `control_lock` locks for clients without control; time
    alone changes `control` at `control_until` (monotonic seconds). `inhibited` has the locks by alarms,
    by the widgets' ids, `confirm_locks` those of presses that no one can confirm.
    """

    robots: Mapping[str, Lamp] = {}
    simulated: bool = False
    fault: TextLike = ""
    log_lock: TextLike = ""
    control: ControlView = NO_CONTROL
    control_lock: Verdict = PERMITTED
    control_until: float = math.inf
    alarms: AlarmsView = NO_ALARMS
    inhibited: Mapping[str, Verdict] = {}
    recipes: Mapping[str, int] = {}
    confirm_locks: ConfirmLocks = UNKNOWN_USERS


def conditions_of(context: ViewContext) -> ServerConditions:
    """What decides the locks of all clients, beside the robot."""
    if context.log_lock or context.inhibited or context.confirm_locks is not UNKNOWN_USERS:
        return ServerConditions(
            log_lock=context.log_lock,
            inhibited=context.inhibited,
            confirm_locks=context.confirm_locks,
        )
    return NO_CONDITIONS


ALONE: Final = ViewContext()  # one robot, its log is written, and control is not required


def build_view(
    panel: Panel,
    robot: RobotState,
    now: float,
    context: ViewContext = ALONE,
    kept: Mapping[str, AttributesUntil] = NOTHING_KEPT,
) -> ViewWithDeadlines:
    """The view at `now` (monotonic seconds). `kept` has the attributes of unseen displays,
    by their ids: they are shown as they are."""
    passable = link_verdict(robot, now)
    interlocks = {i.id: interlock_verdict(i, robot, now, passable) for i in panel.every_interlock}
    grounds = conditions_of(context)
    verdicts = permissions(panel, robot, now, passable, interlocks, grounds)
    failures: dict[str, Exception] = {}
    uniform = _uniform(panel, robot, now, verdicts, failures)
    widgets = {
        w.id: uniform.get(w.id)
        or kept.get(w.id)
        or _show(w, robot, now, verdicts.get(w.id, PERMITTED), failures)
        for w in panel.widgets()
    }
    link, until = link_statuses(panel, robot, passable, verdicts, now)
    banner = simulation_banner(robot, now, is_simulated=context.simulated or robot.graph.is_simulated)
    view = View(
        link=link,
        interlocks={i: enabled(verdict) for i, verdict in interlocks.items()},
        widgets={name: attributes for name, (attributes, _) in widgets.items()},
        notice=Notice(banner=banner, fault=context.fault),
        state=robot_word(passable),
        robots=dict(context.robots),
        control=context.control,
        alarms=context.alarms,
        recipes=dict(context.recipes),
    )
    untils = {w.id: widgets[w.id][1] for w in panel.displays}
    others = (at for name, (_, at) in widgets.items() if name not in untils)
    judged = (passable, *interlocks.values(), *verdicts.values())
    rest = min(until, context.control_until, *others, *(verdict.until for verdict in judged))
    without: dict[str, Attributes] = {}
    if not context.control_lock.permitted:
        grounds = replace(grounds, control=context.control_lock)
        locks = permissions(panel, robot, now, passable, interlocks, grounds)
        without = {w.id: _show(w, robot, now, locks[w.id], failures)[0] for w in panel.commands}
    return ViewWithDeadlines(view, summary(robot.title, link), rest, untils, without, failures)


def _uniform(
    panel: Panel,
    robot: RobotState,
    now: float,
    verdicts: Mapping[str, Verdict],
    failures: dict[str, Exception],
) -> dict[str, AttributesUntil]:
    """The attributes of the uniform buttons: one object for all with the same verdict."""
    shown: dict[str, AttributesUntil] = {}
    for buttons in panel.uniform_buttons.values():
        by_verdict: dict[int, AttributesUntil] = {}
        for button in buttons:
            verdict = verdicts[button.id]
            attributes = by_verdict.get(id(verdict))
            if attributes is None:
                attributes = _show(button, robot, now, verdict, failures)
                by_verdict[id(verdict)] = attributes
            shown[button.id] = attributes
    return shown


def _show(
    widget: BaseWidget, robot: RobotState, now: float, verdict: Verdict, failures: dict[str, Exception]
) -> AttributesUntil:
    """The attributes of a widget. One whose attributes can't be made is locked and says so, whatever is
    wrong with it: the others are shown. It is tried again after `RETRY_S`."""
    try:
        return attributes_of(widget, robot, now, verdict)
    except Exception as error:
        failures[widget.id] = error
        return FAILED_COMMAND if isinstance(widget, Command) else FAILED, now + RETRY_S


def lock_all(panel: Panel, current: ViewWithDeadlines, reason: Text) -> ViewWithDeadlines:
    """The view with every interlock and command locked for one reason."""
    stops = {widget.id for widget in panel.stops}

    def locked(attributes: Mapping[str, Any], widget: str = "") -> Any:
        if "enabled" not in attributes:
            return attributes
        why = joined((ended(panel.stop_hint), reason)) if widget in stops else reason
        overlay = {"enabled": False, "reason": why, "reasons": why, "more": ""}
        return {name: overlay.get(name, value) for name, value in attributes.items()}

    view = current.view.copy()
    view["interlocks"] = {name: locked(state) for name, state in view["interlocks"].items()}
    view["widgets"] = {name: locked(shown, name) for name, shown in view["widgets"].items()}
    view["state"] = UNKNOWN
    without = {name: locked(shown, name) for name, shown in current.without_control.items()}
    return current._replace(view=view, without_control=without)


def update_displays(
    current: ViewWithDeadlines, displays: Iterable[DisplayWidget], robot: RobotState, now: float
) -> ViewWithDeadlines:
    """The view with these displays as of `now`; nothing else may have changed."""
    widgets, untils = dict(current.view["widgets"]), dict(current.displays)
    failures = dict(current.failures)
    for widget in displays:
        failures.pop(widget.id, None)
        widgets[widget.id], untils[widget.id] = _show(widget, robot, now, PERMITTED, failures)
    view: View = {**current.view, "widgets": widgets}
    return current._replace(view=view, displays=untils, failures=failures)


def update_commands(
    current: ViewWithDeadlines,
    commands: Iterable[Command],
    panel: Panel,
    robot: RobotState,
    now: float,
    context: ViewContext = ALONE,
) -> ViewWithDeadlines:
    """The view with these commands as of `now`; nothing but their status may have changed."""
    widgets, without = dict(current.view["widgets"]), dict(current.without_control)
    failures, rest = dict(current.failures), current.rest
    grounds = conditions_of(context)
    for widget in commands:
        failures.pop(widget.id, None)
        interlocks = panel.interlocks_of(widget)
        verdict = with_hint(panel, widget, judged(widget, interlocks, robot, now, grounds))
        widgets[widget.id], until = _show(widget, robot, now, verdict, failures)
        rest = min(rest, until, verdict.until)
        if without:
            locks = replace(grounds, control=context.control_lock)
            lock = with_hint(panel, widget, judged(widget, interlocks, robot, now, locks))
            without[widget.id] = _show(widget, robot, now, lock, failures)[0]
    view: View = {**current.view, "widgets": widgets}
    return current._replace(view=view, rest=rest, without_control=without, failures=failures)


def for_audience(
    view: View,
    without_control: Mapping[str, Attributes],
    audience: Audience,
    of_others: Mapping[str, Mapping[str, Attributes]] = NOTHING_OF_OTHERS,
    needs: PanelNeeds = NO_NEEDS,
) -> View:
    """The view for an audience: without control, commands are locked, and without the role or group
    that they need. Widgets of pages that it does not see are left out. `of_others` has the same for the
    widgets of other robots, by the robot's id."""
    if audience.lacks:
        seen = for_audience(
            view, without_control, audience._replace(lacks=frozenset()), of_others, needs
        )
        return _for_lacking(seen, audience.lacks, needs)
    role = audience.role
    if not role:
        return view
    if role == "embedded":
        widgets = {name: _embedded(attributes) for name, attributes in view["widgets"].items()}
        return {**view, "control": {**NO_CONTROL, "role": role}, "widgets": widgets}
    control = for_role(view["control"], role)
    locked = {} if audience.has_control else dict(without_control)
    for robot in audience.without:
        locked |= of_others.get(robot, {})
    if not locked:
        return {**view, "control": control}
    return {**view, "control": control, "widgets": {**view["widgets"], **locked}}


def _for_lacking(view: View, lacks: frozenset[str], needs: PanelNeeds) -> View:
    """The view for clients without these roles and groups."""
    hidden = needs.hidden_widgets(lacks)
    widgets = {name: shown for name, shown in view["widgets"].items() if name not in hidden}
    for name, needed in needs.commands.items():
        if name in widgets and (unmet := needed & lacks):
            widgets[name] = _locked(widgets[name], role_reason(strictest(unmet)))
    return {**view, "widgets": widgets}


def _locked(attributes: Attributes, reason: TextLike) -> Attributes:
    """The attributes of a command that this client may not press, whatever the robot permits."""
    overlay = {"enabled": False, "reason": reason, "reasons": reason, "more": ""}
    overlay |= {"stoppable": False, "askable": False}
    return {name: overlay.get(name, value) for name, value in attributes.items()}


def _embedded(attributes: Attributes) -> Attributes:
    """The attributes of a widget on a page that may only show."""
    return _locked(attributes, say("page_embedded"))


# Widgets of other robots on the pages of one robot: each is shown from the view of its own robot.


class SharedWidgets(NamedTuple):
    """The attributes of widgets of other robots, by the widgets' ids. `without_control` has those for
    clients without control of a robot, by the robot's id, and `controls` who has control of each."""

    widgets: Mapping[str, Attributes]
    without_control: Mapping[str, Mapping[str, Attributes]]
    controls: Mapping[str, ControlView]


NO_SHARED: Final = SharedWidgets({}, {}, {})
