"""Reading a panel file, and every fault in it with its place."""

import hashlib
import tomllib
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from app.errors import Fault, PanelError
from app.interfaces import interfaces_of
from app.panel.check import faults_in
from app.panel.model import KINDS, Panel


def load_panel(path: Path) -> Panel:
    """The checked panel; PanelError has every fault, `unreadable` where it is not even TOML."""
    try:
        data = path.read_bytes()
        tables = tomllib.loads(data.decode())
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise PanelError(str(path), (Fault("", reason),), unreadable=True) from error
    try:
        panel = Panel.model_validate(tables | {"revision": hashlib.sha256(data).hexdigest()[:12]})
    except ValidationError as error:
        raise PanelError(str(path), tuple(map(_fault, error.errors()))) from None
    faults = tuple(faults_in(panel, interfaces_of(panel.distro)))
    if "revision" in tables:
        faults = (*faults, Fault("revision", "unknown key"))
    if faults:
        raise PanelError(str(path), faults)
    return panel


def _fault(error: Any) -> Fault:
    """One of pydantic's errors in the panel file's own terms."""
    location = error["loc"]
    model, steps = _walk(location)
    place = ""
    for step in steps:
        place += f"[{step}]" if isinstance(step, int) else f".{step}" if place else step
    return Fault(place, _message(error, model, location))


def _walk(location: tuple[str | int, ...]) -> tuple[type[BaseModel], list[str | int]]:
    """The description that a location is in, and the location without pydantic's kind tags."""
    model: type[BaseModel] = Panel
    steps: list[str | int] = []
    previous: str | int = ""
    for step in location:
        if isinstance(previous, int) and step in KINDS:
            model = KINDS[str(step)]
        else:
            steps.append(step)
            model = _inner(model, step) or model
        previous = step
    return model, steps


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
        case "missing":
            return "is missing"
        case "union_tag_not_found":
            return f'"kind" is missing; one of {", ".join(KINDS)}'
        case "union_tag_invalid":
            return f'unknown kind "{error["ctx"]["tag"]}"; one of {", ".join(KINDS)}'
        case "value_error":
            return str(error["ctx"]["error"])
        case "string_pattern_mismatch" if location[-1] in ("id", "interlock"):
            return f'"{error["input"]}" is not an id: a-z, 0-9 and "_", a letter first'
    return f"{error['msg'][0].lower()}{error['msg'][1:]}, not {error['input']!r}"
