"""How a page is laid out: groups with a grid of their own, the frame, what the screen is like."""

from collections.abc import Iterator
from functools import cached_property
from typing import Annotated, Final, Literal, NamedTuple

from pydantic import AfterValidator, Field

from app.panel.base import Description, File, Icon, Id, Label, Span, each_once
from app.panel.shared_keys import NeedsKey, RobotKey
from app.panel.widgets.families import BaseWidget, EntryWidget
from app.panel.widgets.kinds import KINDS, Widget
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.tiles import BUTTONS
from app.system.public import PUBLIC

COLUMNS: Final = 12  # of a page, and of a group that does not say
SCREEN: Final = r"^[1-9][0-9]{2,3}x[1-9][0-9]{2,3}$"
# No page has these ids: what shows the frame of one robot, or of all, around something else.
FRAME_ONLY: Final = "-frame"
FRAME_OF_ALL: Final = "-frame-of-all"
FRAMES: Final = (FRAME_ONLY, FRAME_OF_ALL)
Placed = Iterator[tuple[str, BaseWidget]]

Theme = Literal["light", "dark", "contrast"]
TextSize = Literal["normal", "large"]
Hand = Literal["right", "left"]
Screen = Annotated[str, Field(pattern=SCREEN), PUBLIC]


Screens = Annotated[tuple[Screen, ...], Field(strict=False), AfterValidator(each_once)]


class Group(NeedsKey, RobotKey):
    """A part of a page with a heading and a grid of `columns`; `span` is its width in twelfths of the
    page. Without `columns` its widgets' spans are twelfths of the group. `needs`: the role or group of
    users that its commands need."""

    title: Label | None = None
    note: Label | None = None
    columns: Annotated[int, Field(ge=1, le=COLUMNS)] | None = None
    span: Span = COLUMNS
    widgets: Annotated[tuple[Widget, ...], Field(strict=False)] = Field((), alias="widget")

    @property
    def grid(self) -> int:
        """The columns of its grid."""
        return self.columns or COLUMNS

    @cached_property
    def blocks(self) -> tuple["Block", ...]:
        """Its widgets from above to below. The rows of buttons at the end are a block of their own,
        which stands at the end of the group, unless they are below what is entered."""
        cells = list(self.cells())
        first = 1 + max((row for widget, row, _ in cells if not is_button(widget)), default=-1)
        straddles = any(row < first < row + rows for _, row, rows in cells)
        above = [widget for widget, row, rows in cells if row + rows == first]
        is_entry = any(isinstance(widget, EntryWidget | Parameter) for widget in above)
        if straddles or is_entry:
            first = 1 + max((row for _, row, _ in cells), default=-1)
        facts = tuple(widget for widget, row, _ in cells if row < first)
        buttons = tuple(widget for widget, row, _ in cells if row >= first)
        growing = [row for widget, row, _ in cells if widget.grow and row < first]
        growing += [r for widget, r, _ in cells if KINDS[widget.kind].tile.grows and r < first]
        blocks = (Block(facts, growing[0] + 1 if growing else 0, False), Block(buttons, 0, True))
        return tuple(block for block in blocks if block.widgets)

    def cells(self) -> Iterator[tuple[BaseWidget, int, int]]:
        """(widget, its first row, its rows), placed one after the other as CSS places them in a
        grid."""
        taken: set[tuple[int, int]] = set()
        row = column = 0
        for widget in self.widgets:
            span = self.span_of(widget)
            while column + span > self.grid or taken & _places(row, column, span, widget.rows):
                column += 1
                if column + span > self.grid:
                    row, column = row + 1, 0
            taken |= _places(row, column, span, widget.rows)
            yield widget, row, widget.rows
            column += span

    def span_of(self, widget: BaseWidget) -> int:
        """The columns that a widget takes: one, where the group says how many it has and the widget
        does not."""
        if self.columns is not None and "span" not in widget.model_fields_set:
            return 1
        return min(widget.span, self.grid)


class Block(NamedTuple):
    """Rows of a group. The row `grows` takes the height that is left, counted from 1; 0: none."""

    widgets: tuple[BaseWidget, ...]
    grows: int
    are_buttons: bool


def is_button(widget: BaseWidget) -> bool:
    """Whether it stands with others on one line at the end of its group."""
    return KINDS[widget.kind].tile in BUTTONS


def _places(row: int, column: int, span: int, rows: int) -> set[tuple[int, int]]:
    return {(r, c) for r in range(row, row + rows) for c in range(column, column + span)}


class Page(NeedsKey, RobotKey):
    """A page of the panel; with `fit` it never scrolls. An `overview` has a tile for each robot,
    and the sum of their figures after the text `total`. With a `template` (Jinja) that one places the
    widgets; `styles` is appended to the panel's stylesheet. Clients without the role or group `needs`
    do not see it."""

    id: Id
    title: Label
    icon: Icon | None = None
    overview: bool = False
    total: Label | None = None
    fit: bool = False
    template: File | None = None
    styles: File | None = None
    own: Annotated[tuple[Widget, ...], Field(strict=False)] = Field((), alias="widget")
    groups: Annotated[tuple[Group, ...], Field(strict=False)] = Field((), alias="group")

    @cached_property
    def widgets(self) -> tuple[BaseWidget, ...]:
        """All its widgets: those of no group first."""
        return (*self.own, *(widget for group in self.groups for widget in group.widgets))

    @cached_property
    def parts(self) -> tuple[Group, ...]:
        """Its groups; the widgets of none are the first."""
        if not self.own:
            return self.groups
        # Its widgets are checked already: checking them again would take 15 ms of the first request.
        return (Group.model_construct(widget=self.own), *self.groups)

    def robots(self) -> Iterator[tuple[str, BaseWidget, str | None]]:
        """(place, widget, robot) of every widget: the robot is its own, its group's or the page's."""
        of_group = {f"group[{g}]": group.robot for g, group in enumerate(self.groups)}
        for place, widget in self.placed():
            around = of_group.get(place.partition(".")[0]) or self.robot
            yield place, widget, widget.robot or around

    def placed(self) -> Placed:
        """(place in the page's table, widget) of every widget: ("group[0].widget[2]", …)."""
        return iter(self.placed_widgets)

    @cached_property
    def placed_widgets(self) -> tuple[tuple[str, Widget], ...]:
        """The same, made once: each check of a panel goes through them."""
        own = ((f"widget[{w}]", widget) for w, widget in enumerate(self.own))
        in_groups = (
            (f"group[{g}].widget[{w}]", widget)
            for g, group in enumerate(self.groups)
            for w, widget in enumerate(group.widgets)
        )
        return (*own, *in_groups)


class Frame(Description):
    """What stands on every page: keys that need no input, such as Stop."""

    widgets: Annotated[tuple[Widget, ...], Field(strict=False, max_length=3)] = Field(
        (), alias="widget"
    )
