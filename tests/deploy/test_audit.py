"""`make audit`: what it says of pip-audit's report, and that no data is no result."""

import json
from pathlib import Path
from typing import Any

import pytest

from deploy import audit

WEAK: dict[str, Any] = {
    "name": "pillow",
    "version": "9.0.0",
    "vulns": [{"id": "PYSEC-2022-8", "fix_versions": ["9.0.1"], "aliases": [], "description": ""}],
}
FINE: dict[str, Any] = {"name": "babel", "version": "2.18.0", "vulns": []}
SKIPPED = {"name": "anyio", "skip_reason": "Dependency not found on PyPI and could not be audited"}


def pip_audit(folder: Path, monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    """A pip-audit that does what the program says."""
    (folder / "pip_audit.py").write_text(program)
    monkeypatch.setenv("PYTHONPATH", str(folder))


@pytest.mark.parametrize(
    ("dependencies", "status", "said"),
    [
        ([FINE], 0, "no known weakness"),
        ([FINE, WEAK], 1, "pillow 9.0.0: PYSEC-2022-8, fixed in 9.0.1"),
        ([FINE, SKIPPED], 2, "1 could not be checked, the first: anyio: Dependency not found"),
        ([WEAK, SKIPPED], 1, "pillow 9.0.0"),
    ],
)
def test_the_report_is_read(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    dependencies: list[dict[str, Any]],
    status: int,
    said: str,
) -> None:
    report = json.dumps({"dependencies": dependencies, "fixes": []})
    pip_audit(
        tmp_path, monkeypatch, f"print({report!r}); raise SystemExit({int(WEAK in dependencies)})"
    )
    assert audit.main([str(tmp_path / "requirements.lock")]) == status
    captured = capsys.readouterr()
    assert said in captured.out + captured.err
    assert ("this is no result" in captured.err) == (status == 2)


def test_without_a_network_there_is_no_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pip_audit(tmp_path, monkeypatch, "raise OSError('failed to resolve api.osv.dev')")
    assert audit.main([str(tmp_path / "requirements.lock")]) == 2
    assert "requirements.lock: OSError: failed to resolve api.osv.dev" in capsys.readouterr().err


def test_every_locked_file_is_audited() -> None:
    assert all((audit.ROOT / lock).is_file() for lock in audit.LOCKS)
