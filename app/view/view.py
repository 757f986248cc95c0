"""What the page shows: pure, from (panel, robot, time); the same for HTML and for events.

A view is JSON values and, where a person reads, texts (`i18n`): they are rendered for each language in
use, as an event or as a page. The browser puts texts and attributes where they belong and composes
nothing.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple, TypedDict

from app.i18n import TextLike, say
from app.panel.model import Panel
from app.panel.widgets.families import Display
from app.permission.clients import Client
from app.permission.control_authority_view import NO_CONTROL, ControlView
from app.permission.interlocks import (
    PERMITTED,
    Verdict,
    command_verdict,
    interlock_verdict,
    link_verdict,
)
from app.robot.state import RobotState
from app.view.kinds import Enabled, enabled, show, told
from app.view.link_status import Lamp, LinkStatus, link_statuses, summary


class Notice(TypedDict):
    """What stands above everything; "" where there is nothing to say."""

    banner: TextLike
    fault: TextLike


class View(TypedDict):
    """Everything that can change on a page; `widgets` has the attributes of each by its id, `robots`
    the lamp of each where there are several."""

    link: dict[str, LinkStatus]
    interlocks: dict[str, Enabled]
    widgets: dict[str, dict[str, Any]]
    notice: Notice
    robots: dict[str, Lamp]
    control: ControlView


NO_OTHERS: Final[Mapping[str, Lamp]] = {}


class ViewWithDeadlines(NamedTuple):
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


def build_view(
    panel: Panel,
    robot: RobotState,
    now: float,
    *,
    robots: Mapping[str, Lamp] = NO_OTHERS,
    simulated: bool = False,
    fault: TextLike = "",
    lock: TextLike = "",
    control: ControlView = NO_CONTROL,
    control_until: float = math.inf,
) -> ViewWithDeadlines:
    """The view at `now` (monotonic seconds); `fault` stands above it, for `lock` nothing can be
    pressed, where they are not "". Time alone would change `control` at `control_until`."""
    passable = link_verdict(robot, now)
    interlocks = {i.id: interlock_verdict(i, robot, now) for i in panel.interlocks}
    verdicts = {
        w.id: command_verdict(w, passable, [interlocks[i] for i in w.interlocks], robot, now)
        for w in panel.commands
    }
    locks = {w: Verdict(False, "log", lock) for w in verdicts} if lock else verdicts
    widgets = {w.id: show(w, robot, now, locks.get(w.id, PERMITTED)) for w in panel.widgets()}
    link, until = link_statuses(panel, robot, passable, locks, now)
    banner = say("simulated") if simulated or robot.graph.is_simulated else ""
    view = View(
        link=link,
        interlocks={i: enabled(verdict) for i, verdict in interlocks.items()},
        widgets={name: attributes for name, (attributes, _) in widgets.items()},
        notice=Notice(banner=banner, fault=fault),
        robots=dict(robots),
        control=control,
    )
    untils = {w.id: widgets[w.id][1] for w in panel.displays}
    others = (at for name, (_, at) in widgets.items() if name not in untils)
    judged = (passable, *interlocks.values(), *verdicts.values())
    rest = min(until, control_until, *others, *(verdict.until for verdict in judged))
    return ViewWithDeadlines(view, summary(robot.name, link), rest, untils)


def update_displays(
    seen: ViewWithDeadlines, displays: Iterable[Display], robot: RobotState, now: float
) -> ViewWithDeadlines:
    """The same with these displays as of `now`, where nothing else has changed."""
    widgets, untils = dict(seen.view["widgets"]), dict(seen.displays)
    for widget in displays:
        widgets[widget.id], untils[widget.id] = show(widget, robot, now)
    return ViewWithDeadlines({**seen.view, "widgets": widgets}, seen.robot, seen.rest, untils)


def as_seen_by(view: View, client: Client) -> View:
    """The view as a page shows it: without control what can be pressed is locked, unless there is no
    way to the robot at all. Pages with scripts do the same to what events bring."""
    control = view["control"]
    mine = client.id and client.id == control["holder"]
    if not control["required"] or mine or view["link"]["bridge"]["state"] != "ok":
        return view
    lock = {"enabled": False, "reason": control["text"], **told([control["text"]])}
    widgets = {w: {**a, **{k: lock[k] for k in a.keys() & lock}} for w, a in view["widgets"].items()}
    return {**view, "widgets": widgets}
