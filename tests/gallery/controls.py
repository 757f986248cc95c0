"""Controls, inputs and alarms in each of their states."""

from typing import Any, Final

from app.cell.alarms.shown import PRIORITY_WORDS
from app.records.entry import OutcomeCode
from app.system.texts import TextLike, number, say, time_of_day
from tests.gallery import texts
from tests.gallery.examples import (
    ACTION,
    AT,
    BEFORE,
    CALL,
    CALLED,
    ENABLED,
    FREE,
    HELD,
    HOLD,
    LET_GO,
    LOCKED,
    LOCKED_BY_TWO,
    LONG,
    NOT_LIVE,
    NOTHING,
    PRESSED,
    PUBLISH,
    REFUSED,
    REQUESTED,
    REST,
    RUNS,
    Example,
    Table,
    Texts,
)

# Keys, holds, calls, actions, steps and joysticks in each of their states.

ROLES: Final = (
    Example("start", "publish", PUBLISH | {"label": texts.START.table, "role": "start"}, FREE),
    Example("stop", "publish", PUBLISH | {"label": texts.STOP.table, "role": "stop"}, FREE),
    Example("reset", "publish", PUBLISH | {"label": texts.RESET.table, "role": "reset"}, FREE),
    Example(
        "toggle",
        "publish",
        PUBLISH | {"label": texts.LIGHT.table, "role": "toggle", "icon": "lightbulb"},
        FREE,
    ),
    Example("neutral", "publish", PUBLISH, FREE),
    Example("hold", "hold", HOLD, FREE | LET_GO, marks=ENABLED),
)
SENT: Final[tuple[OutcomeCode, TextLike]] = ("published", say("published", topic="/operation", time=AT))
KEYS: Final = (
    Example("pressed", "publish", PUBLISH, FREE, marks=PRESSED),
    Example("answered", "publish", PUBLISH, FREE, receipt=SENT),
    Example("refused", "publish", PUBLISH, FREE, receipt=REFUSED),
    Example("locked", "publish", PUBLISH, LOCKED),
    Example("locked by several", "publish", PUBLISH | {"interlock": ["door", "auto"]}, LOCKED_BY_TWO),
    Example("locked, black", "publish", PUBLISH | {"label": texts.STOP.table, "role": "stop"}, LOCKED),
    Example(
        "called",
        "call",
        CALL,
        CALLED | {"busy": True, "result": say("call_waiting")},
        marks=PRESSED,
    ),
    Example(
        "succeeded",
        "call",
        CALL,
        CALLED | {"outcome": "succeeded", "result": say("call_succeeded", time=AT)},
    ),
    Example("rejected, long", "call", CALL, CALLED | {"outcome": "rejected", "result": LONG}),
    Example("hold asked", "hold", HOLD, FREE | LET_GO, marks=REQUESTED),
    Example(
        "held", "hold", HOLD, FREE | {"held": True, "holding": say("hold_since", time=AT)}, marks=HELD
    ),
    Example("hold locked", "hold", HOLD, LOCKED | LET_GO),
)
HALFWAY: Final[Table] = {
    "progress": 0.62,
    "doing": say("goal_state_percent", state=say("goal_state_executing"), percent=62),
}
ACTIONS: Final = (
    Example("free", "action", ACTION, CALLED),
    Example("runs", "action", ACTION, LOCKED | REST | RUNS | HALFWAY),
    Example("runs, not known how far", "action", ACTION, LOCKED | REST | RUNS),
    Example(
        "canceled",
        "action",
        ACTION,
        CALLED | {"outcome": "canceled", "result": say("goal_canceled", time=AT)},
    ),
    Example("locked", "action", ACTION, LOCKED | REST),
    Example("refused", "action", ACTION, CALLED, receipt=REFUSED),
)
STEP: Final[Table] = PUBLISH | {
    "label": texts.BELT_SPEED.table,
    "message": {"data": "{value}"},
    "value": {"topic": "/speed", "type": "std_msgs/msg/Float32"},
    "min": 0,
    "max": 250,
    "step": 10,
    "unit": "mm/s",
}
STEPPED: Final[Table] = CALLED | {
    "state": "live",
    "text": "120",
    "note": "",
    "step_up": "130",
    "step_down": "110",
}
MOVED: Final[tuple[OutcomeCode, TextLike]] = (
    "refused",
    say("refused", time=AT, why=say("step_value_changed", label=texts.BELT_SPEED.shown, value="130")),
)
STEPS: Final = (
    Example("free", "step", STEP, STEPPED),
    Example("at its limit", "step", STEP, STEPPED | {"text": "250", "step_up": ""}),
    Example("locked", "step", STEP, STEPPED | LOCKED),
    Example(
        "sent, waiting",
        "step",
        STEP,
        STEPPED | {"enabled": False, "reason": say("press_in_progress")},
    ),
    Example(
        "done",
        "step",
        STEP,
        STEPPED | {"outcome": "confirmed", "result": say("confirmed", topic="/speed", time=AT)},
    ),
    Example("refused", "step", STEP, STEPPED, receipt=MOVED),
    *(
        Example(
            state,
            "step",
            STEP,
            STEPPED
            | LOCKED
            | {"state": state, "reason": note, "note": note, "step_up": "", "step_down": ""}
            | ({} if state == "old" else {"text": "—"}),
        )
        for state, note in NOT_LIVE.items()
    ),
)
SWITCH: Final[Table] = {
    "label": texts.LIGHT.table,
    "service": "/light",
    "type": "std_srvs/srv/SetBool",
    "on_request": {"data": True},
    "off_request": {"data": False},
    "reported": {"topic": "/light_is_on", "type": "std_msgs/msg/Bool"},
    "interlock": "automatic",
}
SWITCHED: Final[Table] = STEPPED | {"note": "", "at": "on", "text": say("on"), "awaited": ""}
UNKNOWN_AT: Final[Table] = {"at": "", "text": say("condition_unknown")}
SWITCHES: Final = (
    Example("on", "switch", SWITCH, SWITCHED),
    Example("off", "switch", SWITCH, SWITCHED | {"at": "off", "text": say("off")}),
    Example("locked", "switch", SWITCH, SWITCHED | LOCKED),
    Example(
        "sent, waiting",
        "switch",
        SWITCH,
        SWITCHED
        | {"enabled": False, "reason": say("press_in_progress"), "busy": True, "awaited": "off"}
        | {"result": say("confirmation_waiting", topic="/light_is_on")},
    ),
    Example(
        "not reported",
        "switch",
        SWITCH,
        SWITCHED
        | {
            "outcome": "unknown",
            "result": say("confirmation_missing", topic="/light_is_on", seconds="2"),
        },
    ),
    *(
        Example(state, "switch", SWITCH, SWITCHED | UNKNOWN_AT | {"state": state, "note": note})
        for state, note in NOT_LIVE.items()
    ),
)
JOYSTICK: Final[Table] = {
    "label": texts.DRIVE.table,
    "topic": "/cmd_vel",
    "type": "geometry_msgs/msg/Twist",
    "interlock": "automatic",
}
STICK: Final[Texts] = ENABLED | {'data-kind="joystick"': 'data-kind="joystick" data-hold="held"'}
MOVES: Final[Texts] = {
    'data-axis="y">': 'data-axis="y">0.25 m/s',
    'data-axis="x">': 'data-axis="x">−0.40 rad/s',
}
JOYSTICKS: Final = (
    Example("free", "joystick", JOYSTICK, FREE | LET_GO, marks=ENABLED),
    Example("held", "joystick", JOYSTICK, FREE | {"held": True, "holding": ""}, marks=STICK | MOVES),
    Example("square", "joystick", JOYSTICK | {"shape": "square"}, FREE | LET_GO, marks=ENABLED),
    Example("locked", "joystick", JOYSTICK, LOCKED | LET_GO),
)


