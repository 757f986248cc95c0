"""The tables of findings in docs/how-to/doctor.md, made from app/tools/doctor/wording.py."""

import re

from app.tools.doctor.findings import KINDS, SEVERITIES


def findings_tables() -> dict[str, str]:
    """Name of the section → table, one for each severity."""
    return {f"findings {severity}": _table(severity) for severity in SEVERITIES}


def _table(severity: str) -> str:
    rows = [
        (f"`{code}`", _italic_names(kind.sentence), _italic_names(kind.do))
        for code, kind in KINDS.items()
        if kind.severity == severity
    ]
    lines = [("Code", "What is wrong", "What to do"), ("---",) * 3, *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _italic_names(sentence: str) -> str:
    """With `…` for the name that it is about, and names of the other parameters in italics."""
    text = sentence.replace("{about}", "…").replace("{hint}", "")
    return re.sub(r"\{(\w+)\}", lambda match: f"*{match[1].replace('_', ' ')}*", text)
