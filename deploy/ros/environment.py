"""`environment.py FOLDER BUILD`: a virtual environment in FOLDER with the panel of this checkout and
its locked dependencies. What only the build needs is kept in BUILD. A second run installs what changed.
"""

import hashlib
import os
import subprocess
import sys
import venv
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent.parent
LOCK = CHECKOUT / "deploy/requirements.lock"
BUILD_LOCK = CHECKOUT / "deploy/build.lock"
DONE = "installed.sha256"


def main(folder: Path, build: Path) -> None:
    build.mkdir(parents=True, exist_ok=True)
    python = folder / "bin/python"
    if not python.exists():
        venv.create(folder, with_pip=True, clear=True)
    if _changed(folder / DONE, LOCK):
        _pip(python, "install", "--require-hashes", "-r", str(LOCK))
        _write_done(folder / DONE, LOCK)
    wheel = _wheel(python, build)
    _pip(python, "install", "--no-deps", "--force-reinstall", str(wheel))


def _wheel(python: Path, build: Path) -> Path:
    """The wheel of the checkout, built with the locked build backend."""
    backend, wheels = build / "backend", build / "wheels"
    if _changed(build / DONE, BUILD_LOCK):
        _pip(
            *(python, "install", "--require-hashes", "-r", str(BUILD_LOCK)),
            *("--upgrade", "--target", str(backend)),
        )
        _write_done(build / DONE, BUILD_LOCK)
    for old in wheels.glob("*.whl"):
        old.unlink()
    options = ["--no-deps", "--no-build-isolation", "--wheel-dir", str(wheels)]
    _pip(python, "wheel", *options, str(CHECKOUT), path=str(backend))
    (wheel,) = wheels.glob("*.whl")
    return wheel


def _changed(done: Path, lock: Path) -> bool:
    return not done.exists() or done.read_text() != _hash(lock)


def _write_done(done: Path, lock: Path) -> None:
    done.write_text(_hash(lock))


def _hash(lock: Path) -> str:
    return hashlib.sha256(lock.read_bytes()).hexdigest()


def _pip(python: Path, *arguments: str, path: str = "") -> None:
    """Runs pip in the environment. The PYTHONPATH of a workspace is not for it; `path` is."""
    command = [str(python), "-m", "pip", "--disable-pip-version-check", "--quiet", *arguments]
    subprocess.run(command, env={**os.environ, "PYTHONPATH": path}, check=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
