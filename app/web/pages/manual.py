"""The manual of a panel: all that its file says about controls, locks and alarms, as one printable page
that needs no server."""

import json
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.cell.alarms.shown import PRIORITY_WORDS
from app.cell.permission.conditions import need
from app.cell.permission.roles import role_name
from app.panel.alarm import Alarm
from app.panel.condition import Condition, Interlock
from app.panel.model import Panel
from app.panel.widgets.families import BaseWidget, Command
from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.key_parts import ConfirmationKeys, confirmation_of
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.parts import parts_of
from app.panel.widgets.templated import is_stop, needs_control
from app.ros.messages import Interfaces
from app.system.texts import Text, TextLike, joined, number, render, say

TEMPLATE: Final = "manual.html"
# What a command does to an endpoint of the robot, by the role of that.
SENT: Final = {"MS": "manual_publishes", "SS": "manual_calls", "AS": "manual_goal"}
# The headings of the template.
WORDS: Final = (
    "manual_title",
    "manual_about",
    "manual_file",
    "manual_made",
    "manual_contents",
    "manual_modes",
    "manual_states",
    "manual_interlocks",
    "manual_conditions",
    "manual_recipe_sets",
    "manual_alarms",
    "manual_is_stop",
    "manual_sends",
    "manual_only_while",
    "manual_locked_by",
    "manual_shown",
    "manual_needed",
    "manual_locked",
    "lock_to_do",
    "alarms_priority",
    "manual_raised",
    "alarms_cause",
    "alarms_consequence",
    "alarms_action",
    "manual_locks",
)
IMAGES: Final = {
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".webp": "image/webp",
}


class ManualLock(NamedTuple):
    """An interlock or another condition. `steps` are what to do, `picture` a `data:` address."""

    id: str
    name: TextLike
    value: TextLike
    need: TextLike
    said: TextLike
    steps: Sequence[str]
    picture: str


class ManualControl(NamedTuple):
    """A control: what it `sends`, a line each, with the `fields` of each message; `notes` say how it is
    pressed, `locks` are ids and names of its interlocks, `alarms` of those that lock it."""

    id: str
    label: TextLike
    sends: Sequence[TextLike]
    fields: Sequence[str]
    notes: Sequence[TextLike]
    locks: Sequence[tuple[str, TextLike]]
    alarms: Sequence[tuple[str, TextLike]]


class ManualPage(NamedTuple):
    """A page, the frame or the page of recipes; `shown` are the labels of all but controls."""

    title: TextLike
    role: TextLike
    controls: Sequence[ManualControl]
    shown: Sequence[TextLike]


class ManualAlarm(NamedTuple):
    """An alarm; `raised` says when, `locks` are the labels of the controls that it locks."""

    id: str
    text: TextLike
    priority: TextLike
    raised: TextLike
    cause: TextLike
    consequence: TextLike
    action: TextLike
    picture: str
    locks: Sequence[TextLike]


class ManualState(NamedTuple):
    """A state of the machine."""

    text: TextLike
    is_stop: bool


def manual_context(
    panel: Panel, interfaces: Interfaces, file: Path, digest: str, now: TextLike, language: str
) -> dict[str, Any]:
    """The variables of the template. `digest` is the SHA-256 of the panel file, `now` the time."""
    return {
        "say": say,
        "words": {code: say(code) for code in WORDS},
        "panel": panel,
        "file": file.name,
        "digest": digest,
        "now": now,
        "pages": list(_pages(panel, interfaces)),
        "interlocks": [_lock(panel, lock, language) for lock in panel.interlocks],
        "conditions": [_lock(panel, each, language) for each in panel.own_conditions],
        "alarms": [_alarm(panel, alarm) for alarm in panel.alarms],
        "states": list(_states(panel)),
        "modes": list(_modes(panel)),
        "recipes": [
            (each.label, [_label(panel, name) for name in each.fields]) for each in panel.recipes
        ],
    }


def _pages(panel: Panel, interfaces: Interfaces) -> Iterator[ManualPage]:
    seen: set[str] = set()

    def page_of(title: TextLike, role: str | None, widgets: Sequence[BaseWidget]) -> ManualPage:
        own = [widget for widget in widgets if widget.id not in seen]
        seen.update(widget.id for widget in own)
        commands = [widget for widget in own if isinstance(widget, Command)]
        shown = [widget.label for widget in own if not isinstance(widget, Command)]
        controls = [_control(panel, interfaces, command) for command in commands]
        return ManualPage(title, role_name(role) if role else "", controls, shown)

    for page in panel.pages:
        yield page_of(page.title, page.needs, page.widgets)
    for title, widgets in (
        (say("manual_frame"), panel.frame.widgets),
        (say("manual_recipes"), panel.recipe_loads),
    ):
        made = page_of(title, None, widgets)
        if made.controls:
            yield made


