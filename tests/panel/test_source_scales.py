"""The scale of a source counts in each table that names it: what is shown, and what is compared."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from pydantic import BaseModel

from app.panel import Panel, load_panel
from app.panel.file.keys import inner_model, known_keys
from app.panel.file.load import check_panel, faults_of_text
from app.panel.source import NAME, reads_source
from app.panel.widgets.kinds import KINDS

pytestmark = pytest.mark.promise("values")

TOPICS: Final = """title = "Cell"
[[source]]
id = "air"
topic = "/air"
type = "std_msgs/msg/Float64"
scale = 0.00001
offset = -1.0
unit = "bar"

[[source]]
id = "count"
topic = "/count"
type = "std_msgs/msg/Int32"
scale = 2
"""
PAGE: Final = '[[page]]\nid = "one"\ntitle = "One"\n'
GO: Final = (
    'kind = "publish"\nlabel = "Go"\ntopic = "/go"\ntype = "std_msgs/msg/Float64"\n'
    "message = { data = 1.0 }\n"
)
STATES: Final = 'states = [{ value = 0, text = "Low", shape = "square" }]'


def on_page(keys: str) -> str:
    return f'{PAGE}[[page.widget]]\nid = "w"\n{keys}\n'


LOCK: Final = f"{PAGE}[[page.widget]]\nid = 'w'\ninterlock = 'air'\n{GO}"
ALARM: Final = '[[alarm]]\nid = "a"\ntext = "Air"\n'
# Of the tables that may name a source, by their place: one that shows or compares the scaled number.
SCALED: Final = {
    "interlock": f'[[interlock]]\nid = "air"\nlabel = "Air"\nsource = "air"\nmin = 5.0\n{LOCK}',
    "condition": f'[[condition]]\nid = "c"\nlabel = "Air"\nsource = "air"\nmin = 5.0\n{PAGE}',
    "alarm": f'{ALARM}source = "air"\nlow = 5.0\n{PAGE}',
    "alarm.when": f'{ALARM}when = {{ source = "air", max = 5.0 }}\n{PAGE}',
    "alarm.while": f'{ALARM}lost = "link"\nwhile = {{ source = "air", max = 5.0 }}\n{PAGE}',
    "robot.overview": (
        f'[[robot]]\nid = "r"\nname = "R"\noverview = {{ source = "air" }}\n{PAGE}'
    ),
    "readout": on_page('kind = "readout"\nlabel = "Air"\nsource = "air"'),
    "figure": on_page('kind = "figure"\nlabel = "Air"\nsource = "air"'),
    "figure.target": on_page(
        'kind = "figure"\nlabel = "A"\ntopic = "/b"\ntype = "std_msgs/msg/Float64"\n'
        'target = { source = "air" }'
    ),
    "figure.line": on_page(
        'kind = "figure"\nlabel = "A"\ntopic = "/b"\ntype = "std_msgs/msg/Float64"\n'
        'line = [{ source = "air", text = "{value} left" }]'
    ),
    "gauge": on_page('kind = "gauge"\nlabel = "Air"\nsource = "air"\nmin = 0\nmax = 8'),
    "gauge.setpoint": on_page(
        'kind = "gauge"\nlabel = "A"\ntopic = "/b"\ntype = "std_msgs/msg/Float64"\nmin = 0\nmax = 8\n'
        'setpoint = { source = "air" }'
    ),
    "trend.pen": on_page('kind = "trend"\nlabel = "Air"\npen = [{ source = "air", label = "Air" }]'),
}  # fmt: skip
# Those that count a number as the robot sends it: the source's scale is an error there.
REFUSED: Final = {
    "state": f'[state]\nsource = "count"\n{STATES}\n{PAGE}',
    "state.detail": (
        f'[state]\ntopic = "/s"\ntype = "std_msgs/msg/Int32"\n{STATES}\n'
        f'detail = [{{ source = "count", values = [0] }}]\n{PAGE}'
    ),
    "oee.counter": (
        f'[state]\ntopic = "/s"\ntype = "std_msgs/msg/Int32"\n{STATES}\n'
        f'[oee]\nrunning = [0]\ncounter = [{{ parts = "all", source = "count" }}]\n{PAGE}'
    ),
    "select.options_from": on_page(
        'kind = "select"\nlabel = "S"\noptions_from = { source = "count" }'
    ),
    "publish.lamp": on_page(f'{GO}lamp = {{ source = "count", {STATES} }}'),
    "publish.confirm": on_page(f'{GO}confirm = {{ source = "count", equals = 1 }}'),
    "step.value": on_page(
        'kind = "step"\nlabel = "S"\ntopic = "/set"\ntype = "std_msgs/msg/Float64"\n'
        'message = { data = "{value}" }\nvalue = { source = "air" }\nmin = 0\nmax = 8\nstep = 1'
    ),
    "switch.reported": on_page(
        'kind = "switch"\nlabel = "S"\ntopic = "/set"\ntype = "std_msgs/msg/Bool"\n'
        'message = { data = "{on}" }\nreported = { source = "count" }'
    ),
    "indicator": on_page(f'kind = "indicator"\nlabel = "I"\nsource = "count"\n{STATES}'),
    "pallet": on_page(
        'kind = "pallet"\nlabel = "P"\nsource = "count"\ncolumns = 2\nrows_in_layer = 2\nlayers = 2'
    ),
    "sequence.current": on_page(
        'kind = "sequence"\nlabel = "S"\ncurrent = { source = "count" }\n'
        'step = [{ value = 0, text = "A" }, { value = 1, text = "B" }]'
    ),
    "joints": on_page('kind = "joints"\nlabel = "J"\nsource = "count"'),
    "table": on_page('kind = "table"\nlabel = "T"\nsource = "count"'),
}  # fmt: skip
# Those that read no one field.
OF_TOPIC: Final = frozenset(
    {"recipe.readback", "switch", "camera", "map", "map.pose", "map.robot_level", "log"}
)


def tables_with_source() -> Iterator[str]:
    """The places of all tables that may name a source; a kind of widget stands for `page.widget`."""
    seen: set[type[BaseModel]] = set()

    def walk(model: type[BaseModel] | None, place: str) -> Iterator[str]:
        if model is None or model in seen:
            return
        seen.add(model)
        if reads_source(model):
            yield place
        for key in known_keys(model):
            yield from walk(inner_model(model, key), f"{place}.{key}".strip("."))

    yield from walk(Panel, "")
    for kind, row in KINDS.items():
        yield from walk(row.model, kind)


def test_each_table_that_names_a_source_has_a_row() -> None:
    assert set(tables_with_source()) == {*SCALED, *REFUSED, *OF_TOPIC}


@pytest.fixture
def load(tmp_path: Path) -> Any:
    def loaded(text: str) -> Panel:
        path = tmp_path / "cell.toml"
        path.write_text(TOPICS + text)
        return load_panel(path)

    return loaded


def described(panel: Panel, place: str) -> Any:
    """The description of the table at a place of `SCALED`."""
    widgets: dict[str, Any] = {str(widget.kind): widget for widget in panel.widgets()}
    tables: dict[str, Any] = {
        "interlock": lambda: panel.interlocks[0],
        "condition": lambda: panel.own_conditions[0],
        "alarm": lambda: panel.alarms[0],
        "alarm.when": lambda: panel.alarms[0].when,
        "alarm.while": lambda: panel.alarms[0].suppressed_while,
        "robot.overview": lambda: panel.robots[0].overview,
        "trend.pen": lambda: widgets["trend"].pens[0],
        "figure.target": lambda: widgets["figure"].target,
        "figure.line": lambda: widgets["figure"].lines[0],
        "gauge.setpoint": lambda: widgets["gauge"].setpoint,
    }
    return tables[place]() if place in tables else widgets[place]


@pytest.mark.parametrize("place", SCALED)
def test_the_scale_of_a_source_counts(load: Any, place: str) -> None:
    table = described(load(SCALED[place]), place)
    assert (table.scale, table.offset) == (0.00001, -1.0)
    assert getattr(table, "unit", "bar") == "bar"


@pytest.mark.parametrize("place", REFUSED)
def test_where_a_number_counts_as_it_is_sent_a_scale_is_an_error(tmp_path: Path, place: str) -> None:
    faults = faults_of_text(TOPICS + REFUSED[place], tmp_path)
    messages = [fault.message for fault in faults if fault.place.endswith(NAME)]
    assert len(messages) == 1
    assert "counts as the robot sends it" in messages[0]


@pytest.mark.parametrize(
    ("keys", "is_fault"),
    [('unit = "Pa"', True), ('unit = "bar"', False), ('unit = "Pa"\nscale = 1', False)],
)
def test_another_unit_than_the_source_has_needs_a_scale(
    tmp_path: Path, keys: str, is_fault: bool
) -> None:
    for place in ("interlock", "condition", "alarm", "readout", "figure", "gauge"):
        text = TOPICS + SCALED[place].replace('source = "air"', f'source = "air"\n{keys}')
        places = [fault.place.rpartition(".")[2] for fault in faults_of_text(text, tmp_path)]
        assert places == (["unit"] if is_fault else []), place


@pytest.mark.parametrize(
    ("place", "key"),
    [
        ("interlock", "interlock[0].min"),
        ("condition", "condition[0].min"),
        ("alarm", "alarm[0].low"),
        ("alarm.when", "alarm[0].when.max"),
        ("alarm.while", "alarm[0].while.max"),
        ("gauge.setpoint", "page[0].widget[0].setpoint.source"),
        ("figure.target", "page[0].widget[0].target.source"),
    ],
)
def test_a_file_whose_meaning_changed_is_named_with_both_readings(
    tmp_path: Path, place: str, key: str
) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(TOPICS + SCALED[place])
    (note,) = [note for note in check_panel(path).notes if "Up to version 0.1" in note.message]
    assert note.place == key
    assert path.read_text().splitlines()[note.line - 1].find(key.rpartition(".")[2]) >= 0
    if "source" not in key:
        assert "is 5 bar, which is 600000 in the message" in note.message
        assert "it was 5 in the message" in note.message


def test_with_its_own_scale_nothing_has_changed(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    keys = 'source = "air"\nscale = 0.00001\noffset = -1.0\nunit = "bar"'
    path.write_text(TOPICS + SCALED["interlock"].replace('source = "air"', keys))
    assert not [note for note in check_panel(path).notes if "Up to version" in note.message]
