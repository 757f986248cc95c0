"""Faults of a panel file's shape: keys and values that do not match the descriptions."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from app.errors import Fault
from app.interfaces.validation import format_value
from app.panel.faults.places import place_of
from app.panel.faults.table_keys import Model, TableKeys, inner_model, key_faults
from app.panel.faults.toml_lines import Path
from app.panel.faults.wording import closest_name, describe_error
from app.panel.model import Panel
from app.panel.widgets.kinds import KINDS


@dataclass(frozen=True, slots=True)
class ShapeFaults:
    """`faults`; further faults in `covered_places` are consequences of these."""

    faults: list[Fault]
    covered_places: tuple[str, ...]

    def covers(self, fault: Fault) -> bool:
        """Whether another fault is a consequence of these."""
        return any(_is_in(fault.place, place) for place in self.covered_places)


def find_shape_faults(error: ValidationError, tables: Mapping[str, Any]) -> ShapeFaults:
    """One fault for each mistake that pydantic found in a panel file's tables."""
    faults: list[Fault] = []
    keys: dict[Path, TableKeys] = {}
    without_header: list[Path] = []
    for detail in error.errors():
        _, path = _resolve_location(detail["loc"])
        match detail["type"]:
            case "missing" | "extra_forbidden" as kind:
                model, above = _resolve_location(detail["loc"][:-1])
                table = keys.setdefault(above, TableKeys(above, model, _table_at(tables, above)))
                (table.missing if kind == "missing" else table.unknown).append(str(path[-1]))
            case "union_tag_not_found" | "union_tag_invalid":
                faults.append(_kind_fault(path, detail["input"]))
            case "tuple_type" if path[-1] == "group" and isinstance(detail["input"], Mapping):
                without_header.append(path)
            case _:
                key = next(step for step in reversed(path) if isinstance(step, str))
                faults.append(Fault(place_of(path), describe_error(detail, key)))
    of_keys, follow = key_faults(keys)
    faults += of_keys
    for path in without_header:
        fault = Fault(place_of(path), "[[page.group]] is missing above the first [[page.group.widget]]")
        faults.append(fault)
        follow.append((place_of(_last_widget(tables, path[:-1])), fault))

    def follows(fault: Fault) -> bool:
        return any(source is not fault and _is_in(fault.place, place) for place, source in follow)

    own = [fault for fault in faults if not follows(fault)]
    return ShapeFaults(own, tuple(place for place, _ in follow))


def _is_in(place: str, around: str) -> bool:
    return place == around or place.startswith((f"{around}.", f"{around}["))


def _resolve_location(location: tuple[str | int, ...]) -> tuple[Model, Path]:
    """(description, path) of a pydantic location; the path has no kind tags."""
    model: Model = Panel
    path: Path = ()
    before: str | int = ""
    for step in location:
        if path[-2:-1] == ("widget",) and isinstance(before, int) and step in KINDS:
            model = KINDS[str(step)].model
        else:
            path = (*path, step)
            model = inner_model(model, step) or model
        before = step
    return model, path


def _table_at(tables: Any, path: Path) -> Any:
    for step in path:
        tables = tables[step]
    return tables


def _last_widget(tables: Any, page: Path) -> Path:
    """Where the keys of a group without a header are: in the table before it."""
    widgets = _table_at(tables, page).get("widget", ())
    return (*page, "widget", len(widgets) - 1) if widgets else page


def _kind_fault(path: Path, table: Any) -> Fault:
    if not isinstance(table, Mapping):
        return Fault(place_of(path), f"must be a table, not {format_value(table)}")
    kinds = ", ".join(KINDS)
    if "kind" not in table:
        if meant := closest_name("kind", table):
            return Fault(place_of((*path, meant)), 'unknown key; did you mean "kind"?')
        return Fault(place_of(path), f'"kind" is missing; one of {kinds}')
    meant = closest_name(str(table["kind"]).lower(), KINDS)
    hint = f'did you mean "{meant}"?' if meant else f"one of {kinds}"
    return Fault(place_of((*path, "kind")), f"unknown kind {format_value(table['kind'])}; {hint}")