# Inputs, parameters and static parts in each of their states.

NUMBER: Final[Table] = {"label": texts.SPEED.table, "unit": "mm/s", "min": 10, "max": 250}
LIMITS: Final[Table] = {"limits": say("limits", low="10", high="250", unit=" mm/s", step="1")}
SELECT: Final[Table] = {
    "label": texts.PROGRAM.table,
    "options": [{"value": 12, "label": texts.BOXES.table}],
}
INPUTS: Final = (
    Example("empty", "text", {"label": texts.ORDER.table}),
    Example("filled", "text", {"label": texts.ORDER.table, "default": "4711"}),
    Example("select", "select", SELECT),
    Example("empty", "number", NUMBER, LIMITS),
    Example("filled", "number", NUMBER, LIMITS, entered=120),
    Example("out of limits", "number", NUMBER, LIMITS, entered=400),
    Example("slider", "slider", NUMBER, LIMITS, entered=120),
    Example("off", "toggle", {"label": texts.WRAPPER.table}),
    Example("on", "toggle", {"label": texts.WRAPPER.table}, entered=True),
)
PARAMETER: Final[Table] = {
    "label": texts.BELT_SPEED.table,
    "node": "/controller",
    "parameter": "speed",
    "type": "double",
    "unit": "mm/s",
}
READABLE: Final[Table] = CALLED | {
    "state": "live",
    "text": number("120.5", "mm/s"),
    "note": say("parameter_read", time=BEFORE),
    "hint": "",
    "limits": say("limits_both", low="10", high="250", unit=" mm/s"),
    "settable": True,
    "askable": True,
    "entry": "120.5",
    "bounds": {"min": "10", "max": "250", "step": "any"},
}
ABSENT: Final[Table] = READABLE | LOCKED | {"text": "—", "entry": "", "askable": False}
OFF_LIMITS: Final[tuple[OutcomeCode, TextLike]] = (
    "refused",
    say(
        "refused",
        time=AT,
        why=say(
            "input_outside_limits", label=texts.BELT_SPEED.shown, given="300", limits=READABLE["limits"]
        ),
    ),
)
PARAMETERS: Final = (
    Example(
        "waiting",
        "parameter",
        PARAMETER,
        ABSENT | {"state": "waiting", "note": say("parameter_waiting_for_node", node="/controller")},
    ),
    Example("live", "parameter", PARAMETER, READABLE),
    Example(
        "old",
        "parameter",
        PARAMETER,
        READABLE | {"state": "old", "note": say("parameter_read_before_disconnect", time=BEFORE)},
    ),
    Example(
        "missing",
        "parameter",
        PARAMETER,
        ABSENT | {"state": "missing", "note": say("parameter_not_declared", node="/controller")},
    ),
    Example("locked", "parameter", PARAMETER, READABLE | LOCKED),
    Example("refused", "parameter", PARAMETER, READABLE, 300, OFF_LIMITS),
    Example("set by another only", "parameter", PARAMETER, READABLE | {"settable": False}),
)
STATIC: Final = (
    Example("label", "label", {"label": texts.ORDER_NOTE.table}),
    Example("large label", "label", {"label": texts.PALLETIZING.table, "size": "large"}),
    Example("small label", "label", {"label": texts.RIBBON.table, "size": "small"}),
    Example("link", "link", {"label": texts.SETUP.table, "page": "setup", "icon": "settings"}),
    Example("image", "image", {"label": texts.BOX.table, "src": "box.svg"}),
)


