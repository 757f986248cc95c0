"""An overview: a tile for each robot, and above them the line of sums. Pure, from the views of the
robots."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, TypedDict

from app.cell.alarms.shown import AlarmRow
from app.cell.robot.state import RobotState
from app.cell.view.displays import NOTHING, field_state, is_number, written_number
from app.cell.view.kinds import Attributes
from app.cell.view.link_status import Lamp
from app.cell.view.view import View
from app.panel.numbers import shown_number
from app.panel.widgets.displays import Readout
from app.system.texts import TextLike, say

MACHINE_STATE: Final = "machine_state"
# The shape of a robot's word where the panel file has no `[state]`, or the robot can't be reached.
SHAPES: Final[Mapping[str, str]] = {"online": "circle", "unknown": "waiting", "lost": "unknown"}
NOT_RAISED: Final = frozenset({"normal", "shelved", "suppressed", "out_of_service"})


class RobotTile(TypedDict):
    """The attributes of a tile: `text`, `shape`, `colour` and `since` say what the robot does, as in
    the header of its pages, `state` whether that is known now. `figure` is its figure, `note` what is
    wrong with it and `figure_state` its state. `alarm` is its most urgent alarm with its `priority`, ""
    for none. `link` is its lamp with `link_state`."""

    state: str
    text: TextLike
    shape: str
    colour: str
    since: TextLike
    figure: TextLike
    figure_state: str
    note: TextLike
    alarm: TextLike
    priority: str
    link: TextLike
    link_state: str


def tile(view: View, lamp: Lamp, figure: str, alarm: AlarmRow | None) -> Attributes:
    """The tile of a robot from its view; `figure` is the id of its figure, "" for none."""
    word, shown = view["state"], view["widgets"].get(MACHINE_STATE)
    if shown is None or word["state"] != "online":
        live = "live" if word["state"] == "online" else "old"
        shown = {"state": live, "text": word["text"], "shape": SHAPES[word["state"]]}
    value = view["widgets"].get(figure, {})
    made = RobotTile(
        state=shown["state"],
        text=shown["text"],
        shape=shown["shape"],
        colour=shown.get("colour", "none"),
        since=shown.get("since", ""),
        figure=value.get("text", ""),
        figure_state=value.get("state", ""),
        note=value.get("note", ""),
        alarm=alarm["text"] if alarm else say("alarm_none"),
        priority=str(alarm["priority"]) if alarm else "",
        link=lamp["text"],
        link_state=lamp["state"],
    )
    return dict(made)


class TileFigure(TypedDict):
    """The number on a robot's tile, None if there is none; `live` says whether it is known now."""

    number: float | None
    live: bool


def figure_now(readout: Readout, robot: RobotState, now: float) -> TileFigure:
    """The figure of a robot at `now` (monotonic seconds)."""
    field = field_state(readout, robot, now)
    number = shown_number(readout, field.value) if is_number(field.value) else None
    return TileFigure(number=number, live=field.state == "live")


def sums(
    tiles: Iterable[Attributes],
    words: Sequence[TextLike],
    figures: Sequence[TileFigure],
    readout: Readout | None,
) -> Attributes:
    """The attributes of the line of sums: `count0`, `text0`, … say how many robots do what, in the
    order of `words`, then as the tiles come; those that are left over are "". `total` is the sum of the
    figures, written as `readout`, and `total_state` "live" if each of them is known now."""
    texts = [shown["text"] for shown in tiles]
    known = [*words, *(text for text in texts if text not in words)]
    distinct = [text for place, text in enumerate(known) if text in texts and text not in known[:place]]
    shown: dict[str, Any] = {"state": "live"}
    for place in range(len(texts)):
        text = distinct[place] if place < len(distinct) else ""
        shown |= {f"count{place}": str(texts.count(text)) if text else "", f"text{place}": text}
    return shown | _total(figures, readout)


def _total(figures: Sequence[TileFigure], readout: Readout | None) -> dict[str, Any]:
    numbers = [figure["number"] for figure in figures if figure["number"] is not None]
    if readout is None or not numbers or len(numbers) < len(figures):
        return {"total": NOTHING, "total_state": "waiting"}
    live = all(figure["live"] for figure in figures)
    total = written_number(sum(numbers), readout.format, readout.unit)
    return {"total": total, "total_state": "live" if live else "old"}


def most_urgent(rows: Mapping[str, AlarmRow]) -> dict[str, AlarmRow]:
    """The most urgent alarm of each robot by the robot's id; `rows` begin with the most urgent."""
    first: dict[str, AlarmRow] = {}
    for row in rows.values():
        if row["state"] not in NOT_RAISED:
            first.setdefault(row["robot"], row)
    return first


class Tiles:
    """The tiles of all robots and their sums, each made again only when what it shows has changed: a
    change of one robot is shown on the pages of all."""

    def __init__(self, words: Sequence[TextLike], readout: Readout | None) -> None:
        """`words` and `readout` as in `sums`."""
        self._words = words
        self._readout = readout
        self._parts: dict[str, tuple[Any, ...]] = {}
        self._tiles: dict[str, Attributes] = {}
        self._summed: tuple[list[Attributes], list[TileFigure]] | None = None
        self._sums: Attributes = {}

    def tile(
        self, name: str, view: View, lamp: Lamp, figure: str, alarm: AlarmRow | None
    ) -> Attributes:
        """The tile with this id; the rest as in `tile`."""
        widgets = view["widgets"]
        parts = (view["state"], widgets.get(MACHINE_STATE), widgets.get(figure), lamp, alarm)
        if self._parts.get(name) != parts:
            self._parts[name], self._tiles[name] = parts, tile(view, lamp, figure, alarm)
        return self._tiles[name]

    def sums(self, tiles: Iterable[Attributes], figures: Sequence[TileFigure]) -> Attributes:
        summed = [*tiles], [*figures]
        if self._summed != summed:
            self._summed, self._sums = summed, sums(summed[0], self._words, figures, self._readout)
        return self._sums
