"""What `make release` makes and checks: deploy/release.py."""

import re
import tarfile
import zipfile
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import pytest
from ruamel.yaml import YAML

from deploy import release
from tests.support.parts import ROOT

WORKFLOW: Final[dict[str, Any]] = YAML(typ="safe").load(ROOT / ".github/workflows/release.yml")


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The release of a checkout that has only what names the version: it is 1.2.3."""
    (tmp_path / "deploy/ros").mkdir(parents=True)
    (tmp_path / "pyproject.toml").write_text('[project]\nversion = "1.2.3"\n')
    (tmp_path / "deploy/ros/package.xml").write_text("<package><version>1.2.3</version></package>")
    (tmp_path / "CHANGELOG.md").write_text("## Unreleased\n\n## 1.2.3 – 2026-05-04\n")
    monkeypatch.setattr(release, "ROOT", tmp_path)
    monkeypatch.setattr(release, "SITE", tmp_path / "build/docs")
    return release


def test_the_version_is_in_one_place_and_in_the_ros_package() -> None:
    release.check_version(None)
    said = re.findall(r"^version = .*$", (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    assert said == [f'version = "{release.version()}"']


def test_a_tag_is_of_the_version_and_has_its_changes(checkout: ModuleType) -> None:
    checkout.check_version("v1.2.3")
    with pytest.raises(release.ReleaseError, match=r'of version 1\.2\.3 it is "v1\.2\.3"'):
        checkout.check_version("v1.2.4")
    changelog = checkout.ROOT / "CHANGELOG.md"
    changelog.write_text("## Unreleased\n")
    with pytest.raises(release.ReleaseError, match=r'has no "## 1\.2\.3 – YYYY-MM-DD"'):
        checkout.check_version("v1.2.3")


def test_a_ros_package_of_another_version_is_no_release(checkout: ModuleType) -> None:
    package = checkout.ROOT / "deploy/ros/package.xml"
    package.write_text("<package><version>1.2.2</version></package>")
    with pytest.raises(
        release.ReleaseError, match=r"package\.xml says 1\.2\.2, pyproject\.toml 1\.2\.3"
    ):
        checkout.check_version(None)


def test_only_files_of_a_release_are_removed(tmp_path: Path) -> None:
    folder = tmp_path / "release"
    release.empty(folder)
    for name in ("operator_panel-0.1.0-py3-none-any.whl", "SHA256SUMS", "requirements.lock"):
        (folder / name).touch()
    release.empty(folder)
    assert list(folder.iterdir()) == []
    (folder / "SHA256SUMS").touch()
    (folder / "operator_panel-src").mkdir()
    (folder / "mine.txt").touch()
    with pytest.raises(release.ReleaseError, match=r"has mine\.txt, operator_panel-src: name a folder"):
        release.empty(folder)
    assert len(list(folder.iterdir())) == 3


@pytest.mark.long("packaging")
def test_the_sdist_gives_the_wheel_of_the_checkout(tmp_path: Path) -> None:
    wheel = release.build(tmp_path)
    assert wheel.name == f"operator_panel-{release.version()}-py3-none-any.whl"
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as archive:
        names = {Path(*Path(name).parts[1:]).as_posix() for name in archive.getnames()}
    assert {"pyproject.toml", "README.md", "CHANGELOG.md", "LICENSE", "zenoh.json5"} <= names
    others = [name for name in names if name.startswith(("tests/", "docs/", ".git/"))]
    assert not [
        name for name in others if not name.startswith("docs/examples/mobile-robot/")
    ]  # shipped
    with zipfile.ZipFile(wheel) as archive:
        installed = {name for name in archive.namelist() if name.startswith("app/deploy/")}
    shipped = {f"app/{name}" for name in names if name.startswith("deploy/")}
    assert installed == shipped - {"app/deploy/template_hook.py"}  # it builds the wheel
    assert "app/deploy/operator-panel-kiosk.service" in installed
    assert "app/deploy/release.lock" not in installed


def test_the_sdist_is_unpacked_by_the_oldest_python_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before Python 3.11.4, as in Debian 12, `extractall` knows no filter."""
    sdist = tmp_path / "panel.tar.gz"
    with tarfile.open(sdist, "w:gz") as archive:
        archive.add(ROOT / "pyproject.toml", "panel/pyproject.toml")
    extract = tarfile.TarFile.extractall

    def as_in_3_11_2(self: tarfile.TarFile, path: str) -> None:
        extract(self, path)

    with monkeypatch.context() as older:
        older.setattr(tarfile.TarFile, "extractall", as_in_3_11_2)
        older.delattr(tarfile, "data_filter", raising=False)
        release.unpack(sdist, str(tmp_path / "older"))
    release.unpack(sdist, str(tmp_path / "newer"))
    for name in ("older", "newer"):
        assert (tmp_path / name / "panel/pyproject.toml").is_file()


def test_release_without_documentation_fails(checkout: ModuleType, tmp_path: Path) -> None:
    with pytest.raises(release.ReleaseError, match="`make docs` writes it"):
        checkout.pack_docs(tmp_path)
    checkout.SITE.mkdir(parents=True)
    (checkout.SITE / "index.html").write_text("<title>Operator panel</title>")
    checkout.pack_docs(tmp_path)
    assert (tmp_path / "operator_panel-1.2.3-docs.tar.gz").is_file()


def test_the_sums_are_of_all_its_files(tmp_path: Path) -> None:
    (tmp_path / "a.whl").write_bytes(b"wheel")
    release.write_sums(tmp_path)
    lines = [line.split("  ") for line in (tmp_path / "SHA256SUMS").read_text().splitlines()]
    assert {name: digest for digest, name in lines} == {
        name: release.digest(tmp_path / name) for name in ("a.whl", "requirements.lock")
    }


def test_the_workflow_may_do_no_more_than_it_must() -> None:
    assert WORKFLOW["on"] == {"push": {"tags": ["v*"]}}
    assert WORKFLOW["permissions"] == {}
    jobs = WORKFLOW["jobs"]
    assert {name: job["permissions"] for name, job in jobs.items()} == {
        "files": {"contents": "read"},
        "publish": {"contents": "write"},
    }
    used = [step["uses"] for job in jobs.values() for step in job["steps"] if "uses" in step]
    assert [
        action for action in used if not re.fullmatch(r"actions/[a-z-]+@(v\d+|[0-9a-f]{40})", action)
    ] == []
    # What has the right to publish runs nothing of the checkout.
    assert not [step for step in jobs["publish"]["steps"] if "checkout" in step.get("uses", "")]
    runs = [step.get("run", "") for step in jobs["files"]["steps"]]
    assert any(re.match(r"make release TAG=", command) for command in runs)
    # A name is a variable of the shell, and not a part of the script.
    assert not [command for command in runs if re.search(r"\$\{\{ *github\.(ref|head|event)", command)]