def _control(panel: Panel, interfaces: Interfaces, command: Command) -> ManualControl:
    sends = [
        say(SENT[role], name=name)
        for part in parts_of(command)
        for role, name in part.endpoints()
        if role in SENT and not isinstance(part, Parameter)
    ]
    if isinstance(command, Parameter):
        sends = [say("manual_sets", name=command.parameter, node=command.node)]
    messages = [sent for sent in command.sent_messages(interfaces) if sent.type_name]
    return ManualControl(
        command.id,
        command.label,
        list(dict.fromkeys(sends)),
        [f"{sent.type_name} {_as_json(sent.fields)}" for sent in messages],
        list(_notes(panel, command)),
        [(lock.id, lock.name) for lock in panel.interlocks_of(command)],
        [(alarm.id, _text(alarm)) for alarm in panel.alarms if command.id in _inhibited(alarm)],
    )


def _as_json(fields: Mapping[str, Any]) -> str:
    return json.dumps(fields, ensure_ascii=False, default=str)


def _notes(panel: Panel, command: Command) -> Iterator[TextLike]:
    """How it is pressed, and by whom."""
    if isinstance(command, HoldCommand):
        yield say("manual_hold")
    if is_stop(command):
        yield say("manual_stop")
    if panel.control.required and not needs_control(command):
        yield say("manual_without_control")
    confirmation = confirmation_of(command)
    if confirmation == "pin":
        yield say("manual_pin")
    elif confirmation == "two_persons":
        yield say("manual_two_persons")
    elif isinstance(command, ConfirmationKeys) and command.asks:
        yield say("manual_asks")
    if isinstance(command, ConfirmationKeys) and command.consequence:
        yield command.consequence
    if command.needs:
        yield say("manual_role", role=role_name(command.needs))


def _inhibited(alarm: Alarm) -> set[str]:
    """The ids of the controls that it locks, of any robot."""
    return {name.rpartition("/")[2] for name in alarm.inhibits}


def _lock(panel: Panel, condition: Condition, language: str) -> ManualLock:
    own = condition if isinstance(condition, Interlock) else None
    advice = own.advice if own else condition.action or ""
    picture = render(own.help.picture, language) if own and own.help.picture else ""
    return ManualLock(
        getattr(condition, "id", ""),
        condition.name,
        f"{condition.topic} {condition.field}".strip(),
        need(condition),
        (own.locked if own else None) or "",
        render(advice, language).splitlines(),
        picture_address(panel, picture),
    )


def picture_address(panel: Panel, name: str) -> str:
    """A picture of the panel as a `data:` address; "" without one."""
    file = panel.shown_pictures.get(name)
    if file is None:
        return ""
    return f"data:{IMAGES[file.suffix]};base64,{b64encode(file.read_bytes()).decode()}"


def _text(alarm: Alarm) -> TextLike:
    return alarm.text or alarm.id


def _alarm(panel: Panel, alarm: Alarm) -> ManualAlarm:
    first, second = alarm.priorities
    levels = [first, second] if alarm.critical_priority or alarm.diagnostics else [first]
    return ManualAlarm(
        alarm.id,
        _text(alarm),
        joined([say(PRIORITY_WORDS[level]) for level in levels], "between_names"),
        joined(list(_raised(alarm)), "between_sentences"),
        alarm.cause or "",
        alarm.consequence or "",
        alarm.action or "",
        picture_address(panel, alarm.picture or ""),
        [_label(panel, name) for name in sorted(_inhibited(alarm))],
    )


def _raised(alarm: Alarm) -> Iterator[TextLike]:
    """When it is raised."""
    for key, limit in alarm.limits.items():
        code = "manual_below" if key.startswith("low") else "manual_above"
        yield say(code, limit=number(f"{limit:g}", alarm.unit))
    if alarm.when is not None:
        yield say("manual_when", name=alarm.when.name, need=need(alarm.when))
    if alarm.source not in ("limits", "condition"):
        yield say("manual_reported", source=alarm.topic_name or alarm.node or alarm.lost or "")


def _states(panel: Panel) -> Iterator[ManualState]:
    rules = panel.state
    for state in rules.states if rules else ():
        yield ManualState(state.text, rules is not None and state.value in rules.stop_values)


def _modes(panel: Panel) -> Iterator[Text]:
    """Who may press, and what is asked of them."""
    yield say("manual_control" if panel.control.required else "manual_no_control")
    if panel.control.required:
        yield say("manual_takeover", seconds=number(f"{panel.control.takeover_after_s:g}"))


def _label(panel: Panel, name: str) -> TextLike:
    return next((widget.label for widget in panel.widgets() if widget.id == name), name)
