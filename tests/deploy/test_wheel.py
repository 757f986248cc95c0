"""The built wheel, installed where nothing of the checkout is, as the service page says; and the
container that is made of it."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from zipfile import ZipFile

import pytest
from ruamel.yaml import YAML

from app.system.settings import PACKAGE
from tests.support import locked
from tests.support.parts import ROOT, Process, Server, free_port, http_client, sends, until
from tests.support.shown_commands import commands_for

pytestmark = [pytest.mark.long("packaging"), pytest.mark.promise("kiosk")]

SHIPPED: Final = PACKAGE / "panel.toml"
# What the pages' commands read and write of the machine is in a folder instead.
PLACES: Final = ("opt", "etc/operator-panel", "var/lib/operator-panel", "backup/panel")
# Two commands of the service page are done in another way, see `locked`; `make release` runs them.
VENV: Final = "python3 -m venv /opt/operator-panel/current"
DEPENDENCIES: Final = (
    "/opt/operator-panel/current/bin/pip install --require-hashes -r requirements.lock"
)
ABSOLUTE: Final = re.compile(rf"(?<![\w.])/(?={'|'.join(PLACES)}\b)")
RELEASE: Final = "/opt/operator-panel/current"  # where the service page installs it
SERVICE: Final = "test_a_wheel_is_installed_as_the_service_page_says"
SERVED: Final = "test_a_panel_is_served_by_its_command_and_its_data_is_backed_up"
CONTAINERFILE: Final = (ROOT / "deploy/Containerfile").read_text().replace("\\\n", "")
COMPOSE: Final = YAML(typ="safe").load(ROOT / "deploy/compose.yaml")
# As a container is: a root that can't be written to, a volume for the data, no capability, and a
# network of its own. $1 is the environment, $2 what runs.
CONTAINED: Final = """
mount --make-rprivate /
mount -t tmpfs panel /opt && mkdir -p /opt/operator-panel/current
mount --bind "$1" /opt/operator-panel/current
mount -t tmpfs data /var/lib && mkdir /var/lib/operator-panel
mount -o remount,bind,ro / && mount -o remount,ro /opt
mount -o remount,bind,ro /opt/operator-panel/current
ip link set lo up
exec setpriv --bounding-set=-all --inh-caps=-all --no-new-privs sh -c "$2"
"""


@dataclass(frozen=True)
class Machine:
    """A folder that is the machine's root, and one with what was copied to it."""

    root: Path
    copied: Path

    @property
    def python(self) -> str:
        return str(self.root / RELEASE[1:] / "bin/python")

    def here(self, command: str) -> str:
        """A page's command, with this folder's paths."""
        return ABSOLUTE.sub(f"{self.root}/", command)

    def install(self, command: str) -> None:
        """A command of the service page."""
        environment = Path(self.here(RELEASE))
        if command == DEPENDENCIES:
            locked.add_dependencies(environment)
            return
        done = self.run(command.replace(VENV, f"{VENV} --without-pip"))
        assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
        if command == VENV:
            locked.add_pip(environment)

    def run(self, command: str) -> subprocess.CompletedProcess[str]:
        path = f"{Path(sys.executable).parent}:/usr/local/bin:/usr/bin:/bin"
        return subprocess.run(
            ["sh", "-c", self.here(command)],
            cwd=self.copied,
            # To compile would take as long as the rest, and is not needed here.
            env={**os.environ, "PATH": path, "PIP_NO_COMPILE": "1", "PYTHONPATH": ""},
            capture_output=True,
            text=True,
            check=False,
        )


