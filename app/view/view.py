"""The view: the state that pages and events show. Pure, from (panel, robot, time).

A view has JSON values, and texts (`i18n`) where a person reads; these are rendered for each language in
use when an event or a page is sent. The browser sets texts and attributes and composes none.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple, TypedDict

from app.alarms.shown import NO_ALARMS, AlarmsView
from app.i18n import Text, TextLike, joined, say
from app.panel.model import Panel
from app.panel.needs import NO_NEEDS, PanelNeeds
from app.panel.widgets.families import BaseWidget, Command, DisplayWidget
from app.permission.confirmations import UNKNOWN_USERS, ConfirmLocks
from app.permission.control_authority_view import NO_CONTROL, ControlView, for_role
from app.permission.interlocks import interlock_verdict, link_verdict
from app.permission.press_permission import NO_CONDITIONS, ServerConditions, permissions
from app.permission.role_locks import hardest, role_reason
from app.permission.verdict import PERMITTED, Verdict
from app.robot.state import RobotState
from app.view.audience import Audience
from app.view.kinds import Attributes, AttributesUntil, Enabled, attributes_of, enabled
from app.view.link_status import Lamp, LinkStatus, link_statuses, summary
from app.view.robot_state import UNKNOWN, RobotWord, robot_word

RETRY_S: Final = 1.0  # after which a widget that can't be shown is tried again
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

    @property
    def until(self) -> float:
        """When time alone changes the view."""
        return min(self.rest, *self.displays.values()) if self.displays else self.rest


class ViewContext(NamedTuple):
    """What a view shows beside the panel and the state of its robot.

    `robots` has the lamp of each robot if the panel has several. `fault` is shown above the page,
    `log_lock` locks all commands; "" for none. `control_lock` locks for clients without control; time
    alone changes `control` at `control_until` (monotonic seconds). `inhibited` has the locks by alarms,
    by the widgets' ids, `confirm_locks` those of presses that nobody can confirm.
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


ALONE: Final = ViewContext()  # one robot, its log is written, and control is not required


def build_view(
    panel: Panel, robot: RobotState, now: float, context: ViewContext = ALONE
) -> ViewWithDeadlines:
    """The view at `now` (monotonic seconds)."""
    passable = link_verdict(robot, now)
    interlocks = {i.id: interlock_verdict(i, robot, now, passable) for i in panel.every_interlock}
    grounds = NO_CONDITIONS
    if context.log_lock or context.inhibited or context.confirm_locks is not UNKNOWN_USERS:
        grounds = ServerConditions(
            log_lock=context.log_lock,
            inhibited=context.inhibited,
            confirm_locks=context.confirm_locks,
        )
    verdicts = permissions(panel, robot, now, passable, interlocks, grounds)
    failures: dict[str, Exception] = {}
    uniform = _uniform(panel, robot, now, verdicts, failures)
    widgets = {
        w.id: uniform.get(w.id) or _show(w, robot, now, verdicts.get(w.id, PERMITTED), failures)
        for w in panel.widgets()
    }
    link, until = link_statuses(panel, robot, passable, verdicts, now)
    banner = say("simulated") if context.simulated or robot.graph.is_simulated else ""
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
        why = joined((reason, panel.stop_hint)) if widget in stops else reason
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
            widgets[name] = _locked(widgets[name], role_reason(hardest(unmet)))
    return {**view, "widgets": widgets}


def _locked(attributes: Attributes, reason: TextLike) -> Attributes:
    """The attributes of a command that this client may not press, whatever the robot permits."""
    overlay = {"enabled": False, "reason": reason, "reasons": reason, "more": ""}
    overlay |= {"stoppable": False, "askable": False}
    return {name: overlay.get(name, value) for name, value in attributes.items()}


def _embedded(attributes: Attributes) -> Attributes:
    """The attributes of a widget on a page that may only show."""
    return _locked(attributes, say("page_embedded"))
