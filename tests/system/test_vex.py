"""What an OpenVEX file says of what is installed."""

import json
from pathlib import Path
from typing import Any, Final

import pytest

from app.system.errors import SettingsError
from app.system.inventory import Component
from app.system.vex import is_meant, parse_vex, read_vex, verdicts

OWN: Final = Component("operator-panel", "0.2.0")
PILLOW: Final = Component("pillow", "12.0.0")
INSTALLED: Final = (OWN, PILLOW, Component("cpython", "3.11.7", kind="generic"))


def product(purl: str, *inner: str) -> dict[str, Any]:
    return {"@id": purl, "subcomponents": [{"@id": each} for each in inner]}


def statement(status: str, *products: dict[str, Any], name: str = "CVE-2026-1", **more: Any) -> Any:
    return {"vulnerability": {"name": name}, "products": list(products), "status": status, **more}


def document(*statements: Any, **more: Any) -> dict[str, Any]:
    return {
        "@context": "https://openvex.dev/ns/v0.2.0",
        "@id": "https://example.org/vex/1",
        "author": "The maintainers",
        "timestamp": "2026-11-01T00:00:00Z",
        "version": 1,
        "statements": list(statements),
        **more,
    }


def judged(*statements: Any) -> list[tuple[str, str, str]]:
    told = verdicts(parse_vex(document(*statements)), INSTALLED)
    return [(each.weakness, each.component.name, each.status) for each in told]


def test_a_file_without_statements_has_its_time() -> None:
    vex = parse_vex(document())
    assert (vex.statements, vex.at.date().isoformat()) == ((), "2026-11-01")


DO: Final = {"action_statement": "Update to 0.2.1."}
IN_PANEL: Final = product("pkg:pypi/operator-panel@0.2.0", "pkg:pypi/pillow@12.0.0")


def test_each_status_is_told_and_what_is_affected_comes_first() -> None:
    assert judged(
        statement("not_affected", IN_PANEL, name="CVE-1", justification="component_not_present"),
        statement("under_investigation", IN_PANEL, name="CVE-2"),
        statement("fixed", product("pkg:pypi/operator-panel@0.2.0"), name="CVE-3"),
        statement("affected", IN_PANEL, name="CVE-4", **DO),
    ) == [
        ("CVE-4", "pillow", "affected"),
        ("CVE-2", "pillow", "under_investigation"),
        ("CVE-3", "operator-panel", "fixed"),
        ("CVE-1", "pillow", "not_affected"),
    ]


@pytest.mark.parametrize(
    "meant",
    [
        product("pkg:pypi/operator-panel@0.1.0", "pkg:pypi/pillow@12.0.0"),  # another release
        product("pkg:pypi/operator-panel@0.2.0", "pkg:pypi/pillow@11.0.0"),  # another version in it
        product("pkg:pypi/operator-panel@0.2.0", "pkg:pypi/not-installed"),
        product("pkg:npm/operator-panel@0.2.0"),
    ],
)
def test_statements_about_others_say_nothing(meant: dict[str, Any]) -> None:
    assert judged(statement("affected", meant, **DO)) == []


def test_the_newest_statement_of_a_weakness_counts() -> None:
    affected = statement("affected", IN_PANEL, **DO)
    fixed = statement("fixed", IN_PANEL, timestamp="2026-11-02T00:00:00Z")
    expected = [("CVE-2026-1", "pillow", "fixed")]
    assert judged(affected, fixed) == judged(fixed, affected) == expected
    older = statement("fixed", IN_PANEL, timestamp="2026-10-01T00:00:00Z")
    assert judged(affected, older) == [("CVE-2026-1", "pillow", "affected")]


@pytest.mark.parametrize(
    ("purl", "expected"),
    [
        ("pkg:pypi/Pillow", True),
        ("pkg:pypi/pillow@12.0.0?arch=x86#sub", True),
        ("pkg:pypi/pillow@12.0.0.1", False),
        ("pkg:pypi/pillow-simd@12.0.0", False),
    ],
)
def test_a_purl_names_a_package_as_indexes_compare_it(purl: str, expected: bool) -> None:
    assert is_meant(purl, PILLOW) is expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "is not JSON"),
        ("[" * 100_000, "is not JSON"),
        ("[]", "the document must be an object"),
        (json.dumps(document(**{"@context": "https://cyclonedx.org"})), '"@context" must begin with'),
        (json.dumps(document(statements={})), '"statements" must be a list'),
        (json.dumps(document(statement("affected", IN_PANEL))), "has no action_statement"),
        (json.dumps(document(statement("not_affected", IN_PANEL))), "has no justification"),
        (json.dumps(document(statement("good", IN_PANEL))), "status must be one of affected"),
        (json.dumps(document(statement("fixed", {"@id": "pillow"}))), "has no purl"),
        (json.dumps(document(statement("fixed"))), "products must be a list"),
        (json.dumps(document(statement("fixed", IN_PANEL), timestamp="soon")), "in ISO 8601"),
    ],
)
def test_what_is_not_openvex_is_refused_with_its_place(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "vex.json"
    file.write_text(text)
    with pytest.raises(SettingsError, match=words) as refused:
        read_vex(file)
    assert str(file) in str(refused.value)


def test_texts_are_printable_and_short() -> None:
    (statement_read,) = parse_vex(
        document(statement("affected", IN_PANEL, action_statement="do\x1b[2J" + "x" * 1000))
    ).statements
    assert "\x1b" not in statement_read.detail
    assert len(statement_read.detail) <= 301
