"""Keys of a panel file's tables that are unknown, missing or in the wrong table."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, get_args

from pydantic import BaseModel

from app.errors import Fault
from app.interfaces.validation import format_value
from app.panel.faults.other_keys import ANSWERED, other_key
from app.panel.faults.places import place_of
from app.panel.faults.toml_lines import Path
from app.panel.faults.wording import closest_name
from app.panel.model import Panel
from app.panel.source import NAME as SOURCE
from app.panel.source import Source, reads_source
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.kinds import KINDS

Model = type[BaseModel]

WHOLE_PAGE: Final = 2  # steps of its path
ITS_HEADER: Final = "is its header missing above?"


def widget_path(path: Path) -> Path:
    """The path of the widget's table that a path is in; empty without one."""
    for n, step in enumerate(path[:-1]):
        if step == "widget" and isinstance(path[n + 1], int):
            return path[: n + 2]
    return ()


@dataclass(frozen=True, slots=True)
class TableKeys:
    """The missing and unknown keys of one table."""

    path: Path
    model: Model
    table: Mapping[str, Any]
    missing: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)

    def fault(self, key: str, message: str) -> Fault:
        """A fault of a key or, if that is "", of the table."""
        return Fault(place_of((*self.path, key) if key else self.path), message)


def inner_model(model: Model, key: str | int) -> Model | None:
    """The description of a table under `key`; None if the key is no table."""
    for name, about in model.model_fields.items():
        if (about.alias or name) == key:
            return next((t for t in _types(about.annotation) if issubclass(t, BaseModel)), None)
    return None


def _types(annotation: Any) -> Iterator[type]:
    if isinstance(annotation, type) and not get_args(annotation):
        yield annotation
    for each in get_args(annotation):
        yield from _types(each)


def known_keys(model: Model) -> list[str]:
    """The keys of a description, and `source` where a source may stand in place of a topic."""
    keys = [about.alias or name for name, about in model.model_fields.items() if not about.exclude]
    return [*keys, SOURCE] if reads_source(model) else keys


def _required_keys(model: Model) -> set[str]:
    return {about.alias or name for name, about in model.model_fields.items() if about.is_required()}


Consequences = list[tuple[str, Fault]]  # (place, the fault that causes all others in it)


def key_faults(tables: Mapping[Path, TableKeys]) -> tuple[list[Fault], Consequences]:
    """The faults of tables (by path), and their consequences."""
    faults: list[Fault] = []
    follow: Consequences = []
    for table in tables.values():
        faults += _other_keys(table)
        faults += _misplaced_keys(table, tables)
        faults += _misspelt_keys(table, follow)
    for table in tables.values():
        faults += (
            _wrong_kind(table, follow) or _missing_header(table, follow) or _remaining_faults(table)
        )
    return faults, follow


def _other_keys(table: TableKeys) -> Iterator[Fault]:
    """Faults of keys that have another name here."""
    header = next((step for step in reversed(table.path) if isinstance(step, str)), "")
    hints = {key: other_key(header, key) for key in table.unknown}
    if not all(hints.values()) or _missing_header(table, []):
        return
    answered = ANSWERED.get(header, ()) if hints else ()
    table.missing[:] = [name for name in table.missing if name not in answered]
    table.unknown.clear()
    yield from (table.fault(key, f"unknown key; {hint}") for key, hint in hints.items())


def _misplaced_keys(table: TableKeys, tables: Mapping[Path, TableKeys]) -> Iterator[Fault]:
    """Faults of keys that belong to a table around this one."""
    path = table.path
    for key in list(table.unknown) if path else ():
        around = (tables[path[:n]] for n in range(len(path)) if path[:n] in tables)
        outer = next((candidate for candidate in around if key in candidate.missing), None)
        if outer is None and (
            key not in known_keys(Panel) or inner_model(Panel, key) or len(table.unknown) > 1
        ):
            continue
        table.unknown.remove(key)
        where = "the file itself: write it above the first table"
        if outer is not None:
            outer.missing.remove(key)
        if outer is not None and outer.path:
            names = ".".join(step for step in path[: len(outer.path) + 1] if isinstance(step, str))
            where = f"{place_of(outer.path)}: write it above its [[{names}]]"
        yield table.fault(key, f"unknown key; it belongs to {where}")


