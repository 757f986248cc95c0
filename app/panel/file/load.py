"""Loads a panel file and reports every fault with its place."""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from pydantic import ValidationError

from app.panel.alarm import Alarm
from app.panel.base import FileContext
from app.panel.checks.memory import NO_MEMORY, CheckMemory
from app.panel.checks.panel import find_faults
from app.panel.checks.robots import duplicate_ids
from app.panel.constants import resolve_condition
from app.panel.file.toml_file import TomlFile, parse_toml, read_toml
from app.panel.file.wording import closest_name
from app.panel.layout import Page
from app.panel.model import Panel
from app.panel.rules import StateRules
from app.panel.source import NAME
from app.panel.widgets.families import BaseWidget
from app.ros.messages import Interfaces, load_interfaces
from app.system.errors import Fault, InterfaceError, Note, PanelError, Remark
from app.system.texts import ENGLISH

if TYPE_CHECKING:
    from app.panel.file.same_widgets import WithCopies
    from app.panel.file.source_tables import Expanded

NOT_WRITTEN: Final = (
    "revision",
    "copies",
    "inputs_of_others",
    "of_others",
)  # fields of a panel that are no keys of its file


def load_panel(path: Path) -> Panel:
    """The checked panel. PanelError has every fault; it is `unreadable` if the file is no TOML."""
    return _load(read_toml(path))


class CheckedPanel(NamedTuple):
    """A panel without faults, with hints (`notes`) and the messages of each press (`previews`)."""

    panel: Panel
    notes: tuple[Note, ...]
    previews: tuple[Remark, ...]


def check_panel(path: Path) -> CheckedPanel:
    """The checked panel with notes and previews; PanelError as in `load_panel`."""
    from app.panel.file.keys import add_locations, lines_in
    from app.panel.file.preview import previews

    file = read_toml(path)
    panel = _load(file)
    interfaces = load_interfaces(panel.distro, panel.interfaces)
    sent = add_locations(previews(panel, interfaces), file.line_of or lines_in(file.text), file.tables)
    return CheckedPanel(panel, _notes(panel, file), tuple(sent))


def _notes(panel: Panel, file: TomlFile, memory: CheckMemory = NO_MEMORY) -> tuple[Note, ...]:
    from app.panel.checks.notes import find_notes
    from app.panel.file.keys import add_locations, lines_in

    interfaces = load_interfaces(panel.distro, panel.interfaces)
    own = _with_sources(file.tables).notes if _names_source(file.tables) else []
    notes = [*find_notes(panel, interfaces, memory), *own]
    return tuple(add_locations(notes, file.line_of or lines_in(file.text), file.tables))


class PanelChecker:
    """Checks the versions of one panel file while it is edited. What did not change since the version
    before is not checked again."""

    def __init__(self) -> None:
        self._memory = CheckMemory()

    def panel(self, file: TomlFile) -> Panel:
        """The checked panel; PanelError as in `load_panel`."""
        return _load(file, self._memory)

    def notes(self, panel: Panel, file: TomlFile) -> tuple[Note, ...]:
        """The hints about a panel without faults."""
        return _notes(panel, file, self._memory)


def faults_of_text(text: str, folder: Path) -> tuple[Fault, ...]:
    """The faults of a panel file in `folder` that would have this text."""
    try:
        _load(parse_toml(folder / "panel.toml", text.encode()))
    except PanelError as error:
        return error.faults
    return ()


def _load(file: TomlFile, memory: CheckMemory = NO_MEMORY) -> Panel:
    written = {key: value for key, value in file.tables.items() if key not in NOT_WRITTEN}
    if faults := _source_faults(written, file):
        raise PanelError(str(file.path), _sorted_faults(faults, file))
    with_sources = _with_sources(written) if _names_source(written) else None
    if with_sources and with_sources.faults:
        raise PanelError(str(file.path), _sorted_faults(with_sources.faults, file))
    tables = with_sources.tables if with_sources else written
    copies = _with_copies(tables)
    if copies and copies.faults:
        raise PanelError(str(file.path), _sorted_faults(copies.faults, file))
    tables = copies.tables if copies else tables
    faults = [Fault(key, "unknown key") for key in NOT_WRITTEN if key in file.tables]
    own = {"revision": file.revision, "copies": frozenset(copies.origins if copies else ())}
    context = _context(file)
    try:
        panel = Panel.model_validate(tables | own | memory.known(tables, context), context=context)
    except ValidationError as error:
        faults += _shape_faults(error, tables | own, context)
    else:
        memory.keep(tables, panel, context)
        faults += _type_faults(panel, memory=memory)
    if faults:
        faults = list(copies.own_faults(faults)) if copies else faults
        moved = {with_sources.at_origin(f): None for f in faults} if with_sources else faults
        raise PanelError(str(file.path), _sorted_faults(moved, file))
    return _resolve_constants(panel, load_interfaces(panel.distro, panel.interfaces), memory)


def _source_faults(tables: dict[str, Any], file: TomlFile) -> list[Fault]:
    """The faults of the tables of sources, which come first: other tables have their keys."""
    lists = (key for key in tables if key != NAME and isinstance(tables[key], list))
    if misspelt := [key for key in lists if closest_name(key, (NAME,))]:
        return [Fault(key, f'unknown key; did you mean "{NAME}"?') for key in misspelt]
    if NAME not in tables:
        return []
    try:
        sources = Panel.model_validate(
            {"title": "?", "page": [], NAME: tables[NAME]}, context=_context(file)
        ).sources
    except ValidationError as error:
        from app.panel.file.shape import find_shape_faults

        return find_shape_faults(error, tables).faults
    return [*duplicate_ids(NAME, [source.id for source in sources])]


