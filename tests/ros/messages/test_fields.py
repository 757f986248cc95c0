"""Fields read at their places: the same as of the whole message, whatever lies around them."""

import json
import random
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import pytest

from app.ros.messages import Fields, Interfaces, load_interfaces, to_plain
from app.ros.messages.definitions import FLOAT_TYPES, Structure, Type
from app.system.errors import DecodeError
from tests.ros.messages.test_interfaces import garbage
from tests.ros.messages.test_values import FIELDS
from tests.support.form import several
from tests.support.samples import Samples

JAZZY: Final = load_interfaces("jazzy")
JOINTS: Final = "sensor_msgs/msg/JointState"
DIAGNOSTICS: Final = "diagnostic_msgs/msg/DiagnosticArray"
HEADER: Final = {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "f"}
UNKNOWN: Final = object()


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Interfaces:
    """Messages with all that a message may have, inside of each other."""
    folder: Path = tmp_path_factory.mktemp("share") / "cell_msgs/msg"
    folder.mkdir(parents=True)
    (folder / "Everything.msg").write_text(FIELDS)
    (folder / "Part.msg").write_text("uint8 A=1\nuint8 kind\nbool fits\nstring name\nwstring title\n")
    (folder / "Shelf.msg").write_text(
        "int16 number\nPart[] parts\nPart[2] pair\nEverything[<=2] more\nbool last\n"
    )
    (folder / "Store.msg").write_text(
        "bool open\nShelf[] shelves\nstring[] names\nint32[] ids\nfloat64[] weights\nPart[] parts\n"
        "uint8[3] codes\nfloat32[3] sizes\nbuiltin_interfaces/Time[] times\nint8 level\n"
    )
    return Interfaces("jazzy", [folder.parent])


# What a path leads to in fields as they were encoded.


def at_path(fields: Any, steps: list[tuple[str, Any]]) -> Any:
    """The value that these steps lead to; UNKNOWN where it is not there, or not the only one."""
    value_at_place, around = fields, fields
    for how, part in steps:
        if how == "name":
            around, value_at_place = value_at_place, value_at_place[part]
        elif how == "index":
            value_at_place = value_at_place[part] if part < len(value_at_place) else UNKNOWN
        else:
            key, value = part
            keys = [element[key] for element in value_at_place] if how == "key" else around[key]
            places = [place for place, candidate in enumerate(keys) if candidate == value]
            fits = len(places) == 1 and len(keys) == len(value_at_place)
            value_at_place = value_at_place[places[0]] if fits else UNKNOWN
        if value_at_place is UNKNOWN:
            break
    return value_at_place


def written(steps: list[tuple[str, Any]]) -> str:
    """The same steps as a path."""
    text = ""
    for how, part in steps:
        match how:
            case "name":
                text += f".{part}" if text else part
            case "index":
                text += f"[{part}]"
            case _:
                key, value = part
                quoted = json.dumps(value) if isinstance(value, bool | int) else quote(value)
                text += f"[{key}={quoted}]"
    return text


