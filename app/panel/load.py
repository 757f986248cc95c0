"""Reading a panel file, and every fault in it with its place."""

from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from pydantic import ValidationError

from app.errors import Fault, InterfaceError, Note, PanelError
from app.interfaces import interfaces_of, read_distribution
from app.panel.causes import one_for_each
from app.panel.check import faults_in
from app.panel.constants import resolved
from app.panel.model import Panel
from app.panel.notes import notes_in
from app.panel.places import located
from app.panel.shape import shape_of
from app.panel.stand_ins import Rest, rest_of
from app.panel.toml_file import TomlFile, read_toml

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
    tables = {key: value for key, value in file.tables.items() if key != "revision"}
    faults = [] if tables == file.tables else [Fault("revision", "unknown key")]
    try:
        panel = Panel.model_validate(tables | {"revision": file.revision}, context=file.path.parent)
    except ValidationError as error:
        shape = shape_of(error, tables)
        rest = _faults_of_the_rest(rest_of(tables, error), file.path.parent)
        faults += [*shape.faults, *(fault for fault in rest if not shape.explains(fault))]
    else:
        read_distribution(panel.distro, kept(panel))
        faults += _faults_with_types(panel)
    if faults:
        told = located(one_for_each(faults), file.text, file.tables)
        raise PanelError(str(file.path), tuple(sorted(told, key=lambda fault: fault.line)))
    return resolved(panel, interfaces_of(panel.distro, panel.interfaces))


def _faults_with_types(panel: Panel, faulty: Collection[str] = ()) -> Iterator[Fault]:
    try:
        interfaces = interfaces_of(panel.distro, panel.interfaces)
    except InterfaceError as error:
        at = next((i for i, folder in enumerate(panel.interfaces) if folder == error.source), 0)
        yield Fault(f"interfaces[{at}]", str(error))
        return
    yield from faults_in(panel, interfaces, faulty)


def _faults_of_the_rest(rest: Rest | None, folder: Path) -> Iterator[Fault]:
    """What is wrong beside the shape."""
    panel = rest and rest.panel(folder)
    if rest and panel:
        yield from filter(rest.judges, _faults_with_types(panel, rest.faulty))
