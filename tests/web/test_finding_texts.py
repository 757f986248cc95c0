"""Findings of the doctor on the page of diagnostics: in the language of its reader."""

import json
from typing import Any

import pytest

from app.cell.session.doctor_process import FoundFault
from app.system.texts import render, say
from app.tools.doctor.findings import KINDS, Report
from app.web.pages.diagnostics import finding_text, remedy_text

LANGUAGES = ("ja", "de")


class Anything(dict[str, str]):
    """Any detail has a value."""

    def __missing__(self, name: str) -> str:
        return f"<{name}>"


def told(code: str, **details: Any) -> FoundFault:
    """A finding as the process of the doctor prints it."""
    report = Report()
    report.find(code, "/topic", **details)
    return FoundFault.model_validate(json.loads(json.dumps(report.findings[0].as_json())))


def details_of(code: str) -> dict[str, Any]:
    """A value for each placeholder of its sentences."""
    seen = Anything()
    names: set[str] = set()

    class Names(Anything):
        def __missing__(self, name: str) -> str:
            names.add(name)
            return ""

    for sentence in (KINDS[code].sentence, KINDS[code].do):
        sentence.format_map(Names())
    return {name: seen[name] for name in names - {"about"}}


@pytest.mark.parametrize("code", KINDS)
@pytest.mark.parametrize("language", LANGUAGES)
def test_each_finding_has_its_sentences_with_all_values(code: str, language: str) -> None:
    finding = told(code, **details_of(code))
    shown = render(finding_text(finding), language), render(remedy_text(finding), language)
    english = finding.sentence, finding.do
    assert shown[1] != english[1]
    for name, value in (*details_of(code).items(), ("about", "/topic")):
        for translated, said in zip(shown, english, strict=True):
            assert (str(value) in translated) == (str(value) in said), (name, translated)


@pytest.mark.parametrize("language", LANGUAGES)
def test_sentences_within_a_finding_are_translated_too(language: str) -> None:
    finding = told("topic_no_publisher", hint=say("finding_hint", names=("/a", "/b")))
    assert finding.sentence == "No node publishes /topic. Did you mean /a, /b?"
    shown = render(finding_text(finding), language)
    assert "Did you mean" not in shown
    assert "/a" in shown
    finding = told("clock_differs", seconds="3.0", direction=say("finding_ahead"))
    assert "ahead" not in render(finding_text(finding), language)


def test_a_finding_of_another_version_is_shown_as_it_was_said() -> None:
    unknown = FoundFault.model_validate(
        {
            "severity": "note",
            "code": "comet",
            "about": "",
            "robot": "",
            "what": "A comet.",
            "do": "Duck.",
        }
    )
    assert (finding_text(unknown), remedy_text(unknown)) == ("A comet.", "Duck.")
    changed = told("topic_type", found="a", wanted="b").model_copy(update={"details": {}})
    assert finding_text(changed) == changed.sentence
