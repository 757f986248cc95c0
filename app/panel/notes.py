"""What is no fault of a panel and still worth a look: `python -m app.check` prints it."""

from collections.abc import Iterator

from app.errors import Note
from app.interfaces import Interfaces
from app.panel.model import Panel


def notes_in(panel: Panel, interfaces: Interfaces) -> Iterator[Note]:
    """Notes by their places in the panel file; ids and lines are added by who prints them."""
    yield from _left_out(panel, interfaces)


def _left_out(panel: Panel, interfaces: Interfaces) -> Iterator[Note]:
    """Types of each folder that can't be used; the panel needs none of them."""
    for f, folder in enumerate(panel.interfaces):
        errors = interfaces.left_out.items()
        own = [(n, why) for n, why in errors if why.source and why.source.is_relative_to(folder)]
        if own:
            name, why = own[0]
            more = f"; {len(own) - 1} more can't be used either" if len(own) > 1 else ""
            what = f"{name} can't be used, and this panel does not need it: {why}{more}"
            yield Note(f"interfaces[{f}]", what)
