"""What an input for places shows, and the card of what is chosen: pure, from (widget, robot, time)."""

import math
from typing import Any, Final, NamedTuple

from app.cell.permission.goal_places import (
    Choice,
    choice_of,
    input_verdict,
    map_here,
    metres,
    name_of,
    place_choice,
    places_of,
    radius_of,
    robot_pose,
)
from app.cell.robot.state import RobotState
from app.cell.robot.transforms import Pose
from app.panel.widgets.place import PlaceInput
from app.system.texts import TextLike, number, say

DECIMALS: Final = 3  # of metres and radians that a page gets
NEAR_M: Final = 10.0  # below which a distance has a decimal
# Counted from the east, against the clock.
DIRECTIONS: Final = (
    *("direction_e", "direction_ne", "direction_n", "direction_nw"),
    *("direction_w", "direction_sw", "direction_s", "direction_se"),
)


class CardRow(NamedTuple):
    """A line of a card: what it is about, and the text."""

    name: TextLike
    text: TextLike


class Card(NamedTuple):
    """What is chosen, as an operator reads it before it is sent: `pose` is what would be sent.
    `level` is the id of its level, "" on a map without levels and where that is not known. `refusal` is
    why it would be refused now, "" if it would not."""

    name: TextLike
    rows: tuple[CardRow, ...]
    pose: Pose
    level: str
    refusal: TextLike


def place_input(widget: PlaceInput, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes: `state` (live, missing), `note`, why nothing may be sent now, "" if something may,
    and `places`, each with `id`, `label`, `icon`, its pose, its `level`, the distance to the robot, ""
    where that is not known, and the `reason` why it is locked; `commands` are those that send it,
    by their ids, and `radius` (metres) is how much floor must be free; and when they change."""
    verdict = input_verdict(widget, robot, now)
    shown, on = robot_pose(widget, robot, now), map_here(widget, robot, now)
    here = None if shown.note else shown.pose
    choices = [place_choice(widget, place, robot, on) for place in places_of(widget, robot)]
    places = [_shown_place(choice, here) for choice in choices]
    note = "" if verdict.permitted else verdict.reason or ""
    commands = [name for name, inputs in robot.place_inputs.items() if widget in inputs]
    shown_now = {"state": "missing" if note else "live", "note": note, "places": places}
    return {**shown_now, "radius": radius_of(widget, robot), "commands": commands}, verdict.until


def _shown_place(choice: Choice, here: Pose | None) -> dict[str, Any]:
    place, pose = choice.place, choice.pose
    assert place is not None
    return {
        "id": place.id,
        "label": place.label,
        "icon": place.icon or "",
        "pose": [round(part, DECIMALS) for part in pose],
        "level": "" if choice.level is None else choice.level.id,
        "distance": "" if here is None or choice.is_elsewhere else distance(here, pose),
        "reason": choice.refusal,
    }


def card_of(widget: PlaceInput, value: Any, robot: RobotState, now: float) -> Card:
    """The card of a value; InputError for one that chooses nothing."""
    choice = choice_of(widget, value, robot, now)
    verdict = input_verdict(widget, robot, now)
    shown = robot_pose(widget, robot, now)
    refusal = choice.refusal if verdict.permitted else verdict.reason or ""
    pose = choice.pose
    where = say("place_at", x=metres(pose.x), y=metres(pose.y))
    rows = [CardRow(say("place_row_place"), where)]
    if choice.place is not None:
        rows = [CardRow(say("place_row_place"), choice.place.label), CardRow("", where)]
    level = choice.level
    if level is not None and level.label:
        rows.append(CardRow("", level.label))
    rows.append(CardRow(say("place_row_turned"), turned(pose.yaw)))
    if shown.pose is not None and not shown.note and not choice.is_elsewhere:
        rows.append(
            CardRow(say("place_row_way"), say("place_straight", distance=distance(shown.pose, pose)))
        )
    if not refusal:
        free = say("place_free", radius=number(f"{radius_of(widget, robot):g}", "m"))
        rows.append(CardRow(say("place_row_floor"), free))
    return Card(name_of(choice), tuple(rows), pose, level.id if level else "", refusal)


def distance(first: Pose, second: Pose) -> TextLike:
    """How far apart two poses are, in a straight line."""
    length = math.hypot(second.x - first.x, second.y - first.y)
    return number(f"{length:.1f}" if length < NEAR_M else f"{length:,.0f}", "m")


def turned(yaw: float) -> TextLike:
    """An angle in radians as degrees, and the direction on the map."""
    degrees = round(math.degrees(yaw)) % 360
    direction = DIRECTIONS[round(degrees / 45) % len(DIRECTIONS)]
    return say("place_turned", degrees=str(degrees), direction=say(direction))
