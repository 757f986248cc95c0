"""Reading a panel file, and every fault in it with its place."""

import copy
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final, get_args

from pydantic import BaseModel, ValidationError

from app.errors import Fault, InterfaceError, Note, PanelError
from app.interfaces import interfaces_of, read_distribution
from app.panel.check import faults_in
from app.panel.constants import resolved
from app.panel.description import ID
from app.panel.model import KINDS, Hold, Panel
from app.panel.notes import notes_in
from app.panel.places import located, place_of
from app.panel.toml_file import TomlFile, read_toml

INLINE: Final[Mapping[str | int, str]] = {
    "options": '[{ value = 1, label = "One" }]',
    "states": '[{ value = 0, text = "Idle", shape = "circle" }]',
}
NEEDED: Final[Mapping[str | int, str]] = {
    "interlock": "a hold needs the interlock whose loss ends it",
    "release": "a hold needs the message that is published when it ends",
}

Kept = Callable[[Panel], Path | None]


def load_panel(path: Path, kept: Kept = lambda _: None) -> Panel:
    """The checked panel; PanelError has every fault, `unreadable` where it is not even TOML.

    `kept` says in which folder what is read of the distribution may be kept for the next start.
    """
    return _panel(read_toml(path), kept)


def check_panel(path: Path) -> tuple[Panel, tuple[Note, ...]]:
    """The checked panel, with what is no fault of it but worth a look; PanelError as `load_panel`."""
    file = read_toml(path)
    panel = _panel(file)
    notes = notes_in(panel, interfaces_of(panel.distro, panel.interfaces))
    return panel, tuple(located(notes, file.text, file.tables))


def _panel(file: TomlFile, kept: Kept = lambda _: None) -> Panel:
    folder = file.path.parent
    tables = {key: value for key, value in file.tables.items() if key != "revision"}
    faults = [] if tables == file.tables else [Fault("revision", "unknown key")]
    try:
        panel = Panel.model_validate(tables | {"revision": file.revision}, context=folder)
    except ValidationError as error:
        faults += map(_fault, error.errors())
        faults += _faults_of_the_rest(tables, error, folder)
    else:
        read_distribution(panel.distro, kept(panel))
        faults += _faults_with_types(panel)
    if faults:
        raise PanelError(str(file.path), tuple(located(faults, file.text, file.tables)))
    return resolved(panel, interfaces_of(panel.distro, panel.interfaces))


def _faults_with_types(panel: Panel, faulty: Collection[str] = ()) -> Iterator[Fault]:
    try:
        interfaces = interfaces_of(panel.distro, panel.interfaces)
    except InterfaceError as error:
        at = next((i for i, folder in enumerate(panel.interfaces) if folder == error.source), 0)
        yield Fault(f"interfaces[{at}]", str(error))
        return
    yield from faults_in(panel, interfaces, faulty)


def _faults_of_the_rest(
    tables: dict[str, Any], error: ValidationError, folder: Path
) -> Iterator[Fault]:
    """What else is wrong: the file is checked with harmless stand-ins for what has no right shape."""
    mended = copy.deepcopy(tables)
    faulty: set[str] = set()
    for fault in error.errors():
        match fault["loc"]:
            case ("page", int(p), "widget", int(w), *_):
                old = tables["page"][p]["widget"][w]
                stand_in = _stand_in(old, f"{p}_{w}")
                mended["page"][p]["widget"][w] = stand_in | {"kind": "text"}
                faulty.add(stand_in["id"])
            case ("interfaces", *_):
                return  # without its types nothing can be said of the rest
            case ("robot", int(r), *_):
                names = {"name": f"?{r}", "namespace": f"/faulty_{r}"}
                mended["robot"][r] = {"id": _stand_in(tables["robot"][r], str(r))["id"], **names}
            case ("interlock", int(i), *_):
                topic = {"topic": f"/faulty_{i}"}
                mended["interlock"][i] = _stand_in(tables["interlock"][i], str(i)) | topic
            case ("record", *_):
                mended.pop("record", None)
            case ("page", int(p), str(key)):
                mended["page"][p].pop(key, None)
                mended["page"][p] = {"id": f"faulty_{p}", "title": "?"} | mended["page"][p]
            case (str(key),) | ("control" | "log" as key, *_):
                mended.pop(key, None)
                mended.setdefault("title", "?")
    try:
        panel = Panel.model_validate(mended, context=folder)
    except ValidationError:
        return  # too much is wrong: what was found already comes first
    yield from _faults_with_types(panel, faulty)


