"""Names, ids and the file of places that operators save."""

from pathlib import Path

import pytest

from app.cell.permission.goal_places import MapPoint
from app.cell.places.saved import (
    MAX_FILE_BYTES,
    MAX_SAVED,
    SavedPlaces,
    new_place,
    places_text,
    read_places,
)
from app.cell.robot.transforms import Pose
from app.cell.session.place_file import NAME, read_saved
from app.panel.places import Place
from app.system.texts import Text

POINT = MapPoint(Pose(1.23456789, -2.0, 3.14159265), "map", "0123456789abcdef")


NONE = SavedPlaces()


def made(name: str, saved: SavedPlaces = NONE, robot: str | None = None) -> Place | Text:
    listed = [Place(id="dock", label="Dock", x=0.0, y=0.0)]
    return new_place(name, POINT, robot, listed, saved)


def test_a_place_keeps_its_frame_its_map_and_its_robot_and_is_read_as_it_was_written() -> None:
    place = made("Bay 7", robot="left")
    assert isinstance(place, Place)
    assert (place.x, place.y, place.yaw) == (1.2346, -2.0, 3.1416)
    assert (place.frame, place.map_version, place.robot) == ("map", POINT.version, "left")
    assert read_places(places_text([place]).encode()).places == (place,)


@pytest.mark.parametrize(
    ("name", "made_id"),
    [("Bay 7", "bay_7"), ("2nd bay", "place_2nd_bay"), ("充電器", "place"), ("Dock!", "dock_2")],
)
def test_an_id_is_made_of_the_name_and_is_unique(name: str, made_id: str) -> None:
    place = made(name)
    assert isinstance(place, Place)
    assert place.id == made_id


def test_no_more_than_the_most_are_kept() -> None:
    every = []
    for number in range(MAX_SAVED):
        place = made(f"Bay {number}")
        assert isinstance(place, Place)
        every.append(place)
    refused = made("One more", SavedPlaces(tuple(every)))
    assert isinstance(refused, Text)
    assert refused.code == "place_too_many"
    text = places_text(every).encode()
    assert len(text) < MAX_FILE_BYTES
    assert len(read_places(text).places) == MAX_SAVED


GOOD = 'id = "a"\nlabel = "A"\nx = 1.0\ny = 2.0\nframe = "map"\nmap_version = "0123456789abcdef"\n'


@pytest.mark.parametrize(
    "text",
    [
        "[[place]",
        "\xff",
        "[[place]]\n" + GOOD.replace('frame = "map"\n', ""),
        "[[place]]\n" + GOOD.replace("1.0", "nan"),
        "[[place]]\n" + GOOD.replace("1.0", '"1.0"'),
        "[[place]]\n" + GOOD + "more = 1\n",
        ("[[place]]\n" + GOOD) * 2,
        "place = 3",
        "place = [3]",
        "[[zone]]\n" + GOOD,
        "#" * (MAX_FILE_BYTES + 1),
    ],
)
def test_a_file_that_is_not_whole_has_no_places_and_says_why(text: str) -> None:
    read = read_places(text.encode("latin-1"))
    assert read.places == ()
    assert read.fault


def test_places_of_a_robot_are_its_own_and_those_of_each() -> None:
    left, each = made("Left", robot="left"), made("Each")
    assert isinstance(left, Place)
    assert isinstance(each, Place)
    saved = SavedPlaces((left, each))
    assert saved.of_robot("left") == (left, each)
    assert saved.of_robot("right") == (each,)


def test_no_file_has_no_places_and_a_link_or_a_folder_is_not_read(tmp_path: Path) -> None:
    assert read_saved(tmp_path) == SavedPlaces()
    (tmp_path / NAME).symlink_to(tmp_path / "elsewhere")
    assert read_saved(tmp_path).fault
    (tmp_path / NAME).unlink()
    (tmp_path / NAME).mkdir()
    assert read_saved(tmp_path).fault
