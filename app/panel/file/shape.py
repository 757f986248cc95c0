"""Faults of a panel file's shape: keys and values that do not match the descriptions."""

import copy
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from pydantic import ValidationError

from app.panel.base import ID, FileContext
from app.panel.file.keys import (
    ITS_HEADER,
    Model,
    TableKeys,
    inner_model,
    key_faults,
    known_keys,
    place_of,
    widget_path,
)
from app.panel.file.same_widgets import NAME as SAME
from app.panel.file.toml_lines import Path
from app.panel.file.wording import closest_name, describe_error
from app.panel.model import Panel
from app.panel.widgets.kinds import KINDS
from app.ros.messages.validation import format_value
from app.system.errors import Fault

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


TEXTS: Final = "texts"  # the table whose keys are the robot's own texts
NAMED_TEXT: Final = 2  # steps to one of them
NAMES_ELSEWHERE: Final = ("name",)  # keys of other programs, which resemble one of this panel


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
    no_texts: list[Fault] = []
    for detail in error.errors():
        _, path = _resolve_location(detail["loc"])
        match detail["type"]:
            case "missing" | "extra_forbidden" as kind:
                model, above = _resolve_location(detail["loc"][:-1])
                widget = _table_at(tables, widget_path(above)) if widget_path(above) else {}
                table = keys.setdefault(
                    above, TableKeys(above, model, _table_at(tables, above), widget)
                )
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
                    message += _as_table(detail["input"], path) or _its_keys(
                        path, _resolve_location(detail["loc"])[0], header
                    )
                named = no_texts if path[0] == TEXTS and len(path) == NAMED_TEXT else faults
                named.append(Fault(place_of(path), message))
    faults += _without_their_header(no_texts)
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


def _without_their_header(faults: list[Fault]) -> list[Fault]:
    """Several entries of `[texts]` that are not texts are keys of the next table: one fault."""
    if len(faults) < 2:
        return faults
    first, others = faults[0], len(faults) - 1
    return [Fault(first.place, f"{first.message}; nor are {others} more entries below: {ITS_HEADER}")]


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


_COMPARED: Final = re.compile(r"\s*(/[\w/]+)\s*(==|=)\s*(true|false|-?\d+(?:\.\d+)?)\s*")


def _as_table(value: object, path: Path) -> str:
    """How a text that stands in place of a table is written as one; "" if that is not known."""
    if not isinstance(value, str):
        return ""
    if path[-2:-1] == ("options",):
        return f': write {{ value = "{value}", label = "{value}" }}'
    if match := _COMPARED.fullmatch(value):
        return f': write {path[-1]} = {{ topic = "{match[1]}", equals = {match[3]} }}'
    return ""


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
    kinds = ", ".join(KINDS)
    written = str(table.get("kind", "")).lower()
    if "kind" not in table and (message := _kind_as_type(table.get("type"))):
        return Fault(place_of((*path, "type")), message)
    others = [key for key in table if key not in NAMES_ELSEWHERE]
    if "id" not in table and "kind" not in table and (meant := closest_name(SAME, others)):
        return Fault(place_of((*path, meant)), f'unknown key; did you mean "{SAME}"?')
    if "kind" not in table:
        if meant := closest_name("kind", table):
            return Fault(place_of((*path, meant)), 'unknown key; did you mean "kind"?')
        return Fault(place_of(path), f'"kind" is missing; one of {kinds}')
    meant = closest_name(written, KINDS)
    hint = f'did you mean "{meant}"?' if meant else f"one of {kinds}"
    hint = _kind_of_others(written) or hint
    return Fault(place_of((*path, "kind")), f"unknown kind {format_value(table['kind'])}; {hint}")


def _kind_of_others(name: str) -> str:
    """The sentence about a kind by its name in other programs; "" if it is none."""
    return OTHER_NAMES.get(re.sub("[^a-z]", "", name.lower()), "")


def _kind_as_type(written: object) -> str:
    """The message about a widget without kind whose `type` is the name of a kind; "" if it is not."""
    if not isinstance(written, str) or "/" in written:
        return ""
    if written in KINDS:
        return f'"kind" is missing: write kind = "{written}"; type is that of a message'
    hint = _kind_of_others(written)
    return f'"kind" is missing; type is that of a message, and {hint}' if hint else ""


# Stand-ins for faulty tables, so that the rest of a panel file can be checked.

TABLES: Final = ("interlock", "condition", "page", "frame", "robot", "alarm", "place")

NO_AREA: Final = {"kind": "label", "points": [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]}


@dataclass(frozen=True, slots=True)
class StandIns:
    """The tables of a panel with stand-ins. `faulty` are the ids of the replaced widgets. `undecidable`
    are kinds of causes that can't be checked: the existing "interlock"s, "input"s, "control"s or
    "alarm"s, the topics that the panel "listens" to, the "action"s of conditions and alarms, the
    "group"s of alarms, the "figure"s of robots, the "map"s, their "level"s, or "place"s on them."""

    tables: dict[str, Any]
    faulty: set[str] = field(default_factory=set)
    undecidable: set[str] = field(default_factory=set)

    def validate(self, context: FileContext) -> Panel | None:
        """The panel; None if it still has faults of shape."""
        try:
            return Panel.model_validate(self.tables, context=context)
        except ValidationError:
            return None

    def is_real(self, fault: Fault) -> bool:
        """Whether a fault is one of the file, and not caused by a stand-in."""
        return fault.cause.partition(" ")[0] not in self.undecidable


