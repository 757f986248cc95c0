"""The support bundle: what it holds, what it does not, and that it asks."""

import io
import json
import os
import sys
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.cli.command import main
from app.diagnose.bundle import CUT, MOST_BYTES, Part, journal, text_part, write
from app.diagnose.redaction import REMOVED, is_secret, plain_without_secrets, without_secrets
from tests.diagnose.setups import Setup, button, call, panel_of
from tests.support.parts import ROOT, Bridge, Server, until, zenoh_file

SECRET = "swordfish"
INPUT = '[[page.widget]]\nid = "words"\nkind = "text"\nlabel = "Words"\n'


@pytest.fixture
def setup(tmp_path: Path) -> Setup:
    return Setup(tmp_path)


@pytest.fixture
def demo(setup: Setup) -> Iterator[Server]:
    """A running server, whose operator typed something in."""
    say = button("/say").replace("message = {}", 'message = { data = "{words}" }')
    setup.panel.write_text(panel_of(INPUT, say, more='mode = "demo"\n') + f'# password = "{SECRET}"\n')
    mine = Server(ROOT, KIOSK_PANEL=str(setup.panel))
    until(lambda: mine.widget("say")["enabled"], "open")
    assert mine.press("say", inputs={"words": SECRET}).status_code == 200
    yield mine
    mine.end()


def files_of(path: Path) -> dict[str, str]:
    with zipfile.ZipFile(path) as packed:
        assert packed.testzip() is None
        return {name: packed.read(name).decode() for name in packed.namelist()}


def command(setup: Setup, server: Server | None, *more: str) -> list[str]:
    port, data = (server.port, server.data) if server else (setup.port, setup.data)
    return ["support", str(setup.panel), "--port", str(port), "--data", str(data), *more]


