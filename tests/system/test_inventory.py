"""The SBOM of an installation: from the metadata of its packages, checked against their files."""

import json
import shutil
import subprocess
from importlib.metadata import PathDistribution, distribution
from pathlib import Path
from typing import Final

import pytest

from app.system.inventory import DPKG, Component, cyclonedx, installed, system_packages
from app.system.settings import APP
from app.system.vex import is_meant

METADATA = """Metadata-Version: 2.4
Name: {name}
Version: {version}
License-Expression: Apache-2.0
Requires-Dist: Pillow>=12
Requires-Dist: not_there
Requires-Dist: paho-mqtt>=2; extra == "mqtt"
"""


def package(folder: Path, name: str, version: str, text: str = METADATA) -> PathDistribution:
    info = folder / f"{name}-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(text.format(name=name, version=version))
    return PathDistribution(info)


def test_what_is_installed_here_has_the_versions_of_its_metadata() -> None:
    components = {component.name: component for component in installed()}
    assert components["fastapi"].version == distribution("fastapi").version
    assert components["fastapi"].licence
    assert "pydantic" in components["fastapi"].needs
    assert next(iter(components)) == APP
    assert components["cpython"].purl.startswith("pkg:generic/cpython@3.")


def test_the_program_is_first_and_the_first_of_a_name_counts(tmp_path: Path) -> None:
    packages = [
        package(tmp_path / "a", "zope.interface", "1.0"),
        package(tmp_path / "a", "operator_panel", "0.2.0"),
        package(tmp_path / "a", "Pillow", "12.0.0"),
        package(tmp_path / "b", "pillow", "11.0.0"),
        package(tmp_path / "b", "broken", "1", "Metadata-Version: 2.4\n"),
    ]
    own, *others = installed(packages)
    assert own == Component(APP, "0.2.0", "Apache-2.0", needs=("pillow", "not-there"))
    assert [str(each) for each in others[:-1]] == ["pillow 12.0.0", "zope-interface 1.0"]


def test_the_sbom_is_the_same_for_the_same_packages_and_names_what_each_needs(tmp_path: Path) -> None:
    packages = [package(tmp_path, "operator_panel", "0.2.0"), package(tmp_path, "pillow", "12.0.0")]
    document = cyclonedx(installed(packages))
    assert json.dumps(document) == json.dumps(cyclonedx(installed(packages)))
    assert (document["bomFormat"], document["specVersion"]) == ("CycloneDX", "1.6")
    assert document["metadata"]["component"]["purl"] == "pkg:pypi/operator-panel@0.2.0"
    assert document["components"][0]["licenses"] == [{"license": {"name": "Apache-2.0"}}]
    first, *_ = document["dependencies"]
    assert first == {
        "ref": "pkg:pypi/operator-panel@0.2.0",
        "dependsOn": ["pkg:pypi/pillow@12.0.0"],
    }
    other = cyclonedx(installed([*packages, package(tmp_path, "more", "1")]))
    assert other["serialNumber"] != document["serialNumber"]


STATUS: Final = """Package: openssl
Status: install ok installed
Priority: optional
Architecture: amd64
Version: 1:3.0.15+b1-1~deb12u1
Description: Secure Sockets Layer
 Version: of no field
 .

Package: held
Status: hold ok installed
Architecture: all
Version: 2.0

Package: removed
Status: deinstall ok config-files
Architecture: all
Version: 1.0

Package: openssl
Status: install ok installed
Architecture: i386
Version: 1:3.0.15+b1-1~deb12u1
"""


@pytest.mark.parametrize(
    ("release", "system"),
    [
        ("NAME=Debian\nID=debian\n", "debian"),
        ('ID="ubuntu"\n', "ubuntu"),
        ("", "debian"),
        (None, "debian"),
    ],
)
def test_packages_of_the_system_are_those_that_dpkg_has_installed(
    tmp_path: Path, release: str | None, system: str
) -> None:
    status, about = tmp_path / "status", tmp_path / "os-release"
    status.write_text(STATUS)
    if release is not None:
        about.write_text(release)
    packages = system_packages(status, about)
    assert [each.purl for each in packages] == [
        f"pkg:deb/{system}/held@2.0?arch=all",
        f"pkg:deb/{system}/openssl@1:3.0.15%2Bb1-1~deb12u1?arch=amd64",
        f"pkg:deb/{system}/openssl@1:3.0.15%2Bb1-1~deb12u1?arch=i386",
    ]
    assert system_packages(tmp_path / "none", about) == ()


def test_packages_of_the_system_are_in_the_sbom_and_meant_by_a_vex_file(tmp_path: Path) -> None:
    (tmp_path / "status").write_text(STATUS)
    packages = system_packages(tmp_path / "status", tmp_path / "none")
    document = cyclonedx((Component(APP, "0.2.0", needs=("openssl",)), *packages))
    *_, last = document["components"]
    assert (last["group"], last["name"], last["type"]) == ("debian", "openssl", "library")
    assert last["version"] == "1:3.0.15+b1-1~deb12u1"
    assert document["dependencies"] == [{"ref": "pkg:pypi/operator-panel@0.2.0", "dependsOn": []}]
    for purl, meant in (
        ("pkg:deb/debian/openssl", True),
        ("pkg:deb/debian/openssl@1:3.0.15%2Bb1-1~deb12u1?arch=amd64", True),
        ("pkg:deb/debian/openssl@3.0.16", False),
        ("pkg:deb/ubuntu/openssl", False),
        ("pkg:pypi/openssl", False),
    ):
        assert is_meant(purl, packages[1]) is meant, purl


def test_they_are_those_that_dpkg_query_lists_here() -> None:
    """On a system without dpkg there are none."""
    program = shutil.which("dpkg-query")
    listed: set[tuple[str, ...]] = set()
    if program is not None:
        form = "${Package}\t${Version}\t${Architecture}\t${db:Status-Status}\n"
        said = subprocess.run([program, "-W", f"-f={form}"], capture_output=True, text=True, check=True)
        rows = [tuple(line.split("\t")) for line in said.stdout.splitlines()]
        listed = {row[:3] for row in rows if row[3] == "installed"}
    here = {(each.name, each.version, each.architecture) for each in system_packages()}
    assert here == listed
    assert bool(here) == DPKG.exists()
