"""Mistakes of people who write their first panel: each fault says what would be right."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from app.panel import Panel, check_panel, load_panel
from app.panel.file.wording import PATTERNS
from app.system.errors import PanelError

GOOD: Final = """title = "Cell"
mode = "live"

[[interlock]]
id = "ready"
topic = "/ready"
type = "std_msgs/msg/Bool"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
min = 0
max = 10

[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Float64"
message = { data = "{speed}" }

[[page.widget]]
id = "load"
kind = "call"
label = "Load"
service = "/load"
type = "std_srvs/srv/Trigger"
answer = "{message}"

[[page.widget]]
id = "height"
kind = "step"
label = "Height"
interlock = "ready"
topic = "/set_height"
type = "std_msgs/msg/Float64"
message = { data = "{value}" }
value = { topic = "/height", type = "std_msgs/msg/Float64" }
min = 0
max = 3
step = 1

[[page.widget]]
id = "position"
kind = "readout"
label = "Position"
topic = "/pose"
type = "geometry_msgs/msg/Pose"
field = "position.x"
"""
FRAME_KEY: Final = """
[[frame.widget]]
id = "{}"
kind = "publish"
label = "F"
topic = "/f"
type = "std_msgs/msg/Bool"
message = {{ data = true }}
"""


def faults(tmp_path: Path, text: str) -> list[str]:
    path = tmp_path / "cell.toml"
    path.write_text(text)
    try:
        load_panel(path)
    except PanelError as error:
        return [str(fault) for fault in error.faults]
    return []


def test_the_panel_without_a_mistake_is_good(tmp_path: Path) -> None:
    assert faults(tmp_path, GOOD) == []


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('mode = "live"', 'mode = "live"\npictures = "img"', "put pictures into one here"),
        (
            'mode = "live"',
            'mode = "live"\ncontrol = true',
            "required, takeover_after_s, local: write [c",
        ),
        (
            'id = "go"',
            'id = "go"\nqos = "reliable"',
            "reliability, durability, depth: write [page.widg",
        ),
        ('id = "go"', 'id = "speed"', "already the id of page[0].widget[0], line 13"),
        ('field = "position.x"', 'field = "position"', "write position.x or position.y or position.z"),
        ('field = "position.x"', "", "data counts where no field is named"),
        ("geometry_msgs/msg/Pose", "my_msgs/msg/Pose", "no package my_msgs: its folder must be among"),
        ("geometry_msgs/msg/Pose", "geometry_msg/msg/Pose", "did you mean geometry_msgs/msg/Pose"),
        ("max = 10", "max = 10\nstep = 20", "a step of 20 is more than the whole range, from 0 to 10"),
        ('"{message}"', '"{message"', '"{message": a brace has no partner; write {field}'),
        ('{ data = "{value}" }', '{ data = "{speed}" }', 'write "{value}" in place of {speed}'),
        (
            'message = { data = "{speed}" }',
            'message = { data = "{speed}" }\nconfirm = { topic = "/go", equals = 1 }',
            "on /go this button publishes: name where the robot answers",
        ),
        ('kind = "publish"', 'kind = "button"', 'a button is "publish" for a topic, "call" for a serv'),
        ('kind = "publish"', 'kind = "e-stop"', 'a stop is "publish" or "call" with role = "stop"'),
        ('kind = "readout"', 'kind = "lamp"', 'a lamp is an "indicator"'),
        ('kind = "readout"', 'kind = "Chart"', 'a curve is a "trend"'),
        ('kind = "readout"', 'kind = "reedout"', 'did you mean "readout"?'),
        ('kind = "readout"', 'kind = "thing"', "one of text, number, slider"),
        ('kind = "publish"\nlabel = "Go"', 'name = "Go"', '"kind" is missing; one of text, number'),
        ('kind = "readout"\nlabel = "Position"', 'label = "P"\ndecimals = 2', '"kind" is missing'),
        (
            'field = "position.x"',
            'field = "position.x"\ndecimals = 2',
            'format, such as format = ".2f"',
        ),
        (
            'field = "position.x"',
            'field = "position.x"\nvisible_if = "ready"',
            "what locks it is interlock",
        ),
        ('field = "position.x"', 'field = "position.x"\nwidth = 3', "its width is span"),
        ('field = "position.x"', 'field = "position.x"\ncolor = "red"', "follows from its role"),
        ('field = "position.x"', 'field = "avg(position.x)"', "there is yaw, norm, min, max, length"),
        ('field = "position.x"', 'field = "position.x * 1000"', "such as scale = 1000"),
        ('field = "position.x"', 'field = "position.*"', "a field is a single value"),
        (
            'id = "go"',
            'id = "go"\ninterlock = [{ topic = "/door", type = "std_msgs/msg/Bool" }]',
            "write the table by itself, such as [[interlock]] with an id",
        ),
        ('id = "go"', 'id = "go"\nneeds = ["speed"]', 'not a list: write needs = "speed"'),
        ('id = "go"', 'id = "go"\nneeds = ["speed", "go"]', "must be a text, not a list of 2 values"),
        ("[[page]]", '[brand]\ncolour = "blue"\n[[page]]', 'it must be like "#1e5aa8"'),
        ("[[page]]", '[brand]\nlogo = "logo.bmp"\n[[page]]', 'it must be like "press.svg"'),
        ("[[page]]", '[embed]\norigins = ["example.com"]\n[[page]]', "the origin of a site"),
        (
            "[[page]]",
            '[[alarm]]\nid = "a"\nlost = "link"\ntext = "A"\npriority = 5\n[[page]]',
            "must be a number: 1 high, 2 medium, 3 low, 4 diagnostic, not 5",
        ),
        (
            "[[page]]",
            '[[alarm]]\nid = "a"\nwhen = "/door == true"\ntext = "A"\npriority = 2\n[[page]]',
            'write when = { topic = "/door", equals = true }',
        ),
        (
            'id = "go"',
            'id = "go_"\nkind = "select"\nlabel = "S"\noptions = ["a"]\n[[page.widget]]\nid = "go"',
            'write { value = "a", label = "a" }',
        ),
        (
            'kind = "number"',
            'type = "button"',
            '"kind" is missing; type is that of a message, and a button is "publish"',
        ),
        ('kind = "number"', 'type = "slider"', 'write kind = "slider"; type is that of a message'),
    ],
)
def test_a_mistake_says_what_would_be_right(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in GOOD
    (fault,) = faults(tmp_path, GOOD.replace(old, new, 1))
    assert words in fault


def test_the_frame_is_named_in_its_own_faults(tmp_path: Path) -> None:
    (single,) = faults(tmp_path, GOOD + FRAME_KEY.format("f").replace("[[", "[").replace("]]", "]"))
    assert "frame.widget" in single
    assert "write [[frame.widget]]" in single
    (many,) = faults(tmp_path, GOOD + "".join(FRAME_KEY.format(f"f{n}") for n in range(4)))
    assert "must have 3 widgets at most; it has 4" in many


def test_a_misspelt_name_of_the_demo_shows_beside_other_faults(tmp_path: Path) -> None:
    broken = GOOD.replace('label = "Go"', 'labl = "Go"') + '\n[demo."/hight"]\nvalues = [1]\n'
    label, demo = faults(tmp_path, broken)
    assert 'did you mean "label"?' in label
    assert "the panel does not use /hight; did you mean /height?" in demo


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("message = { a = 1 b = 2 }", "a comma stands between the keys of a table in braces"),
        ("message = { a = [1 2] }", "a comma stands between the values of a list"),
    ],
)
def test_a_missing_comma_is_named(tmp_path: Path, line: str, words: str) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(GOOD.replace('message = { data = "{speed}" }', line))
    with pytest.raises(PanelError, match=words):
        load_panel(path)


def patterns(schema: object, key: str = "") -> Iterator[str]:
    """The keys of a JSON Schema whose texts have a pattern."""
    if isinstance(schema, dict):
        if isinstance(schema.get("pattern"), str):
            yield key
        for name, inner in schema.items():
            if name in ("properties", "$defs"):
                for each, about in inner.items():
                    yield from patterns(about, each if name == "properties" else "")
            else:
                yield from patterns(inner, key)
    elif isinstance(schema, list):
        for inner in schema:
            yield from patterns(inner, key)


def test_each_key_with_a_pattern_says_what_it_must_be_like() -> None:
    keys = set(patterns(Panel.model_json_schema()))
    assert len(keys) > 20
    assert keys - PATTERNS.keys() == set()


SWITCH: Final = """
[[page.widget]]
id = "light"
kind = "switch"
label = "Light"
topic = "/set_light"
type = "std_msgs/msg/Bool"
on_message = { data = true }
off_message = { data = %s }
reported = { topic = "/light", type = "std_msgs/msg/Bool" }
"""


def test_both_positions_of_a_switch_send_something_else(tmp_path: Path) -> None:
    assert faults(tmp_path, GOOD + SWITCH % "false") == []
    (fault,) = faults(tmp_path, GOOD + SWITCH % "true")
    assert "is the same as on_message" in fault


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('topic = "/ready"', 'topic = "/ready"\nlabel = "Door closed"', 'such as locked = "'),
        ('label = "Go"', 'label = "Go"\nconsequence = "It moves."', "add confirm_press = true"),
        ('label = "Go"', 'label = "−"\nshow_label = false\nicon = "minus"', "write a word"),
    ],
)
def test_what_has_no_effect_is_noted(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(GOOD)
    before = [note for note in check_panel(path).notes if words in str(note)]
    path.write_text(GOOD.replace(old, new, 1))
    assert [before, len([note for note in check_panel(path).notes if words in str(note)])] == [[], 1]
