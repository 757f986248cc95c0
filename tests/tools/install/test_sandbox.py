"""The server under the restrictions of its unit, as far as they need no systemd: every feature works,
and nothing else does."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.records.verify import verify
from app.system.worker import BACKGROUND
from tests.support.parts import ROOT, Server, until
from tests.support.sandbox import allowed_calls, mount_commands, setting
from tests.support.servers import ready

pytestmark = [pytest.mark.usefixtures("systemd"), pytest.mark.long("packaging")]

UNIT = ROOT / "deploy/operator-panel.service"
TEMPORARY = "temporary"  # in place of the unit's own /tmp: the test's files are in that of the machine
PANEL = """
title = "Cell 1"
[record]
before_s = 1
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = { data = true }
[[page.widget]]
id = "history"
kind = "trend"
label = "Boxes"
span = 12
rows = 3
window = "10m"
keep = "24h"
disk = true
[[page.widget.pen]]
topic = "/boxes"
type = "std_msgs/msg/UInt32"
label = "Boxes"
"""


def sandboxed(data: Path) -> list[str]:
    """The command before another one: read-only mounts, no capabilities, the unit's filter."""
    drop = "exec setpriv --bounding-set=-all --inh-caps=-all"
    shell = f'{mount_commands(data, data.parent / TEMPORARY)} && {drop} "$@"'
    sandbox = [sys.executable, "-m", "tests.support.sandbox", str(UNIT)]
    return ["unshare", "--mount", "sh", "-c", shell, "sh", *sandbox]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    (tmp_path / "data").mkdir(mode=0o700)
    (tmp_path / TEMPORARY).mkdir()
    return tmp_path / "data"


@pytest.mark.parametrize(
    ("attempt", "refused"),
    [
        (f"open({str(ROOT / 'x')!r}, 'w')", "Read-only file system"),
        ("__import__('os').nice(-1)", "Operation not permitted"),
        ("__import__('os').chown('/tmp', 1, 1)", "Operation not permitted"),
        ("__import__('mmap').mmap(-1, 4096, prot=7)", "Permission denied"),
        ("__import__('socket').socket(17, 3)", "Operation not permitted"),
        ("__import__('ctypes').CDLL(None).unshare(0x20000) and 1 / 0", "division by zero"),
        ("__import__('os').sched_setscheduler(0, 1, __import__('os').sched_param(1))", "not permitted"),
    ],
)
def test_what_the_server_does_not_need_is_refused(data: Path, attempt: str, refused: str) -> None:
    done = subprocess.run(
        [*sandboxed(data), sys.executable, "-c", attempt], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert refused in done.stderr


def test_the_units_calls_are_those_of_a_service_without_privileges() -> None:
    calls = allowed_calls(UNIT.read_text())
    assert {"read", "socket", "fdatasync", "clone", "execve", "setpriority"} <= calls
    refused = {"mount", "reboot", "setuid", "sched_setscheduler", "ptrace", "bpf", "init_module"}
    assert not refused & calls


def niceness() -> Iterator[int]:
    yield os.nice(0)


def test_a_worker_has_a_lower_priority_than_the_server(data: Path) -> None:
    worker = f"Worker('{__name__}:{niceness.__name__}')"
    script = f"from app.system.worker import Worker; print(*{worker}.results())"
    variables = {**os.environ, "TMPDIR": str(data.parent / TEMPORARY)}
    words = [*sandboxed(data), sys.executable, "-c", script]
    done = subprocess.run(words, cwd=ROOT, env=variables, capture_output=True, text=True)
    assert done.stdout.strip() == str(os.nice(0) + BACKGROUND), done.stderr


def findings(server: Server) -> list[dict[str, str]]:
    doctor = server.http.get("/diagnostics", headers={"Accept": "application/json"}).json()["doctor"]
    return list(doctor["findings"]) if doctor["at"] else []


def test_every_feature_works_under_the_restrictions(data: Path, tmp_path: Path) -> None:
    panel = tmp_path / "panel.toml"
    panel.write_text(PANEL)
    with ready(
        Server(
            ROOT,
            before=sandboxed(data),
            TMPDIR=str(tmp_path / TEMPORARY),
            KIOSK_DATA=str(data),
            KIOSK_PANEL=str(panel),
            KIOSK_MODE="demo",
            KIOSK_LOG_COPY=str(data / "copy"),
        )
    ) as server:
        http = server.http

        def published() -> bool:
            """A machine that stands still may have lost its link just now."""
            return bool(server.press("start", inputs={}).json()["outcome"] == "published")

        until(published, "a press is sent", every_s=0.5)
        assert "data-widget" in http.get("/").text
        assert 'data-outcome="published"' in http.get("/log").text
        assert b"published" in http.get("/log.csv").content  # another process reads the log
        assert "kiosk_" in http.get("/metrics").text
        until(lambda: http.get("/recordings/last.mcap").content.startswith(b"\x89MCAP"), "recorded")
        assert http.get("/widgets/history/trend?span_s=60").status_code == 200
        assert http.post("/diagnostics/check", json={"id": "check-0001"}).status_code == 200
        until(lambda: findings(server), "the doctor has checked", within_s=120)
        assert http.post("/diagnostics/bundle", timeout=120).content.startswith(b"PK")
    assert verify(data).fault == ""
    assert {"operators-log.sqlite3", "trends.sqlite3", "log-key.pem", "kept-files", "copy"} <= {
        path.name for path in data.iterdir()
    }
    assert setting(UNIT.read_text(), "StateDirectoryMode") == ["0700"]
