"""The doctor's findings for a support bundle: codes, and names that are known to be harmless."""

import re
from typing import Any, Final

from app.diagnose.doctor import Diagnosis
from app.diagnose.findings import KINDS, Finding
from app.diagnose.harmless import (
    ADDRESS,
    ENDPOINT,
    HEX,
    LEFT_OUT,
    PLACE,
    ROS_NAME,
    harmless,
    words,
)
from app.diagnose.harmless_keys import DETAILS, PANEL
from app.i18n.catalogue import files

_PORT: Final = re.compile(rf"(?:{ADDRESS.pattern}) port \d{{1,5}}")
_SCREEN: Final = re.compile(r"(?:HDMI|DP|eDP|DVI|VGA|DSI|LVDS)(?:-[A-Z0-9]{1,3}){1,2}")
_ABOUT: Final = (ENDPOINT, ROS_NAME, HEX, PLACE, _PORT, _SCREEN, words(" ".join(files())))
# The place of a fault in the panel file: "page[0].widget[2].topic (line 5)".
_PART: Final = re.compile(r"([A-Za-z0-9_\-]+)((?:\[\d{1,6}\])?)")
_MORE: Final = re.compile(r" and \d{1,9} more")
_LINE: Final = re.compile(r" \(line \d{1,7}\)")
OF_THE_FILE: Final = ("panel_fault", "type_unknown")


def harmless_report(diagnosis: Diagnosis, version: str) -> dict[str, Any]:
    report = diagnosis.report
    return {
        "version": version,
        "well": report.is_well,
        "passed": len(report.facts) + report.more_facts,
        "findings": [_finding(finding) for finding in report.findings],
        "more": dict(report.more),
    }


def _finding(finding: Finding) -> dict[str, str]:
    about = _place(finding.about) if finding.code in OF_THE_FILE else _names(finding.about, *_ABOUT)
    details = {
        name: _names(str(value), rule) if (rule := DETAILS.get(name)) else LEFT_OUT
        for name, value in finding.details.items()
    }
    sentence = KINDS[finding.code].sentence.format(about=about, **details)
    shown = {"severity": finding.severity, "code": finding.code, "about": about}
    return shown | {"robot": finding.robot, "what": sentence}


def _names(text: str, *expected: re.Pattern[str]) -> str:
    """Each of the names if one of the rules expects it."""
    more = _MORE.search(text)
    shown = []
    for name in text[: more.start() if more else None].split(", "):
        kept = (harmless(name, rule) for rule in expected)
        shown.append(next((name for name in kept if name != LEFT_OUT), LEFT_OUT))
    return ", ".join(shown) + (more[0] if more else "")


def _place(text: str) -> str:
    """A place in the panel file, as far as its keys are those of panel files."""
    line = _LINE.search(text)
    parts = []
    for part in text[: line.start() if line else None].split("."):
        key = _PART.fullmatch(part)
        parts.append(part if key is not None and key[1] in PANEL else LEFT_OUT)
    return ".".join(parts) + (line[0] if line else "")
