"""The roles and groups that the pages and commands of a panel need: pure, from the panel.

A command needs what is said at itself, its group and its page, and at least an operator, but for a
stop button, which needs nothing unless it says so itself. A widget on several pages needs what all its
places have in common. A page is not seen, and its widgets are not sent, without what it needs.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from app.panel.alarm import Alarm
from app.panel.layout import Page
from app.panel.roles import OPERATOR
from app.panel.widgets.families import BaseWidget, Command
from app.panel.widgets.templated import is_stop

Needs = frozenset[str]
NOTHING: Final[Needs] = frozenset()


@dataclass(frozen=True, slots=True)
class PanelNeeds:
    """`commands` has what each command needs, by its id; `pages` what a page needs to be seen, by its
    id, for those that need something. `shown_on` has the ids of the pages that show a widget, by its
    id, for the widgets that only such pages show. `alarms` has what acts on an alarm need, by the id of
    its entry."""

    commands: Mapping[str, Needs]
    pages: Mapping[str, str]
    shown_on: Mapping[str, frozenset[str]]
    alarms: Mapping[str, str]

    @property
    def named(self) -> Needs:
        """All that is needed somewhere."""
        return frozenset().union(*self.commands.values(), self.pages.values(), (OPERATOR,))

    def hidden_pages(self, lacks: Collection[str]) -> frozenset[str]:
        """The pages that a client without these roles and groups does not see."""
        return frozenset(page for page, need in self.pages.items() if need in lacks)

    def hidden_widgets(self, lacks: Collection[str]) -> frozenset[str]:
        """The widgets that a client without these roles and groups does not see."""
        hidden = self.hidden_pages(lacks)
        if not hidden:
            return frozenset()
        return frozenset(widget for widget, pages in self.shown_on.items() if pages <= hidden)


NO_NEEDS: Final = PanelNeeds({}, {}, {}, {})


def needs_of(
    pages: Sequence[Page],
    frame: Iterable[BaseWidget],
    every_command: Iterable[Command],
    alarms: Iterable[Alarm],
) -> PanelNeeds:
    """What the pages, commands and alarms of a panel need. `frame` are the widgets of every page."""
    commands: dict[str, Needs] = {}
    shown_on: dict[str, frozenset[str]] = {}
    needing = {page.id: page.needs for page in pages if page.needs}
    for page in pages:
        for widget, needs in _placed(page):
            shown_on[widget.id] = shown_on.get(widget.id, frozenset()) | {page.id}
            if isinstance(widget, Command):
                commands[widget.id] = commands.get(widget.id, needs) & needs
    everywhere = {widget.id for widget in frame}
    always = {page.id for page in pages} - needing.keys()
    for command in every_command:
        own = frozenset(filter(None, (command.needs,)))
        least = NOTHING if is_stop(command) else frozenset({OPERATOR})
        placed = NOTHING if command.id in everywhere or is_stop(command) else commands.get(command.id)
        commands[command.id] = own | least | (placed or NOTHING)
    return PanelNeeds(
        commands,
        needing,
        {
            name: where
            for name, where in shown_on.items()
            if not where & always and name not in everywhere
        },
        {alarm.id: alarm.needs for alarm in alarms if alarm.needs},
    )


def _placed(page: Page) -> Iterator[tuple[BaseWidget, Needs]]:
    """Each widget of a page with what its group and page need."""
    for widget in page.own:
        yield widget, frozenset(filter(None, (page.needs,)))
    for group in page.groups:
        for widget in group.widgets:
            yield widget, frozenset(filter(None, (page.needs, group.needs)))
