"""The panel as a package of a ROS 2 workspace: built by colcon, found and started as `ros2` does."""

import os
import shlex
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import pytest

from tests.support import locked
from tests.support.checkout import copy_project
from tests.support.panel_text import MAIN, START
from tests.support.parts import (
    BRIDGE,
    CYCLONE_ON_LOOPBACK,
    ROOT,
    ROS_PYTHON,
    TESTS,
    Process,
    free_port,
    http_client,
    until,
    zenoh_file,
)

pytestmark = pytest.mark.long("packaging")

PACKAGE: Final = "operator_panel"
PANEL: Final = f'title = "Robot cell 1"\n{MAIN}{START}'
# The bridge's own program takes `-c FILE` and ROS_DOMAIN_ID; that of the tests FILE and places in it.
BRIDGE_COMMAND: Final = f"""#!/bin/sh
[ "$1" = -c ] && [ $# = 2 ] || exit 2
exec {shlex.quote(str(BRIDGE))} "$2" plugins/ros2dds/domain=$ROS_DOMAIN_ID \
    'plugins/ros2dds/ros_automatic_discovery_range="LOCALHOST"'
"""
# As `ros2 run` finds a package's executables.
EXECUTABLES: Final = f"""
import os
from ament_index_python.packages import get_package_prefix
folder = os.path.join(get_package_prefix("{PACKAGE}"), "lib", "{PACKAGE}")
for here, _, files in os.walk(folder):
    print(*(os.path.join(here, one) for one in files if os.access(os.path.join(here, one), os.X_OK)))
"""


@dataclass(frozen=True)
class Workspace:
    """A workspace after `colcon build`; `said` is what that printed."""

    folder: Path
    said: str

    def environment(self) -> dict[str, str]:
        """After its `local_setup.sh`, in a shell that knows no other workspace."""
        shell = subprocess.run(
            ["sh", "-c", ". install/local_setup.sh; env -0"],
            cwd=self.folder,
            env=WITHOUT_PYTHONPATH,
            capture_output=True,
            text=True,
            check=True,
        )
        return dict(line.split("=", 1) for line in shell.stdout.split("\0") if line)

    @property
    def installed(self) -> Path:
        return self.folder / "install" / PACKAGE

    @property
    def environment_folder(self) -> Path:
        """Of the package's own Python environment."""
        return self.installed / "opt" / PACKAGE


WITHOUT_PYTHONPATH: Final = {name: v for name, v in os.environ.items() if name != "PYTHONPATH"}


