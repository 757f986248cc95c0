"""Names that are not below the panel's namespace, in each place of the file."""

from pathlib import Path
from typing import Final

import pytest

from app.panel import load_panel
from app.system.errors import PanelError
from tests.support.builders import faults_text

PANEL: Final = """
title = "Cell"
namespace = "/amr"
record = { topics = ["//cell/door"] }
[[interlock]]
id = "door"
topic = "//cell/door"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "pressure"
kind = "gauge"
label = "Pressure"
topic = "//cell/pressure"
type = "std_msgs/msg/Float64"
min = 0.0
max = 10.0
setpoint = { topic = "//cell/target", type = "std_msgs/msg/Float64" }
[[page.widget]]
id = "trend"
kind = "trend"
label = "Trend"
pen = [{ topic = "//cell/pressure", type = "std_msgs/msg/Float64", label = "Pressure" }]
[[page.widget]]
id = "open"
kind = "call"
label = "Open"
service = "//cell/open"
type = "std_srvs/srv/Trigger"
[[page.widget]]
id = "move"
kind = "action"
label = "Move"
action = "//cell/move"
type = "example_interfaces/action/Fibonacci"
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "//cell/go"
type = "std_msgs/msg/Bool"
message = { data = true }
interlock = "door"
confirm = { topic = "//cell/went", type = "std_msgs/msg/Bool", equals = true }
[[page.widget]]
id = "tries"
kind = "parameter"
label = "Tries"
node = "//cell/plc"
parameter = "tries"
type = "integer"
[demo."//cell/pressure"]
range = [1, 5]
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "cell.toml"


def test_name_outside_the_namespace_is_allowed_in_every_place(path: Path) -> None:
    path.write_text(PANEL)
    load_panel(path)


PEN: Final = 'pen = [{ topic = "//cell/pressure"'
GO: Final = 'topic = "//cell/go"'


@pytest.mark.parametrize(
    ("namespace", "old", "new", "fault"),
    [
        (
            "/cell",
            PEN,
            'pen = [{ topic = "/pressure"',
            'widget[1].pen[0].topic: "/pressure" is "//cell/pressure" at page[0].widget[0].topic',
        ),
        (
            "/cell",
            'service = "//cell/open"',
            'service = "/go"',
            'widget[4].topic: "//cell/go" is "/go" at page[0].widget[2].service',
        ),
        ("/amr", GO, 'topic = "///go"', 'widget[4].topic: "///go" is not an absolute ROS 2 topic name'),
        ("/amr", GO, 'topic = "//rosout"', "widget[4].topic: /rosout is where the panel server"),
    ],
)
def test_a_topic_has_one_spelling(path: Path, namespace: str, old: str, new: str, fault: str) -> None:
    assert old in PANEL
    path.write_text(PANEL.replace('"/amr"', f'"{namespace}"').replace(old, new))
    with pytest.raises(PanelError) as raised:
        load_panel(path)
    assert f"page[0].{fault}" in faults_text(raised.value)