def _stand_in(old: Any, number: str) -> dict[str, Any]:
    """Has the id of what it stands for, so that nobody misses it."""
    known = old.get("id") if isinstance(old, dict) else None
    named = isinstance(known, str) and re.fullmatch(ID, known)
    return {"id": known if named else f"faulty_{number}", "label": "?"}


def _fault(error: Any) -> Fault:
    """One of pydantic's errors in the panel file's own terms."""
    location = error["loc"]
    model, steps = _walk(location)
    return Fault(place_of(tuple(steps)), _message(error, model, location))


def _walk(location: tuple[str | int, ...]) -> tuple[type[BaseModel], list[str | int]]:
    """The description that a location is in, and the location without pydantic's kind tags."""
    model: type[BaseModel] = Panel
    steps: list[str | int] = []
    previous: str | int = ""
    for step in location:
        if steps[-2:-1] == ["widget"] and isinstance(previous, int) and step in KINDS:
            model = KINDS[str(step)]
        else:
            steps.append(step)
            model = _inner(model, step) or model
        previous = step
    return model, steps


def _names(location: tuple[str | int, ...]) -> list[str]:
    return [step for step in location if isinstance(step, str)]


def _inner(model: type[BaseModel], key: str | int) -> type[BaseModel] | None:
    """The description inside `model` that a table under `key` becomes."""
    for name, field in model.model_fields.items():
        if (field.alias or name) == key:
            return next((t for t in _types(field.annotation) if issubclass(t, BaseModel)), None)
    return None


def _types(annotation: Any) -> Iterator[type]:
    if isinstance(annotation, type) and not get_args(annotation):
        yield annotation
    for inner in get_args(annotation):
        yield from _types(inner)


def _message(error: Any, model: type[BaseModel], location: tuple[str | int, ...]) -> str:
    known = [f.alias or n for n, f in model.model_fields.items() if n != "revision"]
    match error["type"]:
        case "extra_forbidden":
            near = get_close_matches(str(location[-1]), known, n=1)
            hint = f'did you mean "{near[0]}"?' if near else f"known here: {', '.join(known)}"
            return f"unknown key; {hint}"
        case "tuple_type" if location == ("interfaces",):
            return 'must be a list of folders: write ["folder"]'
        case "tuple_type" if location[-1] in INLINE:
            return f"must be a list of tables, like {INLINE[location[-1]]}"
        case "string_pattern_mismatch" if location[-1] == "format":
            return f'"{error["input"]}" is not a format: it must be like ".1f", "+.2e" or ",d"'
        case "string_pattern_mismatch" if location[-1] == "constants":
            return f'"{error["input"]}" is not how names of constants start: it must be like STATUS_'
        case "tuple_type":
            return f"must be a list of tables: write [[{'.'.join(map(str, _names(location)))}]]"
        case "dict_type":
            return f'must be a table, like {{ field = "value" }}, not {error["input"]!r}'
        case "missing" if model is Hold and location[-1] in NEEDED:
            return f"is missing: {NEEDED[location[-1]]}"
        case "missing":
            return "is missing"
        case "model_type":
            return f"must be a table, not {error['input']!r}"
        case "union_tag_not_found":
            return f'"kind" is missing; one of {", ".join(KINDS)}'
        case "union_tag_invalid":
            return f'unknown kind "{error["ctx"]["tag"]}"; one of {", ".join(KINDS)}'
        case "value_error":
            return str(error["ctx"]["error"])
        case "string_pattern_mismatch" if location[-1] in ("id", "interlock"):
            return f'"{error["input"]}" is not an id: a-z, 0-9 and "_", a letter first'
    return f"{error['msg'][0].lower()}{error['msg'][1:]}, not {error['input']!r}"
