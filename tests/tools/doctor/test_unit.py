"""The bridge's unit, and what the documentation of it says."""

import subprocess
from pathlib import Path

import pytest

from tests.support.parts import ROOT

UNIT = ROOT / "deploy/zenoh-bridge-ros2dds.service"


@pytest.mark.usefixtures("systemd")
def test_systemd_accepts_the_bridges_unit(tmp_path: Path) -> None:
    text = UNIT.read_text()
    assert text.count("ExecStart=zenoh-bridge-ros2dds ") == 1
    copy = tmp_path / UNIT.name  # with a program that is there
    copy.write_text(text.replace("ExecStart=zenoh-bridge-ros2dds ", "ExecStart=/bin/true "))
    done = subprocess.run(["systemd-analyze", "verify", copy], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_bridge_units_configuration_is_where_the_guide_puts_it() -> None:
    guide = (ROOT / "docs/how-to/bridge.md").read_text()
    place = UNIT.read_text().partition(" -c ")[2].split()[0]
    assert f"cp bridge.json5 {place}" in guide
    assert f"cp {UNIT.name} /etc/systemd/system/" in guide