def _names_source(value: Any) -> bool:
    """Whether a table is a source, or names one."""
    if isinstance(value, dict):
        return NAME in value or any(map(_names_source, value.values()))
    return isinstance(value, list) and any(map(_names_source, value))


def _with_sources(tables: dict[str, Any]) -> "Expanded":
    """Imported only where a panel speaks of sources, for a faster start."""
    from app.panel.file.source_tables import expanded

    return expanded(tables)


def _with_copies(tables: dict[str, Any]) -> "WithCopies | None":
    """None where no widget is on several pages."""
    from app.panel.file.same_widgets import names_same, with_copies

    return with_copies(tables) if names_same(tables) else None


def _context(file: TomlFile) -> FileContext:
    """With the panel's language, in which texts are shown that lack the reader's."""
    language = file.tables.get("language", ENGLISH)
    return FileContext(file.path.parent, language if isinstance(language, str) else ENGLISH)


def _resolve_constants(panel: Panel, interfaces: Interfaces, memory: CheckMemory) -> Panel:
    """The panel with values in place of constants' names in lamps and interlocks, and with the zones of
    files among its zones."""

    def resolved(widgets: Iterable[BaseWidget]) -> tuple[BaseWidget, ...]:
        return tuple(widget.with_constants(interfaces) for widget in widgets)

    def page_of(page: Page) -> Page:
        groups = [
            group.model_copy(update={"widgets": resolved(group.widgets)}) for group in page.groups
        ]
        return page.model_copy(update={"own": resolved(page.own), "groups": tuple(groups)})

    def each(name: str, descriptions: Sequence[Any], resolve: Callable[[Any], Any]) -> tuple[Any, ...]:
        made = (
            memory.results(f"resolved {name}", n, table, (interfaces,), partial(map, resolve, (table,)))
            for n, table in enumerate(descriptions)
        )
        return tuple(resolved for (resolved,) in made)

    pages = each("page", panel.pages, page_of)
    frame = panel.frame.model_copy(update={"widgets": resolved(panel.frame.widgets)})
    conditions = partial(resolve_condition, interfaces=interfaces)
    state = panel.state and panel.state.with_constants(interfaces)
    alarms = tuple(_resolve_alarm(alarm, panel.state, interfaces) for alarm in panel.alarms)
    resolved_parts = {
        "interlocks": each("interlock", panel.interlocks, conditions),
        "own_conditions": each("condition", panel.own_conditions, conditions),
        "alarms": alarms,
        "state": state,
        "oee": panel.oee and panel.oee.with_constants(panel.state, interfaces),
        "frame": frame,
        "zones": (*panel.zones, *(zone for read in panel.zones_of_files for zone in read.zones)),
    }
    return panel.model_copy(update={"pages": pages, **resolved_parts})


def _resolve_alarm(alarm: Alarm, state: StateRules | None, interfaces: Interfaces) -> Alarm:
    """The alarm with values in place of constants' names in its conditions and its state."""
    conditions = {"when": alarm.when, "suppressed_while": alarm.suppressed_while}
    resolved: dict[str, Any] = {
        key: resolve_condition(condition, interfaces)
        for key, condition in conditions.items()
        if condition is not None
    }
    if alarm.state is not None and state is not None:
        resolved["state"] = state.value_of(alarm.state, interfaces)
    return alarm.model_copy(update=resolved) if resolved else alarm


def _type_faults(
    panel: Panel, faulty: Collection[str] = (), memory: CheckMemory = NO_MEMORY
) -> Iterator[Fault]:
    try:
        interfaces = load_interfaces(panel.distro, panel.interfaces)
    except InterfaceError as error:
        at = next((i for i, folder in enumerate(panel.interfaces) if folder == error.source), 0)
        yield Fault(f"interfaces[{at}]", str(error))
        return
    yield from find_faults(panel, interfaces, faulty, memory)


# Modules for panels with faults are imported only when needed, for a faster start.


def _shape_faults(error: ValidationError, tables: dict[str, Any], context: FileContext) -> list[Fault]:
    """Faults of keys and values, and all others that can still be found."""
    from app.panel.file.shape import find_demo_faults, find_shape_faults, make_stand_ins

    shape, rest = find_shape_faults(error, tables), make_stand_ins(tables, error)
    panel = rest and rest.validate(context)
    others = filter(rest.is_real, _type_faults(panel, rest.faulty)) if rest and panel else ()
    faults = shape.faults + [fault for fault in others if not shape.covers(fault)]
    places = {fault.place for fault in faults}
    return faults + [fault for fault in find_demo_faults(tables) if fault.place not in places]


def _sorted_faults(faults: Iterable[Fault], file: TomlFile) -> tuple[Fault, ...]:
    """One fault for each mistake, with its line, in the order of the file."""
    from app.panel.file.keys import add_locations, lines_in
    from app.panel.file.shape import merge_duplicates

    merged = add_locations(merge_duplicates(faults), file.line_of or lines_in(file.text), file.tables)
    return tuple(sorted(merged, key=lambda fault: fault.line))
