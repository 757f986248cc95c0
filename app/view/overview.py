"""The tiles of an overview, one for each robot: pure, from the views of the robots."""

from collections.abc import Mapping
from typing import Final, TypedDict

from app.alarms.rows import AlarmRow
from app.i18n import TextLike, say
from app.view.kinds import Attributes
from app.view.link_status import Lamp
from app.view.view import View

MACHINE_STATE: Final = "machine_state"
# The shape of a robot's word where the panel file has no `[state]`, or the robot can't be reached.
SHAPES: Final[Mapping[str, str]] = {"online": "circle", "unknown": "waiting", "lost": "unknown"}
NOT_RAISED: Final = frozenset({"normal", "shelved", "suppressed", "out_of_service"})


class Tile(TypedDict):
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
    made = Tile(
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


def most_urgent(rows: Mapping[str, AlarmRow]) -> dict[str, AlarmRow]:
    """The most urgent alarm of each robot by the robot's id; `rows` begin with the most urgent."""
    first: dict[str, AlarmRow] = {}
    for row in rows.values():
        if row["state"] not in NOT_RAISED:
            first.setdefault(row["robot"], row)
    return first
