"""Which alarms the page lists, and in which order: as its address says."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, Literal, NamedTuple, TypedDict
from urllib.parse import urlencode

from app.alarms.rows import LISTED_STATES, PRIORITY_WORDS, AlarmRow
from app.i18n import Text, TextLike, joined, render, say
from app.panel.model import Panel

Show = Literal[
    "all",
    "unacknowledged",
    "shelved",
    "active",
    "returned",
    "latched",
    "unknown",
    "suppressed",
    "out_of_service",
]
Sort = Literal["urgent", "newest", "priority", "group"]
SHOWS: Final = ("all", "unacknowledged", *LISTED_STATES)
SEGMENTS: Final[tuple[Show, ...]] = ("all", "unacknowledged", "shelved")  # have a button each
SORTS: Final[tuple[Sort, ...]] = ("urgent", "newest", "priority", "group")


class AlarmChoice(NamedTuple):
    """`show` is a state or several, `priority` 0 is all, `group` is its text in the panel's language;
    "" is all groups or robots. `alarm` is the id of the alarm whose details are shown, "" for none."""

    show: Show = "all"
    priority: int = 0
    group: str = ""
    robot: str = ""
    sort: Sort = "urgent"
    alarm: str = ""

    def address(self, **changed: Any) -> str:
        """The same as the query of an address, with other values."""
        values = {**self._asdict(), **changed}
        defaults = self._field_defaults
        return urlencode({name: value for name, value in values.items() if value != defaults[name]})

    def takes(self, row: AlarmRow) -> bool:
        """Whether the priority, group and robot of an alarm are those to be listed."""
        return (
            self.priority in (0, row["priority"])
            and self.group in ("", str(row["group"]))
            and self.robot in ("", row["robot"])
        )

    def sorted(self, rows: Iterable[AlarmRow], language: str) -> list[AlarmRow]:
        """The rows in the chosen order; those that are alike stay as they are."""
        keys: Mapping[Sort, Callable[[AlarmRow], Any]] = {
            "newest": lambda row: row["order"][-1],
            "priority": lambda row: (row["priority"], row["order"][-1]),
            "group": lambda row: render(row["group"], language),
        }
        key = keys.get(self.sort)
        return list(rows) if key is None else sorted(rows, key=key)


class Chosen(NamedTuple):
    """The alarms of a choice: `taken` have its priority, group and robot, in all states; `rows` are the
    first of those that it lists, in its order, and `more` is how many follow."""

    taken: list[AlarmRow]
    rows: list[AlarmRow]
    more: int


def chosen_rows(choice: AlarmChoice, rows: Iterable[AlarmRow], language: str, limit: int) -> Chosen:
    """The first `limit` rows of a choice, of all that there are."""
    taken = [row for row in rows if choice.takes(row)]
    listed = choice.sorted((row for row in taken if shows(choice.show, row)), language)
    return Chosen(taken, listed[:limit], max(0, len(listed) - limit))


def segment_counts(taken: Iterable[AlarmRow]) -> dict[str, int]:
    """How many of the rows each button would list."""
    rows = list(taken)
    return {show: sum(shows(show, row) for row in rows) for show in SEGMENTS}


def shows(show: Show, row: AlarmRow) -> bool:
    """Whether an alarm has a state that `show` lists."""
    if show == "unacknowledged":
        return not (row["acknowledged"] or row["order"][0])
    return show in ("all", row["state"])


class ChoiceContext(TypedDict):
    """What the page shows of a choice. `counts` are those of the buttons. Each option is its value and
    its text; there are none where there is nothing to choose. `chosen_group` is the group in the
    reader's language, `filtered` the names of what is chosen beside the buttons."""

    choice: AlarmChoice
    segments: list[tuple[Show, str, int]]
    states: list[tuple[Show, Text]]
    priorities: list[Text]
    groups: list[tuple[str, TextLike]]
    robots: list[tuple[str, TextLike]]
    sorts: list[tuple[Sort, Text]]
    chosen_group: TextLike
    filtered: TextLike


def choice_context(panel: Panel, choice: AlarmChoice, rows: Iterable[AlarmRow]) -> ChoiceContext:
    """`rows` are the alarms of the chosen priority, group and robot, in all states."""
    counts = segment_counts(rows)
    states = [(show, say(f"alarms_show_{show}")) for show in SHOWS]
    priorities = [say(code) for code in PRIORITY_WORDS[1:]]
    groups = {str(alarm.group): alarm.group for alarm in panel.alarms if alarm.group}
    robots = {str(robot.id): robot.name for robot in panel.robots}
    filtered: list[TextLike] = []
    if choice.show not in SEGMENTS:
        filtered.append(dict(states)[choice.show])
    if choice.priority:
        filtered.append(priorities[choice.priority - 1])
    if choice.group:
        filtered.append(groups.get(choice.group, choice.group))
    if choice.robot:
        filtered.append(robots.get(choice.robot, choice.robot))
    if choice.sort != "urgent":
        filtered.append(say(f"alarms_sort_{choice.sort}"))
    return ChoiceContext(
        choice=choice,
        segments=[(show, choice.address(show=show, alarm=""), counts[show]) for show in SEGMENTS],
        states=states,
        priorities=priorities,
        groups=list(groups.items()),
        robots=list(robots.items()),
        sorts=[(sort, say(f"alarms_sort_{sort}")) for sort in SORTS],
        chosen_group=groups.get(choice.group, choice.group),
        filtered=joined(filtered, "between_names") if filtered else "",
    )
