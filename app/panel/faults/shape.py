"""Faults of a panel file's shape: keys and values that do not match the descriptions."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from pydantic import ValidationError

from app.errors import Fault
from app.interfaces.validation import format_value
from app.panel.faults.places import place_of
from app.panel.faults.table_keys import Model, TableKeys, inner_model, key_faults, known_keys
from app.panel.faults.toml_lines import Path
from app.panel.faults.wording import closest_name, describe_error
from app.panel.model import Panel
from app.panel.same_widgets import NAME as SAME
from app.panel.widgets.kinds import KINDS

_PRESS: Final = (
    'a button is "publish" for a topic, "call" for a service, "action" for a goal, "hold" while held'
)
# What other programs call a kind → the kind here.
OTHER_NAMES: Final[Mapping[str, str]] = {
    **dict.fromkeys(("button", "pushbutton", "key", "command", "momentary"), _PRESS),
    **dict.fromkeys(
        ("estop", "stop", "emergencystop", "emergency"),
        'a stop is "publish" or "call" with role = "stop"; it does not replace the emergency stop',
    ),
    **dict.fromkeys(("lamp", "led", "light", "status", "state"), 'a lamp is an "indicator"'),
    **dict.fromkeys(("chart", "plot", "graph", "timeseries", "history"), 'a curve is a "trend"'),
    **dict.fromkeys(("bar", "progress", "progressbar", "meter", "dial"), 'a scale is a "gauge"'),
    **dict.fromkeys(("dropdown", "combo", "combobox", "radio", "choice"), 'a choice is a "select"'),
    **dict.fromkeys(
        ("checkbox", "bool", "boolean"), 'a choice of on or off is a "toggle" or a "switch"'
    ),
    **dict.fromkeys(("value", "display", "numeric", "topic"), 'a value is a "readout"'),
    **dict.fromkeys(("input", "entry", "textfield"), 'an entry is a "text" or a "number"'),
    **dict.fromkeys(("service", "trigger"), 'a service is called by a "call"'),
    **dict.fromkeys(("goal",), 'a goal is sent by an "action"'),
    **dict.fromkeys(("jog", "deadman"), 'a button that moves while it is held is a "hold"'),
    **dict.fromkeys(("video", "stream"), 'a picture that moves is a "camera"'),
    **dict.fromkeys(("picture", "icon", "logo"), 'a picture of the panel is an "image"'),
    **dict.fromkeys(("heading", "title", "note", "markdown"), 'a text of the panel is a "label"'),
    **dict.fromkeys(("list", "grid"), 'rows of a message are a "table"'),
}


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
                header = ".".join(step for step in path if isinstance(step, str))
                message = describe_error(detail, key, header)
                if path == ("alarms",) and isinstance(detail["input"], list):
                    message = "is the table [alarms] of what all alarms share: one alarm is [[alarm]]"
                elif detail["type"] == "model_type" and not isinstance(detail["input"], Mapping):
                    message += _its_keys(path, _resolve_location(detail["loc"])[0], header)
                faults.append(Fault(place_of(path), message))
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


def find_demo_faults(tables: Mapping[str, Any]) -> list[Fault]:
    """Faults of names in `[demo]` that nearly are names of the panel, whatever else is wrong in it."""
    demo = tables.get("demo")
    used = {text for key, table in tables.items() if key != "demo" for text in _texts(table)}
    bare = {text.strip("/") for text in used}
    names = [n for n in (demo if isinstance(demo, Mapping) else ()) if n.strip("/") not in bare]
    near = {name: closest_name(name, [text for text in used if "/" in text]) for name in names}
    return [
        Fault(place_of(("demo", name)), f"the panel does not use {name}; did you mean {meant}?")
        for name, meant in near.items()
        if meant
    ]


def _texts(table: Any) -> Iterator[str]:
    if isinstance(table, str):
        yield table
    elif isinstance(table, Mapping | list):
        for inner in table.values() if isinstance(table, Mapping) else table:
            yield from _texts(inner)


def _its_keys(path: Path, model: Model, header: str) -> str:
    """How a table is written, with its keys."""
    keys = ", ".join(known_keys(model))
    if isinstance(path[-1], int):
        return f"; its keys are {keys}: write [[{header}]]"
    return f"; its keys are {keys}: write [{header}] above them"


def _kind_fault(path: Path, table: Any) -> Fault:
    if not isinstance(table, Mapping):
        return Fault(place_of(path), f"must be a table, not {format_value(table)}")
    if SAME in table:
        why = "is for widgets of pages: those of the frame are on every page"
        return Fault(place_of((*path, SAME)), why)
    if "id" not in table and "kind" not in table and (meant := closest_name(SAME, table)):
        return Fault(place_of((*path, meant)), f'unknown key; did you mean "{SAME}"?')
    kinds = ", ".join(KINDS)
    written = str(table.get("kind", "")).lower()
    if "kind" not in table:
        if meant := closest_name("kind", table):
            return Fault(place_of((*path, meant)), 'unknown key; did you mean "kind"?')
        return Fault(place_of(path), f'"kind" is missing; one of {kinds}')
    meant = closest_name(written, KINDS)
    hint = f'did you mean "{meant}"?' if meant else f"one of {kinds}"
    hint = OTHER_NAMES.get(re.sub("[^a-z]", "", written), hint)
    return Fault(place_of((*path, "kind")), f"unknown kind {format_value(table['kind'])}; {hint}")
