"""Values of the page of diagnostics as texts, in no language yet."""

import json
from typing import Any, Final

from app.clock import format_age, format_time
from app.dialect.peer_traits import EVERY_SENTENCES
from app.i18n import Param, Text, TextLike, number, render, say, text_in
from app.robot.round_trips import RoundTripSummary
from app.runtime.doctor_process import FoundFault
from app.runtime.node_round_trips import NodeRoundTrips
from app.view.diagnostic_rows import TopicRow
from app.view.link_status import LinkStatus

NOTHING: Final = "–"
LINK_FINDINGS: Final = frozenset(
    code
    for sentences in EVERY_SENTENCES
    for code in (sentences.absent, sentences.silent, "link_two_kinds")
)


def word(name: str, **about: Param) -> Text:
    return say(f"diagnostics_{name}", **about)


def look_word(name: str, **about: Param) -> Text:
    return say(f"look_{name}", **about)


def milliseconds(ms: float) -> TextLike:
    return number(f"{ms:.1f}" if ms < 10 else f"{ms:.0f}", "ms")


def trip_note(
    name: str, link: LinkStatus, trips: RoundTripSummary | None, to_node: NodeRoundTrips
) -> TextLike:
    """By what the round trips of a link were measured, or why there are none; "" where that is
    clear."""
    if trips is None and link["state"] != "ok":
        return ""  # the link says why
    if name == "node":
        return word(to_node.state, node=to_node.node)
    if trips is not None:
        return ""
    return word("trip_of_page") if name == "server" else word("trip_no_answer")


def rate_text(rate_hz: float | None) -> TextLike:
    if rate_hz is None:
        return NOTHING
    return number(f"{rate_hz:.{0 if rate_hz >= 100 else 1 if rate_hz >= 1 else 2}f}")


def size_text(size: int | None) -> TextLike:
    """Bytes, in units of 1000."""
    if size is None:
        return NOTHING
    if size < 1000:
        return number(str(size), "B")
    return number(f"{size / 1000:.1f}", "kB") if size < 1e6 else number(f"{size / 1e6:.1f}", "MB")


def age_text(age_s: float | None) -> TextLike:
    if age_s is None:
        return word("never")
    return number(f"{age_s:.1f}", "s") if age_s < 60 else format_age(age_s)


def qos_words(row: TopicRow) -> TextLike:
    """The QoS of both sides, as one text where they are alike. Volatile is what has no other word."""
    if not row.robot_qos:
        return word("no_subscriber" if row.use == "published" else "no_publisher")
    theirs, own = (_short(" / ".join(row.robot_qos)), _short(row.own_qos))
    if len(row.robot_qos) == 1 and {*own.split(", ")} - {""} <= {*theirs.split(", ")}:
        return word("qos_both", qos=theirs)
    return word("qos_sides", own=own or word("as_published"), theirs=theirs)


def finding_text(finding: FoundFault) -> TextLike:
    """What is wrong. In English if another version of the doctor says what this catalogue does not
    have."""
    code = finding.code if finding.code in LINK_FINDINGS else f"finding_{finding.code}"
    return _said(finding, code) or finding.sentence


def remedy_text(finding: FoundFault) -> TextLike:
    """What to do about it."""
    return _said(finding, f"finding_{finding.code}_do") or finding.do


def _said(finding: FoundFault, code: str) -> TextLike:
    """The sentence with the details of a finding; "" if the catalogue has none that they fit."""
    stored = {"code": code, "params": {**finding.details, "about": finding.about}}
    try:
        text = text_in(json.dumps(stored))
        render(text)
    except (KeyError, ValueError):
        return ""
    return text


def _short(qos: str) -> str:
    return qos.replace(", volatile", "")


def undecodable_text(row: TopicRow) -> TextLike:
    """ "" if all could be decoded."""
    if row.undecodable is None:
        return ""
    return word(
        "undecodable",
        count=row.undecodable_count,
        time=format_time(row.undecodable.wall),
        why=row.undecodable.reason,
        first=row.undecodable.first.hex(" "),
    )


TEXTS: Final[dict[str, Any]] = {
    "word": word,
    "look_word": look_word,
    "rate_text": rate_text,
    "size_text": size_text,
    "age_text": age_text,
    "qos_words": qos_words,
    "finding_text": finding_text,
    "remedy_text": remedy_text,
    "undecodable_text": undecodable_text,
    "time_text": lambda wall: format_time(wall) if wall else NOTHING,
}
