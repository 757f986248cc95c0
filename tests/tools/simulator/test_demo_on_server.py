"""A demo of any panel on the real server: nothing on it is unknown, and every control works."""

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest

from app.panel import Panel, load_panel
from app.panel.widgets.families import Display
from app.panel.widgets.parameter import Parameter
from tests.support.beside_panel import put_beside
from tests.support.holds import PATIENT
from tests.support.parts import ROOT, TESTS, Process, Server, free_port, until, zenoh_file

pytestmark = pytest.mark.promise("demo")

EXAMPLES: Final = sorted((ROOT / "docs/examples").glob("*.toml"))
HEARD: Final = "/last_heard"  # the reference system says nothing there before a press
BANNER: Final = "SIMULATED ROBOT"
Servers = Callable[[Server], Server]


@pytest.fixture
def everything(tmp_path: Path) -> Path:
    """The panel with every kind of widget, with its interfaces."""
    messages = tmp_path / "msgs/cell_msgs/msg"
    messages.mkdir(parents=True)
    (messages / "Jog.msg").write_text("float64 speed\nuint32 valid_ms\nuint16 number\n")
    put_beside(tmp_path)
    path = Path(shutil.copy(TESTS / "everything.toml", tmp_path))
    # Nobody signs in here: no provider closes the panel, and no press needs a person.
    before, _, after = path.read_text().partition("[access.oidc]")
    whole = f"{before}[embed]{after.partition('[embed]')[2]}"
    for confirmation in ('confirm_press = "pin"\n', 'confirm_press = "two_persons"\n'):
        whole = whole.replace(confirmation, "")
    path.write_text(whole.replace("within_s = 2.0", "within_s = 20.0"))
    return path


def demo_of(path: Path, app: str = "app.main:app") -> Server:
    return Server(ROOT, app=app, KIOSK_PANEL=str(path), KIOSK_MODE="demo")


def not_live(panel: Panel, robot: Server) -> list[str]:
    """The displays and parameters that show no value of now."""
    shown = robot.snapshot()["widgets"]
    ids = [
        widget.id for widget in panel.widgets() if isinstance(widget, Display) and widget.topic != HEARD
    ]
    ids += [widget.id for widget in panel.widgets() if isinstance(widget, Parameter)]
    return [name for name in ids if shown[name]["state"] != "live"]


def is_alive(panel: Panel, robot: Server) -> None:
    """Waits until everything that is shown has a value, as the banner says by whom."""
    until(lambda: not_live(panel, robot) == [], "everything shows a value")
    assert robot.snapshot()["notice"]["banner"] == BANNER


def permitted(kiosk: Server, widget: str) -> bool:
    return bool(kiosk.widget(widget)["enabled"])


def takes_control(kiosk: Server) -> bool:
    """Whether this client has control now. It loses it after some seconds without a sign of life."""
    return bool(kiosk.http.post(f"{kiosk.base}/control/take", json={}).json()["done"])


def pressed(kiosk: Server, widget: str, **inputs: Any) -> dict[str, Any]:
    """The receipt of a press that no interlock refuses; presses are made until one is not."""

    def receipt() -> dict[str, Any] | None:
        if not (takes_control(kiosk) and permitted(kiosk, widget)):
            return None
        path = f"{kiosk.base}/widgets/{widget}"
        answer: dict[str, Any] = kiosk.http.post(path, json={"inputs": inputs}).json()
        return None if answer["outcome"] == "refused" else answer

    made: dict[str, Any] = until(receipt, f"{widget} is not refused", every_s=0.2)
    return made


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_an_example_is_alive(path: Path, servers: Servers) -> None:
    panel = load_panel(path)
    kiosk = servers(demo_of(path))
    robot = kiosk.robot(panel.robots[0].id) if panel.robots else kiosk
    is_alive(panel, robot)

    def states() -> set[str]:
        return {widget["state"] for widget in robot.snapshot()["widgets"].values() if "state" in widget}

    until(lambda: states() <= {"live", "waiting"}, "nothing is unknown")


# The first robot is behind a bridge, the second on rmw_zenoh.
@pytest.mark.parametrize("number", [0, 1])
def test_everything_is_alive_and_works(everything: Path, servers: Servers, number: int) -> None:
    panel = load_panel(everything)
    kiosk = servers(demo_of(everything, PATIENT))
    robot = kiosk.robot(panel.robots[number].id)
    is_alive(panel, robot)
    assert pressed(robot, "say", message="hello")["outcome"] == "confirmed"
    assert pressed(robot, "drive", speed=0.5)["outcome"] == "published"
    assert pressed(robot, "add", message="gain")["outcome"] == "succeeded"
    assert pressed(robot, "feed", feed=1.5)["outcome"] == "succeeded"
    until(lambda: robot.widget("feed")["text"] == "1.5 mm/s", "it is set")
    assert pressed(robot, "preset", preset=1)["outcome"] == "succeeded"
    assert pressed(robot, "home", count=5)["outcome"] == "accepted"
    until(lambda: robot.widget("home")["outcome"] == "succeeded", "a result")
    assert "is not whole" not in kiosk.process.text  # as the robot on rmw_zenoh says


def test_the_robots_of_a_panel_differ(everything: Path, servers: Servers) -> None:
    panel = load_panel(everything)
    kiosk = servers(demo_of(everything))
    robots = [kiosk.robot(entry.id) for entry in panel.robots]
    for robot in robots:
        is_alive(panel, robot)
    level, other = (robot.widget("battery")["text"] for robot in robots)
    assert level != other


@pytest.mark.parametrize("number", [0, pytest.param(1, marks=pytest.mark.long("detail"))])
def test_a_goal_of_any_action_is_canceled(everything: Path, servers: Servers, number: int) -> None:
    text = everything.read_text()
    everything.write_text(text.replace("duration_s = 5.0", "duration_s = 600.0"))
    panel = load_panel(everything)
    robot = servers(demo_of(everything, PATIENT)).robot(panel.robots[number].id)
    is_alive(panel, robot)
    assert pressed(robot, "home", count=5)["outcome"] == "accepted"
    until(lambda: robot.widget("home")["stoppable"], "it can be canceled")
    assert takes_control(robot)
    canceled = robot.http.post(f"{robot.base}/widgets/home/cancel", json={}).json()
    assert canceled["outcome"] == "accepted", canceled
    until(lambda: robot.widget("home")["outcome"] == "canceled", "it is canceled")


def test_the_robots_of_a_panel_run_as_a_program_of_their_own(
    everything: Path, tmp_path: Path, servers: Servers
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    text = everything.read_text()
    for robot in ("robot1", "robot2"):
        text = text.replace(f'connect = ["tcp/{robot}:7447"]', "")
    everything.write_text(text)
    command = [sys.executable, "-m", "app.simulator", str(everything), endpoint]
    simulator = Process(command, {}, cwd=ROOT)
    try:
        until(lambda: "listening" in simulator.text, "it listens")
        zenoh = str(zenoh_file(tmp_path, endpoint))
        kiosk = servers(Server(ROOT, KIOSK_PANEL=str(everything), KIOSK_ZENOH=zenoh))
        panel = load_panel(everything)
        for entry in panel.robots:
            is_alive(panel, kiosk.robot(entry.id))
    finally:
        assert simulator.end() == 0, simulator.text
