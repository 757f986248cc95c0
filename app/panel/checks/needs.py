"""Checks of the roles and groups of users that a panel file names."""

from collections.abc import Iterator

from app.errors import Fault
from app.panel.faults.wording import closest_name, list_names
from app.panel.model import Panel
from app.panel.widgets.confirmed import confirmation_of
from app.panel.widgets.families import Command
from app.panel.widgets.templated import is_stop
from app.roles import ROLES


def needs_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of `needs` that name neither a role nor a group of `[access]`."""
    known = [*ROLES, *panel.access.groups]
    for place, need in _needs(panel):
        if need and need not in known:
            meant = closest_name(need.lower(), known)
            hint = f'; did you mean "{meant}"?' if meant else ""
            message = f'"{need}" is neither a role nor a group: there is {list_names(known)}{hint}'
            own = ', and groups of your own by `groups = ["…"]` in [access]' if not meant else ""
            yield Fault(f"{place}.needs", message + own, cause=f"needs {need}")


def confirmation_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of stop buttons that ask for a PIN."""
    for place, widget in _commands(panel):
        if is_stop(widget) and confirmation_of(widget):
            message = "is not for a stop button: whoever stands at the screen can stop"
            yield Fault(f"{place}.confirm_press", message)


def _commands(panel: Panel) -> Iterator[tuple[str, Command]]:
    """(place, command) of each command on a page and in the frame, once."""
    for p, page in enumerate(panel.pages):
        for place, widget in page.placed():
            at = f"page[{p}].{place}"
            if isinstance(widget, Command) and at not in panel.copies:
                yield at, widget
    for w, widget in enumerate(panel.frame.widgets):
        if isinstance(widget, Command):
            yield f"frame.widget[{w}]", widget


def _needs(panel: Panel) -> Iterator[tuple[str, str | None]]:
    """(place, what it needs) of all that may say so."""
    for p, page in enumerate(panel.pages):
        yield f"page[{p}]", page.needs
        for g, group in enumerate(page.groups):
            yield f"page[{p}].group[{g}]", group.needs
    for place, widget in _commands(panel):
        yield place, widget.needs
    for a, alarm in enumerate(panel.alarms):
        yield f"alarm[{a}]", alarm.needs
