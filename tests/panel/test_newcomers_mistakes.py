"""Mistakes of people who write their first panel: each fault says what would be right."""

from pathlib import Path
from typing import Final

import pytest

from app.errors import PanelError
from app.panel import load_panel

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
