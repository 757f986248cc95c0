"""`operator-panel router-config`: what it lets through, and what it does with files and mistakes.
With the real router: `tests/cell/session/test_router_config.py`."""

import json
from pathlib import Path
from typing import Any

import pytest
import zenoh

from app.tools.cli.command import main
from tests.support.panel_text import ADD, CELL, COUNT, LOCKED_START, SPEED

LATCHED_START = LOCKED_START + 'qos = { durability = "transient_local" }\n'
PANEL = f'dialect = "rmw_zenoh"\ndomain = 7\n{CELL}{LATCHED_START}{ADD}{COUNT}{SPEED}'
SEVERAL = PANEL.replace('dialect = "rmw_zenoh"\ndomain = 7\n', "").replace(
    'namespace = "/cell9"',
    'robot = [{ id = "left", name = "Left", namespace = "/l", connect = ["tcp/192.0.2.1:7447"],'
    ' dialect = "rmw_zenoh", domain = 3 },'
    ' { id = "right", name = "Right", namespace = "/r", dialect = "bridge" }]',
)
BOOL = "std_msgs::msg::dds_::Bool_/*"


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    path = tmp_path / "cell1.toml"
    path.write_text(PANEL)
    return path


def written(panel: Path, *options: str) -> zenoh.Config:
    """What was written, as Zenoh reads it."""
    path = panel.with_name("router.json5")
    assert main(["router-config", str(panel), "--output", str(path), "--force", *options]) == 0
    return zenoh.Config.from_file(path)


def access(config: zenoh.Config) -> dict[str, Any]:
    control: dict[str, Any] = json.loads(config.get_json("access_control"))
    return control


def allowed(config: zenoh.Config, message: str, flow: str) -> set[str]:
    """The key expressions on which the panel may send ("ingress") or receive a kind of message."""
    control = access(config)
    (rules,) = (each["rules"] for each in control["policies"] if each["subjects"] == ["panel"])
    return {
        expression
        for rule in control["rules"]
        if rule["id"] in rules and message in rule["messages"] and flow in rule["flows"]
        for expression in rule["key_exprs"]
    }


def test_a_panel_may_put_its_commands_and_its_log_only(panel: Path) -> None:
    config = written(panel)
    assert json.loads(config.get_json("mode")) == "router"
    assert access(config)["enabled"]
    assert access(config)["default_permission"] == "deny"
    assert allowed(config, "put", "ingress") == {
        f"7/cell9/start/{BOOL}",
        "7/cell9/rosout/rcl_interfaces::msg::dds_::Log_/*",
        "7/rosout/rcl_interfaces::msg::dds_::Log_/*",
    }
    assert allowed(config, "delete", "ingress") == allowed(config, "delete", "egress") == set()


def test_a_panel_may_ask_its_services_only(panel: Path) -> None:
    asked = {key.split("/", 1)[1].rsplit("/", 2)[0] for key in _services(written(panel))}
    assert asked == {
        "cell9/add_two_ints",
        "cell9/arm/describe_parameters",
        "cell9/arm/get_parameters",
        "cell9/arm/set_parameters",
        "cell9/count/_action/cancel_goal",
        "cell9/count/_action/get_result",
        "cell9/count/_action/send_goal",
    }


def _services(config: zenoh.Config) -> set[str]:
    return {key for key in allowed(config, "query", "ingress") if "/srv" in key or "::srv::" in key} | {
        key for key in allowed(config, "query", "ingress") if "::action::" in key and "@adv" not in key
    }


def test_a_panel_may_be_the_node_of_a_panel_only(panel: Path) -> None:
    tokens = allowed(written(panel), "liveliness_token", "ingress")
    nodes = {token.split("/")[8] for token in tokens if token.startswith("@ros2_lv/")}
    assert nodes == {"web_ui$*"}
    kinds = {token.split("/")[5] for token in tokens if token.startswith("@ros2_lv/")}
    assert kinds == {"NN", "MP", "MS", "SC"}  # no server
    assert f"@ros2_lv/7/*/0/*/MP/%/%/web_ui$*/%cell9%start/{BOOL}/*" in tokens
    assert not any("MP" in token and "operation_enabled" in token for token in tokens)


def test_only_what_keeps_its_last_message_has_a_cache(panel: Path) -> None:
    assert allowed(written(panel), "declare_queryable", "ingress") >= {
        f"7/cell9/start/{BOOL}/@adv/pub/**"
    }
    assert not any(
        "operation" in key for key in allowed(written(panel), "declare_queryable", "ingress")
    )


def test_nodes_come_to_the_usual_port_and_the_panel_to_its_own(panel: Path) -> None:
    here = written(panel)
    assert json.loads(here.get_json("listen/endpoints")) == [
        "tcp/127.0.0.1:7447",
        "unixsock-stream//run/zenohd/panel.sock",
    ]
    elsewhere = written(panel, "--listen", "tcp/0.0.0.0:7447", "--nodes", "eth1", "--nodes", "lo")
    assert json.loads(elsewhere.get_json("listen/endpoints")) == ["tcp/0.0.0.0:7447"]
    (nodes,) = (each for each in access(elsewhere)["subjects"] if each["id"] == "nodes")
    assert nodes["interfaces"] == ["eth1", "lo"]


def test_config_for_several_robots_needs_the_name_of_one_without_a_bridge(
    panel: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    panel.write_text(SEVERAL)
    config = written(panel, "--robot", "left")
    assert json.loads(config.get_json("listen/endpoints"))[1] == "tcp/192.0.2.1:7447"
    assert f"3/l/start/{BOOL}" in allowed(config, "put", "ingress")
    for options, words in (([], "there is left, right"), (["--robot", "right"], "bridge-config")):
        with pytest.raises(SystemExit) as ended:
            main(["router-config", str(panel), *options])
        assert ended.value.code == 2
        assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("--domain=233", "is not a ROS_DOMAIN_ID: 0 to 232"),
        ("--listen=7447", "is not a Zenoh endpoint"),
        ("--nodes=a/b", "is not a network interface"),
    ],
)
def test_a_mistake_is_named(option: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["router-config", option])
    assert words in capsys.readouterr().err


def test_a_panel_with_faults_is_refused(panel: Path, capsys: pytest.CaptureFixture[str]) -> None:
    panel.write_text("title = 3")
    assert main(["router-config", str(panel)]) == 2
    assert "can't be used" in capsys.readouterr().err
