"""What is no fault of a panel and still worth a look: `python -m app.check` prints it."""

from collections.abc import Iterator

from app.errors import Note
from app.panel.model import Panel


def notes_in(panel: Panel) -> Iterator[Note]:
    """Notes by their places in the panel file; ids and lines are added by who prints them."""
    yield from ()