def quote(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"


class Walker:
    """Chooses paths at random through what a type has."""

    def __init__(self, interfaces: Interfaces, seed: int) -> None:
        self._structures = interfaces.structures
        self._chance = random.Random(seed)

    def steps(self, type_name: str, fields: Any) -> list[tuple[str, Any]]:
        made: list[tuple[str, Any]] = []
        structure, value = self._structures[type_name], fields
        while structure.fields:
            field = self._chance.choice(structure.fields)
            made.append(("name", field.name))
            kind, around, value = field.type, value, value[field.name]
            if kind.container != "one" and self._chance.random() < 0.8:
                step = self._element(kind, structure, around, value)
                made.append(step)
                value = at_path(around, [("name", field.name), step])
                kind = kind.element
            if (
                value is UNKNOWN
                or not kind.is_nested
                or kind.container != "one"
                or self._chance.random() < 0.1
            ):
                break
            structure = self._structures[kind.name]
        return made

    def _element(self, kind: Type, around: Structure, there: Any, value: Any) -> tuple[str, Any]:
        inner = self._structures[kind.name].fields if kind.is_nested else ()
        own = [field.name for field in inner if _is_key(field.type)]
        lists = [
            field.name
            for field in around.fields
            if field.type.container != "one" and _is_key(field.type.element)
        ]
        lists = [name for name in lists if name not in {field.name for field in inner}]
        if own and self._chance.random() < 0.5:
            key = self._chance.choice(own)
            values = [element[key] for element in value] or [self._any(inner, key)]
            return "key", (key, self._chance.choice(values))
        if lists and self._chance.random() < 0.5:
            key = self._chance.choice(lists)
            values = there[key] or [self._any(around.fields, key)]
            return "beside", (key, self._chance.choice(values))
        most = (kind.size or 4) - 1
        return "index", self._chance.randint(0, most)

    def _any(self, fields: Any, key: str) -> Any:
        kind = next(field.type.element for field in fields if field.name == key)
        return {"bool": True, "string": "x", "wstring": "x"}.get(kind.name, 1)


def _is_key(kind: Type) -> bool:
    return kind.container == "one" and not kind.is_nested and kind.name not in FLOAT_TYPES


def plain(value: Any) -> str:
    return json.dumps(to_plain(value) if not isinstance(value, dict | list) else _plain(value))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list) else to_plain(value)


def test_field_read_at_its_place_equals_the_sent_field(cell: Interfaces) -> None:
    counts = {"key": 0, "beside": 0, "index": 0, "unknown": 0}
    for seed in range(several(250, 600)):
        walker = Walker(cell, seed)
        fields = Samples(cell.structures, seed).fields("cell_msgs/msg/Store")
        ways = [walker.steps("cell_msgs/msg/Store", fields) for _ in range(seed % 7 + 1)]
        reader = cell.field_reader("cell_msgs/msg/Store", map(written, ways))
        read = reader.read(cell.encode("cell_msgs/msg/Store", fields))
        for way in ways:
            wanted, value = at_path(fields, way), read.get(written(way))
            if wanted is UNKNOWN:
                assert value is None, (seed, written(way))
            else:
                assert plain(value) == plain(wanted), (seed, written(way))
            for how, _ in way:
                counts[how] = counts.get(how, 0) + 1
            counts["unknown"] += wanted is UNKNOWN
    assert min(counts.values()) > 50, counts


def test_of_every_type_that_is_built_in_each_field_is_read(cell: Interfaces) -> None:
    for seed, name in enumerate(JAZZY.structures):
        fields = Samples(JAZZY.structures, seed).fields(name)
        reader = JAZZY.field_reader(name, fields)
        read = reader.read(JAZZY.encode(name, fields))
        for field, value in fields.items():
            assert plain(read.get(field)) == plain(value), (name, field)


def test_reader_without_fields_still_validates_the_message(cell: Interfaces) -> None:
    for seed, name in list(enumerate(cell.structures))[:: several(2, 1)]:
        whole = cell.encode(name, Samples(cell.structures, seed).fields(name))
        reader = cell.field_reader(name, ())
        assert isinstance(reader.read(whole), Fields)
        for length in range(len(whole) - 3):
            with pytest.raises(DecodeError):
                reader.read(whole[:length])
        with pytest.raises(DecodeError, match="it ends at"):
            reader.read(whole + bytes(4))


def test_damage_raises_nothing_but_a_decode_error(cell: Interfaces) -> None:
    store = "cell_msgs/msg/Store"
    fields = Samples(cell.structures, 5).fields(store, "most")
    whole = cell.encode(store, fields)
    walker = Walker(cell, 1)
    reader = cell.field_reader(store, {written(walker.steps(store, fields)) for _ in range(40)})
    chance = random.Random(2)
    for _ in range(several(300, 4000)):
        at, byte = chance.randrange(len(whole)), chance.choice((0, 1, 0x7F, 0xFF))
        readable(reader, whole[:at] + bytes((byte,)) + whole[at + 1 :])
    for seed, name in list(enumerate(cell.structures))[:: several(4, 1)]:
        own = cell.field_reader(name, [field.name for field in cell.structures[name].fields])
        for data in garbage(seed):
            readable(own, data)


def readable(reader: Any, data: bytes) -> None:
    with suppress(DecodeError):
        reader.read(data)
