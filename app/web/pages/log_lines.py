"""The lines of a log, as a page and `GET /widgets/{widget}/lines` have them in a reader's language."""

from collections.abc import Callable, Iterable
from typing import Any, Final

from app.cell.robot.log_lines import Line, LogFilter
from app.cell.session.session import RobotSession
from app.panel.model import Panel
from app.panel.robot_texts import robot_text
from app.panel.widgets.displays import LEVELS, Level, LogView
from app.system.clock import format_time, iso_time
from app.system.log import NODE_NAME
from app.system.texts import render, say

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
    wanted = wanted_lines(session.panel, widget, language)
    return lines_values(kept.newest(wanted, RENDERED).lines, wanted, language)


def lines_values(
    lines: Iterable[tuple[int, Line]], wanted: LogFilter, language: str
) -> list[dict[str, Any]]:
    """The attributes of the newest of these lines that are wanted, as many as a rendered page has."""
    fitting = [line for line in lines if wanted.has(line[1])][-RENDERED:]
    return [line_values(*line, wanted.translate, language) for line in fitting]


def wanted_lines(
    panel: Panel,
    widget: LogView,
    language: str,
    level: Level | None = None,
    node: str = "",
    search: str = "",
) -> LogFilter:
    """The filter of a log for lines of this level and above, a node and a text; by default the widget's
    own level and node, and any text. `search` is also found in the text as its reader has it."""
    level = level or widget.level
    severity = 10 * LEVELS.index(level) + 10 if level != "debug" else 0
    own, texts = "" if widget.own else NODE_NAME, panel.robot_texts

    def shown(text: str) -> str:
        return render(robot_text(texts, text, text), language)

    return LogFilter(severity, node or widget.node, search, own, shown)


def line_values(number: int, line: Line, shown: Callable[[str], str], language: str) -> dict[str, Any]:
    """The attributes of a line, in a reader's language: those of `LogLine`."""
    return {
        "number": number,
        "time": render(format_time(line.stamp), language),
        "at": iso_time(line.stamp),
        "level": line.level,
        "word": render(LEVEL_WORDS[line.level], language),
        "node": line.node,
        "text": shown(line.text),
    }
