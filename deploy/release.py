"""`python deploy/release.py FOLDER [--tag TAG]`: the files of a release, each checked.

FOLDER gets the wheel, the sdist, the SBOM (CycloneDX), the VEX file (OpenVEX), the documentation as a
site, the locked dependencies and SHA256SUMS. If RELEASE_KEY names a secret key of minisign, the wheel,
the VEX file and SHA256SUMS are signed with it. The version is that of pyproject.toml. Exit status 1:
what is wrong is printed.
"""

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
import urllib.request
import venv
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":  # its folder is on the path, and not that of the checkout
    sys.path.insert(0, str(ROOT))

from deploy import vex  # noqa: E402
from deploy.audit import audit  # noqa: E402

LOCK = ROOT / "deploy/requirements.lock"
SITE = ROOT / "build/docs"
STARTS_WITHIN_S = 60


class ReleaseError(Exception):
    """What keeps this from being a release."""


def version() -> str:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return str(project["version"])


def check_version(tag: str | None) -> None:
    """A ROS package has to name the version itself; a tag's changes are under its heading."""
    named = ElementTree.parse(ROOT / "deploy/ros/package.xml").findtext("version")
    if named != version():
        raise ReleaseError(f"package.xml says {named}, pyproject.toml {version()}")
    if tag is None:
        return
    if tag != f"v{version()}":
        raise ReleaseError(f'the tag is "{tag}": of version {version()} it is "v{version()}"')
    heading = rf"^## {re.escape(version())} – \d{{4}}-\d{{2}}-\d{{2}}$"
    if not re.search(heading, (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE):
        raise ReleaseError(f'CHANGELOG.md has no "## {version()} – YYYY-MM-DD": what was "Unreleased"')


def empty(folder: Path) -> None:
    """Makes the folder, without the files of an earlier release. ReleaseError if it has others."""
    folder.mkdir(parents=True, exist_ok=True)
    others = sorted(path.name for path in folder.iterdir() if not is_of_release(path))
    if others:
        raise ReleaseError(f"{folder} has {', '.join(others[:3])}: name a folder for the release alone")
    for path in folder.iterdir():
        path.unlink()


def is_of_release(path: Path) -> bool:
    named = path.name.startswith("operator_panel-") or path.name in (
        "SHA256SUMS",
        "SHA256SUMS.minisig",
        LOCK.name,
        ".gitignore",
    )
    return named and path.is_file()


def build(folder: Path) -> Path:
    """Wheel and sdist; the wheel. The sdist gives the same wheel as the checkout."""
    run("-m", "build", "--no-isolation", "--sdist", "--wheel", "--outdir", str(folder), str(ROOT))
    (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    with tempfile.TemporaryDirectory() as unpacked:
        unpack(sdist, unpacked)
        (source,) = Path(unpacked).iterdir()
        run("-m", "build", "--no-isolation", "--wheel", "--outdir", unpacked, str(source))
        (again,) = Path(unpacked).glob("*.whl")
        if again.name != wheel.name or digest(again) != digest(wheel):
            raise ReleaseError(f"{sdist.name} gives another wheel than the checkout")
    return wheel


def unpack(sdist: Path, folder: str) -> None:
    """Python has `filter="data"` since 3.11.4; before that, the attribute is ignored."""
    with tarfile.open(sdist) as archive:
        archive.extraction_filter = getattr(tarfile, "data_filter", None)
        archive.extractall(folder)


def describe(folder: Path) -> None:
    """The SBOM: each locked dependency with its hashes."""
    target = folder / f"operator_panel-{version()}.cdx.json"
    arguments = ["--pyproject", str(ROOT / "pyproject.toml"), "--output-reproducible", "--validate"]
    run("-m", "cyclonedx_py", "requirements", *arguments, "-o", str(target), str(LOCK))


def judge(folder: Path, tag: str | None) -> Path:
    """The VEX file. ReleaseError for a known weakness that deploy/vex.toml does not judge, and for a
    tag also where the data of known weaknesses was not reached."""
    statements = vex.judgements()
    weak, unchecked = audit(LOCK)
    if left := vex.unjudged(weak, statements):
        raise ReleaseError("deploy/vex.toml does not judge:\n" + "\n".join(map(str, left)))
    if unchecked and tag is not None:
        raise ReleaseError(f"not known which weaknesses there are: {unchecked[0]}")
    if unchecked:
        print(f"the VEX file may lack weaknesses: {unchecked[0]}", file=sys.stderr)
    target = folder / f"operator_panel-{version()}.vex.json"
    document = vex.document(version(), statements, vex.locked(LOCK), datetime.now(UTC))
    target.write_text(json.dumps(document, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return target


def pack_docs(folder: Path) -> None:
    if not (SITE / "index.html").is_file():
        raise ReleaseError(f"{SITE} has no documentation: `make docs` writes it")
    shutil.make_archive(str(folder / f"operator_panel-{version()}-docs"), "gztar", SITE)


def try_out(wheel: Path) -> None:
    """In an environment with the locked dependencies only: its version, and a demo that is ready."""
    with tempfile.TemporaryDirectory() as folder:
        venv.create(Path(folder) / "venv", with_pip=True)
        python = f"{folder}/venv/bin/python"
        pip = ("-m", "pip", "--disable-pip-version-check", "--quiet", "install")
        run(*pip, "--require-hashes", "-r", str(LOCK), python=python)
        run(*pip, "--no-deps", str(wheel), python=python)
        command = f"{folder}/venv/bin/operator-panel"
        printed = subprocess.check_output([command, "--version"], cwd=folder, text=True).strip()
        if printed != f"operator-panel {version()}":
            raise ReleaseError(f'the installed wheel prints "{printed}", not version {version()}')
        with serving(command, Path(folder)) as port:
            wait_until_ready(port)


@contextmanager
def serving(command: str, folder: Path) -> Iterator[int]:
    """The server with the shipped demo; its port."""
    log = folder / "server.log"
    env = {**os.environ, "KIOSK_DATA": str(folder / "data"), "PYTHONPATH": ""}
    with log.open("w") as stream:
        server = subprocess.Popen([command, "run", "--port=0"], cwd=folder, env=env, stderr=stream)
    try:
        until = time.monotonic() + STARTS_WITHIN_S
        while not (match := re.search(r"the panel is at http://[\d.]+:(\d+)", log.read_text())):
            if server.poll() is not None or time.monotonic() > until:
                raise ReleaseError(f"the installed server does not start:\n{log.read_text()}")
            time.sleep(0.1)
        yield int(match[1])
    finally:
        server.terminate()
        server.wait()


def wait_until_ready(port: int) -> None:
    # The server is on this machine: a proxy of the environment is not for it.
    direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    until = time.monotonic() + STARTS_WITHIN_S
    while True:
        try:
            with direct.open(f"http://127.0.0.1:{port}/readyz", timeout=5):
                return
        except OSError as error:  # 503 is one, too
            if time.monotonic() > until:
                raise ReleaseError(f"the installed server is not ready: {error}") from error
        time.sleep(0.1)


def write_sums(folder: Path) -> None:
    """As `sha256sum --check` reads them."""
    shutil.copy(LOCK, folder)
    files = sorted(path for path in folder.iterdir() if path.name != "SHA256SUMS")
    (folder / "SHA256SUMS").write_text("".join(f"{digest(path)}  {path.name}\n" for path in files))


def sign(files: Iterable[Path], key: str) -> None:
    """Signatures of these files. minisign asks for the key's password."""
    for path in files:
        comment = f"operator-panel {version()} {path.name} sha256:{digest(path)}"
        try:
            subprocess.run(["minisign", "-S", "-s", key, "-m", str(path), "-t", comment], check=True)
        except FileNotFoundError:
            raise ReleaseError("RELEASE_KEY is set, and minisign is not installed") from None
        except subprocess.CalledProcessError as error:
            raise ReleaseError(
                f"{path.name} is not signed: minisign ended with {error.returncode}"
            ) from error


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def run(*arguments: str, python: str = sys.executable) -> None:
    done = subprocess.run([python, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise ReleaseError(f"{' '.join(arguments[:4])} failed:\n{done.stdout}{done.stderr}")


def main() -> int:
    parser = argparse.ArgumentParser(description="Makes and checks the files of a release.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--tag", help="the tag that this is a release of")
    options = parser.parse_args()
    try:
        check_version(options.tag)
        empty(options.folder)
        wheel = build(options.folder)
        describe(options.folder)
        weaknesses = judge(options.folder, options.tag)
        pack_docs(options.folder)
        write_sums(options.folder)
        try_out(wheel)
        if key := os.environ.get("RELEASE_KEY"):
            sign((wheel, weaknesses, options.folder / "SHA256SUMS"), key)
        else:
            print("not signed: RELEASE_KEY names no secret key of minisign", file=sys.stderr)
    except (ReleaseError, vex.VexError) as error:
        print(error, file=sys.stderr)
        return 1
    print("".join(f"{path}\n" for path in sorted(options.folder.iterdir())), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
