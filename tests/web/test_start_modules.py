"""How many modules the server imports until its first page: their import is most of its start."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.budgets import check
from tests.support.parts import ROOT, SHIPPED
from tests.support.servers import panel_file
from tests.web.test_first_page import THREE


def modules(panel: Path, mode: str, data: Path) -> tuple[int, int]:
    """(modules of the server, all modules)."""
    environment = {"KIOSK_PANEL": str(panel), "KIOSK_MODE": mode, "KIOSK_DATA": str(data)}
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.modules_at_start"],
        cwd=ROOT,
        env={**os.environ, **environment, "PYTHONPATH": ""},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    own, every = json.loads(done.stdout)
    return own, every


@pytest.mark.parametrize("name", ["shipped panel", "three widgets"])
def test_the_start_imports_no_more_modules(name: str, tmp_path: Path) -> None:
    shipped = name == "shipped panel"
    panel = SHIPPED if shipped else panel_file(tmp_path, THREE)
    own, every = modules(panel, "demo" if shipped else "live", tmp_path / "data")
    check(f"modules of the server, {name}", own)
    check(f"all modules, {name}", every)
