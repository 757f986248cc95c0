"""The words of a page: by their names in its templates, and those of the keypad and the keyboard."""

import time
from functools import partial
from typing import Any, Final, NamedTuple, TypedDict

from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.cell.view.trend import Plot, plot
from app.panel.frame_keys import FrameKey, frame_keys
from app.panel.layout import Page
from app.panel.robot_panels import opened_page, page_for
from app.panel.template import input_ids
from app.panel.widgets.displays import LogView
from app.panel.widgets.families import Command, EntryWidget, PressCommand
from app.panel.widgets.parts import CompositeCommand
from app.panel.widgets.templated import is_stop
from app.panel.widgets.trend import Trend
from app.system.texts import Text, TextLike, ended, joined, number, render, say
from app.system.texts.text import number_like
from app.web.pages.log_lines import LEVEL_WORDS, newest_lines

# The words of the keypad and the keyboard on the screen, by their codes.

ENTRY_WORDS: Final = (
    "keypad_now",
    "keypad_clear",
    "keypad_delete",
    "keypad_sign",
    "keypad_decimal",
    "keypad_decimal_name",
    "keypad_min",
    "keypad_max",
    "keypad_close",
    "keypad_enter",
    "keypad_too_low",
    "keypad_too_high",
    "keypad_off_step",
    "keypad_outside",
    "keypad_empty",
    "keypad_locks",
    "keyboard_locks",
    "keyboard_done",
    "keyboard_space",
    "keyboard_shift",
    "keyboard_signs",
    "keyboard_left",
    "keyboard_right",
)

# Why a typed text is not a number, at its input and in the keypad.
UNREADABLE: Final[dict[str, Any]] = {
    "keypad_no_number": say("keypad_no_number", example=number_like(whole=False)),
    "keypad_unclear": say("keypad_unclear"),
    "keypad_no_whole": say("keypad_no_whole", example=number_like(whole=True)),
}


# The words of a page, by their names in its templates, and the questions before its presses.

WORDS: Final = (
    "menu",
    "whole",
    "close",
    "story_title",
    "phone",
    "cancel",
    "robots",
    "control",
    "set",
    "read_again",
    "back",
    "empty",
    "hold_connection_lost",
    "hold_needs_javascript",
    "gamepad_left",
    "gamepad_right",
    "gamepad_unknown",
    "camera_none",
    "camera_late",
    "camera_not_drawn",
    "map_zoom_in",
    "map_zoom_out",
    "map_follow",
    "map_whole",
    "map_not_loaded",
    "map_layers",
    "map_layer_plan",
    "map_layer_routes",
    "map_plan_broken",
    "map_robots",
    "map_levels",
    "map_level_follow",
    "map_level_by_hand",
    "place_choose",
    "place_choose_touch",
    "place_crosshair",
    "place_all_locked",
    "place_no_answer",
    "place_clear",
    "places_save",
    "places_save_robot",
    "places_title",
    "rosout_level",
    "rosout_node",
    "rosout_search",
    "rosout_pause",
    "table_empty",
    *(word.code for word in LEVEL_WORDS.values()),
    "frame_keys",
    "scan_not_asked",
    "touch_other_finger",
    "clean",
    "cleaning_end",
    "diagnostics_title",
    "help",
    "recipes_title",
    "users_page_title",
    "overview_sums",
)
TREND_WORDS: Final = (
    "trend_earlier",
    "trend_later",
    "trend_longer",
    "trend_shorter",
    "trend_pause",
    "trend_live",
    "trend_paused",
)
ALARM_WORDS: Final = (
    "alarm_line",
    "oee_reason",
    "alarm_none",
    "alarms_unheard",
    "alarm_none_unacknowledged",
    "alarm_unacknowledged",
    "alarm_standing",
    "alarm_acknowledge",
    "alarm_needs_control",
    "alarms_cut",
    "alarms_first_out",
    "alarm_sound_silence",
    "alarm_sound_silenced",
    "alarm_sound_blocked",
    "alarm_sound_on",
    "lost",
)
LINK_WORDS: Final = ("links", "link_state", "link_since", "link_locks")
NAMED_ROBOTS: Final = 2  # so many a button names; of more it says how many
CONTROL_ACT_WORDS: Final = {
    "take": "control_take",
    "ask": "control_ask",
    "give": "control_give",
    "keep": "control_keep",
    "release": "control_release",
    "withdraw": "control_withdraw",
}


class Scope(NamedTuple):
    """The robots that a button of the frame is for: as it says them, and, of a button for several,
    their ids by commas."""

    text: TextLike
    robots: str


class AskedChange(NamedTuple):
    """A value that a press changes in the robot."""

    label: TextLike
    old: TextLike
    new: TextLike


