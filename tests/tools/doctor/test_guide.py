"""The commands that the guides show can be given as they stand there."""

import re
import shlex
import zipfile
from pathlib import Path

import pytest

from app.system.settings import APP
from app.tools.cli.command import main
from tests.support.parts import ROOT
from tests.tools.doctor.setups import panel_of

GUIDES = ("how-to/doctor.md", "how-to/bridge.md", "how-to/rmw-zenoh.md", "troubleshooting.md")
TEXTS = "".join((ROOT / "docs" / name).read_text() for name in GUIDES)
BLOCKS = re.findall(r"^```sh\n(.*?)^```", TEXTS, re.DOTALL | re.MULTILINE)
COMMANDS = [line for block in BLOCKS for line in block.splitlines() if line.startswith(f"{APP} ")]


@pytest.mark.parametrize("line", sorted(set(COMMANDS)))
def test_a_command_of_a_guide(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("KIOSK_DATA", str(tmp_path / "data"))
    (tmp_path / "cell1.toml").write_text(panel_of(more='mode = "demo"\n'))
    if "--tls pki" in line:  # made by the command before it
        assert main(["pki", "new", "pki", "--panel", "cell1.toml"]) == 0
    assert main(shlex.split(line)[1:]) in (0, 1)  # 1: of what is on this machine, as its port 8000
    for name in re.findall(r"-o (\S+)", line):
        assert (tmp_path / name).stat().st_size > 100
    if "support.zip" in line:
        assert zipfile.is_zipfile(tmp_path / "support.zip")


def test_the_guides_show_each_command() -> None:
    shown = {line.split()[1] for line in COMMANDS}
    assert shown == {"doctor", "support", "bridge-config", "pki", "router-config"}
