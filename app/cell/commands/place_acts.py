"""Acts on the places that operators save: the rows of save and delete.

`ActRequest.object` is the id of the input that offers them. Of save, `values` has the typed `name`, the
touched pose as `value` ("" for where the robot is), and the version of the `map` that the screen
showed; of delete, the id of the `place`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Protocol

from app.cell.commands.acts import Act, ActRequest, Applied, Finish, server_and_control_permit
from app.cell.permission.goal_places import MapPoint, metres, point_to_save
from app.cell.places.saved import SavedPlaces, new_place
from app.cell.robot.state import RobotState
from app.panel.model import Panel
from app.panel.places import Place
from app.panel.roles import MAINTENANCE
from app.panel.widgets.place import PlaceInput
from app.system.errors import InputError
from app.system.texts import Text, TextLike, say


class PlaceFile(Protocol):
    """The file of saved places."""

    @property
    def saved(self) -> SavedPlaces: ...

    @property
    def is_writing(self) -> bool:
        """Whether a change is on its way to the disk."""

    def write(self, places: tuple[Place, ...]) -> Finish:
        """Begins to write all places; the function returned waits for its end."""


class RobotPlaces(NamedTuple):
    """The places of one robot: `panel` is that of all robots, whose ids are taken. `now` is in
    monotonic seconds."""

    panel: Panel
    robot: RobotState
    file: PlaceFile
    now: Callable[[], float]

    def input(self, name: str) -> PlaceInput | None:
        """The input with this id, if it lets operators save places."""
        inputs = (w for w in self.panel.place_inputs if w.save)
        return next((w for w in inputs if w.id == name and w.map in self.robot.map_views), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceChange(Applied):
    """What an act changed: the place's name, and where it is."""

    name: TextLike = ""
    where: TextLike = ""


def save_refusal(
    places: RobotPlaces, widget: PlaceInput, value: str, version: str
) -> MapPoint | TextLike:
    """The pose that would be saved now, or why none would."""
    if fault := _file_fault(places.file):
        return fault
    return point_to_save(widget, value, version, places.robot, places.now())


def _file_fault(file: PlaceFile) -> Text | None:
    if file.saved.fault:
        return say("place_file_broken", why=file.saved.fault)
    return say("place_being_written") if file.is_writing else None


def _save(places: RobotPlaces, request: ActRequest) -> PlaceChange:
    widget = places.input(request.object)
    if widget is None:
        return PlaceChange(say("saved_place_gone"))
    values = request.values
    point = save_refusal(places, widget, _text(values, "value"), _text(values, "map"))
    if not isinstance(point, MapPoint):
        return PlaceChange(_refusal(point))
    saved = places.file.saved
    place = new_place(_text(values, "name"), point, places.robot.id, places.panel.places, saved)
    if isinstance(place, Text):
        return PlaceChange(place)
    where = where_of(place)
    return PlaceChange(
        finish=places.file.write((*saved.places, place)),
        note=say("log_done_place_save", name=place.label, where=where),
        name=place.label,
        where=where,
    )


def _delete(places: RobotPlaces, request: ActRequest) -> PlaceChange:
    if fault := _file_fault(places.file):
        return PlaceChange(fault)
    saved = places.file.saved
    own = SavedPlaces(saved.of_robot(places.robot.id))
    place = own.place(_text(request.values, "place"))
    if place is None or places.input(request.object) is None:
        return PlaceChange(say("saved_place_gone"))
    kept = tuple(other for other in saved.places if other is not place)
    return PlaceChange(
        finish=places.file.write(kept),
        note=say("log_done_place_delete", name=place.label, where=where_of(place)),
        name=place.label,
        where=where_of(place),
    )


def where_of(place: Place) -> Text:
    """Where a place is on its map."""
    return say("place_at", x=metres(place.x), y=metres(place.y))


def _text(values: Mapping[str, Any], name: str) -> str:
    text = values.get(name, "")
    if not isinstance(text, str):
        raise InputError(f"{name} must be a text")
    return text


def _refusal(reason: TextLike) -> Text:
    return reason if isinstance(reason, Text) else say("with_stop", said=str(reason))


def needs_of_places(panel: Panel, widget: str) -> tuple[str, ...]:
    """The role or group that acts on the places of an input need beside that of the act."""
    needs = next((w.needs for w in panel.place_inputs if w.id == widget), None)
    return (needs,) if needs else ()


def _entry(code: str) -> Callable[[PlaceChange], Text]:
    return lambda change: say(code, name=change.name, where=change.where)


def _row(
    word: str, apply: Callable[[RobotPlaces, ActRequest], PlaceChange], code: str
) -> Act[RobotPlaces, PlaceChange]:
    return Act(word, server_and_control_permit, apply, _entry(code), MAINTENANCE)


PLACE_ACTS: Final[Mapping[str, Act[RobotPlaces, PlaceChange]]] = {
    "save": _row("log_page_place_save", _save, "log_done_place_save"),
    "delete": _row("log_page_place_delete", _delete, "log_done_place_delete"),
}
