"""English: every sentence that a person reads, by its code."""

from collections.abc import Mapping
from typing import Final

ENGLISH: Final[Mapping[str, str]] = {
    # Why a control is locked.
    "no_link": "No connection to the robot: its bridge cannot be reached.",
    "no_link_at": "No connection to the robot: its bridge cannot be reached at {where}.",
    "and_more": "{names} and {number} more",
    "no_bridge": "No connection to the robot: Zenoh responds, but no ROS 2 bridge is running.",
    "no_bridge_of": (
        "No connection to {name}: Zenoh responds, but no ROS 2 bridge of its namespace is running."
    ),
    "ending": "The panel server is shutting down.",
    "joining": "Connecting to the robot's topics. Please wait.",
    "catching_up": "The panel server stalled. Catching up with the robot.",
    "bridge_silent": (
        "No connection to the robot: its bridge does not respond. If this persists, restart the bridge."
    ),
    "wrong_type": "{topic} is {found} on the robot, but this panel expects {wanted}.",
    "unheard": "Locked: the bridge does not forward {topic}. If this persists, restart the bridge.",
    "waiting": "Locked: waiting for {topic}.",
    "cut": "Locked: the connection was lost. Waiting for a new {topic}.",
    "stale": "Locked: the last {topic} is older than {limit} s.",
    "new_publisher": "Locked: a new publisher of {topic} has not published yet.",
    "no_publisher": "Locked: no node of the robot publishes {topic}.",
    "unreadable": "Locked: {topic} cannot be read. The data received is not {wanted}.",
    "missing": "Locked: the last {topic} has no {field}.",
    "several": "Locked: the last {topic} has {field} more than once.",
    "reading": "Locked: {topic} is large and is still being read.",
    "forbidden": "The robot does not permit {name}.",
    "unmet": "{name} is {value}: it must be {wanted}.",
    "either": "{first} or {last}",
    "both": "{one} and {other}",
    "not_value": "not {value}",
    "more_reasons": "+{number} more",
    "no_service": "Locked: the robot does not offer {name} at present.",
    "getting_ready": "Locked: the robot has just started {name}. Connecting.",
    "busy": "In progress: waiting for the robot.",
    "perhaps_busy": "Locked: a goal sent earlier may still be running.",
    # QoS that DDS would not match: the robot's and the panel's.
    "publishes_best_effort": (
        "The robot publishes {topic} as best effort, but this panel requires reliable."
    ),
    "publishes_volatile": (
        "The robot publishes {topic} as volatile, but this panel requires transient local."
    ),
    "asks_for_reliable": (
        "The robot requires {topic} as reliable, but this panel publishes it as best effort."
    ),
    "asks_for_transient_local": (
        "The robot requires {topic} as transient local, but this panel publishes it as volatile."
    ),
    # What a page says by itself, without its server.
    "server_lost": "No connection to the panel server.",
    "server_unsure": "No response from the panel server. The command may or may not have been sent.",
    # Parameters: why one is locked, what is shown of it, what came of setting it.
    "no_parameters": "Locked: the robot does not offer the parameters of {node} at present.",
    "parameter_waiting": "Locked: waiting for {node} to report {name}.",
    "parameter_silent": (
        "Locked: {node} does not respond when {name} is read. “Read again” tries once more."
    ),
    "parameter_undeclared": "Locked: {node} has no parameter {name}.",
    "parameter_mistyped": "{name} of {node} is {found}, but this panel expects {wanted}.",
    "parameter_unreadable": "Locked: the value of {name} from {node} cannot be read.",
    "parameter_read_only": "Read only: {node} does not allow {name} to be set.",
    "parameter_apart": (
        "Locked: {node} accepts {theirs} for {name} and this panel offers {ours}. No value fits both."
    ),
    "parameter_read": "read {time}",
    "parameter_told": "read {time}; {node} does not report changes",
    "parameter_cut": "from before the connection was lost, read {time}",
    "parameter_no_answer": "no response since; read {time}",
    "parameter_asking": "waiting for {node}",
    "parameter_unanswered": "no response from {node}",
    "read_again": "Read again",
    "read_named": "Read {label} again",
    "parameter_no_value": "declared, but has no value yet",
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
    "limits_list": "{each}; separate several values with commas",
    "list_value": "{label}, value {number}",
    "list_long": "{label} has {count} values. At most {most} are allowed",
    "no_list": "{label} must be {limits}, not {given}",
    "no_text": "{label} must be text of {most} characters at most, not {given}",
    # What came of a call or a goal.
    "waiting_for_answer": "Sent. Waiting for the robot's response.",
    "answered": "Done at {time}",
    "said_no": "Rejected by the robot at {time}",
    "timed_out": "No response within {seconds} s. The robot may or may not have done it.",
    "cyclone_hint": " (Services and actions work only with robots on Cyclone DDS.)",
    "call_cut": "The connection was lost while waiting. The robot may have done it.",
    "call_dropped": "The bridge returned no response for {service}. The result is unknown.",
    "answer_unreadable": "The robot responded, but not with {wanted}. The robot may have done it.",
    "too_many": "too many calls of {service} are still waiting for a response",
    "goal_rejected": "The robot rejected the goal at {time}.",
    "goal_accepted": "Accepted at {time}.",
    "goal_executing": "In progress.",
    "goal_canceling": "Canceling.",
    "goal_succeeded": "Succeeded at {time}",
    "goal_canceled": "Canceled at {time}",
    "goal_aborted": "Aborted by the robot at {time}",
    "goal_lost": "The robot no longer knows this goal. The result is unknown.",
    "goal_not_there": (
        "The robot does not know this goal: it was not received, or is already forgotten."
    ),
    "goal_silent": "No news of this goal from the robot for {seconds} s. The result is unknown.",
    "goal_in_doubt": "A goal sent at {time}, before the restart, may still be running.",
    "goal_found": "Still in progress at {time}.",
    "goal_had_succeeded": "Succeeded before {time}",
    "goal_had_been_canceled": "Canceled before {time}",
    "goal_had_been_aborted": "Aborted by the robot before {time}",
    "goals_unread": "It is unknown whether a goal from before the restart is still running: {why}",
    "goal_cut": "The connection was lost. The robot may still be doing it.",
    "goal_fault": "Internal error in the panel server. The result is unknown.",
    "goal_gone": "The robot stopped offering {name}. The result is unknown.",
    "cancel": "Cancel",
    "cancel_sent": "Cancel requested at {time}.",
    "cancel_refused": "The robot refused to cancel at {time}.",
    "cancel_unheard": (
        "The robot does not offer {name} at present. The cancel request may not have arrived."
    ),
    "goal_over": (
        "Nothing was canceled: that goal is over, or was sent before the restart and may still be"
        " running."
    ),
    "nothing_to_cancel": "nothing is in progress",
    # Why a press is no longer what was meant.
    "changed_meanwhile": "it changed while you pressed.",
    "expired": "it took {seconds} s to arrive. Press again.",
    "ahead": "its time is ahead of the panel server. Reload the page.",
    "seen_on_another": "the page showed another robot.",
    "seen_before_restart": "the panel server restarted after the page showed this.",
    # The effect of a command.
    "waiting_for_effect": "Sent. Waiting for {topic} to confirm it.",
    "confirmed": "Confirmed by {topic} at {time}.",
    "no_effect": "No confirmation on {topic} within {seconds} s. The result is unknown.",
    # Before a command.
    "ask": "{label}?",
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
    "control_free": "No panel has control of {robot}. Take control first.",
    "control_mine": "This panel has control of {robot}.",
    "control_asks": (
        "{name} requests control of {robot}. If this panel is not touched, control passes in "
        "{seconds} s."
    ),
    "control_asked": (
        "Control requested from {name}. If that panel is not touched, control passes to you in "
        "{seconds} s."
    ),
    "control_take": "Take control",
    "control_ask": "Request control",
    "control_give": "Give",
    "control_keep": "Keep",
    "control_release": "Release control",
    "control_withdraw": "Cancel request",
    "control_taken": "Another panel has control. You can request it.",
    "control_asked_by": "Another panel has already requested control. Please wait.",
    "control_denied": "The request was denied. Try again in a few seconds.",
    "control_stranger": "Not done: this browser had no cookie of this panel. Try again.",
    "control_not_yours": "Nothing was done: the control of the robot had already changed.",
    "control_too_often": "Too many requests in a short time. Wait a second, then try again.",
    "no_client": "no one",
    # What a readout shows beside or instead of a value.
    "readout_waiting": "waiting for {topic}",
    "readout_cut": "from before the connection was lost, received {time}",
    "readout_old": "{age} old",
    "readout_unreadable": "{topic} cannot be read: the data received is not {wanted}",
    "readout_time": "received {time}",
    "readout_missing": "no {field} in the message received {time}",
    "readout_several": "{field} is more than once in the message received {time}",
    # What a lamp shows when no state of its own does.
    "lamp_waiting": "No value yet",
    "lamp_unknown": "Unknown: {value}",
    "lamp_old": "Unknown",
    "lamp_unreadable": "Unreadable",
    "lamp_missing": "Missing",
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
    "sent_to_nobody": "Sent on {topic} at {time}, but no node is known to subscribe to it.",
    "sent_unanswered": (
        "Sent on {topic} at {time}, but the bridge has not responded since. The robot may not "
        "have received it."
    ),
    "refused": "Not sent at {time}: {why}",
    "not_encoded": "Not sent at {time}: {why}.",
    "too_many_presses": "Not sent: {most} presses on this page are still waiting for a response.",
    "too_often": "too many presses in a short time. Wait a second, then press again.",
    "cancel_too_often": "too many cancel requests in a short time. Wait a second.",
    "press_past": "Not sent again: press {id} was already made. See the operator's log for its result.",
    "press_too_soon": (
        "Not sent: this came so soon after the page that it may be a double tap. Press again if "
        "you meant it."
    ),
    "press_before": "{label}: {said}",
    "press_reused": "Not sent: the press id {id} was already used for another press.",
    # The operator's log.
    "log_unwritable": "The operator's log cannot be written: {why}.",
    "log_unwritable_free": "The operator's log cannot be written, so nothing is logged: {why}.",
    "log_unreadable": "The operator's log cannot be read: {why}.",
    "log_reader_ended": "the process reading it ended",
    "log_exported": "The operator's log is already being exported. Try again when that export is done.",
    "log_searched": "The operator's log is being searched by others. Try again in a moment.",
    "folder_taken": "Another server is using this panel's data: {why}.",
    "log_taken": "{name} was removed or renamed",
    "log_emptied": "the file was emptied",
    "log_closed": "the file is being reopened",
    "log_slow": "the disk did not store the entry within {seconds} s",
    "log_full_queue": "presses arrive faster than the disk can store them. Press again",
    "log_more_refused": "{count} more refusals from {name} since {since}, each answered as usual.",
    "log_more_limited": (
        "{count} presses from {name} since {since} exceeded the limit and were not sent."
    ),
    "others": "others",
    "log_abandoned": "Not sent: the log entry was written too late.",
    "log_not_on_disk": "{said} (Not safely in the operator's log: {why}.)",
    "log_ended": "the panel server ended before the result was known",
    "press_by_stopping": "the panel server is shutting down. Press again.",
    "server_ends": "The panel server is shutting down. The result is unknown.",
    "log_broke_off": "Internal error in the panel server. The command may or may not have been sent.",
    "log_began": "The panel server started.",
    "log_began_anew": "The previous log was damaged and is kept as {name}.",
    "log_began_for_gone": (
        "The previous log, up to entry {last}, was removed or renamed while the server was running."
    ),
    "log_began_empty": "The log was empty when the server opened it. The last entry was number {last}.",
    "log_found": "The file found in its place is kept as {name}.",
    "log_resumed": "The log could not be written from {since} until now: {why}.",
    "log_lost": "The disk lost entries {first} to {last}.",
    "log_removed_days": "older than {days} days",
    "log_removed_size": "the log was larger than {size} MB",
    "log_done_take": "Control taken.",
    "log_done_take_over": "Control taken over. Before: {holder}.",
    "log_done_ask": "Control requested from {holder}.",
    "log_done_give": "Control given to {requester}.",
    "log_done_keep": "Request denied: {requester}.",
    "log_done_release": "Control released.",
    "log_done_withdraw": "Request cancelled.",
    "log_control_lost": "{name} lost control: its page no longer answers. Now in control: {other}.",
    "log_control_idle": "{name} lost control: not touched after a request. Now in control: {other}.",
    "log_control_first_page": "Control taken when the first page was opened at the cell.",
    "log_control_request_lost": "The request ended: the page of {name} no longer answers.",
    "log_off": "The operator's log is switched off in the panel file.",
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
    "log_page_none": "No such entry.",
    "log_page_newest": "Newest",
    "log_page_older": "Older",
    "log_page_csv": "CSV",
    "log_page_head": "{count} entries, head",
    "log_page_cancel": "{label} (cancel)",
    "log_page_control_take": "Take control",
    "log_page_control_ask": "Request control",
    "log_page_control_give": "Give control",
    "log_page_control_keep": "Keep control",
    "log_page_control_release": "Release control",
    "log_page_control_lost": "Control lost",
    "log_page_control_idle": "Control passed on",
    "log_page_control_first_page": "Control taken",
    "log_page_control_request_lost": "Request for control ended",
    "log_page_later": "{outcome}, later",
    # Hold-to-run: what is shown while it is held, and why it ended.
    "hold_since": "Held since {time}.",
    "hold_released": "Released at {time}, after {seconds} s.",
    "hold_ended": "Ended at {time}, after {seconds} s: {why} Release and press again.",
    "hold_unsaid": " The stop message was not sent: {why}",
    "hold_unanswered": (
        " The bridge did not respond afterwards. The robot may not have received the stop message."
    ),
    "hold_by_renewal": "the bridge stopped forwarding a topic and is being reconnected.",
    "hold_by_cancel": "the screen canceled the touch.",
    "hold_by_sliding": "the finger slid off the button.",
    "hold_by_second": "a second finger touched the screen.",
    "hold_by_menu": "a menu was opened.",
    "hold_by_blur": "the page lost the focus.",
    "hold_by_hiding": "the page was hidden.",
    "hold_by_leaving": "the page was left.",
    "hold_by_lock": "the page was locked.",
    "hold_by_escape": "Escape was pressed.",
    "hold_by_silence": "the browser had no response from the panel server.",
    "hold_by_heartbeat": "no signal from the browser.",
    "hold_by_closing": "the connection to the browser was closed.",
    "hold_by_stall": "the panel server stalled.",
    "hold_by_nonsense": "the browser sent an invalid message.",
    "hold_by_stopping": "the panel server is shutting down.",
    "hold_elsewhere": "held by another browser.",
    "hold_same_topic": "{label} is held, which also sends on {topic}.",
    "hold_late": "the press came too late.",
    "hold_let_go": "released before the hold began. Hold it longer.",
    "hold_scripts": "Locked: hold-to-run needs JavaScript.",
    "hold_cut": "The connection to the panel server was lost while this was held.",
    # Recordings.
    "not_recorded": "Presses are not recorded: {why}. They are sent as usual.",
    # What the service manager is told.
    "ready": "Ready: commands can reach the robot.",
    "ready_of": "{name}: {state}",
    "link_stands_still": "The Zenoh session of {name} does not respond. Restart the panel server.",
    "stopping": "Shutting down.",
    # The way to the robot.
    "server": "Server",
    "bridge": "Bridge",
    "robot": "Robot",
    "robots": "Robots",
    "simulated": "SIMULATED ROBOT",
    "ok": "ok",
    "lost": "no connection",
    "unknown": "unknown",
    "absent": "not found",
    "silent": "no response",
    "no_node": "no node found",
    "pending": "connecting",
    "pausing": "catching up",
    "node_silent": "silent",
    # Its links: what each locks, why the robot's nodes are not heard and what helps.
    "links": "Connection to the robot",
    "link_state": "State",
    "link_since": "Since",
    "link_locks": "What it locks, and why",
    "locks": "Locks {names}.",
    "locks_more": "Locks {names} and {number} more.",
    "locks_nothing": "Locks nothing.",
    "locks_all": "Locks every control.",
    "node_unknown": "While the bridge cannot be reached, the state of the robot's nodes is unknown.",
    "node_absent": (
        "No node that this panel communicates with was found. Start it, with the ROS domain of "
        "the bridge."
    ),
    "node_gone": (
        "{name} has disappeared, though the bridge is running. Restart the node. If it is "
        "running, the bridge has lost it: restart the bridge."
    ),
    "node_stale": (
        "No new data on {topic} for {limit} s or more, though its node is running. Check whether "
        "the node hangs, and restart it."
    ),
}