def make_stand_ins(tables: dict[str, Any], error: ValidationError) -> StandIns | None:
    """The stand-ins for the tables in `error`; None if the rest can't be checked."""
    rest = StandIns(copy.deepcopy(tables))
    for fault in error.errors():
        if path := widget_path(fault["loc"]):
            _widget(rest, tables, path)
            if fault["loc"][-1] == "id" and len(fault["loc"]) > len(path) + 2:
                rest.undecidable.add("input")  # the header of the next widget may be missing below it
            continue
        match fault["loc"]:
            case ("interfaces" | "distro", *_):
                return None  # all types may be different
            case ("page", int(p), "group", int(g), str(key), *_):
                rest.tables["page"][p]["group"][g].pop(key, None)
                rest.undecidable.update(("input", "control", "listens", "level"))
            case ("page", int(p), str(key), *_):
                page = rest.tables["page"][p]
                page.pop(key, None)
                rest.tables["page"][p] = {"id": f"faulty_{p}", "title": "?"} | page
                rest.undecidable.update(("input", "control", "listens", "level", "page"))
            case ("interlock" | "condition" as name, int(i), *_):
                stand_in = _stand_in(tables[name][i], f"{name}_{i}")
                rest.tables[name][i] = stand_in | {"topic": f"/faulty_{name}_{i}"}
                rest.undecidable.update(("listens", "action", *_unnamed("interlock", tables[name][i])))
            case ("place" | "zone" as name, int(i), *_):
                stand_in = _stand_in(tables[name][i], str(i)) | {"label": f"?{i}"}
                where = {"x": 0.0, "y": 0.0} if name == "place" else NO_AREA
                rest.tables[name][i] = stand_in | where
                rest.undecidable.update(_unnamed("place", tables[name][i]))
            case ("zone_file", int(i), *_):
                rest.tables.pop("zone_file", None)
            case ("alarm", int(i), *_):
                stand_in = _stand_in(tables["alarm"][i], str(i))
                rest.tables["alarm"][i] = {"id": stand_in["id"], "text": "?", "lost": "link"}
                unnamed = _unnamed("alarm", tables["alarm"][i])
                rest.undecidable.update(("listens", "action", "group", *unnamed))
            case ("robot", int(r), key, *_):
                if key == "overview":  # the header of the next robot may be missing below it
                    rest.undecidable.add("robot")
                names = {"name": f"?{r}", "namespace": f"/faulty_{r}"}
                rest.undecidable.update(("figure", *_unnamed("robot", tables["robot"][r])))
                rest.tables["robot"][r] = {"id": _stand_in(tables["robot"][r], str(r))["id"], **names}
            case (str(key),) if closest_name(key, ("interfaces", "distro")):
                return None
            case (str(key), *_):
                rest.tables.pop(key, None)
                rest.tables.setdefault("title", "?")
                rest.undecidable.update(("control", "state"))
                if closest_name(key, ("pictures",)):
                    rest.undecidable.add("picture")
                if closest_name(key, TABLES):
                    rest.undecidable.update(("interlock", "listens", "page", "robot", "alarm"))
                    rest.undecidable.update(("group", "place", "level"))
    return rest


def _widget(rest: StandIns, tables: dict[str, Any], path: Path) -> None:
    old: Any = tables
    around: Any = rest.tables
    for step in path[:-1]:
        old, around = old[step], around[step]
    old = old[path[-1]]
    stand_in = _stand_in(old, "_".join(str(step) for step in path if isinstance(step, int)))
    around[path[-1]] = stand_in | {"kind": "text"}
    rest.faulty.add(stand_in["id"])
    rest.undecidable.update(("listens", "control", "map", "level", *_unnamed("input", old)))


def _stand_in(old: Any, number: str) -> dict[str, Any]:
    """A table with the id of the replaced one, so that references to it are valid."""
    return {"id": f"faulty_{number}" if _unnamed("", old) else old["id"], "label": "?"}


def _unnamed(kind: str, old: Any) -> list[str]:
    """[kind] if the table has no valid id, else []."""
    known = old.get("id") if isinstance(old, dict) else None
    return [] if isinstance(known, str) and re.fullmatch(ID, known) else [kind]


# Merges faults with one cause.

MAX_PLACES: Final = 3
OWNER: Final = re.compile(r"(?:page\[[0-9]+\]|frame)(?:\.group\[[0-9]+\])?\.widget\[[0-9]+\]\.")


def merge_duplicates(faults: Iterable[Fault]) -> list[Fault]:
    """The first fault of each cause, with the places of the others in its message."""
    groups: dict[str, list[Fault]] = {}
    for number, fault in enumerate(faults):
        groups.setdefault(fault.cause or f"#{number}", []).append(fault)
    return [_merge(*group) for group in groups.values()]


def _merge(first: Fault, *others: Fault) -> Fault:
    if not others:
        return first
    owner = OWNER.match(first.place)
    near = owner[0] if owner else first.place
    places = ", ".join(fault.place.removeprefix(near) for fault in others[:MAX_PLACES])
    more = f" and {len(others) - MAX_PLACES} more" if len(others) > MAX_PLACES else ""
    return replace(first, message=f"{first.message} (also at {places}{more})")
