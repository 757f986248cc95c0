"""The findings of `operator-panel doctor`: each has a stable code, a severity, what is wrong and what
to do about it. A new finding is a row of `wording.py`; docs/how-to/doctor.md is made from them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal, get_args

from app.diagnose import wording
from app.printable import readable

# An error keeps the panel, or a part of it, from working. A warning lets it work, but not always or not
# as meant. A note is worth knowing, and is no reason for another exit status.
Severity = Literal["error", "warning", "note"]
SEVERITIES: Final[tuple[Severity, ...]] = get_args(Severity)


@dataclass(frozen=True, slots=True)
class Kind:
    """`what` and `do` are sentences with `{name}` placeholders."""

    severity: Severity
    what: str
    do: str


_ROWS: Final[Mapping[Severity, wording.Rows]] = {
    "error": wording.ERRORS,
    "warning": wording.WARNINGS,
    "note": wording.NOTES,
}
KINDS: Final[Mapping[str, Kind]] = {
    code: Kind(severity, what, do)
    for severity, rows in _ROWS.items()
    for code, (what, do) in rows.items()
}


@dataclass(frozen=True, slots=True)
class Finding:
    """`about` is the name of what is wrong: a topic, an endpoint, a path. `robot` is the id of one of
    several robots, "" where the panel has one."""

    code: str
    about: str = ""
    robot: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def severity(self) -> Severity:
        return KINDS[self.code].severity

    @property
    def what(self) -> str:
        return self._filled(KINDS[self.code].what)

    @property
    def do(self) -> str:
        return self._filled(KINDS[self.code].do)

    def _filled(self, sentence: str) -> str:
        """The sentence with its details. Texts of robots and other programs are made printable."""
        return readable(sentence.format(about=self.about, **self.details))

    def as_json(self) -> dict[str, str]:
        found = {"severity": self.severity, "code": self.code, "about": readable(self.about)}
        return found | {"robot": self.robot, "what": self.what, "do": self.do}


@dataclass(slots=True)
class Report:
    """The results in order: `findings` are faults, `facts` are what is as it should be."""

    findings: list[Finding] = field(default_factory=list)
    facts: list[str] = field(default_factory=list)

    def find(self, code: str, about: str = "", *, robot: str = "", **details: Any) -> None:
        """Adds a finding; KeyError for a code that is no row of `KINDS`."""
        if code not in KINDS:
            raise KeyError(f'"{code}" is not a finding: add it to app/diagnose/wording.py')
        found = Finding(code, about, robot, details)
        if found not in self.findings:
            self.findings.append(found)

    def fact(self, text: str) -> None:
        self.facts.append(readable(text))

    @property
    def is_well(self) -> bool:
        """Whether there is neither an error nor a warning."""
        return all(found.severity == "note" for found in self.findings)

    def codes(self) -> list[str]:
        return [found.code for found in self.findings]
