"""Environments with the panel's locked dependencies, copied from the tests' own: pip takes 20 s.
`tests/requirements.lock` has each of them with the same version and hashes, and pip has checked
these. `make release` installs them by pip."""

import re
import shlex
import shutil
import sys
from importlib.metadata import distribution
from pathlib import Path, PurePosixPath
from typing import Final

from tests.support.parts import ROOT

LOCK: Final = ROOT / "deploy/requirements.lock"
ENTRY: Final = re.compile(r"^[\w.-]+==.*(?:\n +--hash=.*)+$", re.MULTILINE)


def entries(lock: Path) -> dict[str, str]:
    """Each entry of a lock file, by its distribution: the version and the hashes."""
    return {entry.partition("==")[0]: entry for entry in ENTRY.findall(lock.read_text())}


def add_dependencies(environment: Path) -> None:
    """Copies the locked dependencies into a virtual environment, which may have some of them."""
    site = environment / f"lib/python{sys.version_info[0]}.{sys.version_info[1]}/site-packages"
    for name, entry in entries(LOCK).items():
        installed = distribution(name)
        assert entry.startswith(f"{name}=={installed.version} "), (
            f"{name} {installed.version}: `make test`"
        )
        tops = {PurePosixPath(file).parts[0] for file in installed.files or ()} - {"..", "__pycache__"}
        for top in tops:
            source, target = Path(str(installed.locate_file(top))), site / top
            if source.is_dir():
                shutil.copytree(source, target, dirs_exist_ok=True)  # a namespace has several
            else:
                shutil.copy2(source, target)


def add_pip(environment: Path) -> None:
    """Writes `bin/pip`, which runs the pip of the tests."""
    python = shlex.quote(str(environment / "bin/python"))
    pip = environment / "bin/pip"
    pip.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m pip --python {python} "$@"\n')
    pip.chmod(0o755)
