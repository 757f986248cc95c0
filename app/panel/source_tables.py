"""Writes the keys of a source into each table that names it, before the tables are checked."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from pydantic import BaseModel

from app.errors import Fault
from app.interfaces.validation import format_value
from app.panel.condition import Condition
from app.panel.faults.table_keys import inner_model, known_keys
from app.panel.faults.wording import list_names
from app.panel.model import Panel
from app.panel.source import NAME, Source, reads_source
from app.panel.widgets.kinds import KINDS

OWN: Final = ("topic", "type", "qos")  # of the source alone
OF_NUMBER: Final = frozenset({"scale", "offset"})


@dataclass(frozen=True, slots=True)
class Expanded:
    """The tables with the keys of their sources; `origins` are the places of keys in the file, by the
    places that they were written to."""

    tables: dict[str, Any]
    faults: list[Fault] = field(default_factory=list)
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
        if NAME not in table or not reads_source(model):
            return whole
        keys = [
            key for key in known_keys(model) if not issubclass(model, Condition) or key not in OF_NUMBER
        ]
        return self._with_source(whole, keys, place)

    def _value(self, model: type[BaseModel] | None, value: Any, place: str) -> Any:
        if isinstance(value, dict):
            return self.table(model, value, place)
        if isinstance(value, list):
            items = enumerate(value)
            return [self._value(model, item, f"{place}[{number}]") for number, item in items]
        return value

    def _with_source(self, table: dict[str, Any], keys: list[str], place: str) -> dict[str, Any]:
        name = table.pop(NAME)
        if not isinstance(name, str) or name not in self._sources:
            there = f"; there is {list_names(sorted(self._sources))}" if self._sources else ""
            message = f"no source {format_value(name)}{there or f': write a [[{NAME}]] with this id'}"
            self._made.faults.append(Fault(f"{place}.{NAME}", message))
            return table
        at, source = self._sources[name]
        for key in OWN:
            if key in table:
                message = f'stands beside source: "{name}" has it; write the one or the other'
                self._made.faults.append(Fault(f"{place}.{key}", message))
        for key in _shared(source, table, keys):
            table[key] = source[key]
            self._made.origins[f"{place}.{key}"] = f"{at}.{key}"
        return table


def _shared(source: Mapping[str, Any], table: Mapping[str, Any], keys: list[str]) -> Iterator[str]:
    """The keys that a table has from its source: those that it knows and does not have itself.

    What is about one field is not that of another field. A scale, an offset and the unit of the result
    belong together: all of them, or none. A condition compares what the robot sends, unless it has a
    scale itself."""
    shared = {*source} - {"id"}
    is_about_topic = {"stale_s", "diagnostics", "list"} & table.keys()  # of an alarm
    if is_about_topic:
        shared &= {*OWN}
    elif table.get("field", source.get("field")) != source.get("field"):
        shared &= {*OWN, "max_age_s"}
    scaling = OF_NUMBER & source.keys()
    if scaling and (OF_NUMBER & table.keys() or not scaling <= {*keys}):
        shared -= {*OF_NUMBER, "unit", *(() if {*keys} >= OF_NUMBER else ("format",))}
    return (key for key in source if key in shared and key in keys and key not in table)
