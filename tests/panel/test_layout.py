"""Groups, the frame, icons and the roles of keys in a panel file: right ones are taken; each fault is
named with its place and what would be right."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from app.panel import Panel, Publish, load_panel
from app.panel.widgets.displays import Indicator
from app.panel.widgets.key_parts import COLOURS, ICONS, OWN_COLOURS
from app.system.errors import PanelError
from app.system.pictures import icons
from tests.panel.test_panel import toml
from tests.support.builders import FREE, GUARDED, HEARD, INTERLOCK, MESSAGE, Table

pytestmark = pytest.mark.promise("layout")

STOP: Table = {**FREE, "id": "stop", "message": {"data": "stop"}}
HALT: Table = {
    "id": "halt", "kind": "call", "label": "Halt", "service": "/halt", "type": "std_srvs/srv/Trigger",
}  # fmt: skip


def tables(*groups: Table, own: tuple[Table, ...] = (MESSAGE,), **more: Any) -> dict[str, Any]:
    page = {"id": "one", "title": "One", "widget": list(own), "group": list(groups)}
    return {"title": "Cell", "interlock": [INTERLOCK], "page": [page], **more}


def loaded(folder: Path, content: Mapping[str, Any]) -> Panel:
    path = folder / "cell.toml"
    path.write_text("".join(f"{name} = {toml(value)}\n" for name, value in content.items()))
    return load_panel(path)


def faults(folder: Path, content: Mapping[str, Any]) -> dict[str, str]:
    """Place → message of every fault."""
    with pytest.raises(PanelError) as caught:
        loaded(folder, content)
    return {fault.place: fault.message for fault in caught.value.faults}


def of_frame(*widgets: Table) -> dict[str, Any]:
    return tables(frame={"widget": list(widgets)})


def key(**changes: Any) -> dict[str, Any]:
    return tables(own=(MESSAGE, {**FREE, **changes}))


def test_a_page_has_the_widgets_of_its_groups_after_those_of_none(tmp_path: Path) -> None:
    groups = {"title": "First", "widget": [FREE]}, {"widget": [GUARDED, HEARD]}
    panel = loaded(tmp_path, tables(*groups))
    (page,) = panel.pages
    assert [widget.id for widget in page.widgets] == ["message", "free", "guarded", "heard"]
    assert [place for place, _ in page.placed()] == [
        "widget[0]", "group[0].widget[0]", "group[1].widget[0]", "group[1].widget[1]",
    ]  # fmt: skip
    assert [part.title for part in page.parts] == [None, "First", None]


def test_a_page_of_groups_alone_has_no_other_part(tmp_path: Path) -> None:
    (page,) = loaded(tmp_path, tables({"widget": [STOP]}, own=())).pages
    assert [len(part.widgets) for part in page.parts] == [1]


def test_the_keys_of_the_frame_are_widgets_and_commands_of_the_panel(tmp_path: Path) -> None:
    panel = loaded(tmp_path, of_frame(STOP, HALT))
    assert [widget.id for widget in panel.widgets()] == ["message", "stop", "halt"]
    assert [command.id for command in panel.commands] == ["stop", "halt"]


@pytest.mark.parametrize(
    ("columns", "span", "taken"),
    [
        (None, None, 12),  # twelfths of the group
        (None, 4, 4),
        (3, None, 1),
        (3, 2, 2),
        (3, 8, 3),  # never more than there are
    ],
)
def test_a_widget_takes_columns_of_its_group(
    tmp_path: Path, columns: int | None, span: int | None, taken: int
) -> None:
    heard = HEARD if span is None else {**HEARD, "span": span}
    group: dict[str, Any] = {"widget": [heard]}
    (page,) = loaded(
        tmp_path, tables(group if columns is None else {**group, "columns": columns})
    ).pages
    (part,) = page.groups
    assert part.grid == (columns or 12)
    assert part.span_of(part.widgets[0]) == taken


def test_values_and_conditions_of_groups_are_resolved_like_those_of_pages(tmp_path: Path) -> None:
    lamp = {
        **HEARD, "kind": "indicator", "type": "sensor_msgs/msg/BatteryState",
        "field": "power_supply_health",
        "states": [{"value": "POWER_SUPPLY_HEALTH_GOOD", "text": "Good", "shape": "circle"}],
    }  # fmt: skip
    panel = loaded(tmp_path, tables({"widget": [lamp]}))
    (widget,) = panel.pages[0].groups[0].widgets
    assert isinstance(widget, Indicator)
    assert widget.states[0].value == 1


@pytest.mark.parametrize(
    ("content", "place", "words"),
    [
        (tables({"columns": 0, "widget": [FREE]}), "page[0].group[0].columns", "1 or more, not 0"),
        (tables({"columns": 13}), "page[0].group[0].columns", "12 or less, not 13"),
        (tables({"span": 13, "widget": [FREE]}), "page[0].group[0].span", "12 or less, not 13"),
        (tables({"title": ""}), "page[0].group[0].title", "must not be empty"),
        (tables({"colums": 3, "widget": [FREE]}), "page[0].group[0].colums", 'did you mean "columns"?'),
        (
            tables({"widget": [HEARD]}, {"widget": [GUARDED, {**FREE, "topic": "go"}]}),
            "page[0].group[1].widget[1].topic",
            '"go" is not an absolute ROS 2 topic name',
        ),
        (
            tables({"widget": [{**FREE, "type": "std_msgs/msg/Strng"}]}),
            "page[0].group[0].widget[0].type",
            "did you mean",
        ),
        (
            tables({"widget": [{**HEARD, "rows": 9}]}),
            "page[0].group[0].widget[0].rows",
            "8 or less, not 9",
        ),
        (
            tables({"widget": [FREE]}, {"widget": [{**HEARD, "id": "free"}]}),
            "page[0].group[1].widget[0].id",
            '"free" is already the id of page[0].group[0].widget[0]',
        ),
        (
            tables({"widget": [{**FREE, "id": "message"}]}),
            "page[0].group[0].widget[0].id",
            '"message" is already the id of page[0].widget[0]',
        ),
        (tables(group={"widget": [FREE]}), "group", "unknown key"),
        (of_frame({**STOP, "id": "message"}), "frame.widget[0].id", "the id of page[0].widget[0]"),
        (of_frame(STOP, STOP), "frame.widget[1].id", "already the id of frame.widget[0]"),
        (
            of_frame(HALT, {**MESSAGE, "id": "note"}),
            "frame.widget[1].kind",
            '"text" is not for the frame',
        ),
        (of_frame(HEARD), "frame.widget[0].kind", "keys of the kinds publish, call and hold"),
        (of_frame({**STOP, "topic": "stop"}), "frame.widget[0].topic", "not an absolute ROS 2 topic"),
        (of_frame({**STOP, "interlock": "doors"}), "frame.widget[0].interlock", "doors"),
        # Of a page's inputs the frame, which is on all pages, has none.
        (
            of_frame({**STOP, "message": {"data": "{message}"}}),
            "frame.widget[0].message.data",
            "message",
        ),
        (tables(screens=["1280x800", "1280x800"]), "screens", 'names "1280x800" twice'),
        (tables(screens="1280x800"), "screens", 'write ["1280x800"]'),
        (tables(screens=["1280 x 800"]), "screens[0]", "1280 x 800"),
        (tables(theme="darkk"), "theme", 'did you mean "dark"?'),
        (tables(text_size="huge"), "text_size", '"normal" or "large"'),
        (tables(hand="lefty"), "hand", 'did you mean "left"?'),
        (key(icon="squre"), "page[0].widget[1].icon", 'did you mean "square"?'),
        (key(icon="no such thing"), "page[0].widget[1].icon", "docs/reference/icons.md lists them"),
        (key(role="strat"), "page[0].widget[1].role", 'did you mean "start"?'),
        (key(note="x" * 41), "page[0].widget[1].note", "40 characters at most"),
        (
            key(role="start", colour="red"),
            "page[0].widget[1].colour",
            "a start key is white or grey (IEC 60204-1), never red",
        ),
        (
            key(role="stop", colour="red"),
            "page[0].widget[1].colour",
            "a stop key is black or grey (IEC 60204-1), never red",
        ),
    ],
)
def test_a_fault_is_named_with_its_place(
    tmp_path: Path, content: dict[str, Any], place: str, words: str
) -> None:
    reported = faults(tmp_path, content)
    assert list(reported) == [place]
    assert words in reported[place]


def test_icon_of_a_page_must_be_shipped(tmp_path: Path) -> None:
    content = tables()
    content["page"][0]["icon"] = "factry"
    assert faults(tmp_path, content) == {
        "page[0].icon": '"factry" is not one of the shipped icons: did you mean "factory"?'
    }


def test_three_keys_fill_the_frame(tmp_path: Path) -> None:
    keys = [{**STOP, "id": f"stop{n}"} for n in range(4)]
    assert loaded(tmp_path, of_frame(*keys[:3]))
    (place,) = faults(tmp_path, of_frame(*keys))
    assert place == "frame.widget"


def test_faults_in_groups_and_in_the_frame_are_reported_together(tmp_path: Path) -> None:
    """The rest is checked beside stand-ins of what is no widget at all."""
    content = tables(
        {"columns": "three", "widget": [{**HEARD, "kind": "redout"}, {**FREE, "type": "x/msg/Y"}]},
        frame={"widget": [{**STOP, "topik": "/stop"}, {**HALT, "service": "halt"}]},
    )
    assert set(faults(tmp_path, content)) == {
        "page[0].group[0].columns",
        "page[0].group[0].widget[0].kind",
        "page[0].group[0].widget[1].type",
        "frame.widget[0].topik",
        "frame.widget[1].service",
    }


def test_a_fault_has_the_line_and_the_id_of_its_widget(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(
        """title = "Cell"

