"""Names of constants in messages, confirmations and displays, also of enumerations without a prefix."""

from pathlib import Path
from typing import Final

import pytest

from app.panel import load_panel
from app.panel.file.load import check_panel
from app.ros.messages import load_interfaces
from app.system.errors import PanelError
from tests.support.builders import faults_text

DIAGNOSTICS: Final = "diagnostic_msgs/msg/DiagnosticArray"
PANEL: Final = """
title = "Cell"
interfaces = ["cell_msgs"]
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "mode"
kind = "select"
label = "Mode"
options = [{ value = "AUTO", label = "Automatic" }, { value = 1, label = "Manual" }]
[[page.widget]]
id = "set"
kind = "publish"
label = "Set"
topic = "/set"
type = "cell_msgs/msg/Mode"
message = { mode = "{mode}", history = ["MANUAL", 2], inner = { level = "ERROR" } }
confirm = { topic = "/mode", type = "cell_msgs/msg/Mode", field = "mode", equals = "{mode}" }
[[page.widget]]
id = "call"
kind = "call"
label = "Call"
service = "/change"
type = "cell_msgs/srv/Change"
request = { how = "FAST" }
[[page.widget]]
id = "go"
kind = "action"
label = "Go"
action = "/go"
type = "cell_msgs/action/Go"
goal = { how = "SLOW" }
[[page.widget]]
id = "shown"
kind = "readout"
label = "Mode"
topic = "/mode"
type = "cell_msgs/msg/Mode"
field = "mode"
constants = ""
[[page.widget]]
id = "table"
kind = "table"
label = "Diagnostics"
topic = "/diagnostics"
type = "diagnostic_msgs/msg/DiagnosticArray"
field = "status"
column = [{ label = "Level", field = "level", constants = "" }]
[demo."/mode"]
values = ["AUTO", "MANUAL", 2]
message = { inner = { level = "WARN" } }
"""
FILES: Final = {
    "msg/Mode.msg": "uint8 AUTO=0\nuint8 MANUAL=1\nstring MAKER=A\nbool FITTED=true\nfloat64 HALF=0.5\n"
    "uint8 mode\nuint8[] history\ndiagnostic_msgs/DiagnosticStatus inner\nstring text\n"
    "float32 x\nbool on",
    "srv/Change.srv": "int8 FAST=-1\nint8 how\n---\nbool success",
    "action/Go.action": "int8 SLOW=3\nint8 how\n---\n---\n",
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        file = tmp_path / "cell_msgs" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    (tmp_path / "cell.toml").write_text(PANEL)
    return tmp_path / "cell.toml"


def test_a_message_a_request_and_a_goal_have_the_values_of_named_constants(path: Path) -> None:
    panel = load_panel(path)
    interfaces = load_interfaces(panel.distro, panel.interfaces)
    mode = "cell_msgs/msg/Mode"
    fields = {"mode": "MANUAL", "x": "HALF", "on": "FITTED", "inner": {"level": "STALE"}}
    made = interfaces.decode(mode, interfaces.encode(mode, fields))
    assert (made.mode, made.x, made.on, made.inner.level) == (1, 0.5, True, 3)
    request = interfaces.service_types("cell_msgs/srv/Change")[0]
    assert interfaces.decode(request, interfaces.encode(request, {"how": "FAST"})).how == -1
    goal = interfaces.action_types("cell_msgs/action/Go").send_goal_request
    payload = interfaces.encode(goal, {"goal": {"how": "SLOW"}})
    assert interfaces.decode(goal, payload).goal.how == 3


def test_the_preview_of_a_press_has_the_values_that_the_robot_gets(path: Path) -> None:
    publish, call, goal = (preview.message for preview in check_panel(path).previews)
    assert "history: [1, 2]" in publish
    assert "level: 2" in publish
    assert 'mode: "{mode}"' in publish
    assert "how: -1" in call
    assert "how: 3" in goal


def test_a_text_is_not_the_name_of_a_constant(path: Path) -> None:
    interfaces = load_interfaces("jazzy", (path.parent / "cell_msgs",))
    made = interfaces.encode("cell_msgs/msg/Mode", {"text": "MAKER"})
    assert interfaces.decode("cell_msgs/msg/Mode", made).text == "MAKER"


NAMES: Final = (
    'must be a whole number (uint8) or the name of a constant of cell_msgs/msg/Mode, not "{}"{}'
)


@pytest.mark.parametrize(
    ("old", "new", "place", "fault"),
    [
        (
            '["MANUAL", 2]',
            '["MANAUL", 2]',
            "page[0].widget[1].message.history[0]",
            NAMES.format("MANAUL", "; did you mean MANUAL? it has AUTO, MANUAL"),
        ),
        (
            '"AUTO", label',
            '"QQ", label',
            "page[0].widget[1].message.mode",
            'input "mode" gives "QQ"; the field is uint8',
        ),
        (
            'equals = "{mode}"',
            'equals = "MAKER"',
            "page[0].widget[1].confirm.equals",
            NAMES.format("MAKER", "; it has AUTO, MANUAL"),
        ),
        (
            'how = "FAST"',
            'how = "QQQ"',
            "page[0].widget[2].request.how",
            "must be a whole number (int8) or the name of a constant of "
            'cell_msgs/srv/Change_Request, not "QQQ"; it has FAST',
        ),
        (
            'values = ["AUTO"',
            'values = ["QQQ"',
            'demo."/mode".values[0]',
            f'"mode": {NAMES.format("QQQ", "; it has AUTO, MANUAL")}',
        ),
        (
            '{ level = "WARN" }',
            '{ level = "QQQ" }',
            'demo."/mode".message.inner.level',
            "must be a whole number (byte) or the name of a constant of "
            'diagnostic_msgs/msg/DiagnosticStatus, not "QQQ"; it has OK, WARN, ERROR, STALE',
        ),
    ],
)
def test_an_unknown_name_is_named_with_the_constants_there_are(
    path: Path, old: str, new: str, place: str, fault: str
) -> None:
    assert old in PANEL
    path.write_text(PANEL.replace(old, new))
    with pytest.raises(PanelError) as raised:
        load_panel(path)
    assert f"{place}: {fault}" in faults_text(raised.value)


def test_two_enumerations_without_a_prefix_are_not_told_apart_by_their_constants(path: Path) -> None:
    file = path.parent / "cell_msgs/msg/Mode.msg"
    file.write_text(f"uint8 OPEN=0\n{FILES['msg/Mode.msg']}")
    with pytest.raises(PanelError, match="OPEN and AUTO are both 0: a longer prefix tells them apart"):
        load_panel(path)
