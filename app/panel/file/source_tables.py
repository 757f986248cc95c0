"""Writes the keys of a source into each table that names it, before the tables are checked."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

from pydantic import BaseModel

from app.panel.alarm import LIMIT_KEYS
from app.panel.condition import COMPARISONS, Condition
from app.panel.file.keys import inner_model, known_keys
from app.panel.file.wording import known_hint
from app.panel.model import Panel
from app.panel.numbers import Scaling, sent_number
from app.panel.source import NAME, Source, reads_source
from app.panel.widgets.kinds import KINDS
from app.ros.messages.validation import format_value
from app.system.errors import Fault, Note

OWN: Final = ("topic", "type", "qos")  # of the source alone
OF_NUMBER: Final = frozenset({"scale", "offset"})
BESIDE: Final = frozenset({"setpoint", "target"})  # fields beside the number of a widget


@dataclass(frozen=True, slots=True)
class Expanded:
    """The tables with the keys of their sources. `origins` are the places of keys in the file, by the
    places that they were written to; `notes` are about numbers that had another meaning."""

    tables: dict[str, Any]
    faults: list[Fault] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    origins: dict[str, str] = field(default_factory=dict)

    def at_origin(self, fault: Fault) -> Fault:
        """The fault at the place in the file."""
        for place, origin in self.origins.items():
            if fault.place == place or fault.place.startswith((f"{place}.", f"{place}[")):
                return fault.at(f"{origin}{fault.place[len(place) :]}")
        return fault


def expanded(tables: dict[str, Any]) -> Expanded:
    """The tables of a panel file, whose sources are good, with the keys of those that they name."""
    sources = enumerate(tables.get(NAME, ()))
    known = {table["id"]: (f"{NAME}[{number}]", table) for number, table in sources}
    made = Expanded({})
    made.tables.update(_Walk(known, made).table(Panel, tables, ""))
    return made


class _Walk:
    def __init__(self, sources: Mapping[str, tuple[str, Mapping[str, Any]]], made: Expanded) -> None:
        self._sources = sources
        self._made = made

    def table(self, model: type[BaseModel] | None, table: dict[str, Any], place: str) -> dict[str, Any]:
        """A table and those in it, with the keys of their sources."""
        kind = table.get("kind")
        model = KINDS[kind].model if isinstance(kind, str) and kind in KINDS else model
        if model is None or model is Source:
            return table
        whole = {
            key: self._value(inner_model(model, key), value, f"{place}.{key}".strip("."))
            for key, value in table.items()
        }
        if NAME in table and reads_source(model):
            whole = self._with_source(whole, model, place)
        for key in BESIDE & table.keys():
            if isinstance(table[key], dict) and NAME in table[key]:
                self._made.notes.extend(_beside_notes(whole, whole[key], f"{place}.{key}.{NAME}"))
        return whole

    def _value(self, model: type[BaseModel] | None, value: Any, place: str) -> Any:
        if isinstance(value, dict):
            return self.table(model, value, place)
        if isinstance(value, list):
            items = enumerate(value)
            return [self._value(model, item, f"{place}[{number}]") for number, item in items]
        return value

    def _with_source(self, table: dict[str, Any], model: type[BaseModel], place: str) -> dict[str, Any]:
        name = table.pop(NAME)
        if not isinstance(name, str) or name not in self._sources:
            there = f"; {known_hint(str(name), sorted(self._sources))}" if self._sources else ""
            message = f"no source {format_value(name)}{there or f': write a [[{NAME}]] with this id'}"
            self._made.faults.append(Fault(f"{place}.{NAME}", message))
            return table
        at, source = self._sources[name]
        for key in OWN:
            if key in table:
                message = f'stands beside source: "{name}" has it; write the one or the other'
                self._made.faults.append(Fault(f"{place}.{key}", message))
        naming = _Naming(source, dict(table), model, place)
        self._made.faults.extend(naming.faults())
        self._made.notes.extend(naming.notes())
        for key in naming.shared:
            table[key] = source[key]
            self._made.origins[f"{place}.{key}"] = f"{at}.{key}"
        return table


@dataclass(frozen=True)
class _Naming:
    """A table that names a source.

    What is about one field is not that of another field. A scale, an offset and the unit of the result
    belong together: all of them, or none."""

    source: Mapping[str, Any]
    table: Mapping[str, Any]
    model: type[BaseModel]
    place: str

    @cached_property
    def _keys(self) -> list[str]:
        return known_keys(self.model)

    @cached_property
    def _is_same_field(self) -> bool:
        """Whether the table reads the source's field."""
        field = self.source.get("field", "data")
        is_same = self.table.get("field", field) == field
        return "field" in self._keys and not self._is_about_topic and is_same

    @property
    def _is_about_topic(self) -> bool:
        """Whether it is an alarm that reads no field."""
        return bool({"stale_s", "diagnostics", "list"} & self.table.keys())

    @cached_property
    def _scaling(self) -> Scaling | None:
        """That of the source, where the table has none of its own."""
        if not OF_NUMBER & self.source.keys() or OF_NUMBER & self.table.keys():
            return None
        return Scaling(self.source.get("scale", 1.0), self.source.get("offset", 0.0))

    @cached_property
    def shared(self) -> tuple[str, ...]:
        """The keys that the table has from its source: those that it knows and does not have itself."""
        shared = {*self.source} - {"id"}
        if self._is_about_topic:
            shared &= {*OWN}
        elif "field" in self._keys and not self._is_same_field:
            shared &= {*OWN, "max_age_s"}
        elif OF_NUMBER & self.table.keys():
            shared -= {*OF_NUMBER, "unit"}
        known = shared.intersection(self._keys).difference(self.table)
        return tuple(key for key in self.source if key in known)

    def faults(self) -> Iterator[Fault]:
        """Faults of numbers that would be shown or compared in another unit than that of the source."""
        if not self._is_same_field:
            return
        name, unit = self.source["id"], self.source.get("unit")
        if self._scaling and not {*self._keys} >= OF_NUMBER:
            message = (
                f'"{name}" has scale or offset, and here the number counts as the robot sends it: '
                "write topic, type and field, or name a source without them"
            )
            yield Fault(f"{self.place}.{NAME}", message)
        own = self.table.get("unit", unit)
        if unit and own != unit and not OF_NUMBER & self.table.keys():
            message = (
                f'{_text(own)} is not the unit of source "{name}", {_text(unit)}: leave it out, or '
                "write scale and offset too"
            )
            yield Fault(f"{self.place}.unit", message)

    def notes(self) -> Iterator[Note]:
        """The limits that up to 0.1 counted for the number as the robot sends it."""
        if not self._scaling or not self._is_same_field or self._scaling.scale == 0:
            return
        is_condition = issubclass(self.model, Condition)
        unit = self.table.get("unit", self.source.get("unit", ""))
        for key in COMPARISONS if is_condition else LIMIT_KEYS if "offset" in self.source else ():
            limits = self.table.get(key)
            for limit in limits if isinstance(limits, list) else [limits]:
                if isinstance(limit, int | float) and not isinstance(limit, bool):
                    yield Note(f"{self.place}.{key}", _readings(limit, unit, self._scaling))


def _beside_notes(widget: Mapping[str, Any], field: Mapping[str, Any], place: str) -> Iterator[Note]:
    """That a field beside the number of a widget had the widget's scale up to 0.1."""
    own, its = (Scaling(t.get("scale", 1.0), t.get("offset", 0.0)) for t in (widget, field))
    if OF_NUMBER & field.keys() and own != its:
        before = f"value * {own.scale:g} + {own.offset:g}, as the number beside it"
        yield Note(
            place, f"shows value * {its.scale:g} + {its.offset:g}. Up to version 0.1 it showed {before}"
        )


def _readings(limit: float, unit: Any, scaling: Scaling) -> str:
    sent = sent_number(*scaling, limit)
    shown = f"{limit:g} {_text(unit)}".strip()
    return (
        f"is {shown}, which is {sent:.15g} in the message. Up to version 0.1 it was {limit:g} in the "
        "message. With scale, offset and unit here as at the source, this note goes"
    )


def _text(unit: Any) -> str:
    """A unit, which may be a text for each language."""
    return str(next(iter(unit.values()), "")) if isinstance(unit, Mapping) else str(unit)
