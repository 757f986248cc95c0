"""Every sentence that an operator reads, by its code: the one place to translate.

Codes are stable names for tests and logs; `say` fills in what the sentence is about.
"""

import time
from collections.abc import Mapping
from typing import Final

from app.printable import printable

ENGLISH: Final[Mapping[str, str]] = {
    # Why a control is locked.
    "no_link": "No connection to the robot: its bridge can't be reached.",
    "no_link_at": "No connection to the robot: its bridge can't be reached at {where}.",
    "and_more": "{names} and {number} more",
    "no_bridge": "No connection to the robot: Zenoh answers, but no ROS 2 bridge is there.",
    "no_bridge_of": "No connection to {name}: Zenoh answers, but no ROS 2 bridge of its namespace.",
    "ending": "The panel's server is ending, or takes a new panel.",
    "joining": "Joining the robot's topics: a moment.",
    "catching_up": "The panel's server stood still: it takes in what the robot said meanwhile.",
    "bridge_silent": (
        "No connection to the robot: its bridge does not answer. If this stays, restart the bridge."
    ),
    "wrong_type": "{topic} is {found} on the robot, but this panel is made for {wanted}.",
    "unheard": "Locked: the bridge does not pass on {topic}. If this stays, restart the bridge.",
    "waiting": "Locked: waiting for {topic}.",
    "cut": "Locked: the connection was cut; waiting for a new {topic}.",
    "stale": "Locked: the last {topic} is older than {limit} s.",
    "new_publisher": "A new publisher of {topic} has not said anything yet.",
    "no_publisher": "Locked: no node of the robot publishes {topic}.",
    "unreadable": "Locked: {topic} can't be read: what arrives is not {wanted}.",
    "missing": "Locked: there is no {field} in the last {topic}.",
    "several": "Locked: {field} is in the last {topic} more than once.",
    "reading": "Locked: {topic} is large; it is being read.",
    "forbidden": "The robot does not permit {name}.",
    "unmet": "{name} is {value}: it must be {wanted}.",
    "either": "{first} or {last}",
    "both": "{one} and {other}",
    "not_value": "not {value}",
    "more_reasons": "+{number} more",
    "no_service": "Locked: the robot does not offer {name} now.",
    "getting_ready": "Locked: the robot has just begun to offer {name}; getting ready.",
    "busy": "Under way: waiting for the robot.",
    "perhaps_busy": "Locked: a goal that was sent before may still be under way.",
    # QoS that DDS would not match: the robot's and the panel's.
    "publishes_best_effort": "The robot publishes {topic} best effort; this panel asks for reliable.",
    "publishes_volatile": "The robot publishes {topic} volatile; this panel asks for transient local.",
    "asks_for_reliable": "The robot asks for {topic} reliable; this panel publishes it best effort.",
    "asks_for_transient_local": (
        "The robot asks for {topic} transient local; this panel publishes it volatile."
    ),
    # What a page says by itself, without its server.
    "server_lost": "There is no connection to the panel's server.",
    "server_unsure": "No answer from the panel's server: it is not known whether this was sent.",
    # Parameters: why one is locked, what is shown of it, what came of setting it.
    "no_parameters": "Locked: the robot does not offer the parameters of {node} now.",
    "parameter_waiting": "Locked: waiting for {node} to tell its {name}.",
    "parameter_silent": (
        "Locked: {node} does not answer when it is asked for its {name}. “Read again” asks once more."
    ),
    "parameter_undeclared": "Locked: {node} has no parameter {name}.",
    "parameter_mistyped": "{name} of {node} is {found}, but this panel is made for {wanted}.",
    "parameter_unreadable": "Locked: what {node} tells of its {name} can't be read.",
    "parameter_read_only": "Read only: {node} does not let its {name} be set.",
    "parameter_apart": (
        "Locked: {node} takes {theirs} for its {name}, and this panel gives {ours}: no value is both."
    ),
    "parameter_read": "read {time}",
    "parameter_told": "read {time}; {node} does not tell of changes",
    "parameter_cut": "from before the connection was cut, read {time}",
    "parameter_no_answer": "no answer since; read {time}",
    "parameter_asking": "waiting for {node}",
    "parameter_unanswered": "no answer from {node}",
    "read_again": "Read again",
    "read_named": "Read {label} again",
    "parameter_no_value": "declared, but it has no value yet",
    "parameter_not_there": "not declared by {node}",
    "parameter_set": "Set to {value} at {time}.",
    "set": "Set",
    "set_named": "Set {label}",
    "limits_both": "{low} to {high}{unit}",
    "limits_low": "{low}{unit} or more",
    "limits_high": "{high}{unit} or less",
    "limits_step": "in steps of {step}",
    "any_number": "a number",
    "any_whole": "a whole number",
    "any_text": "a text",
    "limits_list": "{each}; several with commas between them",
    "list_value": "{label}, value {number}",
    "list_long": "{label} has {count} values; {most} are allowed",
    "no_list": "{label} must be {limits}, not {given}",
    "no_text": "{label} must be text of {most} characters at most, not {given}",
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
    "goal_not_there": "The robot does not know this goal: it did not get it, or knows it no longer.",
    "goal_silent": "The robot told nothing of this goal for {seconds} s: what came of it is not known.",
    "goal_in_doubt": "A goal of {time} may still be under way: it was sent before this server's start.",
    "goal_found": "Found under way at {time}.",
    "goal_had_succeeded": "Succeeded, by {time}",
    "goal_had_been_canceled": "Canceled, by {time}",
    "goal_had_been_aborted": "Aborted by the robot, by {time}",
    "goals_unread": "Whether a goal of before this server's start is under way is not known: {why}",
    "goal_cut": "The connection was cut: the robot may still be doing it.",
    "goal_fault": "A fault of the panel's server: what came of it is not known.",
    "goal_gone": "The robot stopped offering {name}: what came of it is not known.",
    "cancel": "Cancel",
    "cancel_sent": "The robot was asked to cancel at {time}.",
    "cancel_refused": "The robot refused to cancel at {time}.",
    "cancel_unheard": (
        "The robot does not offer {name} now: it is not known whether it was asked to cancel."
    ),
    "goal_over": (
        "That goal is over, or of before this server's start and perhaps still under way: nothing was"
        " canceled."
    ),
    "nothing_to_cancel": "there is nothing under way to cancel",
    # Why a press is no longer what was meant.
    "changed_meanwhile": "it changed while you pressed.",
    "expired": "it took {seconds} s to get here: press again.",
    "ahead": "its time is ahead of the panel's server: load the page again.",
    "seen_on_another": "the page showed another robot.",
    "seen_before_restart": "the panel's server was started anew since the page showed this.",
    # The effect of a command.
    "waiting_for_effect": "Sent; waiting for {topic} to show it.",
    "confirmed": "Confirmed by {topic} at {time}.",
    "no_effect": "{topic} did not show it within {seconds} s: it is not known whether it was done.",
    # Before a command.
    "ask": "{label}: do it?",
    "ask_on": "{label} on {robot}?",
    "empty": "(empty)",
    "back": "Back",
    # Who has control.
    "browser": "Panel {number}",
    "browser_local": "the panel at the cell",
    "browser_more": "browser {number} at the cell",
    "browser_unknown": "a program",
    "the_robot": "the robot",
    "control": "Control of the robot",
    "control_held": "{name} has control of {robot}.",
    "control_free": "Nobody has control of {robot}: take control first.",
    "control_mine": "This panel has control of {robot}.",
    "control_asks": "{name} asks for control of {robot}; untouched, it goes over in {seconds} s.",
    "control_asked": "{name} was asked: control is yours after {seconds} s without a touch there.",
    "control_take": "Take control",
    "control_ask": "Ask for control",
    "control_give": "Give",
    "control_keep": "Keep",
    "control_release": "Give up control",
    "control_withdraw": "Ask no more",
    "control_taken": "Another panel has control: it can be asked.",
    "control_asked_by": "Another panel is asking already: a moment.",
    "control_denied": "The request was denied: it can be made again in some seconds.",
    "control_stranger": "Not done: this browser had no cookie of this panel. Try once more.",
    "control_not_yours": "This had changed already: nothing was done.",
    # What a readout shows beside or instead of a value.
    "readout_waiting": "waiting for {topic}",
    "readout_cut": "from before the connection was cut, received {time}",
    "readout_old": "{age} old",
    "readout_unreadable": "{topic} can't be read: what arrives is not {wanted}",
    "readout_time": "received {time}",
    "readout_missing": "there is no {field} in what was received {time}",
    "readout_several": "{field} is more than once in what was received {time}",
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
    "sent_unanswered": (
        "Sent on {topic} at {time}, but the bridge has not answered since: it is not known whether it "
        "reaches the robot."
    ),
    "refused": "Not sent at {time}: {why}",
    "not_encoded": "Not sent at {time}: {why}.",
    "too_many_presses": "Not sent: {most} presses of this page have had no answer yet.",
    "too_often": "too many presses in a short time. Wait a second, then press again.",
    "cancel_too_often": "the robot has been asked to cancel this many times just now. Wait a second.",
    "press_past": "Not sent again: press {id} was made before; the operator's log has what came of it.",
    "press_too_soon": (
        "Not sent: so soon after the page came it may be a second tap. Press again if it was meant."
    ),
    "press_before": "{label}: {said}",
    "press_reused": "Not sent: the press id {id} was already used for another press.",
    # The operator's log.
    "log_unwritable": "The operator's log can't be written: {why}.",
    "log_unwritable_free": "The operator's log can't be written, so nothing is logged: {why}.",
    "log_unreadable": "The operator's log can't be read: {why}.",
    "log_reader_ended": "what read it was ended",
    "log_exported": "The operator's log is being exported already. Try again when that is done.",
    "log_searched": "The operator's log is being searched by others. Try again in a moment.",
    "folder_taken": "Another server has taken this panel's data: {why}.",
    "log_taken": "{name} was removed or renamed",
    "log_emptied": "the file was emptied",
    "log_closed": "the file is being opened anew",
    "log_slow": "the disk did not take the entry in {seconds} s",
    "log_full_queue": "more is pressed than the disk takes; press again",
    "log_more_refused": "{count} more refusals from {name} since {since}, each answered as ever.",
    "log_more_limited": "{count} presses from {name} since {since} were over the limit: not sent.",
    "others": "others",
    "log_abandoned": "Not sent: the entry was written too late.",
    "log_not_on_disk": "{said} (Not safely in the operator's log: {why}.)",
    "log_ended": "the panel's server ended before it knew",
    "press_by_stopping": "the panel's server stops or takes a new panel. Press again.",
    "server_ends": "The panel's server ends: it is not known what came of this.",
    "log_broke_off": "A fault of the panel's server: it is not known whether this was sent.",
    "log_began": "The panel's server started.",
    "log_began_anew": "The log before this one was damaged and is kept as {name}.",
    "log_began_for_gone": (
        "The log before this one, up to entry {last}, was removed or renamed while the server ran."
    ),
    "log_began_empty": "The log had no entries when the server opened it; the last was number {last}.",
    "log_found": "What stood in its place is kept as {name}.",
    "log_resumed": "The log could not be written from {since} to now: {why}.",
    "log_lost": "The disk lost entries {first} to {last}.",
    "log_removed_days": "older than {days} days",
    "log_removed_size": "the log was larger than {size} MB",
    "log_off": "The panel file switches the operator's log off.",
    "log_link": "Log",
    # Its page.
    "log_page_title": "Operator's log",
    "log_page_since": "From",
    "log_page_until": "To",
    "log_page_widget": "Control",
    "log_page_outcome": "Outcome",
    "log_page_who": "Who",
    "log_page_text": "Text",
    "log_page_every": "every step",
    "log_page_all": "all",
    "log_page_filter": "Filter",
    "log_page_show": "Show",
    "log_page_number": "No.",
    "log_page_time": "Time",
    "log_page_values": "Values",
    "log_page_of": "of {number}",
    "log_page_pressed": "pressed {time}",
    "log_page_none": "There is no such entry.",
    "log_page_newest": "Newest",
    "log_page_older": "Older",
    "log_page_csv": "CSV",
    "log_page_head": "{count} entries, head",
    "log_page_cancel": "{label} (cancel)",
    "log_page_later": "{outcome}, later",
    # Hold-to-run: what is shown while it is held, and why it ended.
    "hold_since": "Held since {time}.",
    "hold_released": "Released at {time}, after {seconds} s.",
    "hold_ended": "Ended at {time}, after {seconds} s: {why} Let go and press again.",
    "hold_unsaid": " The message that ends it was not sent: {why}",
    "hold_unanswered": (
        " The bridge did not answer after that: it is not known whether the robot got the message that"
        " ends it."
    ),
    "hold_by_renewal": "the bridge no longer passes on a topic: the connection to it is made anew.",
    "hold_by_cancel": "the screen took the touch away.",
    "hold_by_sliding": "the finger slid off the button.",
    "hold_by_second": "a second finger touched the screen.",
    "hold_by_menu": "a menu was asked for.",
    "hold_by_blur": "the page lost the input.",
    "hold_by_hiding": "the page was hidden.",
    "hold_by_leaving": "the page was left.",
    "hold_by_lock": "the page was locked.",
    "hold_by_escape": "Escape was pressed.",
    "hold_by_silence": "the browser had no answer from the panel's server.",
    "hold_by_heartbeat": "nothing was heard from the browser.",
    "hold_by_closing": "the connection to the browser was closed.",
    "hold_by_stall": "the panel's server stood still.",
    "hold_by_nonsense": "the browser sent what can't be understood.",
    "hold_by_stopping": "the panel's server stops or takes a new panel.",
    "hold_elsewhere": "held by another browser.",
    "hold_same_topic": "{label} is held, which sends on {topic} too.",
    "hold_late": "the press came too late.",
    "hold_let_go": "it was let go before it began: hold it longer.",
    "hold_scripts": "Locked: holding needs the page's scripts.",
    "hold_cut": "The connection to the panel's server was lost while this was held.",
    # Recordings.
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
    "robots": "Robots",
    "simulated": "SIMULATED ROBOT",
    "ok": "ok",
    "lost": "no connection",
    "unknown": "not known",
    "absent": "not there",
    "silent": "no answer",
    "no_node": "no node seen",
    "pending": "joining",
    "pausing": "catching up",
    "node_silent": "silent",
    # Its links: what each locks, why the robot's nodes are not heard and what helps.
    "links": "The way to the robot",
    "link_state": "State",
    "link_since": "Since",
    "link_locks": "What it locks, and why",
    "locks": "Locks {names}.",
    "locks_more": "Locks {names} and {number} more.",
    "locks_nothing": "Locks nothing.",
    "locks_all": "Locks every control.",
    "node_unknown": "While the bridge can't be reached, nothing is known of the robot's nodes.",
    "node_absent": (
        "No node that this panel talks with is seen: start it, with the ROS domain of the bridge."
    ),
    "node_gone": (
        "{name} was there and is gone, but the bridge is not: start its node again; if it runs, the "
        "bridge has lost it: restart the node or the bridge."
    ),
    "node_stale": (
        "Nothing new on {topic} for {limit} s or more, though its node is there: look whether the node "
        "hangs or has crashed, and restart it."
    ),
}


def say(code: str, **about: object) -> str:
    """The sentence for `code`, filled in; a KeyError is a mistake of the programmer's."""
    return printable(ENGLISH[code].format(**about))


def age(seconds: float) -> str:
    """An age as an operator says it: "4 s", "12 min", "3 h"."""
    if seconds < 60:
        return f"{int(seconds)} s"
    if seconds < 3600:
        return f"{int(seconds // 60)} min"
    return f"{int(seconds // 3600)} h"


def moment(wall: float) -> str:
    """Date and time in the server's zone, of seconds since the epoch."""
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(wall))


def clock(wall: float) -> str:
    """The time of day in the server's zone, of seconds since the epoch."""
    return time.strftime("%H:%M:%S", time.localtime(wall))