def make_checkout(folder: Path) -> None:
    """The files of the checkout, but of the locked dependencies only one: pip takes 20 s for all."""
    copy_project(folder)
    (folder / "deploy/requirements.lock").write_text(locked.entries(locked.LOCK)["annotated-types"])


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    folder = tmp_path_factory.mktemp("workspace")
    make_checkout(folder / "src/operator-panel")
    colcon = ROS_PYTHON.with_name("colcon")
    # What is compiled would take a third of the time, and is not needed here.
    env = {**WITHOUT_PYTHONPATH, "PIP_NO_COMPILE": "1", "PATH": f"{colcon.parent}:{os.environ['PATH']}"}
    built = subprocess.run(
        [colcon, "build"], cwd=folder, env=env, capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stdout + built.stderr
    mine = Workspace(folder, built.stdout)
    assert list(mine.environment_folder.glob("lib/*/site-packages/annotated_types/__init__.py"))
    locked.add_dependencies(mine.environment_folder)
    return mine


def output(command: list[str], env: Mapping[str, str]) -> str:
    """Its standard output."""
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_colcon_builds_one_package(workspace: Workspace) -> None:
    assert "Summary: 1 package finished" in workspace.said
    assert "stderr" not in workspace.said
    for checkout in (ROOT, workspace.folder / "src/operator-panel"):
        assert not list(checkout.glob("*.egg-info")) + list(checkout.glob("build/lib"))


def test_ros2_run_finds_the_command_and_no_other(workspace: Workspace) -> None:
    env = workspace.environment()
    (command,) = output([str(ROS_PYTHON), "-c", EXECUTABLES], env).split()
    assert command.endswith(f"/lib/{PACKAGE}/operator-panel")
    version = ElementTree.parse(ROOT / "deploy/ros/package.xml").findtext("version")
    assert output([command, "--version"], env) == f"operator-panel {version}\n"


def test_the_package_has_the_version_of_the_project() -> None:
    package = ElementTree.parse(ROOT / "deploy/ros/package.xml")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert package.findtext("version") == project["version"]
    assert package.findtext("description") == project["description"]
    assert package.findtext("license") == project["license"]


def test_modules_of_other_packages_do_not_come_before_its_own(
    workspace: Workspace, tmp_path: Path
) -> None:
    (tmp_path / "app.py").write_text("raise SystemExit('another package')\n")
    command = str(workspace.installed / f"lib/{PACKAGE}/operator-panel")
    env = {**workspace.environment(), "PYTHONPATH": str(tmp_path)}
    assert output([command, "check", "--help"], env).startswith("usage: operator-panel check")


@pytest.fixture
def launched(workspace: Workspace, domain: int, tmp_path: Path) -> Iterator[tuple[Process, str]]:
    """The launch with a panel, and the address of the server."""
    panel, bridge = tmp_path / "cell1.toml", tmp_path / "zenoh-bridge-ros2dds"
    panel.write_text(PANEL)
    bridge.write_text(BRIDGE_COMMAND)
    bridge.chmod(0o755)
    endpoint, port = f"tcp/127.0.0.1:{free_port()}", free_port()
    shipped = workspace.installed / f"share/{PACKAGE}/bridge.json5"
    config = tmp_path / "bridge.json5"
    config.write_text(shipped.read_text().replace("tcp/127.0.0.1:7447", endpoint))
    file = workspace.installed / f"share/{PACKAGE}/launch/kiosk.launch.py"
    process = Process(
        [
            *(sys.executable, str(TESTS / "ros_nodes/launch_file.py"), str(file)),
            f"panel:={panel.name}",
            *(f"port:={port}", f"bridge_command:={bridge}", f"bridge_config:={config}"),
        ],
        {
            **workspace.environment(),
            "KIOSK_ZENOH": str(zenoh_file(tmp_path, endpoint)),
            "KIOSK_DATA": str(tmp_path / "data"),
            "ROS_DOMAIN_ID": str(domain + 2),
            "ROS_DISTRO": "jazzy",
            "CYCLONEDDS_URI": CYCLONE_ON_LOOPBACK,
        },
        cwd=tmp_path,
    )
    yield process, f"http://127.0.0.1:{port}"
    process.end(signal.SIGINT)


def test_a_launch_starts_the_server_and_the_bridge(launched: tuple[Process, str]) -> None:
    process, address = launched
    until(lambda: "the panel is at" in process.text, "the server listens", within_s=60)
    with http_client(address) as http:
        until(lambda: http.get("/readyz").status_code == 200, "the bridge is there", within_s=30)
        assert "<title>Main – Robot cell 1</title>" in http.get("/").text
    process.send(signal.SIGINT)
    assert process.wait(30) == 0
    assert process.count("Finished server process") == 1
    assert process.count("launch: interrupted") == 1


def launch(workspace: Workspace, folder: Path, *arguments: str) -> str:
    """What a launch says that ends by itself."""
    (folder / "cell1.toml").write_text(PANEL.replace('"/start"', '"start"'))
    file = workspace.installed / f"share/{PACKAGE}/launch/kiosk.launch.py"
    done = subprocess.run(
        [sys.executable, str(TESTS / "ros_nodes/launch_file.py"), str(file), *arguments],
        cwd=folder,
        env={**workspace.environment(), "KIOSK_DATA": str(folder / "data")},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stderr


def test_a_launch_ends_with_a_panel_that_has_a_fault(workspace: Workspace, tmp_path: Path) -> None:
    said = launch(workspace, tmp_path, "panel:=cell1.toml", f"port:={free_port()}", "bridge:=false")
    assert 'line 11: "start" is not an absolute ROS 2 topic name' in said
    assert "launch: the panel's server has ended" in said


def test_a_launch_names_the_bridge_that_is_not_installed(workspace: Workspace, tmp_path: Path) -> None:
    said = launch(workspace, tmp_path, "panel:=cell1.toml", "bridge_command:=no-such-bridge")
    assert 'the bridge\'s program "no-such-bridge" is not on the PATH: install it' in said
    assert "missing: panel" in launch(workspace, tmp_path)
