"""What the page shows: pure, from (panel, robot, time); the same for HTML and for events.

A view is plain JSON values; the browser puts texts and attributes where they belong and composes
nothing.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple, TypedDict

from app.i18n import say
from app.panel.input_values import limits
from app.panel.model import Display, Input, Panel, Pressed
from app.panel.widgets.displays import Readout
from app.panel.widgets.hold import Hold
from app.panel.widgets.inputs import Numeric
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.publish import Publish
from app.panel.widgets.service_action import Action, Call
from app.permission.clients import Browser
from app.permission.control_authority_view import NO_CONTROL, ControlView
from app.permission.interlocks import Verdict, command_verdict, interlock_verdict, way
from app.robot.command_status import IDLE, Progress
from app.robot.state import Robot
from app.view.display_values import indicator, readout
from app.view.link_status import Lamp, LinkLamp, lamps, summary
from app.view.parameter_values import parameter


class Enabled(TypedDict):
    enabled: bool
    reason: str | None


class Notice(TypedDict):
    """What stands above everything; "" where there is nothing to say."""

    banner: str
    fault: str


class View(TypedDict):
    """Everything that can change on a page; `widgets` has the attributes of each by its id, `robots`
    the lamp of each where there are several."""

    link: dict[str, LinkLamp]
    interlocks: dict[str, Enabled]
    widgets: dict[str, dict[str, Any]]
    notice: Notice
    robots: dict[str, Lamp]
    control: ControlView


Shown = Input | Pressed | Hold | Display

NO_OTHERS: Final[Mapping[str, Lamp]] = {}


class Sight(NamedTuple):
    """A view, the robot's lamp on the pages of others, and when (monotonic seconds) time alone would
    change what the displays show, by their ids, and the `rest`."""

    view: View
    robot: Lamp
    rest: float
    displays: Mapping[str, float]

    @property
    def until(self) -> float:
        """When time alone would change it."""
        return min(self.rest, *self.displays.values()) if self.displays else self.rest


def sight(
    panel: Panel,
    robot: Robot,
    now: float,
    *,
    robots: Mapping[str, Lamp] = NO_OTHERS,
    simulated: bool = False,
    fault: str = "",
    lock: str = "",
    control: ControlView = NO_CONTROL,
    control_until: float = math.inf,
) -> Sight:
    """The view at `now` (monotonic seconds); `fault` stands above it, for `lock` nothing can be
    pressed, where they are not "". Time alone would change `control` at `control_until`."""
    passable = way(robot, now)
    interlocks = {i.id: interlock_verdict(i, robot, now) for i in panel.interlocks}
    verdicts = {
        w.id: command_verdict(w, passable, [interlocks[i] for i in w.interlocks], robot, now)
        for w in panel.commands
    }
    told = {w: Verdict(False, "log", lock) for w in verdicts} if lock else verdicts
    displays = {w.id: displayed(w, robot, now) for w in panel.displays}
    link, until = lamps(panel, robot, passable, told, now)
    banner = say("simulated") if simulated or robot.graph.simulated else ""
    view = View(
        link=link,
        interlocks={i: enabled(verdict) for i, verdict in interlocks.items()},
        widgets={
            w.id: displays[w.id][0] if w.id in displays else _shown(w, robot, told)
            for w in panel.widgets()
        },
        notice=Notice(banner=banner, fault=fault),
        robots=dict(robots),
        control=control,
    )
    judged = (passable, *interlocks.values(), *verdicts.values())
    rest = min(until, control_until, *(verdict.until for verdict in judged))
    return Sight(view, summary(robot.name, link), rest, {w: at for w, (_, at) in displays.items()})


def refreshed(seen: Sight, displays: Iterable[Display], robot: Robot, now: float) -> Sight:
    """The same with these displays as of `now`, where nothing else has changed."""
    widgets, untils = dict(seen.view["widgets"]), dict(seen.displays)
    for widget in displays:
        widgets[widget.id], untils[widget.id] = displayed(widget, robot, now)
    return Sight({**seen.view, "widgets": widgets}, seen.robot, seen.rest, untils)


def displayed(widget: Display, robot: Robot, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a display, and when time alone would change them."""
    if isinstance(widget, Readout):
        return readout(widget, robot, now)
    return indicator(widget, robot, now)


def _shown(widget: Shown, robot: Robot, verdicts: Mapping[str, Verdict]) -> dict[str, Any]:
    """The attributes of a widget that is no display."""
    match widget:
        case Numeric():
            return {"limits": limits(widget)}
        case Publish() | Call() | Action() | Parameter():
            return {**_lock(widget, verdicts[widget.id]), **_came(widget, robot)}
        case Hold():
            holding = robot.held.get(widget.id, "")
            return {**_lock(widget, verdicts[widget.id]), "held": bool(holding), "holding": holding}
    return {}


def _came(widget: Pressed, robot: Robot) -> dict[str, Any]:
    """What came of a press, and what a parameter is."""
    if isinstance(widget, Publish) and not widget.confirm:
        return {}
    came = progress(robot.progress.get(widget.id, IDLE))
    return came | parameter(widget, robot) if isinstance(widget, Parameter) else came


def as_seen_by(view: View, browser: Browser) -> View:
    """The view as a page shows it: without control what can be pressed is locked, unless there is no
    way to the robot at all. Pages with scripts do the same to what events bring."""
    control = view["control"]
    mine = browser.id and browser.id == control["holder"]
    if not control["required"] or mine or view["link"]["bridge"]["state"] != "ok":
        return view
    lock = {"enabled": False, "reason": control["text"], **_told([control["text"]])}
    widgets = {w: {**a, **{k: lock[k] for k in a.keys() & lock}} for w, a in view["widgets"].items()}
    return {**view, "widgets": widgets}


def enabled(verdict: Verdict) -> Enabled:
    return {"enabled": verdict.permitted, "reason": verdict.reason}


def _lock(widget: Pressed | Hold, verdict: Verdict) -> dict[str, Any]:
    """Attributes of a control; one with several interlocks tells all reasons."""
    several = _told(verdict.reasons) if len(widget.interlocks) > 1 else {}
    return {**enabled(verdict), **several}


def _told(reasons: Sequence[str]) -> dict[str, str]:
    """`reasons` are all, a line each, and `more` says how many there are beside the first."""
    more = say("more_reasons", number=len(reasons) - 1) if len(reasons) > 1 else ""
    return {"reasons": "\n".join(reasons), "more": more}


def progress(of: Progress) -> dict[str, Any]:
    """Attributes of a call or an action: `progress` from 0 to 1, None where it is not known; `goal`
    is the state of an action's goal as ROS names it, `press` the id of the press that a cancel is for,
    both "" where there is none."""
    return {
        "busy": of.busy,
        "outcome": of.outcome,
        "result": of.text,
        "progress": of.fraction,
        "stoppable": of.stoppable,
        "goal": of.goal,
        "press": of.press,
    }
