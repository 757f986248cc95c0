"""Every sentence that an operator reads, by its code: the one place to translate.

Codes are stable names for tests and logs; `say` fills in what the sentence is about.
"""

import time
from collections.abc import Mapping
from typing import Final

ENGLISH: Final[Mapping[str, str]] = {
    # Why a control is locked.
    "no_link": "No connection to the robot: its bridge can't be reached.",
    "no_bridge": "No connection to the robot: Zenoh answers, but no ROS 2 bridge is there.",
    "no_bridge_of": "No connection to {name}: Zenoh answers, but no ROS 2 bridge of its namespace.",
    "joining": "Joining the robot's topics: a moment.",
    "bridge_silent": "The ROS 2 bridge is connected but does not answer: restart the bridge.",
    "wrong_type": "{topic} is {found} on the robot, but this panel is made for {wanted}.",
    "unheard": "Locked: the bridge does not pass on {topic}. If this stays, restart the bridge.",
    "waiting": "Locked: waiting for {topic}.",
    "cut": "Locked: the connection was cut; waiting for a new {topic}.",
    "stale": "Locked: the last {topic} is older than {limit} s.",
    "no_publisher": "Locked: no node of the robot publishes {topic}.",
    "unreadable": "Locked: {topic} can't be read: what arrives is not {wanted}.",
    "forbidden": "The robot does not permit {name}.",
    # QoS that DDS would not match: the robot's and the panel's.
    "publishes_best_effort": "The robot publishes {topic} best effort; this panel asks for reliable.",
    "publishes_volatile": "The robot publishes {topic} volatile; this panel asks for transient local.",
    "asks_for_reliable": "The robot asks for {topic} reliable; this panel publishes it best effort.",
    "asks_for_transient_local": (
        "The robot asks for {topic} transient local; this panel publishes it volatile."
    ),
    "server_lost": "There is no connection to the panel's server.",
    "server_unsure": "No answer from the panel's server: it is not known whether this was sent.",
    "no_service": "Locked: the robot does not offer {name} now.",
    "busy": "Under way: waiting for the robot.",
    # What came of a call or a goal.
    "waiting_for_answer": "Sent; waiting for the robot's answer.",
    "answered": "Done at {time}",
    "said_no": "The robot said no at {time}",
    "timed_out": "No answer within {seconds} s: it is not known whether the robot did it.",
    "cyclone_hint": " (Services and actions reach only robots on Cyclone DDS.)",
    "call_cut": "The connection was cut while waiting: the robot may have done it.",
    "call_dropped": "The bridge gave no answer for {service}: it is not known whether it was done.",
    "answer_unreadable": "The robot answered, but not with {wanted}: the robot may have done it.",
    "too_many": "too many calls of {service} have had no answer yet",
    "goal_rejected": "The robot rejected the goal at {time}.",
    "goal_accepted": "Accepted at {time}.",
    "goal_executing": "Under way.",
    "goal_canceling": "Being canceled.",
    "goal_succeeded": "Succeeded at {time}",
    "goal_canceled": "Canceled at {time}",
    "goal_aborted": "The robot aborted it at {time}",
    "goal_lost": "The robot no longer knows this goal: what came of it is not known.",
    "goal_cut": "The connection was cut: the robot may still be doing it.",
    "cancel": "Cancel",
    "robots": "Robots",
    "cancel_sent": "The robot was asked to cancel at {time}.",
    "cancel_refused": "The robot did not cancel it at {time}.",
    "nothing_to_cancel": "there is nothing under way to cancel",
    "changed_meanwhile": "it changed while you pressed.",
    "expired": "it took {seconds} s to get here: press again.",
    "ahead": "its time is ahead of the panel's server: load the page again.",
    "seen_on_another": "the page showed another robot.",
    "seen_before_restart": "the panel's server was started anew since the page showed this.",
    # What a readout shows beside or instead of a value.
    "readout_waiting": "waiting for {topic}",
    "readout_cut": "from before the connection was cut, received {time}",
    "readout_old": "{age} old",
    "readout_unreadable": "{topic} can't be read: what arrives is not {wanted}",
    "readout_time": "received {time}",
    "readout_missing": "there is no {field} in what was received {time}",
    # What a lamp shows when no state of its own does.
    "lamp_waiting": "No value yet",
    "lamp_unknown": "Unknown: {value}",
    "lamp_old": "Not known",
    "lamp_unreadable": "Not readable",
    "lamp_missing": "Not there",
    "lamp_was": "was {text}: {note}",
    # Inputs: what they take, and why a value is refused.
    "on": "On",
    "off": "Off",
    "less": "{label}: less",
    "more": "{label}: more",
    "limits": "{low} to {high}{unit}, in steps of {step}",
    "number_empty": "{label} has no number: it must be {limits}",
    "no_number": "{label} must be a number, {limits}, not {given}",
    "off_limits": "{label} is {given}: it must be {limits}",
    "no_option": "{label} must be one of {options}, not {given}",
    "no_toggle": "{label} must be true ({on}) or false ({off}), not {given}",
    # What came of a press.
    "published": "Sent on {topic} at {time}.",
    "sent_to_nobody": "Sent on {topic} at {time}, but no node is known to listen to it.",
    "refused": "Not sent at {time}: {why}",
    "not_encoded": "Not sent at {time}: {why}.",
    "press_reused": "Not sent: the press id {id} was already used for another press.",
    "not_recorded": "Presses are not recorded: {why}. They work as always.",
    # What the service manager is told.
    "ready": "Ready: commands can reach the robot.",
    "ready_of": "{name}: {state}",
    "link_stands_still": "The Zenoh link of {name} stands still: the server must be started anew.",
    "stopping": "Stopping.",
    # The way to the robot.
    "server": "Server",
    "bridge": "Bridge",
    "robot": "Robot",
    "simulated": "SIMULATED ROBOT",
    "ok": "ok",
    "lost": "no connection",
    "unknown": "not known",
    "absent": "not there",
    "silent": "no answer",
    "no_node": "no node seen",
    "pending": "joining",
}


def say(code: str, **about: object) -> str:
    """The sentence for `code`, filled in; a KeyError is a mistake of the programmer's."""
    return ENGLISH[code].format(**about)


def age(seconds: float) -> str:
    """An age as an operator says it: "4 s", "12 min", "3 h"."""
    if seconds < 60:
        return f"{int(seconds)} s"
    if seconds < 3600:
        return f"{int(seconds // 60)} min"
    return f"{int(seconds // 3600)} h"


def clock(wall: float) -> str:
    """The time of day in the server's zone, of seconds since the epoch."""
    return time.strftime("%H:%M:%S", time.localtime(wall))
