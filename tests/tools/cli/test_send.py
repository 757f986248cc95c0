"""`operator-panel send`: the kiosk's check and the difference, then the take."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.parts import ROOT
from tests.support.sent_panels import OTHER, PANEL, Kiosk


@pytest.fixture
def kiosk(tmp_path: Path) -> Iterator[Kiosk]:
    own = Kiosk(tmp_path)
    yield own
    own.close()


def send(panel: Path, kiosk: Kiosk, *options: str, stdin: str = "") -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-m", "app.cli", "send", str(panel), "--to", kiosk.url, *options]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, input=stdin)


def test_panel_is_compared_and_sent(kiosk: Kiosk, tmp_path: Path) -> None:
    panel, token = tmp_path / "cell1.toml", tmp_path / "token"
    token.write_text(kiosk.tokens["engineer"] + "\n")
    panel.write_text("no_key = 1\n" + OTHER)
    faulty = send(panel, kiosk, "--token-file", str(token), "--yes")
    assert faulty.returncode == 1
    assert "no_key, line 1" in faulty.stdout
    panel.write_text(OTHER)
    unasked = send(panel, kiosk, "--token-file", str(token))
    assert (unasked.returncode, kiosk.panel.read_text()) == (1, PANEL)
    assert '-label = "Start"  # the first one\n+label = "Go"' in unasked.stdout
    done = send(panel, kiosk, "--token-file", "-", "--yes", stdin=token.read_text())
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1].startswith("Shown by the kiosk since ")
    assert kiosk.panel.read_text() == OTHER
    again = send(panel, kiosk, "--token-file", str(token))
    assert (again.returncode, again.stdout.splitlines()[-1]) == (0, "The kiosk has this file already.")
    none = send(panel, kiosk)
    assert none.returncode == 1
    assert "OPERATOR_PANEL_TOKEN" in none.stderr
