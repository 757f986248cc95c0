"""An overview in the gallery: a tile for each thing that a robot's tile may show."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from app.cell.view.kinds import Attributes
from app.cell.view.overview import RobotTile, TileFigure, sums
from app.cell.view.times import span_text
from app.panel.keys import SUMS, RobotEntry
from app.system.texts import number, say
from tests.gallery import texts

UNIT: Final = "boxes/h"
ALARM_AFTER_S: Final = 41.0


class OverviewPage(NamedTuple):
    """The keys of a page that an overview shows."""

    total: Any


class Overview(NamedTuple):
    """What the template of an overview needs of panel, page and view."""

    robots: Sequence[RobotEntry]
    page: OverviewPage
    widgets: Mapping[str, Attributes]
    tile_pages: Mapping[str, str]


def _robot(own_id: str, name: str) -> RobotEntry:
    figure = {"topic": "/rate", "type": "std_msgs/msg/Float32", "unit": UNIT, "format": ".0f"}
    return RobotEntry.model_validate({"id": own_id, "name": name, "overview": figure})


def _tiles() -> list[Attributes]:
    """Running, in fault, with another alarm, and without contact."""
    running = RobotTile(
        state="live",
        text=texts.PALLETIZING.shown,
        shape="play",
        colour="grey",
        since=say("machine_state_for", duration=span_text(4 * 3600 + 120)),
        figure=number("291", UNIT),
        figure_state="live",
        note="",
        alarm=say("alarm_none"),
        priority="",
        link=say("ok"),
        link_state="ok",
    )
    since = say("machine_state_for", duration=span_text(ALARM_AFTER_S))
    fault = {"text": texts.ERROR.shown, "shape": "cross", "colour": "red", "since": since}
    alarm = {"alarm": texts.AIR_INLET.shown, "priority": "1"}
    low = {"figure": number("198", UNIT), "alarm": texts.GUARD_DOOR.shown, "priority": "3"}
    lost = {
        "state": "old",
        "text": say("state_lost"),
        "shape": "unknown",
        "colour": "none",
        "since": "",
    }
    old = {"figure_state": "old", "note": say("readout_old", age=span_text(ALARM_AFTER_S))}
    link = {"link": say("lost"), "link_state": "bad"}
    return [
        {**running},
        {**running, **fault, **alarm},
        {**running, **low},
        {**running, **lost, **old, **link},
    ]


def overview() -> Overview:
    """An overview of four robots."""
    robots = [_robot(f"example_cell_{place}", f"Cell {place}") for place in range(1, 5)]
    tiles = _tiles()
    numbers = (291, 291, 198, 291)
    figures = [
        TileFigure(number=numbers[place], live=tiles[place]["state"] == "live") for place in range(4)
    ]
    return Overview(
        robots=robots,
        page=OverviewPage(texts.BOXES_COUNT.shown),
        widgets={robot.tile_id: shown for robot, shown in zip(robots, tiles, strict=True)}
        | {SUMS: sums(tiles, [], figures, robots[0].figure)},
        tile_pages={str(robot.id): "" for robot in robots},
    )