def test_what_is_listed_is_what_it_holds_without_secrets(
    setup: Setup,
    demo: Server,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("KIOSK_HOSTS", "panel1.local")
    monkeypatch.setenv("DATABASE_PASSWORD", SECRET)
    zenoh = setup.folder / "zenoh.json5"
    said = (ROOT / "zenoh.json5").read_text()
    login = f'auth: {{ usrpwd: {{ user: "u", password: "{SECRET}" }} }},'
    zenoh.write_text(said.replace("transport: {", "transport: {\n" + login, 1))
    path = setup.folder / "bundle.zip"
    options = ["--zenoh", str(zenoh), "-o", str(path), "--yes"]
    assert main(command(setup, demo, *options)) == 0
    output = capsys.readouterr().out
    found = files_of(path)
    assert {line.split()[0] for line in output.splitlines() if line.startswith("  ")} == set(found)
    assert set(found) - {"logs/journal.txt"} == {
        "doctor.json",
        "versions.json",
        "settings.json",
        "machine.json",
        "panel/cell1.toml",
        "zenoh/zenoh.json5",
        "logs/operators-log.csv",
        "state/readyz.json",
        "state/snapshot.txt",
        "state/metrics.txt",
    }
    assert [name for name, text in found.items() if SECRET in text] == []
    assert REMOVED in found["panel/cell1.toml"]
    assert json.loads(found["settings.json"])["environment"]["KIOSK_HOSTS"] == "panel1.local"
    assert json.loads(found["versions.json"])["eclipse-zenoh"].startswith("1.")
    assert json.loads(found["doctor.json"])["findings"][0]["code"] == "server_running"
    assert ",say," in found["logs/operators-log.csv"]
    assert "event: snapshot" in found["state/snapshot.txt"]
    assert "# HELP" in found["state/metrics.txt"]
    assert path.stat().st_mode & 0o777 == 0o600


def test_the_graph_is_in_it(setup: Setup, domain: int, capsys: pytest.CaptureFixture[str]) -> None:
    setup.panel.write_text(panel_of(call("/reset", "std_srvs/srv/Trigger")))
    bridge, path = Bridge(domain + 5), setup.folder / "bundle.zip"
    bridge.start()
    try:
        zenoh = zenoh_file(setup.folder, bridge.endpoint)
        options = ["--zenoh", str(zenoh), "--listen", "0.1", "-o", str(path), "--yes"]
        assert main(command(setup, None, *options)) == 0
    finally:
        bridge.end()
    graph = json.loads(files_of(path)["graph.json"])
    assert graph["robots"][0]["bridges"][0]["version"] == "v1.10.2"
    assert "graph.json" in capsys.readouterr().out


@pytest.fixture
def quick(setup: Setup) -> Setup:
    """Nothing that has to be waited for."""
    setup.panel.write_text(panel_of(more='mode = "demo"\n'))
    return setup


def test_a_list_writes_nothing(
    quick: Setup, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(quick.folder)
    assert main(command(quick, None, "--list")) == 0
    assert "doctor.json" in capsys.readouterr().out
    assert list(quick.folder.glob("*.zip")) == []


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("answer", "status"), [("y\n", 0), ("\n", 2), ("no\n", 2)])
def test_it_asks_before_it_writes(
    quick: Setup, answer: str, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(quick.folder)
    monkeypatch.setattr(sys, "stdin", Terminal(answer))
    assert main(command(quick, None)) == status
    assert len(list(quick.folder.glob("operator-panel-support-*.zip"))) == (status == 0)


def test_without_a_terminal_it_says_so(
    quick: Setup, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("y\n"))
    assert main(command(quick, None)) == 2
    assert "--yes" in capsys.readouterr().err


def test_a_file_that_is_there_is_kept(quick: Setup, capsys: pytest.CaptureFixture[str]) -> None:
    path = quick.folder / "bundle.zip"
    path.write_text("mine")
    assert main(command(quick, None, "--yes", "-o", str(path))) == 1
    assert "exists: give another name with -o" in capsys.readouterr().err
    assert path.read_text() == "mine"
    assert main(command(quick, None, "--yes", "-o", str(quick.folder / "no/bundle.zip"))) == 1


def test_the_journal_is_asked_for_the_last_hour_of_our_units(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "journalctl"
    program.write_text('#!/bin/sh\necho "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    command = journal().split()
    assert {"--unit=operator-panel*", "--unit=zenoh-bridge*", "--since=-3600s"} <= set(command)


@pytest.mark.parametrize("line", ["x" * 99 + "\n", "a=b " * 24 + "\n", "key\n", '"' * 99 + "\n"])
def test_of_a_long_log_the_end_is_kept(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    most = 400_000
    monkeypatch.setattr("app.diagnose.bundle.MOST_BYTES", most)
    part = text_part("logs/journal.txt", "", line * (2 * most // len(line)))
    assert part.text.startswith(CUT + line)
    assert part.text.endswith(line)
    assert most - len(line) <= part.size - len(CUT) <= most


def test_a_line_without_end_is_left_out() -> None:
    assert text_part("logs/journal.txt", "", "x" * (2 * MOST_BYTES)).text == CUT


def test_without_a_journal_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert journal() == ""


def test_a_bundle_is_a_zip(tmp_path: Path) -> None:
    path = tmp_path / "bundle.zip"
    began = time.time()
    assert write(path, [Part("a/b.txt", "", "äöü")]) == path.stat().st_size
    assert files_of(path) == {"a/b.txt": "äöü"}
    assert path.stat().st_mtime >= began - 1


SECRETS = "password pin user_pin tls_private_key apiToken Set-Cookie KIOSK_PIN_1 usrpwd"


@pytest.mark.parametrize("key", SECRETS.split())
def test_keys_of_secrets(key: str) -> None:
    assert is_secret(key)


@pytest.mark.parametrize("key", ["pinch", "spin", "tokenizer", "topic", "interlock", "author"])
def test_keys_of_no_secrets(key: str) -> None:
    assert not is_secret(key)


@pytest.mark.parametrize(
    "text",
    [
        f'password = "{SECRET}"',
        f"password: '{SECRET}'",
        f'{{"token":"{SECRET}", "x": 1}}',
        f"KIOSK_PIN={SECRET} other",
        f'pins = ["1234", "{SECRET}"]',
        f"Authorization: Bearer {SECRET}",
        f"http://user:{SECRET}@robot/",
        f"-----BEGIN PRIVATE KEY-----\n{SECRET}\n-----END PRIVATE KEY-----",
        f'listen_private_key_base64: "{SECRET}",',
    ],
)
def test_secrets_are_taken_out_of_texts(text: str) -> None:
    assert SECRET not in without_secrets(text)
    assert REMOVED in without_secrets(text)


def test_what_is_no_secret_stays() -> None:
    text = 'topic = "/pin_state"\nspeed = 3\n# see http://robot/x\n[tls]\nlease: 2000,\n'
    assert without_secrets(text) == text
    assert plain_without_secrets({"a": [1, {"pin": 1}]}) == {"a": [1, {"pin": REMOVED}]}
