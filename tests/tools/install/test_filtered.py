"""The server's own processes under the unit's filter of system calls: resources are not changed."""

import subprocess
import sys
from pathlib import Path

import pytest

from app.records.store import Store
from tests.records.test_store import fill
from tests.support.parts import ROOT
from tests.support.system_calls import forbid_resources

SEARCH = """
import pathlib, sys
from app.records import Filter
from app.system.worker import Worker
search = Worker("app.records.reader:search", pathlib.Path(sys.argv[1]), Filter(every=True), None, 10)
print(len(next(search.results())))
"""
CHECK = [sys.executable, "-m", "app.cli", "check"]


def run(command: list[str]) -> bytes:
    done = subprocess.run(
        command,
        capture_output=True,
        cwd=ROOT,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
        preexec_fn=forbid_resources,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout


def test_the_filter_forbids() -> None:
    with pytest.raises(AssertionError, match="PermissionError"):
        run([sys.executable, "-c", "import os; os.nice(1)"])


def test_the_operators_log_can_be_read(tmp_path: Path) -> None:
    store = Store(tmp_path, "boot1")
    fill(store, 3)
    assert int(run([sys.executable, "-c", SEARCH, str(tmp_path)])) >= 3
    store.close()


def test_a_pages_own_template_is_tried_with_its_limits(tmp_path: Path) -> None:
    run([*CHECK, str(ROOT / "docs/examples/plan/panel.toml")])
    page = '[[page]]\nid = "a"\ntitle = "A"\ntemplate = "a.html"\n'
    (tmp_path / "cell1.toml").write_text(f'title = "Cell"\n{page}')
    (tmp_path / "a.html").write_text('{{ "x".center(3000000000) }}')
    with pytest.raises(AssertionError, match=r"a\.html: line 1: it takes more than 50 MB"):
        run([*CHECK, str(tmp_path / "cell1.toml")])
