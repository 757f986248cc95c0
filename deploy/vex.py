"""The VEX file of a release: what `deploy/vex.toml` says of known weaknesses of the locked packages, in
the form of OpenVEX 0.2.0. `operator-panel sbom --check` and the panel read it.

Source: https://github.com/openvex/spec/blob/main/OPENVEX-SPEC.md
"""

import re
import tomllib
import uuid
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from deploy.audit import Weakness

JUDGEMENTS: Final = Path(__file__).with_name("vex.toml")
NAMESPACE: Final = uuid.UUID("5a8bf1b6-6f1e-4a33-9d7c-3f6c5f0e8a57")
PINNED: Final = re.compile(r"^([A-Za-z0-9._-]+)==([^ ;\\]+)", re.MULTILINE)
DETAILS: Final = ("justification", "impact_statement", "action_statement")
KEYS: Final = frozenset({"weakness", "packages", "status", *DETAILS})


class VexError(Exception):
    """What keeps a release from having a VEX file."""


def locked(lock: Path) -> dict[str, str]:
    """The version of each package in a lock file."""
    return dict(PINNED.findall(lock.read_text(encoding="utf-8")))


def judgements(file: Path = JUDGEMENTS) -> list[dict[str, Any]]:
    """VexError for keys that are not known."""
    statements: list[dict[str, Any]] = tomllib.loads(file.read_text(encoding="utf-8")).get(
        "statement", []
    )
    for statement in statements:
        if wrong := statement.keys() - KEYS:
            raise VexError(f"{file.name}: {', '.join(sorted(wrong))} is no key of a statement")
    return statements


def unjudged(weak: Iterable[Weakness], statements: Sequence[Mapping[str, Any]]) -> list[Weakness]:
    """The known weaknesses about which no statement is."""
    said = {(each["weakness"], name) for each in statements for name in each["packages"]}
    return [weakness for weakness in weak if (weakness.id, weakness.package) not in said]


def document(
    version: str, statements: Sequence[Mapping[str, Any]], versions: Mapping[str, str], at: datetime
) -> dict[str, Any]:
    """The file of this version of the program. `versions` are those of the locked packages: a statement
    about another package raises VexError."""
    return {
        "@context": "https://openvex.dev/ns/v0.2.0",
        "@id": f"urn:uuid:{uuid.uuid5(NAMESPACE, f'{version} {at.isoformat()}')}",
        "author": f"the maintainers of operator-panel {version}",
        "timestamp": at.astimezone(UTC).isoformat(timespec="seconds"),
        "version": 1,
        "statements": [_statement(each, version, versions) for each in statements],
    }


def _statement(about: Mapping[str, Any], version: str, versions: Mapping[str, str]) -> dict[str, Any]:
    if others := [name for name in about["packages"] if name not in versions]:
        raise VexError(f"{about['weakness']}: {', '.join(others)} is not locked")
    parts = [{"@id": f"pkg:pypi/{name}@{versions[name]}"} for name in about["packages"]]
    return {
        "vulnerability": {"name": about["weakness"]},
        "products": [{"@id": f"pkg:pypi/operator-panel@{version}", "subcomponents": parts}],
        "status": about["status"],
        **{key: about[key] for key in DETAILS if key in about},
    }
