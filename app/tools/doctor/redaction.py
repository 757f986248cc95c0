"""What of the doctor's findings and of the operator's log may be in a support bundle. All else that is
in one is marked in the models themselves (`app.system.public`)."""

import json
import re
from collections.abc import Iterator
from functools import cache
from typing import Any, Final

from app.panel.base import Description
from app.records.database import LogRow
from app.system.public import LEFT_OUT, LONGEST, public_part
from app.system.texts.catalogue import files
from app.tools.doctor.doctor import Diagnosis
from app.tools.doctor.findings import KINDS, Finding

# What a name or a value of a finding is like if it can hold no secret.
_ADDRESS: Final = r"[0-9a-fA-F:.]{2,45}|localhost"
_FORMS: Final = re.compile(
    r"[+\-]?\d{1,20}(?:\.\d{1,20})?|v?\d[\w.+\-]{0,60}"  # a number or a version
    # A ROS name, and not where a user has files.
    r"|(?:(?!/(?:home|root|mnt|media|tmp)/)/{1,2}[A-Za-z_]\w*(?:/\w+)*/?)?"
    r"|[a-z]\w*(?:/(?:msg|srv|action))?/[A-Z]\w*|(?:bool|integer|double|string)(?:\[\])?"  # a type
    r"|(?:tcp|udp|tls|quic|ws|wss|unixsock-stream)/[\w.:\[\]%\-]{1,200}"  # an endpoint
    rf"|[0-9a-f.\-]{{1,64}}|(?:{_ADDRESS}) port \d{{1,5}}"
    r"|(?:HDMI|DP|eDP|DVI|VGA|DSI|LVDS)(?:-[A-Z0-9]{1,3}){1,2}"  # a screen
    # The files of an installation.
    r"|/(?:etc|opt|var/lib|run)/operator-panel(?:/[\w.\-]{1,80}){0,6}"
    rf"|{'|'.join(files())}",
    re.ASCII,
)
# The place of a fault in the panel file: "page[0].widget[2].topic (line 5)".
_PART: Final = re.compile(r"([A-Za-z0-9_\-]+)((?:\[\d{1,6}\])?)")
_MORE: Final = re.compile(r" and \d{1,9} more")
_LINE: Final = re.compile(r" \(line \d{1,7}\)")
_CODE: Final = re.compile(r"[a-z][a-z0-9_]{0,63}")
OF_THE_FILE: Final = ("panel_fault", "type_unknown")


def public_report(diagnosis: Diagnosis, version: str) -> dict[str, Any]:
    report = diagnosis.report
    return {
        "version": version,
        "well": report.is_well,
        "passed": len(report.facts) + report.more_facts,
        "findings": [_finding(finding) for finding in report.findings],
        "more": dict(report.more),
    }


def _finding(finding: Finding) -> dict[str, str]:
    about = _place(finding.about) if finding.code in OF_THE_FILE else _names(finding.about)
    details = {name: _names(str(value)) for name, value in finding.details.items()}
    return {
        "severity": finding.severity,
        "code": finding.code,
        "about": about,
        "robot": finding.robot,
        "what": KINDS[finding.code].sentence.format(about=about, **details),
    }


def _names(text: str) -> str:
    """Each of the names that is of a known form; of an endpoint what is before its settings."""
    more = _MORE.search(text)
    names = [re.split("[?#]", name)[0] for name in text[: more.start() if more else None].split(", ")]
    shown = [name if len(name) <= LONGEST and _FORMS.fullmatch(name) else LEFT_OUT for name in names]
    return ", ".join(shown) + (more[0] if more else "")


def _place(text: str) -> str:
    """A place in the panel file, as far as its keys are those of panel files."""
    line = _LINE.search(text)
    parts = []
    for part in text[: line.start() if line else None].split("."):
        key = _PART.fullmatch(part)
        parts.append(part if key is not None and key[1] in _keys() else LEFT_OUT)
    return ".".join(parts) + (line[0] if line else "")


@cache
def _keys(model: type[Description] = Description) -> frozenset[str]:
    """All keys of a panel file."""
    own = {key for name, field in model.model_fields.items() for key in (name, field.alias) if key}
    return frozenset(own).union(*map(_keys, model.__subclasses__()))


def public_code(text: object) -> str:
    return text if isinstance(text, str) and _CODE.fullmatch(text) else ""


def public_entry(row: LogRow) -> dict[str, Any]:
    """An entry of the operator's log by its public columns, with the codes of its reason and of the
    sentences in that."""
    try:
        codes = list(_codes(json.loads(row.entry.text or "{}")))
    except (ValueError, RecursionError):
        codes = []
    shown = public_part(row.entry) | {"codes": codes}
    return {name: value for name, value in shown.items() if value not in ("", None, LEFT_OUT)}


def _codes(text: Any) -> Iterator[str]:
    if not isinstance(text, dict):
        return
    if code := public_code(text.get("code")):
        yield code
    for inner in text.get("params", {}).values():
        yield from _codes(inner)