def _misspelt_keys(table: TableKeys, follow: Consequences) -> Iterator[Fault]:
    """Faults of unknown keys that are similar to a known one."""
    for key in list(table.unknown):
        meant = closest_name(key, table.missing) or closest_name(key, known_keys(table.model))
        if not meant:
            continue
        table.unknown.remove(key)
        if meant == SOURCE and reads_source(table.model):
            table.missing[:] = [name for name in table.missing if name not in known_keys(Source)]
        if meant in table.missing:
            table.missing.remove(meant)
        fault = table.fault(key, f'unknown key; did you mean "{meant}"?')
        if inner_model(table.model, meant):
            follow.append((place_of((*table.path, meant)), fault))
        yield fault


def _missing_header(table: TableKeys, follow: Consequences) -> list[Fault]:
    """A fault of keys of another table whose header is missing."""
    keys = set(table.unknown)
    names = [name for name, model in _other_tables(table) if keys <= set(known_keys(model))]
    if len(keys) < 2 or not names:
        return []
    fault = table.fault(
        table.unknown[0], f"{_quote_names(table.unknown)} are keys of {names[0]}: {ITS_HEADER}"
    )
    around = widget_path(table.path) or table.path[:WHOLE_PAGE]
    follow += [(place_of(around), fault)] if table.path else []
    return [fault]


def _other_tables(table: TableKeys) -> Iterator[tuple[str, Model]]:
    """(name, description) of the tables in this one, then of all others of the file."""
    header = ".".join(step for step in table.path if isinstance(step, str))
    for key in known_keys(table.model):
        if model := inner_model(table.model, key):
            yield (f"{header}.{key}" if header else key), model
    for kind in KINDS.values():
        if table.path[-2:-1] != ("widget",):
            yield "[[page.widget]]", kind.model
        for key in known_keys(kind.model):
            if model := inner_model(kind.model, key):
                yield f"page.widget.{key}", model
    for key in known_keys(Panel):
        if model := inner_model(Panel, key):
            yield f'"{key}"', model


def _wrong_kind(table: TableKeys, follow: Consequences) -> list[Fault]:
    """A fault of a widget that has the keys of another kind."""
    keys = set(table.table)
    kinds = [
        name
        for name, kind in KINDS.items()
        if table.path[-2:-1] == ("widget",)
        and _required_keys(kind.model) <= keys <= set(known_keys(kind.model))
    ]
    if not kinds or not table.unknown:
        return []
    kind_text, listed = format_value(table.table["kind"]), _quote_names(kinds)
    if len(table.missing) + len(table.unknown) == 1:
        message = f"unknown key of {kind_text}; all the keys are those of {listed}"
        return [table.fault(table.unknown[0], message)]
    needs = f" and needs {_quote_names(table.missing)}" if table.missing else ""
    message = f"{kind_text} has no {_quote_names(table.unknown)}{needs}; the keys are those of {listed}"
    fault = table.fault("kind", message)
    follow.append((place_of(table.path), fault))
    return [fault]


def _remaining_faults(table: TableKeys) -> list[Fault]:
    """One fault for the remaining unknown keys, and one for the missing keys."""
    missing, unknown = table.missing, table.unknown
    here = f"known here: {', '.join(known_keys(table.model))}"
    if len(missing) == len(unknown) == 1:
        hint = f'is it the "{missing[0]}" that is missing? {here}'
        return [table.fault(unknown[0], f"unknown key; {hint}")]
    faults = []
    if unknown:
        more = f", as {_quote_names(unknown[1:])}" if len(unknown) > 1 else ""
        faults.append(table.fault(unknown[0], f"unknown key{more}; {here}"))
    if len(missing) == 1:
        model = table.model
        why = model.why_needed.get(missing[0]) if issubclass(model, BaseWidget) else None
        faults.append(table.fault(missing[0], f"is missing: {why}" if why else "is missing"))
    elif missing:
        faults.append(table.fault("", f"{_quote_names(missing)} are missing"))
    return faults


def _quote_names(names: Sequence[str]) -> str:
    """Quoted names with commas and an "and"."""
    *others, last = (f'"{name}"' for name in names)
    return f"{', '.join(others)} and {last}" if others else last
