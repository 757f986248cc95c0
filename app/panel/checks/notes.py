"""Hints about a panel that are no faults; `python -m app.check` prints them."""

from collections.abc import Iterator
from typing import Final

from app.errors import Note
from app.interfaces import Interfaces
from app.panel.checks.fit import fit_notes
from app.panel.checks.languages import untranslated_notes
from app.panel.checks.page_templates import unplaced_notes
from app.panel.checks.units import unit_notes
from app.panel.model import Panel
from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.service_action import Action
from app.panel.widgets.trend import Trend, history_bytes
from app.panel.widths.cut_texts import cut_notes

MOVING: Final = (HoldCommand, Action)


def find_notes(panel: Panel, interfaces: Interfaces) -> Iterator[Note]:
    """All notes with their places in the panel file, without ids and lines."""
    yield from _stop_notes(panel)
    yield from _unbounded_trust_notes(panel)
    yield from _embedded_controls_notes(panel)
    yield from _unused_interlock_notes(panel)
    yield from _unused_source_notes(panel)
    yield from _unusable_type_notes(panel, interfaces)
    yield from _trend_notes(panel)
    yield from unit_notes(panel, interfaces)
    yield from fit_notes(panel)
    yield from cut_notes(panel)
    yield from unplaced_notes(panel)
    yield from untranslated_notes(panel)


def _stop_notes(panel: Panel) -> Iterator[Note]:
    """The first widget that moves the robot, where Stop is not on every page."""
    if any(widget in panel.stops for widget in panel.frame.widgets):
        return
    for p, page in enumerate(panel.pages):
        for place, widget in page.placed():
            if isinstance(widget, MOVING) or getattr(widget, "role", "") == "start":
                message = (
                    "can move the robot, and Stop is not on every page: add a [[frame.widget]] with "
                    'role = "stop"'
                )
                yield Note(f"page[{p}].{place}", message)
                return


def _unbounded_trust_notes(panel: Panel) -> Iterator[Note]:
    """Interlocks whose last value counts without a limit: see docs/permissions.md."""
    for i, interlock in enumerate(panel.interlocks):
        if interlock.max_age_s is None and not interlock.require_publisher:
            yield Note(
                f"interlock[{i}]",
                f"the last value on {interlock.topic} counts for as long as the bridge is connected, "
                "also when its publisher is gone or one of its messages is lost: give max_age_s where "
                "it is published regularly, or require_publisher = true where its publisher stays",
            )


def _embedded_controls_notes(panel: Panel) -> Iterator[Note]:
    """Controls in pages of others."""
    if panel.embed.controls and panel.embed.origins:
        yield Note(
            "embed.controls",
            "a page that embeds this panel can lay something over a button, so that an operator "
            "presses without seeing it: list only origins that you trust as much as the panel",
        )


def _unused_interlock_notes(panel: Panel) -> Iterator[Note]:
    """Interlocks that no control uses."""
    used = {name for widget in panel.commands for name in widget.interlocks}
    for i, interlock in enumerate(panel.interlocks):
        if interlock.id not in used:
            message = f'locks nothing: no control has interlock = "{interlock.id}"'
            yield Note(f"interlock[{i}]", message)


def _unused_source_notes(panel: Panel) -> Iterator[Note]:
    """Sources whose topic nothing listens to."""
    listened = panel.listened()
    for number, source in enumerate(panel.sources):
        if source.topic not in listened:
            yield Note(f"source[{number}]", f'nothing has source = "{source.id}"')


def _unusable_type_notes(panel: Panel, interfaces: Interfaces) -> Iterator[Note]:
    """Unusable types of each folder that the panel does not need."""
    for f, folder in enumerate(panel.interfaces):
        errors = interfaces.unusable.items()
        own = [(n, why) for n, why in errors if why.source and why.source.is_relative_to(folder)]
        if own:
            name, why = own[0]
            more = f"; {len(own) - 1} more can't be used either" if len(own) > 1 else ""
            message = f"{name} can't be used, and this panel does not need it: {why}{more}"
            yield Note(f"interfaces[{f}]", message)


def _trend_notes(panel: Panel) -> Iterator[Note]:
    """The memory that the history of each trend takes, and on disk."""
    robots = len(panel.robots) or 1
    for p, page in enumerate(panel.pages):
        for place, widget in page.placed():
            if isinstance(widget, Trend) and f"page[{p}].{place}" not in panel.copies:
                size = robots * len(widget.pens) * history_bytes(widget.keep_s) / 1e6
                where = "memory, and as much on disk" if widget.disk else "memory"
                pens = f"{len(widget.pens)} pen{'s' * (len(widget.pens) > 1)}"
                message = f"keeps {widget.keep} of {pens}: {size:.1f} MB of {where}"
                yield Note(f"page[{p}].{place}", message)
