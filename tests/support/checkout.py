"""The checkout that the tests run in: copies of its files, and whether tests have written into it."""

import hashlib
import shutil
import subprocess
from collections.abc import Collection
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parent.parent.parent
CACHES: Final = ("__pycache__/", ".pyc", ".mypy_cache/", ".ruff_cache/", ".hypothesis/")


def _git(*arguments: str) -> str:
    command = ["git", "-c", "core.quotePath=off", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def copy_project(folder: Path, without: Collection[str] = ()) -> None:
    """Copies the project's files and folders of the top level, not what else lies in the checkout: a
    reader's own panel file is there too, and a link would let a test write into it."""
    folder.mkdir(parents=True, exist_ok=True)
    names = {path.partition("/")[0] for path in _git("ls-files").splitlines()}
    for name in names - set(without):
        if (ROOT / name).is_dir():
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, folder / name, symlinks=True, ignore=ignored)
        else:
            shutil.copy2(ROOT / name, folder / name)


def state() -> dict[str, str]:
    """What git says of each file that is not as committed, with the hash of its content,
    and of each ignored file or folder; without caches."""
    lines = _git("status", "--porcelain", "--ignored=matching", "--untracked-files=all").splitlines()
    return {line: _hash(ROOT / line[3:]) for line in lines if not line.endswith(CACHES)}


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
