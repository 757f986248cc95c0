"""What the page shows: pure, from (panel, robot, time); the same for HTML and for events.

A view is plain JSON values; the browser puts texts and attributes where they belong and composes
nothing.
"""

import math
import time
from dataclasses import dataclass
from typing import Any, Final, Literal, TypedDict

from app.interlocks import Verdict, interlock_verdict, press_verdict, way
from app.panel.model import Action, Call, Panel, Publish, Readout, TextInput
from app.progress import IDLE, Progress
from app.robot import Robot, value_of
from app.sentences import age, say

LONGEST_TEXT: Final = 200  # characters of a value that a readout shows


class Lamp(TypedDict):
    """One part of the way to the robot: `state` is "ok", "wait" or "bad"."""

    name: str
    state: Literal["ok", "wait", "bad"]
    text: str


class Enabled(TypedDict):
    enabled: bool
    reason: str | None


class Notice(TypedDict):
    """What stands above everything; "" where there is nothing to say."""

    banner: str
    fault: str


class View(TypedDict):
    """Everything that can change on a page; `widgets` has the attributes of each by its id."""

    link: dict[str, Lamp]
    interlocks: dict[str, Enabled]
    widgets: dict[str, dict[str, Any]]
    notice: Notice


@dataclass(frozen=True, slots=True)
class Sight:
    """A view, and when (monotonic seconds) time alone would change it."""

    view: View
    until: float


def sight(panel: Panel, robot: Robot, now: float, *, simulated: bool = False, fault: str = "") -> Sight:
    """The view at `now` (monotonic seconds); `fault` is of a panel file that could not be loaded."""
    untils = [math.inf]

    def noted(verdict: Verdict) -> Verdict:
        untils.append(verdict.until)
        return verdict

    passable = noted(way(robot, now))
    interlocks = {i.id: noted(interlock_verdict(i, robot, now)) for i in panel.interlocks}
    widgets: dict[str, dict[str, Any]] = {}
    for widget in panel.widgets():
        match widget:
            case TextInput():
                widgets[widget.id] = {}
            case Publish() | Call() | Action():
                interlock = panel.interlock(widget.interlock)
                verdict = noted(press_verdict(widget, interlock, robot, now))
                widgets[widget.id] = {**enabled(verdict)}
                if not isinstance(widget, Publish):
                    widgets[widget.id] |= progress(robot.progress.get(widget.id, IDLE))
            case Readout():
                widgets[widget.id], until = readout(widget, robot, now)
                untils.append(until)
    view = View(
        link=lamps(panel, robot, passable),
        interlocks={i: enabled(verdict) for i, verdict in interlocks.items()},
        widgets=widgets,
        notice=Notice(
            banner=say("simulated") if simulated or robot.graph.simulated else "", fault=fault
        ),
    )
    return Sight(view, min(untils))


def enabled(verdict: Verdict) -> Enabled:
    return {"enabled": verdict.permitted, "reason": verdict.reason}


def progress(of: Progress) -> dict[str, Any]:
    """Attributes of a call or an action: `progress` from 0 to 1, None where it is not known."""
    return {
        "busy": of.busy,
        "outcome": of.outcome,
        "result": of.text,
        "progress": of.fraction,
        "stoppable": of.stoppable,
    }


def readout(widget: Readout, robot: Robot, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a readout: `state` is "waiting", "live", "old" or "unreadable"."""
    topic = widget.topic
    found = robot.graph.wrong_type("MS", robot.key(topic), widget.type)
    if found:
        note = say("wrong_type", topic=topic, found=found, wanted=widget.type)
        return shown("unreadable", "—", note)
    if robot.graph.unheard(robot.key(topic)):
        return shown("unreadable", "—", say("unheard", topic=topic))
    reading = robot.reading(topic)
    if reading.status == "waiting":
        return shown("waiting", "—", say("readout_waiting", topic=topic))
    if reading.status == "unreadable":
        return shown("unreadable", "—", say("readout_unreadable", topic=topic, wanted=widget.type))
    if reading.message is None:
        return shown("waiting", "—", say("readout_waiting", topic=topic))
    text = written(value_of(reading.message, widget.field))
    if reading.status == "cut":
        return shown("old", text, say("readout_cut", time=clock(reading.wall)))
    if widget.max_age_s is None:
        return shown("live", text, say("readout_time", time=clock(reading.wall)))
    old = now - reading.at
    if old < widget.max_age_s:
        note = say("readout_time", time=clock(reading.wall))
        return shown("live", text, note, reading.at + widget.max_age_s)
    step = 1 if old < 60 else 60
    return shown("old", text, say("readout_old", age=age(old)), reading.at + (old // step + 1) * step)


def shown(state: str, text: str, note: str, until: float = math.inf) -> tuple[dict[str, Any], float]:
    return {"state": state, "text": text, "note": note}, until


def written(value: Any) -> str:
    """A field's value as text, cut to what a readout can show; None is a value that is not there."""
    if value is None:
        return "—"
    if isinstance(value, bool):
        return "true" if value else "false"
    text = _number(value) if isinstance(value, float) else str(value)
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 1] + "…"


def _number(value: float) -> str:
    """Six digits where they are enough: a float32's 0.1 is not 0.10000000149011612."""
    return f"{value:.6g}" if 1e-4 <= abs(value) < 1e6 else repr(value)


def clock(wall: float) -> str:
    """The time of day in the server's zone."""
    return time.strftime("%H:%M:%S", time.localtime(wall))


def lamps(panel: Panel, robot: Robot, passable: Verdict) -> dict[str, Lamp]:
    """The three lights: the server is "ok" wherever it says so itself."""
    bridge: dict[str, tuple[Literal["ok", "wait", "bad"], str]] = {
        "no_link": ("bad", "lost"),
        "no_bridge": ("bad", "absent"),
        "bridge_silent": ("bad", "silent"),
        "joining": ("wait", "pending"),
        "permitted": ("ok", "ok"),
    }
    state, text = bridge[passable.code]
    topics = [("MP", t) for t in panel.subscriptions()] + [("MS", t) for t in panel.publications()]
    seen = any(
        robot.graph.on_robot("MP" if role == "MP" else "MS", robot.key(topic)) for role, topic in topics
    )
    node: tuple[Literal["ok", "wait", "bad"], str] = ("ok", "ok") if seen else ("wait", "no_node")
    if state == "bad":
        node = ("bad", "lost")
    return {
        "server": Lamp(name=say("server"), state="ok", text=say("ok")),
        "bridge": Lamp(name=say("bridge"), state=state, text=say(text)),
        "node": Lamp(name=say("robot"), state=node[0], text=say(node[1])),
    }
