"""`operator-panel run`: a panel without any variable of the environment; mistakes in a sentence."""

import os
import socket
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import uvicorn

from app.system.settings import PACKAGE
from app.tools.cli import run
from app.tools.cli.arguments import environment
from app.tools.cli.command import main
from app.web.server import OPTIONS
from tests.support.parts import ROOT, Process, free_port, http_client, until
from tests.support.processes import command
from tests.support.processes.command import COMMAND

SHIPPED = PACKAGE / "panel.toml"


def said(*words: str, status: int, env: Mapping[str, str] | None = None) -> str:
    """What a start that fails says."""
    done = command.run(COMMAND, "run", *words, env=env)
    assert (done.returncode, done.stdout) == (status, "")
    assert "Traceback" not in done.stderr
    return done.stderr


def test_a_panel_file_is_all_that_it_needs(tmp_path: Path) -> None:
    panel, port = tmp_path / "cell1.toml", free_port()
    panel.write_text(SHIPPED.read_text().replace('en = "Robot cell 1"', 'en = "My cell"'))
    options = ["--port", str(port), "--data", str(tmp_path / "data"), "--name", "cell1.local"]
    env = {"KIOSK_PANEL": str(SHIPPED)}  # what is said on the command line goes before it
    process = Process([sys.executable, "-m", COMMAND, "run", str(panel), *options], env, cwd=ROOT)
    try:
        until(lambda: f"the panel is at http://127.0.0.1:{port}" in process.text, "it listens", 30)
        with http_client(f"http://127.0.0.1:{port}") as http:
            page = http.get("/", headers={"host": "cell1.local"})
        assert (page.status_code, "My cell" in page.text) == (200, True)
        assert (tmp_path / "data").is_dir()
    finally:
        process.end()


def test_the_server_gets_the_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    passed: dict[str, Any] = {}
    monkeypatch.setattr(uvicorn, "run", lambda app, **options: passed.update(options, app=app))
    monkeypatch.setattr(os, "environ", {})
    port = free_port()
    assert main(["run", "--port", str(port)]) == 0
    assert (passed["app"], passed["host"], passed["port"]) == ("app.main:app", "127.0.0.1", port)
    assert OPTIONS.items() <= passed.items()


def test_an_option_is_a_variable() -> None:
    words = "cell.toml --zenoh z.json5 --mode live --data d --name a --name b --proxy 192.0.2.1"
    parsed = run.make_parser("x").parse_args([*words.split(), "--log-level", "debug"])
    assert environment(parsed) == {
        "KIOSK_PANEL": "cell.toml",
        "KIOSK_ZENOH": "z.json5",
        "KIOSK_MODE": "live",
        "KIOSK_DATA": "d",
        "KIOSK_HOSTS": "a,b",
        "KIOSK_PROXIES": "192.0.2.1",
        "KIOSK_LOG_LEVEL": "debug",
    }
    assert environment(run.make_parser("x").parse_args([])) == {}


def test_a_port_in_use_is_one_sentence() -> None:
    port = free_port()
    with socket.create_server(("127.0.0.1", port)):
        text = said("--port", str(port), status=1)
    assert text.startswith(f"can't listen on 127.0.0.1 port {port}: another program does, perhaps")
    assert text.count("\n") == 1


def test_faults_of_a_panel_file_are_reported_with_their_places(tmp_path: Path) -> None:
    panel = tmp_path / "bad.toml"
    panel.write_text(SHIPPED.read_text().replace('kind = "text"', 'kind = "txt"'))
    line = panel.read_text().splitlines().index('kind = "txt"') + 1
    text = said(str(panel), "--port", str(free_port()), status=1)
    assert text.splitlines()[0] == f"{panel} can't be used:"
    assert f'page[1].group[0].widget[2].kind "message", line {line}: unknown kind "txt"' in text
    missing = said(str(tmp_path / "none.toml"), "--port", str(free_port()), status=1)
    assert missing == f"{tmp_path / 'none.toml'} can't be used:\n  No such file or directory\n"


@pytest.mark.parametrize(
    ("words", "status", "sentence"),
    [
        ("--prot 9000", 2, "--prot is not an option of this command: did you mean --port?"),
        ("--reload", 2, "--reload is not an option of this command"),
        ("--port 99999", 2, 'argument --port: "99999" is not a port: 1 to 65535, or 0'),
        ("--port", 2, "argument --port: expected one argument"),
        ("one.toml two.toml", 2, '"two.toml" is one argument too many'),
        ("--mode simulated", 2, "argument --mode: invalid choice: 'simulated'"),
        ("--ssl-certfile a.pem", 2, "--ssl-certfile and --ssl-keyfile are given together"),
        ("--ssl-certfile /none --ssl-keyfile /none", 1, "/none: no such file or directory"),
        ("--name http://cell1", 1, 'KIOSK_HOSTS has "http://cell1": names or addresses'),
        ("--without cookies", 2, "argument --without: invalid choice: 'cookies'"),
        ("--host 192.0.2.1", 1, "can't listen on 192.0.2.1 port 8000: cannot assign"),
    ],
)
def test_a_mistake_is_one_sentence(words: str, status: int, sentence: str) -> None:
    text = said(*words.split(), status=status)
    assert sentence in text
    assert text.count("\n") == 1


def test_a_wrong_variable_is_one_sentence() -> None:
    text = said(status=1, env={"KIOSK_MODE": "simulated", "PATH": "/usr/bin:/bin"})
    assert text == 'KIOSK_MODE is "simulated": it must be "demo" or "live"\n'
