"""The lines of a log, as a page and `GET /widgets/{widget}/lines` have them in a reader's language."""

from typing import Any, Final

from app.clock import format_time, iso_time
from app.i18n import render, say
from app.panel.widgets.log_view import LEVELS, Level, LogView
from app.robot.log_lines import Line, Wanted
from app.ros_logging import NODE_NAME
from app.runtime.robot_session import RobotSession

LEVEL_WORDS: Final = {
    "debug": say("rosout_debug"),
    "info": say("rosout_info"),
    "warn": say("rosout_warn"),
    "error": say("rosout_error"),
    "fatal": say("rosout_fatal"),
}
RENDERED: Final = 20  # lines of a page as it is rendered


def newest_lines(session: RobotSession, language: str, widget: LogView) -> list[dict[str, Any]]:
    """The newest lines of a log, as many as a rendered page has."""
    kept = session.robot.log_lines[session.robot.key(widget.topic)]
    wanted = wanted_lines(widget, widget.level, widget.node, "")
    return [line_values(*line, language) for line in kept.newest(wanted, RENDERED).lines]


def wanted_lines(widget: LogView, level: Level, node: str, search: str) -> Wanted:
    """The filter of a log for lines of this level and above, a node and a text; "" for all."""
    severity = 10 * LEVELS.index(level) + 10 if level != "debug" else 0
    return Wanted(severity, node, search, "" if widget.own else NODE_NAME)


def line_values(number: int, line: Line, language: str) -> dict[str, Any]:
    """The attributes of a line, in a reader's language: those of `LogLine`."""
    return {
        "number": number,
        "time": render(format_time(line.stamp), language),
        "at": iso_time(line.stamp),
        "level": line.level,
        "word": render(LEVEL_WORDS[line.level], language),
        "node": line.node,
        "text": line.text,
    }
