"""The units and files of a kiosk PC, as the machine's own programs judge them."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.parts import ROOT

pytestmark = pytest.mark.promise("kiosk")

DEPLOY = ROOT / "deploy"
SERVER, SCREEN = "operator-panel.service", "operator-panel-kiosk.service"
ROUTER = "operator-panel-router.service"


def setting(unit: str, name: str) -> list[str]:
    return re.findall(rf"^{name}=(.*)$", (DEPLOY / unit).read_text(), re.MULTILINE)


@pytest.fixture
def units(tmp_path: Path) -> Path:
    """The units, with a program that is there and units that they wait for."""
    for name in (SERVER, SCREEN, ROUTER):
        text = (
            (DEPLOY / name)
            .read_text()
            .replace("/opt/operator-panel/current/bin/operator-panel", "/bin/true")
            .replace("ExecStart=zenohd", "ExecStart=/bin/true")
        )
        (tmp_path / name).write_text(text)
    for name in ("seatd.service", "plymouth-quit-wait.service", "getty@tty1.service"):
        (tmp_path / name).write_text("[Service]\nExecStart=/bin/true\n")
    return tmp_path


@pytest.mark.usefixtures("systemd")
def test_systemd_understands_the_units(units: Path) -> None:
    verify = ["systemd-analyze", "verify", "--man=no", "--recursive-errors=one"]
    done = subprocess.run(
        [*verify, *(str(units / name) for name in (SERVER, SCREEN, ROUTER))],
        capture_output=True,
        text=True,
        check=False,
        env={"SYSTEMD_UNIT_PATH": f"{units}:", "PATH": "/usr/bin:/bin"},
    )
    ours = [line for line in done.stderr.splitlines() if "operator-panel" in line]
    assert (done.returncode, ours) == (0, []), done.stderr


@pytest.mark.usefixtures("systemd")
@pytest.mark.parametrize(("name", "most"), [(SERVER, 15), (SCREEN, 45), (ROUTER, 20)])
def test_the_units_stay_hardened(name: str, most: int) -> None:
    """`most` is in tenths of systemd's exposure level: 100 is not hardened at all."""
    rate = ["systemd-analyze", "security", "--offline=true", f"--threshold={most}", "--no-pager"]
    done = subprocess.run([*rate, str(DEPLOY / name)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-500:]


def test_the_server_gets_the_processor_before_the_browser() -> None:
    nice, weight = (
        {unit: int(setting(unit, name)[0]) for unit in (SERVER, SCREEN)}
        for name in ("Nice", "CPUWeight")
    )
    assert nice[SCREEN] - nice[SERVER] >= 10
    assert weight[SERVER] >= 10 * weight[SCREEN]


def test_the_browser_reaches_this_machine_only() -> None:
    assert setting(SCREEN, "IPAddressDeny") == ["any"]
    assert setting(SCREEN, "IPAddressAllow") == ["localhost"]
    policies = json.loads((DEPLOY / "kiosk-policies.json").read_text())
    assert "*" in policies["URLBlocklist"]
    assert "file:///run/operator-panel-kiosk/waiting.html" in policies["URLAllowlist"]


@pytest.mark.usefixtures("systemd")
def test_sysusers_accepts_the_users_file(tmp_path: Path) -> None:
    (tmp_path / "etc/sysusers.d").mkdir(parents=True)
    shutil.copy(DEPLOY / "sysusers.conf", tmp_path / "etc/sysusers.d/operator-panel.conf")
    subprocess.run(["systemd-sysusers", f"--root={tmp_path}"], check=True, capture_output=True)
    (entry,) = [
        line
        for line in (tmp_path / "etc/passwd").read_text().splitlines()
        if line.startswith("operator-kiosk:")
    ]
    assert entry.endswith(":/run/operator-panel-kiosk:/usr/sbin/nologin")
    members = (tmp_path / "etc/group").read_text()
    groups = re.findall(r"^(\w+):.*\boperator-kiosk$", members, re.MULTILINE)
    assert sorted(groups) == ["input", "render", "video"]
