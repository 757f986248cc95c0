"""The findings of `operator-panel doctor`: each has a stable code, a severity, what is wrong and what
to do about it. A new finding is a code in `wording.py` and its two sentences in the catalogue;
docs/how-to/doctor.md is made from them.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, get_args

from app.system.printable import one_line
from app.system.texts import ENGLISH, Text, TextLike, render, say, sentences
from app.tools.doctor import wording

MOST_ALIKE: Final = 20  # findings of one code about one robot; others are counted
MOST_FACTS: Final = 200
MOST_TEXT: Final = 1000  # characters of a detail
MOST_NAMED: Final = 3

# An error keeps the panel, or a part of it, from working. A warning lets it work, but not always or not
# as meant. A note is worth knowing, and is no reason for another exit status.
Severity = Literal["error", "warning", "note"]
SEVERITIES: Final[tuple[Severity, ...]] = get_args(Severity)


@dataclass(frozen=True, slots=True)
class Kind:
    """`sentence` and `do` are the English sentences, with `{name}` placeholders."""

    severity: Severity
    sentence: str
    do: str


_CODES: Final[Mapping[Severity, Sequence[str]]] = {
    "error": wording.ERRORS,
    "warning": wording.WARNINGS,
    "note": wording.NOTES,
}
KINDS: Final[Mapping[str, Kind]] = {
    code: Kind(
        severity,
        sentences(ENGLISH)[wording.sentence_code(code)],
        sentences(ENGLISH)[wording.remedy_code(code)],
    )
    for severity, codes in _CODES.items()
    for code in codes
}


@dataclass(frozen=True, slots=True)
class Finding:
    """`about` is the name of what is wrong: a topic, an endpoint, a path. `robot` is the id of one of
    several robots, "" where the panel has one. A detail that a person reads may be a Text."""

    code: str
    about: str = ""
    robot: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def severity(self) -> Severity:
        return KINDS[self.code].severity

    @property
    def sentence(self) -> str:
        return render(self.text)

    @property
    def do(self) -> str:
        return render(say(wording.remedy_code(self.code), **self._params()))

    @property
    def text(self) -> Text:
        """What is wrong."""
        return say(wording.sentence_code(self.code), **self._params())

    @property
    def is_named(self) -> bool:
        """Whether the sentence has the name that it is about."""
        return not self.about or "{about}" in KINDS[self.code].sentence

    def _params(self) -> dict[str, TextLike]:
        """The details. Texts of robots and other programs are made printable."""
        return {
            name: text if isinstance(text, Text) else one_line(str(text), MOST_TEXT)
            for name, text in {**self.details, "about": self.about}.items()
        }

    def as_json(self) -> dict[str, Any]:
        finding = {
            "severity": self.severity,
            "code": self.code,
            "about": one_line(self.about, MOST_TEXT),
        }
        written = {
            name: text.as_json() if isinstance(text, Text) else text
            for name, text in self._params().items()
            if name != "about"
        }
        told = {"robot": self.robot, "what": self.sentence, "do": self.do}
        return finding | told | {"details": written}


def few(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"{', '.join(names[:MOST_NAMED])}{more}"


@dataclass(slots=True)
class Report:
    """The results in order: `findings` are faults, `facts` are what is as it should be. What is beyond
    a limit is counted: `more` by code, `more_facts`."""

    findings: list[Finding] = field(default_factory=list)
    facts: list[str] = field(default_factory=list)
    more: Counter[str] = field(default_factory=Counter)
    more_facts: int = 0
    _known: Counter[tuple[str, str]] = field(default_factory=Counter)  # by code and robot

    def find(self, code: str, about: str = "", *, robot: str = "", **details: Any) -> None:
        """Adds a finding; KeyError for a code that is no row of `KINDS`."""
        if code not in KINDS:
            raise KeyError(f'"{code}" is not a finding: add it to app/tools/doctor/wording.py')
        if self._known[code, robot] >= MOST_ALIKE:
            self.more[code] += 1
            return
        finding = Finding(code, about, robot, details)
        if finding not in self.findings:
            self.findings.append(finding)
            self._known[code, robot] += 1

    def fact(self, text: str) -> None:
        if len(self.facts) < MOST_FACTS:
            self.facts.append(one_line(text, MOST_TEXT))
        else:
            self.more_facts += 1

    @property
    def is_well(self) -> bool:
        """Whether there is neither an error nor a warning."""
        return all(finding.severity == "note" for finding in self.findings)

    def count(self, severity: Severity) -> int:
        """How many findings of a severity there are, with those that are only counted."""
        more = sum(number for code, number in self.more.items() if KINDS[code].severity == severity)
        return more + sum(finding.severity == severity for finding in self.findings)

    def codes(self) -> list[str]:
        return [finding.code for finding in self.findings]
