"""A panel whose robot is on rmw_zenoh gets a Zenoh router's unit and configuration beside it."""

import os
from contextlib import closing, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import pytest
import zenoh

from app.tools.cell_config.rmw_zenoh_router import FOR_NODES
from app.tools.cli.command import main
from app.tools.install.host import Host
from app.tools.install.plan import (
    CONFIG,
    PANEL,
    PROGRAMS,
    ROUTER,
    Options,
    RouterConfig,
    needs_router,
    steps,
    uninstall_steps,
)
from app.tools.install.release import RELEASES
from app.tools.install.steps import apply, describe, revert
from tests.support.cells import client_of
from tests.support.parts import Process, free_port, until
from tests.support.places import ZENOHD
from tests.tools.install.test_plan import make_wheel, of_files, path_on
from tests.tools.install.test_units import setting

UNIT: Final = f"/etc/systemd/system/{ROUTER}"
RMW: Final = 'dialect = "rmw_zenoh"\n'
CELL: Final = f'title = "Cell"\n{RMW}[[page]]\nid = "main"\ntitle = "Main"\n'


def panel_in(folder: Path, text: str) -> Path:
    path = folder / "cell1.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "needed"),
    [
        (RMW, True),
        (f'[[robot]]\nid = "a"\n{RMW}', True),
        ("", False),
        ('dialect = "bridge"\n', False),
        (f'[[robot]]\nid = "a"\n{RMW}[[robot]]\nid = "b"\n{RMW}', False),
        ("no TOML", False),
    ],
)
def test_a_panel_says_whether_its_robot_needs_a_router(text: str, needed: bool, tmp_path: Path) -> None:
    assert needs_router(panel_in(tmp_path, text)) is needed


def test_the_routers_unit_is_written_and_taken_back(host: Host, tmp_path: Path) -> None:
    plan = steps(Options(wheel=make_wheel(tmp_path), panel=panel_in(tmp_path, RMW)), host)
    said = list(describe(plan, host))
    assert any(CONFIG in line for line in said)
    assert not any(f"enable {ROUTER}" in line for line in said)  # no zenohd is there
    apply(of_files(plan), host, str)
    assert f"zenohd --config {CONFIG}" in path_on(host, UNIT).read_text()
    revert(
        [step for step in of_files(uninstall_steps(host)) if ROUTER in step.describe(host)], host, str
    )
    assert not path_on(host, UNIT).exists()


def test_the_units_command_serves_nodes_and_the_panel_of_another_user(
    zenohd: None, tmp_path: Path
) -> None:
    """As the unit starts it, with the configuration that is written beside it; and again after it was
    killed, which leaves its socket. It warns of nothing."""
    (command,), (mask,), (folder,), (variables,) = (
        setting(ROUTER, name) for name in ("ExecStart", "UMask", "RuntimeDirectory", "Environment")
    )
    with TemporaryDirectory(dir="/tmp", prefix="panel-") as run:  # a socket's path must be short
        door, file, nodes = Path(run) / "panel.sock", tmp_path / "router.json5", free_endpoint()
        assert main(["router-config", str(panel_in(tmp_path, CELL)), "-o", str(file)]) == 0
        text = file.read_text().replace(FOR_NODES, nodes)
        assert f"/run/{folder}/panel.sock" in text
        file.write_text(text.replace(f"/run/{folder}", run))
        started = f"umask {mask}; exec {command.replace(CONFIG, str(file))} >&2"
        path = f"PATH={ZENOHD.parent}:{os.environ['PATH']}"
        environment = ["env", "-u", "ZENOH_RUNTIME", path, *variables.split()]
        for written in ([], ["RUST_LOG=info"]):
            process = Process([*environment, *written, "sh", "-c", started], {})
            try:
                until(lambda: opens(nodes) and opens(f"unixsock-stream/{door}"), "both connect")
                assert door.stat().st_mode & 0o666 == 0o666
                assert process.running
            finally:
                process.kill()
            assert bool(process.text) == bool(written)
            assert "\x1b" not in process.text, "the journal has no colours"


def free_endpoint() -> str:
    return f"tcp/127.0.0.1:{free_port()}"


def opens(endpoint: str) -> bool:
    with suppress(zenoh.ZError), closing(client_of(endpoint)) as session:
        return list(session.info.routers_zid()) != []
    return False


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_unit_is_started_where_the_router_is_installed(
    program: str, host: Host, tmp_path: Path
) -> None:
    host.files.write(program, b"")
    plan = steps(Options(wheel=make_wheel(tmp_path), panel=panel_in(tmp_path, RMW)), host)
    assert any(f"enable {ROUTER}" in line for line in describe(plan, host))


def test_a_panel_behind_a_bridge_gets_no_router(host: Host, tmp_path: Path) -> None:
    plan = steps(Options(wheel=make_wheel(tmp_path), panel=panel_in(tmp_path, "")), host)
    assert not any("router" in line for line in describe(plan, host))


def test_the_configuration_is_that_of_the_releases_own_command(
    host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = ["// one\n"]
    asked: list[list[str]] = []

    def run(_: Host, command: list[str], env: object = None) -> str:
        asked.append(command)
        return written[-1]

    monkeypatch.setattr(Host, "run", run)
    step = RouterConfig("0.1.0-abc", PANEL)
    assert not step.is_done(host)
    host.files.write(f"{RELEASES}/0.1.0-abc/bin/operator-panel", b"")
    step.do(host)
    assert path_on(host, CONFIG).read_text() == "// one\n"
    assert step.is_done(host)
    written.append("// another panel\n")
    assert not step.is_done(host)
    assert asked[-1][1:] == ["router-config", PANEL]
    assert step.undo(host) == f"removed {CONFIG}"
