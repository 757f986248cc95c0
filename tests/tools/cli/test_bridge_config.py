"""`operator-panel bridge-config`: what it lets through, and what it does with files and mistakes."""

import json
from pathlib import Path

import pytest
import zenoh

from app.tools.cli.command import main
from tests.support.panel_text import CELL, COUNT, LOCKED_START, SPEED
from tests.support.parts import ROOT

PRESSURE_AND_RESET = """
[[page.widget]]
id = "pressure"
kind = "readout"
label = "Pressure"
topic = "/pressure"
type = "std_msgs/msg/Float64"
field = "data"
[[page.widget]]
id = "reset"
kind = "call"
label = "Reset"
service = "/reset"
type = "std_srvs/srv/Trigger"
timeout_s = 12.5
"""
CONFIRM = 'confirm = { topic = "/started", type = "std_msgs/msg/Bool", equals = true }'
PANEL = f"{CELL}{LOCKED_START}{CONFIRM}{PRESSURE_AND_RESET}{COUNT}timeout_s = 8.0\n{SPEED}"
SEVERAL = PANEL.replace(
    'namespace = "/cell9"',
    'robot = [{ id = "left", name = "Left", namespace = "/l", connect = ["tcp/192.0.2.1:7447"] },'
    ' { id = "right", name = "Right", namespace = "/r" }]',
)


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    path = tmp_path / "cell1.toml"
    path.write_text(PANEL)
    return path


def written(panel: Path, *options: str) -> zenoh.Config:
    """What was written, as Zenoh reads it."""
    path = panel.with_name("bridge.json5")
    assert main(["bridge-config", str(panel), "--output", str(path), "--force", *options]) == 0
    return zenoh.Config.from_file(path)


def plugin(config: zenoh.Config) -> dict[str, object]:
    plugin_config: dict[str, object] = json.loads(config.get_json("plugins/ros2dds"))
    return plugin_config


def test_generated_config_allows_the_panels_names_only(panel: Path) -> None:
    said = plugin(written(panel, "--domain", "7"))
    assert said["namespace"] == "/cell9"
    assert said["domain"] == 7
    assert said["allow"] == {
        "publishers": ["/operation_enabled", "/parameter_events", "/pressure", "/started"],
        "subscribers": ["/rosout", "/start"],
        "service_servers": [
            "/arm/describe_parameters",
            "/arm/get_parameters",
            "/arm/set_parameters",
            "/reset",
        ],
        "service_clients": [],
        "action_servers": ["/count"],
        "action_clients": [],
    }


def test_generated_config_has_the_panels_timeouts(panel: Path) -> None:
    assert plugin(written(panel))["queries_timeout"] == {
        "default": 5.0,
        "services": ["^/reset$=12.5"],
        "actions": {"send_goal": ["^/count$=8"]},
    }


def test_names_of_a_robot_that_has_the_namespace_itself(panel: Path) -> None:
    said = plugin(written(panel, "--prefixed"))
    assert "namespace" not in said
    assert isinstance(allow := said["allow"], dict)
    assert allow["action_servers"] == ["/cell9/count"]
    assert "/cell9/pressure" in allow["publishers"]


OUTSIDE = """
[[page.widget]]
id = "diagnostics"
kind = "readout"
label = "Diagnostics"
topic = "//diagnostics"
type = "std_msgs/msg/String"
[[page.widget]]
id = "own"
kind = "call"
label = "Own"
service = "//cell9/own"
type = "std_srvs/srv/Trigger"
timeout_s = 9.0
"""


def test_names_that_are_not_below_the_namespace(panel: Path) -> None:
    """A bridge that adds its namespace has no others."""
    panel.write_text(panel.read_text() + OUTSIDE)
    prefixed, adding = plugin(written(panel, "--prefixed")), plugin(written(panel))
    assert isinstance(there := prefixed["allow"], dict)
    assert {"/diagnostics", "/parameter_events", "/cell9/pressure"} <= set(there["publishers"])
    assert there["subscribers"] == ["/cell9/start", "/rosout"]
    assert "/cell9/own" in there["service_servers"]
    assert isinstance(there := adding["allow"], dict)
    assert not any("diagnostics" in name for name in there["publishers"])
    assert "/own" in there["service_servers"]
    text = panel.with_name("bridge.json5").read_text()
    assert "// //diagnostics is not below /cell9: it needs another bridge." in text
    assert "^/own$=9" in text


@pytest.mark.parametrize(
    "place", ["mode", "transport/link/tx", "scouting/multicast", "listen/endpoints"]
)
def test_the_rest_is_as_in_the_shipped_file(panel: Path, place: str) -> None:
    shipped = zenoh.Config.from_file(ROOT / "deploy/bridge.json5")
    assert json.loads(written(panel).get_json(place)) == json.loads(shipped.get_json(place))


def test_generated_plugin_section_is_as_in_the_shipped_file(panel: Path) -> None:
    shipped = plugin(zenoh.Config.from_file(ROOT / "deploy/bridge.json5"))
    said = plugin(written(panel))
    assert {key: said[key] for key in shipped} == shipped


def test_the_shipped_panel_goes_to_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bridge-config", "--listen", "tcp/192.0.2.10:7447"]) == 0
    assert 'listen: { endpoints: ["tcp/192.0.2.10:7447"] }' in capsys.readouterr().out


def test_the_domain_is_this_machines_by_default(panel: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert plugin(written(panel))["domain"] == 42


def test_config_for_several_robots_needs_a_robots_name(
    panel: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    panel.write_text(SEVERAL)
    config = written(panel, "--robot", "left")
    assert plugin(config)["namespace"] == "/l"
    assert json.loads(config.get_json("listen/endpoints")) == ["tcp/192.0.2.1:7447"]
    with pytest.raises(SystemExit) as ended:
        main(["bridge-config", str(panel)])
    assert ended.value.code == 2
    assert "there is left, right" in capsys.readouterr().err


def test_a_file_is_not_replaced_unasked(panel: Path, capsys: pytest.CaptureFixture[str]) -> None:
    there = panel.with_name("bridge.json5")
    there.write_text("mine")
    assert main(["bridge-config", str(panel), "-o", str(there)]) == 1
    assert "--force" in capsys.readouterr().err
    assert there.read_text() == "mine"


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("--domain=233", "is not a ROS_DOMAIN_ID: 0 to 232"),
        ("--listen=7447", "is not a Zenoh endpoint"),
        ("--nodename=a/b", "is not a name of a ROS 2 node"),
    ],
)
def test_a_mistake_is_named(option: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["bridge-config", option])
    assert words in capsys.readouterr().err


def test_a_panel_with_faults_is_refused(panel: Path, capsys: pytest.CaptureFixture[str]) -> None:
    panel.write_text("title = 3")
    assert main(["bridge-config", str(panel)]) == 2
    assert "can't be used" in capsys.readouterr().err


def test_a_robot_on_rmw_zenoh_needs_no_bridge(panel: Path, capsys: pytest.CaptureFixture[str]) -> None:
    panel.write_text(f'dialect = "rmw_zenoh"\n{panel.read_text()}')
    with pytest.raises(SystemExit) as ended:
        main(["bridge-config", str(panel)])
    assert ended.value.code == 2
    assert "router-config" in capsys.readouterr().err