class Ask(TypedDict):
    """The question before a press: what it will do, and the inputs that it takes. Of a recipe `changes`
    are the values that it changes, and `note` says how many."""

    sentence: Text
    inputs: list[EntryWidget]
    changes: list[AskedChange]
    note: TextLike


def page_words(
    fleet: Fleet, session: RobotSession, page: Page, pictures: str, language: str
) -> dict[str, Any]:
    """The `words` of a page's context; `pictures` is the path of the panel's picture files. `stop_lost`
    is shown at a stop button of a page without its server. `plot` and
    `lines` are called by the macros of trends and logs, with the widget."""
    own = {"base": session.base, "pictures": pictures, "log": say("log_link")}
    panel = fleet.panel
    pages = {robot.id: page_for(panel, robot.id, page).id for robot in panel.robots}
    tiles = {robot.id: opened_page(panel, robot.id).id for robot in panel.robots}
    own |= {"tile_pages": {robot: f"pages/{shown}" for robot, shown in tiles.items()}}
    own |= {"robot_pages": {robot: f"pages/{shown}" for robot, shown in pages.items()}}
    own |= {"asks": asks_of(fleet, session, page), "scopes": _scopes(fleet, session, page)}
    own |= {"stop_lost": joined((ended(session.panel.stop_hint), say("server_lost")))}
    titles = {robot.id: fleet.session(robot.id).robot.title for robot in panel.robots}
    own |= {"robot_names": {robot: render(title, language) for robot, title in titles.items()}}
    own |= {"plot": partial(_plot_now, fleet, session)}
    own |= {"lines": partial(_lines_now, fleet, session, language)}
    own |= {"minutes": lambda minutes: say("alarms_minutes", count=number(str(minutes)))}
    own |= {"overview_robots": say("overview_robots", count=number(str(len(panel.robots))))}
    # The browser puts in where the crosshair is.
    own |= {"place_crosshair_at": say("place_crosshair_at", x="{x}", y="{y}", degrees="{degrees}")}
    shown = (*page.widgets, *panel.frame.widgets)
    has_stop = any(isinstance(widget, Command) and is_stop(widget) for widget in shown)
    own |= {"cleaning": say("cleaning" if has_stop else "cleaning_without_stop")}
    named = (*WORDS, *LINK_WORDS, *ENTRY_WORDS, *TREND_WORDS, *ALARM_WORDS)
    plain = {word: say(word) for word in named}
    return own | plain | UNREADABLE | {act: say(code) for act, code in CONTROL_ACT_WORDS.items()}


def _scopes(fleet: Fleet, session: RobotSession, page: Page) -> dict[str, Scope]:
    """Which robots the buttons of the frame are for, by their ids, on a panel of several."""
    if len(fleet.sessions) < 2:
        return {}
    keys = frame_keys(fleet.panel, session.entry.id if session.entry else None, page.id)
    return {key.widget.id: _scope(fleet, key) for key in keys}


def _scope(fleet: Fleet, key: FrameKey) -> Scope:
    names = [fleet.session(robot).robot.title for robot in key.robots]
    part, count = number(str(len(names))), number(str(len(fleet.sessions)))
    if len(names) <= NAMED_ROBOTS:
        text = joined(names, "between_names")
    elif len(names) == len(fleet.sessions):
        text = say("stop_all_robots", count=count)
    else:
        text = say("stop_some_robots", part=part, count=count)
    return Scope(text, ",".join(key.robots) if key.of_several else "")


def _plot_now(fleet: Fleet, session: RobotSession, widget: Trend) -> Plot:
    robot = fleet.session_for(session, str(widget.id)).robot
    return plot(widget, robot, time.monotonic(), time.time())


def _lines_now(
    fleet: Fleet, session: RobotSession, language: str, widget: LogView
) -> list[dict[str, Any]]:
    return newest_lines(fleet.session_for(session, str(widget.id)), language, widget)


def asks_of(fleet: Fleet, session: RobotSession, page: Page) -> dict[str, Ask]:
    """The questions before presses of a page, by the ids of the widgets that need one."""
    shown = (*page.widgets, *fleet.panel.frame.widgets)
    pressed = (w for w in shown if isinstance(w, PressCommand) and w.asks)
    return {w.id: ask_of(fleet.session_for(session, str(w.id)), w) for w in pressed}


def ask_of(session: RobotSession, widget: Command) -> Ask:
    """The question before a press of `widget`; it names the robot if the panel has several."""
    inputs = {w.id: w for w in session.panel.widgets() if isinstance(w, EntryWidget)}
    robot = session.entry.name if session.entry else ""
    sentence = say("ask_on" if robot else "ask", label=widget.label, robot=robot)
    own = widget.id if isinstance(widget, CompositeCommand) else ""  # its button says it
    names = (name for name in input_ids(widget) if name in inputs and name != own)
    shown = [inputs[name] for name in names]
    return Ask(sentence=sentence, inputs=shown, changes=[], note="")
