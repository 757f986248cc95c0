"""A live panel that other machines can reach has TLS and users, or says that it goes without."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from uvicorn import Config

from app.system.errors import SettingsError
from app.system.settings import Settings
from app.tools.cli.command import main
from app.web.server import check_protected
from tests.support.panel_text import CELL
from tests.support.parts import ROOT, Process, free_port, until
from tests.support.users import add_user


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    path = tmp_path / "cell1.toml"
    path.write_text(f'mode = "live"\n{CELL}')
    return path


def command(panel: Path, *options: str) -> list[str]:
    run = [sys.executable, "-m", "app.cli", "run", str(panel), "--host", "0.0.0.0"]
    return [*run, "--port", str(free_port()), "--data", str(panel.parent / "data"), *options]


def with_certificate(panel: Path) -> tuple[str, ...]:
    folder = panel.parent / "pki"
    assert main(["pki", "new", str(folder), "--panel", str(panel)]) == 0
    assert main(["pki", "add", str(folder), "web", "--host", "panel1.local"]) == 0
    return "--ssl-certfile", str(folder / "web.pem"), "--ssl-keyfile", str(folder / "web.key")


@pytest.mark.parametrize("tls", [False, pytest.param(True, marks=pytest.mark.long("detail"))])
def test_a_live_panel_without_protection_does_not_start(panel: Path, tls: bool) -> None:
    options = with_certificate(panel) if tls else ()
    done = subprocess.run(
        command(panel, *options), cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode != 0
    assert "to listen on 0.0.0.0, beyond this machine, the panel needs" in done.stderr
    assert ("TLS (--ssl-certfile and --ssl-keyfile)" in done.stderr) is not tls
    assert "users (`operator-panel users`)" in done.stderr
    assert f"KIOSK_WITHOUT={'users' if tls else 'tls,users'} if" in done.stderr
    assert "Traceback" not in done.stderr
    assert "Uvicorn running" not in done.stderr


def test_a_live_panel_with_tls_and_users_is_open(panel: Path) -> None:
    add_user(panel.parent / "data", "anna", "operator", pin="4711")
    opens(command(panel, *with_certificate(panel)), "the panel is at https://")


@pytest.mark.parametrize(
    "options",
    [
        ("--without", "tls", "--without", "users"),
        pytest.param(("--mode", "demo"), marks=pytest.mark.long("detail")),
    ],
)
def test_a_panel_that_goes_without_is_open(panel: Path, options: tuple[str, ...]) -> None:
    opens(command(panel, *options), "the panel is at http://")


def opens(words: list[str], said: str) -> None:
    process = Process(words, {}, cwd=str(ROOT))
    try:
        until(lambda: said in process.text or not process.running, "it listens")
        assert process.running, process.text
    finally:
        process.end()


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.7", "::1", "localhost"])
def test_a_panel_of_this_machine_needs_nothing(host: str) -> None:
    check_protected(Config("app", host=host), False, ())
    check_protected(Config("app", uds="/run/panel.sock"), False, ())
    check_protected(None, False, ())


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "", "192.0.2.1"])
@pytest.mark.parametrize("without", [(), ("tls",), ("users",)])
def test_any_other_address_needs_both(host: str, without: tuple[str, ...]) -> None:
    with pytest.raises(SettingsError, match=r"KIOSK_WITHOUT=.*(tls|users)"):
        check_protected(Config("app", host=host), False, without)
    check_protected(Config("app", host=host), True, ("tls", *without))


def test_a_socket_that_it_was_given_is_asked() -> None:
    for host, is_open in (("127.0.0.1", False), ("0.0.0.0", True)):
        with socket.create_server((host, 0)) as accepted:
            config = Config("app", fd=os.dup(accepted.fileno()))
            if is_open:
                with pytest.raises(SettingsError):
                    check_protected(config, False, ())
            else:
                check_protected(config, False, ())
            assert config.fd is not None
            os.close(config.fd)


def test_a_wrong_setting_is_one_sentence() -> None:
    with pytest.raises(SettingsError, match='KIOSK_WITHOUT has "https": tls or users, or both'):
        Settings.from_environment({"KIOSK_WITHOUT": "https"})
    assert Settings.from_environment({"KIOSK_WITHOUT": "tls, users"}).without == ("tls", "users")