[[frame.widget]]
id = "halt"
kind = "call"
label = "Halt"
service = "halt"
type = "std_srvs/srv/Trigger"

[[page]]
id = "one"
title = "One"
[[page.group]]
title = "First"
[[page.group]]
title = "Second"
columns = 20
[[page.group.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "go"
type = "std_msgs/msg/Empty"
message = {}
"""
    )
    with pytest.raises(PanelError) as caught:
        load_panel(path)
    located = {fault.place: (fault.id, fault.line) for fault in caught.value.faults}
    assert located == {
        "frame.widget[0].service": ("halt", 7),
        "page[0].group[1].columns": ("one", 17),
        "page[0].group[1].widget[0].topic": ("go", 22),
    }


@pytest.mark.parametrize("role", COLOURS)
def test_each_role_has_a_suitable_colour(tmp_path: Path, role: str) -> None:
    (_, plain) = loaded(tmp_path, key(role=role)).pages[0].widgets
    assert isinstance(plain, Publish)
    assert plain.shown_colour == OWN_COLOURS.get(plain.role, "")
    assert plain.shown_colour in ("", *COLOURS[plain.role])
    assert plain.shown_icon == ICONS.get(plain.role, "")
    for colour in COLOURS[plain.role]:
        (_, coloured) = loaded(tmp_path, key(role=role, colour=colour, icon="house")).pages[0].widgets
        assert isinstance(coloured, Publish)
        assert (coloured.shown_colour, coloured.shown_icon) == (colour, "house")


def test_no_key_is_red_yellow_or_green() -> None:
    """Red and yellow are of emergency stops, which no screen has; what is normal has no colour."""
    assert {"red", "yellow", "green"}.isdisjoint(
        {colour for themes in COLOURS.values() for colour in themes}
    )


def test_the_icons_of_roles_are_shipped() -> None:
    assert set(ICONS.values()) <= set(icons())


def blocks_of(folder: Path, *widgets: Table) -> list[tuple[list[str], int, bool]]:
    """The blocks of a group of one column: (ids, the growing row, whether they are buttons)."""
    (page,) = loaded(folder, tables({"columns": 1, "widget": list(widgets)})).pages
    group = page.parts[1]
    return [([w.id for w in block.widgets], block.grows, block.are_buttons) for block in group.blocks]


def test_buttons_stand_at_the_end_of_their_group_unless_they_are_below_an_input(tmp_path: Path) -> None:
    assert blocks_of(tmp_path, HEARD, FREE, HALT) == [
        (["heard"], 0, False),
        (["free", "halt"], 0, True),
    ]
    assert blocks_of(tmp_path, FREE, HEARD) == [(["free", "heard"], 0, False)]
    note = {"id": "note", "kind": "text", "label": "Note"}
    assert blocks_of(tmp_path, HEARD, note, FREE) == [(["heard", "note", "free"], 0, False)]
    assert blocks_of(tmp_path, FREE) == [(["free"], 0, True)]


def test_one_widget_of_a_group_takes_the_height_that_is_left(tmp_path: Path) -> None:
    second = {**HEARD, "id": "second", "grow": True}
    assert blocks_of(tmp_path, HEARD, second, FREE) == [
        (["heard", "second"], 2, False),
        (["free"], 0, True),
    ]
    table = tables({"widget": [{**HEARD, "grow": True}, second]})
    assert faults(tmp_path, table) == {
        "page[0].group[0].widget[1].grow": '"heard" has it already: one widget of a group grows'
    }
