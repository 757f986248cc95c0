"""The software of this installation: the Python packages of its environment, from their own metadata,
the interpreter, and the packages of a Debian; as an SBOM in the form of CycloneDX 1.6.

Sources: https://cyclonedx.org/docs/1.6/json, https://github.com/package-url/purl-spec, dpkg-query(1)
"""

import platform
import re
import uuid
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import Distribution, distributions
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from app.system.settings import APP

PYPI: Final = "pypi"
DEBIAN: Final = "deb"
DPKG: Final = Path("/var/lib/dpkg/status")  # what dpkg-query reads
DPKG_KEYS: Final = frozenset({"Package", "Status", "Version", "Architecture"})
NAME_SIGNS: Final = re.compile(r"[-_.]+")
NAMESPACE: Final = uuid.UUID("5a8bf1b6-6f1e-4a33-9d7c-3f6c5f0e8a57")
EXTRA: Final = re.compile(r"extra\s*==")
REQUIRED: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


@dataclass(frozen=True, slots=True)
class Component:
    """An installed package: `version` is "" of a checkout. `kind` is the type of its purl, `namespace`
    whose package it is, such as "debian", and `architecture` its own. `needs` are the names of what it
    needs, without its extras."""

    name: str
    version: str
    licence: str = ""
    kind: str = PYPI
    needs: Sequence[str] = ()
    namespace: str = ""
    architecture: str = ""

    @property
    def full_name(self) -> str:
        """As it stands in its purl."""
        return f"{self.namespace}/{self.name}" if self.namespace else self.name

    @property
    def purl(self) -> str:
        version = f"@{quote(self.version, safe=':')}" if self.version else ""
        more = f"?arch={self.architecture}" if self.architecture else ""
        return f"pkg:{self.kind}/{quote(self.full_name)}{version}{more}"

    def __str__(self) -> str:
        return f"{self.name} {self.version}".rstrip()


def package_name(name: str) -> str:
    """The name as package indexes compare it (PEP 503)."""
    return NAME_SIGNS.sub("-", name).lower()


def installed(packages: Iterable[Distribution] | None = None) -> tuple[Component, ...]:
    """This program first, then all packages of its environment by their names, then the interpreter.
    Blocks: it reads a file of each."""
    known: dict[str, Component] = {}
    for each in distributions() if packages is None else packages:
        component = _component(each)
        if component is not None:
            known.setdefault(component.name, component)  # the first on the path is imported
    own = known.pop(APP, Component(APP, ""))
    python = Component(
        platform.python_implementation().lower(), platform.python_version(), "", "generic"
    )
    return (own, *(known[name] for name in sorted(known)), python)


def system_packages(
    status: Path = DPKG, release: Path = Path("/etc/os-release")
) -> tuple[Component, ...]:
    """The packages that dpkg has installed, by their names; none on a system without dpkg. Blocks."""
    try:
        text = status.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ()
    system = _system_name(release)
    packages = (_dpkg_fields(paragraph) for paragraph in text.split("\n\n"))
    components = {
        Component(
            about["Package"],
            about["Version"],
            kind=DEBIAN,
            namespace=system,
            architecture=about.get("Architecture", ""),
        )
        for about in packages
        if about.get("Status", "").endswith(" installed") and {"Package", "Version"} <= about.keys()
    }
    return tuple(sorted(components, key=lambda package: package.purl))


def _dpkg_fields(paragraph: str) -> dict[str, str]:
    lines = (line.partition(": ") for line in paragraph.splitlines())
    return {key: value for key, _, value in lines if key in DPKG_KEYS}


def _system_name(release: Path) -> str:
    """`ID` of os-release(5), such as "debian" or "ubuntu"."""
    try:
        lines = release.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    return next((line[3:].strip("\"'") for line in lines if line.startswith("ID=")), "debian")


def _component(distribution: Distribution) -> Component | None:
    about = distribution.metadata
    name, version = about["Name"], about["Version"]
    if not name or not version:
        return None  # what is left of a package that was removed
    licence = about["License-Expression"] or about["License"] or ""
    needs = dict.fromkeys(_needs(distribution.requires or ()))
    return Component(package_name(name), version, licence.split("\n")[0][:200], needs=tuple(needs))


def _needs(requirements: Iterable[str]) -> Iterator[str]:
    for text in requirements:
        name = REQUIRED.match(text)
        if name and not EXTRA.search(text):
            yield package_name(name[0])


def cyclonedx(components: Sequence[Component]) -> dict[str, Any]:
    """The SBOM of these components, the first of which is the program. The same components make the
    same document: it has no time of its own."""
    own, *others = components
    listed = {each.name: each for each in components if each.kind != DEBIAN}
    serial = uuid.uuid5(NAMESPACE, "\n".join(component.purl for component in components))
    return {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{serial}",
        "version": 1,
        "metadata": {"component": _listed(own, "application")},
        "components": [_listed(component) for component in others],
        "dependencies": [
            {
                "ref": component.purl,
                "dependsOn": sorted(listed[name].purl for name in component.needs if name in listed),
            }
            for component in components
            if component.kind != DEBIAN  # what these need is not read
        ],
    }


def _listed(component: Component, type_name: str = "") -> dict[str, Any]:
    about: dict[str, Any] = {
        "type": type_name or ("library" if component.kind in (PYPI, DEBIAN) else "platform"),
        "bom-ref": component.purl,
        "name": component.name,
        "purl": component.purl,
    }
    if component.namespace:
        about["group"] = component.namespace
    if component.version:
        about["version"] = component.version
    if component.licence:
        about["licenses"] = [{"license": {"name": component.licence}}]
    return about
