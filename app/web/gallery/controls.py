"""Keys, holds, calls, actions, steps and joysticks in each of their states."""

from typing import Final

from app.i18n import TextLike, say
from app.robot.command_status import OutcomeCode
from app.web.gallery import texts
from app.web.gallery.examples import (
    ACTION,
    AT,
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