def of_pages(test: str) -> list[str]:
    return commands_for(f"tests/deploy/test_wheel.py::{test}")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True, timeout=120)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def machine(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Machine:
    """After the commands of the service page; the old version is the new one's."""
    mine = Machine(tmp_path_factory.mktemp("machine"), tmp_path_factory.mktemp("copied"))
    for path in (ROOT / "deploy/requirements.lock", ROOT / "zenoh.json5", wheel):
        shutil.copy(path, mine.copied)
    shutil.copy(SHIPPED, mine.copied / "cell1.toml")
    for place in PLACES:
        (mine.root / place).mkdir(parents=True)
    (mine.root / "opt/operator-panel").mkdir()
    (mine.root / "opt/operator-panel/0.2").symlink_to("current")
    for command in of_pages(SERVICE):
        mine.install(command)
    return mine


def test_a_wheel_is_installed_as_the_service_page_says(machine: Machine, wheel: Path) -> None:
    commands = of_pages(SERVICE)
    assert commands[:2] == [VENV, DEPENDENCIES]
    assert [command for command in commands if "pip install" in command][1:] == [commands[2]]
    requirements = machine.run(f"{RELEASE}/bin/pip check")
    assert requirements.returncode == 0, requirements.stdout
    version = machine.run(f"{RELEASE}/bin/operator-panel --version")
    assert version.stdout.split() == ["operator-panel", wheel.name.split("-")[1]]
    check = machine.run(f"{RELEASE}/bin/operator-panel check /etc/operator-panel/panel.toml")
    assert check.returncode == 0, check.stderr
    # Installed, it needs no file of the checkout: these are its own.
    shipped = machine.run(f"{RELEASE}/bin/python -m app.check")
    assert shipped.returncode == 0, shipped.stderr
    assert str(ROOT) not in shipped.stdout
    by_name = machine.run(f"{RELEASE}/bin/operator-panel check mobile-robot")
    assert (by_name.returncode, str(ROOT) in by_name.stdout) == (0, False), by_name.stderr
    services = (
        "from app.ros.messages import load_interfaces as of; "
        "of('jazzy').service_types('std_srvs/srv/SetBool')"
    )
    assert machine.run(f"{RELEASE}/bin/python -c {shlex.quote(services)}").returncode == 0


def test_each_template_of_the_wheel_is_compiled(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        names = archive.namelist()
    templates = [name for name in names if re.fullmatch(r"app/templates/.*\.html", name)]
    compiled = [name for name in names if name.startswith("app/compiled_templates/tmpl_")]
    assert len(compiled) == len(templates) > 0


def test_the_dependencies_of_the_tests_are_those_that_are_locked_for_the_panel() -> None:
    of_tests = locked.entries(ROOT / "tests/requirements.lock")
    assert len(locked.entries(locked.LOCK)) > 20
    assert locked.entries(locked.LOCK).items() <= of_tests.items()


def test_a_replay_names_the_extra_that_it_needs(machine: Machine) -> None:
    replay = machine.run(f"{RELEASE}/bin/operator-panel simulate tcp/127.0.0.1:0 --bag cell.mcap")
    assert replay.returncode == 2
    assert "replaying needs rosbags: " in replay.stderr
    (command,) = re.findall(r'`(pip install "[^`]+)`', replay.stderr)
    # Without an index, pip finds the installed panel, and not what its extra adds.
    extra = machine.run(f"{RELEASE}/bin/{command} --no-index")
    assert "No matching distribution found for rosbags" in extra.stderr


def test_an_installed_wheel_serves_from_any_folder(machine: Machine, tmp_path: Path) -> None:
    mine = Server(tmp_path, python=machine.python)
    try:
        until(mine.ready, "ready")
        html = mine.http.get("/pages/operation").text
        assert "Publish1" in html
        files = [part for part in html.split('"') if re.match("/static/.", part)]
        assert len(files) >= 4
        assert {mine.http.get(file).status_code for file in files} == {200}
        until(lambda: sends(mine, "from a wheel"), "a press is sent")
    finally:
        mine.end()
    live = Server(tmp_path, python=machine.python, KIOSK_MODE="live")
    try:  # by the zenoh.json5 that is in it
        until(
            lambda: "No connection to the robot" in live.widget("operation")["reason"],
            "the start is over, and the lock says what is missing",
        )
    finally:
        live.end()


def test_a_wheel_has_no_gallery_and_says_so_in_development(
    wheel: Path, machine: Machine, tmp_path: Path
) -> None:
    names = ZipFile(wheel).namelist()
    assert [name for name in names if "gallery" in name] == []
    assert {"app/templates/log.html", "app/static/css/log.css", "app/web/routes/widget_data.py"} <= {
        *names
    }
    mine = Server(tmp_path, python=machine.python, KIOSK_MODE="demo", KIOSK_DEV="1")
    try:
        assert mine.http.get("/").status_code == 200
        assert mine.http.get("/gallery").status_code == 404
        assert "/gallery is not in the installed package" in mine.process.text
    finally:
        mine.end()


def test_a_panel_is_served_by_its_command_and_its_data_is_backed_up(machine: Machine) -> None:
    run, *backups = sorted(of_pages(SERVED), key=lambda command: " run " not in command)
    assert len(backups) >= 3
    panel, port = machine.copied / "cell1.toml", free_port()
    panel.write_text(SHIPPED.read_text().replace("Publish1", "Pick up"))
    served = Process(
        [*shlex.split(machine.here(run)), f"--port={port}"],
        {"PYTHONPATH": "", "KIOSK_DATA": str(machine.root / "var/lib/operator-panel")},
        cwd=machine.copied,
    )
    try:
        until(lambda: "the panel is at" in served.text, "it listens", within_s=30)
        with http_client(f"http://127.0.0.1:{port}") as http:
            assert "Pick up" in http.get("/pages/operation").text
        for command in backups:
            done = machine.run(command)
            assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    finally:
        served.end()
    backup = machine.root / "backup/panel"
    for name in ("cell1.zip", "data.zip"):
        with zipfile.ZipFile(backup / name) as packed:
            assert "data/operators-log.sqlite3" in packed.namelist()
    assert (backup / "panel.toml").read_text() == SHIPPED.read_text()


def instructions(name: str) -> list[str]:
    """What follows an instruction in the last stage of the Containerfile."""
    last = re.split(r"^FROM .*$", CONTAINERFILE, flags=re.MULTILINE)[-1]
    return re.findall(rf"^{name} +(.*)$", last, re.MULTILINE)


def test_image_installs_as_the_service_page_does(wheel: Path) -> None:
    installs = [
        command for command in of_pages(SERVICE) if "pip install" in command or " -m venv " in command
    ]
    made = re.sub(r" --no-cache-dir|/build/", "", CONTAINERFILE)
    assert [command for command in installs if command not in made] == []
    (copied,) = re.findall(r"^COPY (deploy/.*) /build/$", CONTAINERFILE, re.MULTILINE)
    lock, built = copied.split()
    assert (ROOT / lock).is_file()
    assert Path(built).match(f"dist/{built.split('/')[1]}")
    assert wheel.match(built.split("/")[1])
    ignored = (ROOT / ".dockerignore").read_text().splitlines()
    assert [pattern for pattern in ignored if pattern[:1] != "#"] == ["*", f"!{lock}", f"!{built}"]


def test_image_names_no_host_and_runs_as_its_own_user() -> None:
    images = re.findall(r"^FROM (\S+)", CONTAINERFILE, re.MULTILINE)
    images += [service["image"] for service in COMPOSE["services"].values()]
    assert [image for image in images if "." in image.split("/")[0] and "/" in image] == []
    assert instructions("USER") == ["10001"]
    assert "useradd --system --uid 10001" in CONTAINERFILE


def shell(words: str) -> str:
    """An instruction's JSON list, as a command of a shell with the image's variables."""
    setting = "".join(f"export {line}; " for line in instructions("ENV"))
    return f"{setting}exec {shlex.join(json.loads(words))}"


@pytest.fixture
def container(namespaces: None, machine: Machine) -> Iterator[Process]:
    """What the image starts; its environment is that of the service page, with the same content."""
    (entry,), (command,) = instructions("ENTRYPOINT"), instructions("CMD")
    start = shell(json.dumps([*json.loads(entry), *json.loads(command)]))
    mine = Process(
        [
            *("unshare", "--mount", "--net", "sh", "-ec", CONTAINED),
            *("sh", str(machine.root / RELEASE[1:]), start),
        ],
        {"PYTHONPATH": "", "HOME": "/nonexistent"},
        cwd="/",
    )
    yield mine
    mine.end()


def test_image_starts_read_only_and_its_health_check_passes(container: Process) -> None:
    (health,) = instructions("HEALTHCHECK")

    def inside(command: str) -> int:
        enter = ["nsenter", f"--target={container.pid}", "--mount", "--net", "sh", "-c", command]
        return subprocess.run(enter, capture_output=True, cwd="/", check=False).returncode

    until(lambda: "the panel is at" in container.text, "it serves", within_s=60)
    check = shell(health.split(" CMD ", 1)[1])
    assert inside(check) == 0
    assert inside("touch /opt/operator-panel/current/x || touch /x || touch /etc/x") != 0
    assert inside(check.replace(":8000/", ":8001/")) != 0  # where nothing serves


def test_composition_gives_each_service_minimal_access() -> None:
    services = COMPOSE["services"]
    assert set(services) == {"panel", "bridge"}
    for service in services.values():
        assert (service["read_only"], service["cap_drop"], service["network_mode"]) == (
            True,
            ["ALL"],
            "host",
        )
        assert service["security_opt"] == ["no-new-privileges:true"]
        assert "ports" not in service  # the host's network has none to publish
        assert service["restart"] == "unless-stopped"
    panel, bridge = services["panel"], services["bridge"]
    folder = ROOT / "deploy" / panel["build"]["context"]
    assert (folder / panel["build"]["dockerfile"]).resolve() == ROOT / "deploy/Containerfile"
    mounted = {volume["target"]: volume for volume in panel["volumes"] if isinstance(volume, dict)}
    assert panel["command"] == ["run", "/etc/operator-panel/panel.toml"]
    assert mounted["/etc/operator-panel"]["read_only"]
    (data,) = (volume for volume in panel["volumes"] if isinstance(volume, str))
    assert data == f"{next(iter(COMPOSE['volumes']))}:{instructions('VOLUME')[0]}"
    (config,) = bridge["volumes"]
    assert (ROOT / "deploy" / config["source"]).resolve() == ROOT / "deploy/bridge.json5"
    assert bridge["command"] == ["-c", config["target"]]
    cargo = (ROOT / "tests/bridge_crate/Cargo.toml").read_text()
    (version,) = re.findall(r'zenoh-plugin-ros2dds = \{ version = "=([\d.]+)"', cargo)
    assert bridge["image"].endswith(f":{version}")