# Alarms in the gallery.

NO_LINE: Final[Table] = {"line": None, "standing": 0, "active": 0, "unacknowledged": 0}
STATES: Final = (
    ("active", False, "alarm_state_active_unacknowledged", "acknowledge"),
    ("latched", True, "alarm_state_latched", "reset"),
    ("unknown", True, "alarm_state_unknown", ""),
)
LABELS: Final = {
    "acknowledge": say("alarm_acknowledge"),
    "reset": say("alarms_reset"),
    "": "",
}


def _row(priority: int) -> dict[str, Any]:
    """The alarm of a priority, with the state of its place in `STATES`."""
    state, acknowledged, word, act = STATES[(priority - 1) % len(STATES)]
    return {
        "id": f"alarm_{priority}",
        "priority": priority,
        "priority_text": say(PRIORITY_WORDS[priority]),
        "known": state != "unknown",
        "occurrence": 1,
        "since_text": time_of_day("14:31:58"),
        "text": texts.AIR_INLET.shown,
        "action": texts.LOOK_IN.shown,
        "state": state,
        "state_text": say(word),
        "acknowledged": acknowledged,
        "group": texts.GRIPPER.shown,
        "follows_text": "",
        "value_text": number("4.8", "bar"),
        "limit_text": number("5", "bar"),
        "first": priority == 1,
        "acts": ["out_of_service" if priority == 1 else "shelve"],
        "shelf": None,
        "out_of_service": None,
        "act": act,
        "act_text": LABELS[act],
    }


def _line(priority: int) -> Table:
    counts = {"standing": 5, "active": 4, "unacknowledged": 3}
    return {"state": "live", "alarms": {"line": _row(priority), **counts}}


ALARMS: Final = (
    *(
        Example(f"line, priority {priority}", "alarm_line", NOTHING, _line(priority))
        for priority in (1, 2, 3)
    ),
    Example("line, none", "alarm_line", NOTHING, {"state": "live", "alarms": NO_LINE}),
    Example(
        "list",
        "alarm_list",
        {"label": texts.AIR_INLET.table},
        {
            "state": "live",
            "alarms": {
                "rows": [_row(priority) for priority in (1, 2, 3, 4)],
                "more": say("alarms_more", count=number("12")),
                "below": [],
            },
        },
    ),
    Example(
        "list, none",
        "alarm_list",
        {"label": texts.AIR_INLET.table},
        {"state": "live", "alarms": {"rows": [], "more": "", "below": []}},
    ),
)
