"""Checks of `[texts]`: entries that no text of the robot is, and those that are never shown."""

from collections.abc import Iterator

from app.panel.fault_catalogue import CatalogueError, read_catalogue
from app.panel.model import Panel
from app.panel.texts import key_in_place
from app.panel.widgets.displays import LogView
from app.panel.widgets.families import TopicSource
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.service_action import Action, Call
from app.panel.widgets.table import Table
from app.ros.messages import Interfaces
from app.system.errors import Fault, InterfaceError, Note
from app.system.texts.text import each_language

NAME = "texts"


def robot_text_faults(panel: Panel) -> Iterator[Fault]:
    """Entries under what no robot publishes."""
    for said in panel.robot_texts:
        if said != said.strip() or not said:
            message = "must be a code or a text of the robot, without spaces around it"
            yield Fault(_place(said), message)


def robot_text_notes(panel: Panel, interfaces: Interfaces) -> Iterator[Note]:
    """Entries that are never shown, or change nothing."""
    if panel.robot_texts and not _shows_texts(panel, interfaces):
        message = (
            "nothing here shows a text of the robot: no diagnostics or list of alarms, call, action, "
            "parameter, log, table or display of a text"
        )
        yield Note(NAME, message)
        return
    catalogued = dict(_catalogued(panel))
    for said, text in panel.robot_texts.items():
        if (file := catalogued.get(said)) is not None:
            message = f"is not shown for the code {said}: {file} has a text of it, which comes first"
            yield Note(_place(said), message)
        elif {*each_language(text).values()} == {said}:
            yield Note(_place(said), "is what the robot says, in every language: leave it out")


def _place(said: str) -> str:
    return f"{NAME}.{key_in_place(said)}"


def _shows_texts(panel: Panel, interfaces: Interfaces) -> bool:
    return (
        any(alarm.diagnostics or alarm.listed for alarm in panel.alarms)
        or any(isinstance(widget, LogView | Parameter | Table) for widget in panel.widgets())
        or any(isinstance(part, Call | Action) for part in panel.senders())
        or any(
            _has_text(source, interfaces) for widget in panel.displays for source in widget.sources()
        )
    )


def _has_text(source: TopicSource, interfaces: Interfaces) -> bool:
    try:
        kinds = [interfaces.field_type(source.type, field) for field in source.fields]
    except InterfaceError:
        return False
    return any(kind.startswith(("string", "wstring")) for kind in kinds)


def _catalogued(panel: Panel) -> Iterator[tuple[str, str]]:
    """(code, file) of each code with a text in a catalogue of faults."""
    for alarm in panel.alarms:
        file = alarm.listed.catalogue if alarm.listed else None
        if file is None:
            continue
        try:
            catalogue = read_catalogue(file, panel.language)
        except CatalogueError:  # a fault of its own
            continue
        yield from ((code, file.name) for code, texts in catalogue.items() if texts.text)
