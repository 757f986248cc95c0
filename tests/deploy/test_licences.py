"""The licences of all locked dependencies: each is listed, as the installed package declares it, and
allowed."""

import re
import tomllib
from importlib.metadata import PackageMetadata, metadata
from typing import Final

import pytest

from tests.support.parts import ROOT

LISTED: Final = tomllib.loads((ROOT / "deploy/licences.toml").read_text())
# Of what a release installs: no duty beyond keeping the notices.
ALLOWED: Final = frozenset(
    [
        "0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "CC0-1.0", "ISC", "MIT", "MIT-0",
        "MIT-CMU", "PSF-2.0", "Zlib",
    ]
)  # fmt: skip
# Of an extra, which its user installs beside the panel, as a package of its own.
ALLOWED_IN_EXTRAS: Final = ALLOWED | {"LGPL-3.0-only"}
# Of tests and tools, which are not distributed.
ALLOWED_IN_TESTS: Final = ALLOWED | {"MPL-2.0"}
# What older metadata says in place of an SPDX expression.
WORDS: Final = {
    "MIT License": "MIT",
    "MIT": "MIT",
    "BSD License": "BSD-3-Clause",
    "BSD": "BSD-3-Clause",
    "BSD-3-Clause": "BSD-3-Clause",
    "Apache Software License": "Apache-2.0",
    "Apache-2.0": "Apache-2.0",
    "Eclipse Public License 2.0 (EPL-2.0)": "EPL-2.0",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "MPL-2.0": "MPL-2.0",
}


def locked(lock: str) -> set[str]:
    return set(re.findall(r"^([a-z0-9-]+)==", (ROOT / lock).read_text(), re.MULTILINE))


SHIPPED: Final = locked("deploy/requirements.lock")
EXTRAS: Final = {
    "apsw", "authlib", "joserfc", "numpy", "paho-mqtt", "psycopg", "psycopg-binary", "rosbags",
    "ruamel-yaml", "tomlrt",
}  # with the extras only  # fmt: skip
TESTS: Final = locked("tests/requirements.lock")


def declared(about: PackageMetadata) -> str:
    """The licence as a package declares it: an SPDX expression, or several by OR; "" for none."""
    if expression := about.get_all("License-Expression"):
        return str(expression[0])
    classifiers = about.get_all("Classifier") or []
    words = [line.split(" :: ")[-1] for line in classifiers if line.startswith("License ::")]
    if not set(words) & WORDS.keys():
        words += about.get_all("License") or []
    names = {WORDS[word] for word in words if word in WORDS}
    return " OR ".join(sorted(names))


def is_allowed(expression: str, allowed: frozenset[str]) -> bool:
    """Whether every part of one alternative is allowed."""
    return any(
        all(name.strip() in allowed for name in alternative.split(" AND "))
        for alternative in expression.split(" OR ")
    )


def test_every_locked_dependency_is_listed_and_nothing_else() -> None:
    assert set(LISTED["shipped"]) == SHIPPED
    assert set(LISTED["extras"]) == EXTRAS
    assert set(LISTED["tests"]) == TESTS - SHIPPED - EXTRAS
    assert set(LISTED["undeclared"]) <= TESTS


@pytest.mark.parametrize("part", ["shipped", "extras", "tests"])
def test_every_licence_is_allowed(part: str) -> None:
    allowed = {"tests": ALLOWED_IN_TESTS, "extras": ALLOWED_IN_EXTRAS}.get(part, ALLOWED)
    refused = {name: text for name, text in LISTED[part].items() if not is_allowed(text, allowed)}
    assert refused == {}


def test_every_licence_is_as_the_installed_package_declares_it() -> None:
    every = LISTED["shipped"] | LISTED["extras"] | LISTED["tests"]
    assert {n: declared(metadata(n)) for n in every if n not in LISTED["undeclared"]} == {
        name: text for name, text in every.items() if name not in LISTED["undeclared"]
    }


@pytest.mark.parametrize(
    ("expression", "allowed"),
    [
        ("MIT", True),
        ("GPL-3.0-only", False),
        ("GPL-3.0-only OR MIT", True),
        ("MIT AND GPL-3.0-only", False),
        ("", False),
    ],
)
def test_a_licence_that_is_not_allowed_is_noticed(expression: str, allowed: bool) -> None:
    assert is_allowed(expression, ALLOWED) == allowed
