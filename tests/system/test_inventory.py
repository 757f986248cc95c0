"""The SBOM of an installation: from the metadata of its packages, checked against their files."""

import json
from importlib.metadata import PathDistribution, distribution
from pathlib import Path

from app.system.inventory import Component, cyclonedx, installed
from app.system.settings import APP

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
