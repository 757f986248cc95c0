"""The report of a proof: JSON with a signature, and a page for the technical file."""

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from app.panel import Panel, load_panel
from app.records.log_key import LogKey
from app.system.errors import KioskError
from app.system.settings import shipped_path
from app.system.version import installed_version
from app.tools.prove.result import Proof, Result

TEMPLATE: Final = "proof.html"
# What each situation is, for a reader of the report.
SITUATIONS: Final[Mapping[str, str]] = {
    "permits": "permits: the control works",
    "forbids": "forbids",
    "never_seen": "never received",
    "old": "older than max_age_s",
    "other_type": "published with another type",
    "publisher_gone": "its publisher is gone",
    "robot_lost": "its robot is lost",
    "link_cut": "the link to the robot is cut",
    "no_control": "another page has control",
    "no_role": "without a role",
    "role_less": "a user without the role or group: refused",
    "role_enough": "a user with just the role and groups: it works",
    "unconfirmed": "not confirmed by a person: refused",
    "wrong_pin": "confirmed with a wrong PIN: refused",
    "same_person": "confirmed twice by the same person: refused",
    "shutdown": "the server is ending",
    "released": "ends when it is released",
    "page_gone": "ends when its page is gone",
    "no_beat": "ends when its page is silent",
    "raised": "raised, shown, acknowledged, returned",
}


@dataclass(frozen=True)
class Subject:
    """What was proved: the panel file and its SHA-256, and when (UTC)."""

    path: Path
    panel: Panel
    sha256: str
    at: datetime


def subject_of(path: Path) -> Subject:
    """The panel file as it is now. KioskError if it can't be used, or changes while it is read."""
    panel = load_panel(path)
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    if not sha256.startswith(panel.revision):
        raise KioskError(f"{path} was changed while it was read: try again")
    return Subject(path, panel, sha256, datetime.now(UTC))


def as_json(subject: Subject, proof: Proof) -> dict[str, Any]:
    """The report without its signature. Times are seconds, `at` is RFC 3339."""
    return {
        "panel": subject.path.name,
        "title": str(subject.panel.title),
        "sha256": subject.sha256,
        "version": installed_version(),
        "zenoh": installed_version("eclipse-zenoh"),
        "at": subject.at.astimezone(UTC).isoformat(timespec="seconds"),
        "kind": proof.kind,
        "server": proof.server,
        "watched_by": proof.watchers,
        "missing_steps": proof.missing,
        "holds": proof.holds,
        "cases": len(proof.results),
        "faults": len(proof.faults),
        "took_s": round(proof.took_s, 1),
        "browser": proof.browser,
        "left_out": dict(proof.left_out),
        "results": [_row(result) for result in in_order(proof.results)],
    }


def _row(result: Result) -> dict[str, Any]:
    took_s = None if result.took_s is None else round(result.took_s, 3)
    return {**result._asdict(), "took_s": took_s, "holds": not result.fault}


def in_order(results: Iterable[Result]) -> list[Result]:
    """By robot, control, interlock and situation: the same for each proof of a panel."""
    order = [*SITUATIONS]

    def place(row: Result) -> tuple[object, ...]:
        return row.robot, row.kind, row.name, row.guard, order.index(row.situation)

    return sorted(results, key=place)


def signed(report: Mapping[str, Any], key: LogKey | None) -> dict[str, Any]:
    """The report with the signature of its canonical JSON by the operator's log's key, if there is
    one."""
    if key is None:
        return {**report, "key": "", "signature": ""}
    return {**report, "key": key.public, "signature": key.signed(canonical(report))}


def canonical(report: Mapping[str, Any]) -> bytes:
    """The bytes that are signed: JSON with sorted keys, without spaces, in UTF-8, without `key` and
    `signature`."""
    own = {name: value for name, value in report.items() if name not in ("key", "signature")}
    return json.dumps(own, sort_keys=True, ensure_ascii=False, separators=(",", ":")).encode()


def as_html(report: Mapping[str, Any]) -> str:
    """The report as a page for the screen and for paper."""
    rows: Sequence[Mapping[str, Any]] = report["results"]
    longest: dict[str, float] = {}
    for row in rows:
        if row["took_s"] is not None and not row["fault"]:
            longest[row["situation"]] = max(longest.get(row["situation"], 0.0), row["took_s"])
    environment = Environment(
        loader=FileSystemLoader(shipped_path("templates")), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    counts = Counter(row["situation"] for row in rows)
    return environment.get_template(TEMPLATE).render(
        report=report,
        situations=SITUATIONS,
        counts=counts,
        longest=longest,
        live=report["kind"] == "live",
        robots=any(row["robot"] for row in rows),
    )


def as_text(proof: Proof) -> str:
    """What the command prints: each fault, and a line that sums up."""
    lines = [
        f"{f'robot {row.robot}, ' if row.robot else ''}{row.kind} {row.name}"
        f"{f', interlock {row.guard}' if row.guard else ''}:"
        f" {SITUATIONS[row.situation]}: {row.fault}"
        for row in in_order(proof.faults)
    ]
    lines += [f"not proved: {name}: {why}" for name, why in sorted(proof.left_out.items())]
    verdict = "every case holds" if not proof.faults else f"{len(proof.faults)} do not hold"
    if proof.missing:
        verdict = f"{verdict}, {proof.missing} steps were not reached"
    took = f" in {proof.took_s:.0f} s" if proof.kind == "simulated" else ""
    lines.append(f"{len(proof.results)} cases{took}: {verdict}")
    return "\n".join(lines)
