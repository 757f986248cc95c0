"""Places that are saved while the panel runs: their names, and their text in TOML. Pure.

The text is a part of a panel file: `[[place]]` tables, each with the frame and the version of its map.
"""

import tomllib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from pydantic import ValidationError

from app.cell.people.look_alikes import look_alike, mixes_scripts
from app.cell.permission.goal_places import MapPoint
from app.cell.recipes.recipe import clean_name, id_for, name_fault
from app.panel.places import Place
from app.system.texts import Text, TextLike, say
from app.system.texts.text import each_language
from app.system.toml_values import key_text, value_text

MAX_SAVED: Final = 200
MAX_FILE_BYTES: Final = 200_000
DECIMALS: Final = 4  # of metres and radians
TABLE: Final = "place"
OWN_KEYS: Final = ("id", "label", "x", "y", "yaw", "frame", "map_version", "robot")
NEEDED: Final = ("frame", "map_version")  # of a saved place, beside those of each


@dataclass(frozen=True, slots=True)
class SavedPlaces:
    """The places of the file, in their order. `fault`: why it can't be read, "" if it can; then there
    are none, and none is saved, so that the file stays as it is."""

    places: tuple[Place, ...] = ()
    fault: TextLike = ""

    def of_robot(self, robot: str | None) -> tuple[Place, ...]:
        """Those of one robot; of a panel with one robot, all."""
        return tuple(place for place in self.places if place.robot in (None, robot))

    def place(self, place_id: str) -> Place | None:
        return next((place for place in self.places if place.id == place_id), None)


def new_place(
    name: str, point: MapPoint, robot: str | None, listed: Sequence[Place], saved: SavedPlaces
) -> Place | Text:
    """The place with a typed name, or why it can't have it. `listed` are the places of the panel
    file."""
    name = clean_name(name)
    if fault := _name_fault(name, (*listed, *saved.places)):
        return fault
    if len(saved.places) >= MAX_SAVED:
        return say("place_too_many", most=MAX_SAVED)
    made = _id_for(name, [str(place.id) for place in (*listed, *saved.places)])
    x, y, yaw = (round(part, DECIMALS) for part in point.pose)
    values = (made, name, x, y, yaw, point.frame, point.version, robot)
    return Place.model_validate(
        {key: value for key, value in zip(OWN_KEYS, values, strict=True) if value is not None}
    )


def _id_for(name: str, taken: Sequence[str]) -> str:
    """An id of the panel file: it begins with a letter."""
    made = id_for(name, taken, TABLE)
    return made if made[0].isalpha() else id_for(f"{TABLE} {name}", taken)


def _name_fault(name: str, others: Iterable[Place]) -> Text | None:
    if fault := name_fault(name, ()):
        return fault
    if mixes_scripts(name):
        return say("users_name_mixed", name=name)
    taken = [text for place in others for text in each_language(place.label).values()]
    if name_fault(name, taken):
        return say("place_name_taken", name=name)
    if other := look_alike(name, taken):
        return say("users_name_alike", name=name, other=other)
    return None


def places_text(places: Iterable[Place]) -> str:
    """The places as a part of a panel file."""
    return "\n".join(map(_table, places))


def _table(place: Place) -> str:
    lines = [f"[[{TABLE}]]"]
    for key in OWN_KEYS:
        value = getattr(place, key)
        if value is not None:
            lines.append(f"{key_text(key)} = {value_text(value)}")
    return "\n".join((*lines, ""))


def read_places(content: bytes) -> SavedPlaces:
    """The places of a file, or why it is none."""
    if len(content) > MAX_FILE_BYTES:
        return SavedPlaces(fault=say("recipe_file_too_long"))
    try:
        tables = tomllib.loads(content.decode())
    except ValueError as error:  # UnicodeDecodeError and TOMLDecodeError
        return SavedPlaces(fault=say("recipe_file_no_toml", why=str(error)))
    try:
        places = tuple(_checked(tables))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        return SavedPlaces(fault=say("recipe_file_incomplete", key=key))
    except _WrongKey as error:
        return SavedPlaces(fault=say("recipe_file_incomplete", key=str(error)))
    return SavedPlaces(places)


class _WrongKey(Exception):
    """The key that is missing or wrong."""


def _checked(tables: dict[str, Any]) -> Iterator[Place]:
    every = tables.pop(TABLE, [])
    if tables or not isinstance(every, list) or len(every) > MAX_SAVED:
        raise _WrongKey(next(iter(tables), TABLE))
    known: set[str] = set()
    for number, table in enumerate(every):
        place = Place.model_validate(table)
        for key in NEEDED:
            if getattr(place, key) is None:
                raise _WrongKey(f"{TABLE}[{number}].{key}")
        if str(place.id) in known or not isinstance(place.label, str):
            raise _WrongKey(f"{TABLE}[{number}].id")
        known.add(str(place.id))
        yield place
