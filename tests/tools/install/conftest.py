"""Fixtures of a machine that a panel is installed on."""

from pathlib import Path

import pytest

from app.tools.install.host import Host


@pytest.fixture
def host(tmp_path: Path) -> Host:
    """A folder with what says that it is Debian 12."""
    root = tmp_path / "root"
    (root / "etc").mkdir(parents=True)
    (root / "etc/os-release").write_text('ID=debian\nVERSION_ID="12"\n')
    (root / "etc/passwd").write_text("root:x:0:0::/root:/bin/sh\n")
    return Host(root)
