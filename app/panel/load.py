"""Reading a panel file, and every fault in it with its place."""

from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from app.errors import Fault, InterfaceError, Note, PanelError, Remark
from app.interfaces import Interfaces, interfaces_of, read_distribution
from app.panel.checks.panel import faults_in
from app.panel.constants import resolved_interlock
from app.panel.faults.toml_file import TomlFile, read_toml
from app.panel.model import Panel

Kept = Callable[[Panel], Path | None]


def load_panel(path: Path, kept: Kept = lambda _: None) -> Panel:
    """The checked panel; PanelError has every fault, `unreadable` where it is not even TOML.

    `kept` says in which folder what is read of the distribution may be kept for the next start.
    """
    return _panel(read_toml(path), kept)


class Checked(NamedTuple):
    """A good panel; `notes` are worth a look, `sent` is what each press sends."""

    panel: Panel
    notes: tuple[Note, ...]
    sent: tuple[Remark, ...]


def check_panel(path: Path) -> Checked:
    """The checked panel, with what there is to say of it; PanelError as `load_panel`."""
    from app.panel.checks.notes import notes_in
    from app.panel.faults.places import located
    from app.panel.preview import previews

    file = read_toml(path)
    panel = _panel(file)
    interfaces = interfaces_of(panel.distro, panel.interfaces)
    notes = located(notes_in(panel, interfaces), file.text, file.tables)
    sent = located(previews(panel, interfaces), file.text, file.tables)
    return Checked(panel, tuple(notes), tuple(sent))


def _panel(file: TomlFile, kept: Kept = lambda _: None) -> Panel:
    tables = {key: value for key, value in file.tables.items() if key != "revision"}
    faults = [] if tables == file.tables else [Fault("revision", "unknown key")]
    try:
        panel = Panel.model_validate(tables | {"revision": file.revision}, context=file.path.parent)
    except ValidationError as error:
        faults += _faults_of_shape(error, tables, file.path.parent)
    else:
        read_distribution(panel.distro, kept(panel))
        faults += _faults_with_types(panel)
    if faults:
        raise PanelError(str(file.path), _told(faults, file))
    return _resolved(panel, interfaces_of(panel.distro, panel.interfaces))


def _resolved(panel: Panel, interfaces: Interfaces) -> Panel:
    """The checked panel, with the value of each constant that a lamp or an interlock names."""
    pages = [
        page.model_copy(update={"widgets": tuple(w.resolved(interfaces) for w in page.widgets)})
        for page in panel.pages
    ]
    interlocks = tuple(resolved_interlock(one, interfaces) for one in panel.interlocks)
    return panel.model_copy(update={"pages": tuple(pages), "interlocks": interlocks})


def _faults_with_types(panel: Panel, faulty: Collection[str] = ()) -> Iterator[Fault]:
    try:
        interfaces = interfaces_of(panel.distro, panel.interfaces)
    except InterfaceError as error:
        at = next((i for i, folder in enumerate(panel.interfaces) if folder == error.source), 0)
        yield Fault(f"interfaces[{at}]", str(error))
        return
    yield from faults_in(panel, interfaces, faulty)


# Modules that only a panel with a fault needs are read then: a start is the quicker for it.


def _faults_of_shape(error: ValidationError, tables: dict[str, Any], folder: Path) -> list[Fault]:
    """What is wrong with the shape, and beside that."""
    from app.panel.faults.shape import shape_of
    from app.panel.faults.stand_ins import rest_of

    shape, rest = shape_of(error, tables), rest_of(tables, error)
    panel = rest and rest.panel(folder)
    if not rest or not panel:
        return shape.faults
    others = filter(rest.judges, _faults_with_types(panel, rest.faulty))
    return shape.faults + [fault for fault in others if not shape.explains(fault)]


def _told(faults: Iterable[Fault], file: TomlFile) -> tuple[Fault, ...]:
    """One for each mistake, with its line, in the order of the file."""
    from app.panel.faults.duplicates import one_for_each
    from app.panel.faults.places import located

    told = located(one_for_each(faults), file.text, file.tables)
    return tuple(sorted(told, key=lambda fault: fault.line))
