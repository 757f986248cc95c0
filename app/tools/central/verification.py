"""Verifies what the centre has of each panel: the chain and the signed heads of its log, by the rules
of `operator-panel log verify`, and the numbers of the other streams."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from app.cell.forward.streams import STREAMS, entry_of
from app.records.entry import Entry
from app.records.verify import Chain, Signed, SignedPart
from app.tools.central.schema import TABLES

if TYPE_CHECKING:
    from app.tools.central.schema import Database

AT_ONCE: Final = 2_000  # entries that are in memory
COLUMNS: Final = ", ".join(f'"{name}"' for name in STREAMS["log"].columns)


class PanelRow(NamedTuple):
    """A panel of the centre, by its number; `key` signs its log."""

    number: int
    name: str
    key: str
    is_retired: bool


@dataclass(slots=True)
class Finding:
    """What is wrong, or only to be known (`is_note`), with a stream of a panel."""

    panel: str
    stream: str
    text: str
    is_note: bool = False

    def __str__(self) -> str:
        return f"{self.panel}: {self.stream}: {self.text}"


@dataclass(slots=True)
class PanelResult:
    """The result of one panel: how many entries its log has, up to which they are signed, and what was
    found."""

    panel: PanelRow
    entries: int = 0
    signed: Signed = field(default_factory=Signed)
    findings: list[Finding] = field(default_factory=list)


def panels(db: "Database", name: str = "") -> list[PanelRow]:
    """The panels, by name; only those with this name, if one is given."""
    rows = db.execute(
        "SELECT id, name, key, retired IS NOT NULL FROM operator_panel.panel"
        " WHERE %s IN ('', name) ORDER BY name, id",
        (name,),
    ).fetchall()
    return [PanelRow(*row) for row in rows]


def verify_panel(db: "Database", panel: PanelRow, keys: Mapping[str, str]) -> PanelResult:
    """`keys` are those that were noted elsewhere, by the panel's name."""
    result = PanelResult(panel)
    noted = keys.get(panel.name)
    if noted is not None and not panel.is_retired and noted != panel.key:
        text = f"the centre names the key {panel.key}, and not the noted {noted}"
        result.findings.append(Finding(panel.name, "log", text))
    explained = _Explained(db, panel.number)
    last = 0
    for generation in _generations(db, panel.number):
        part = _LogPart(panel, generation, noted or panel.key, explained, last)
        result.findings += part.findings(_entries(db, panel.number, generation))
        result.entries += part.count
        result.signed, last = part.signed, part.last
    result.findings += _end_findings(db, panel)
    for stream in STREAMS.values():
        if stream.dense and not stream.chained:
            result.findings += _gaps(db, panel, stream.name, explained)
    return result


def _generations(db: "Database", panel: int) -> list[int]:
    rows = db.execute(
        "SELECT DISTINCT generation FROM operator_panel.log WHERE panel = %s ORDER BY 1", (panel,)
    )
    return [row[0] for row in rows.fetchall()]


def _entries(db: "Database", panel: int, generation: int) -> Iterator[tuple[Entry, datetime]]:
    """The entries of a panel in order, with the time of their row."""
    after = 0
    while True:
        rows = db.execute(
            f"SELECT seq, at, {COLUMNS} FROM operator_panel.log"
            " WHERE panel = %s AND generation = %s AND seq > %s ORDER BY seq, at LIMIT %s",
            (panel, generation, after, AT_ONCE),
        ).fetchall()
        for seq, at, *values in rows:
            yield entry_of(values, seq), at
            after = seq
        if len(rows) < AT_ONCE:
            return


class _Explained:
    """What a panel itself, or `prune`, has noted about rows that are not there."""

    def __init__(self, db: "Database", panel: int) -> None:
        def rows(query: str) -> list[tuple[Any, ...]]:
            return db.execute(query, (panel,)).fetchall()

        self.beginnings = {
            (stream, generation): (first, prev)
            for stream, generation, first, prev in rows(
                "SELECT stream, generation, first, prev FROM operator_panel.beginning WHERE panel = %s"
            )
        }
        self.pruned = {
            (stream, generation): (upto, digest)
            for stream, generation, upto, digest in rows(
                "SELECT stream, generation, upto, hash FROM operator_panel.pruned WHERE panel = %s"
                " ORDER BY upto"
            )
        }
        self.gaps = {
            (stream, generation, first, last): reason
            for stream, generation, first, last, reason in rows(
                'SELECT stream, generation, first, "last", reason FROM operator_panel.gap'
                " WHERE panel = %s"
            )
        }

    def begin_fault(self, generation: int, first: Entry) -> str:
        """What is wrong with the first entry that the centre has, "" if it may be the first."""
        upto, digest = self.pruned.get(("log", generation), (0, ""))
        if upto == first.seq - 1 and digest == first.prev and first.kind == "signed":
            return ""
        if first.seq == 1 or (first.seq, first.prev) == self.beginnings.get(("log", generation)):
            return ""
        if upto >= first.seq:
            return f"entry {first.seq} is there, though entries up to {upto} were pruned"
        return f"the entries before {first.seq} are missing, and not by prune"


class _LogPart:
    """The log of one panel and generation: each fault is named, and what follows it is verified too."""

    def __init__(
        self, panel: PanelRow, generation: int, key: str, explained: _Explained, before: int
    ) -> None:
        """`before` is the last number of the generation before."""
        self._panel = panel
        self._generation = generation
        self._signed = SignedPart((key,))
        self._explained = explained
        self._before = before
        self.count = self.last = 0

    @property
    def signed(self) -> Signed:
        return self._signed.result

    def findings(self, entries: Iterable[tuple[Entry, datetime]]) -> Iterator[Finding]:
        chain: Chain | None = None
        before: tuple[Entry, datetime] | None = None
        missing: list[tuple[int, str, Finding]] = []  # to the last number, with the hash of its entry
        for entry, at in entries:
            self.count, self.last = self.count + 1, entry.seq
            if entry.kind == "removed":
                _confirm(missing, entry)
            if chain is None:
                chain = Chain(entry.prev, "", self._signed)
                yield from self._begin(entry, at)
                fault = chain.begin_at(entry) or self._signed.fault(entry)
            else:
                fault = chain.fault(entry)
                if fault and before is not None and entry.seq > before[0].seq + 1:
                    finding = self._missing(before, (entry, at))
                    missing.append((entry.seq - 1, entry.prev, finding))
                    yield finding
                    fault = chain.begin_at(entry) or self._signed.fault(entry)
                elif fault:
                    chain.begin_at(entry)
            if fault:
                yield self._finding(f"{fault} ({_time(at)})")
            before = entry, at
        if fault := self._signed.end_fault():
            yield self._finding(fault, is_note=self.count == 0)

    def _begin(self, entry: Entry, at: datetime) -> Iterator[Finding]:
        if fault := self._explained.begin_fault(self._generation, entry):
            yield self._finding(f"{fault} ({_time(at)})")
        if self._generation:
            yield self._finding(
                f"the cell's log was replaced or restored: from entry {entry.seq} on, {_time(at)}, it"
                f" is another one than the centre had up to entry {self._before}",
                is_note=True,
            )

    def _missing(self, before: tuple[Entry, datetime], after: tuple[Entry, datetime]) -> Finding:
        first, last = before[0].seq + 1, after[0].seq - 1
        names = f"entry {first} is" if first == last else f"entries {first} to {last} are"
        reason = self._explained.gaps.get(("log", self._generation, first, last), "")
        told = f": {reason}" if reason else ""
        return self._finding(f"{names} missing, between {_time(before[1])} and {_time(after[1])}{told}")

    def _finding(self, text: str, *, is_note: bool = False) -> Finding:
        return Finding(self._panel.name, "log", text, is_note)


def _confirm(missing: Sequence[tuple[int, str, Finding]], entry: Entry) -> None:
    """Where an entry of the cell's log, which is signed later, says that the cell itself removed what
    is missing, that is no fault."""
    try:
        values = json.loads(entry.values)
        removed = values["last"], values["hash"]
    except (ValueError, LookupError, TypeError):
        return
    for last, digest, finding in missing:
        if removed == (last, digest):
            finding.is_note = True


def _end_findings(db: "Database", panel: PanelRow) -> Iterator[Finding]:
    """The panel notes once a minute up to which entry the centre had its log."""
    row = db.execute(
        "SELECT h.log_generation, h.log_seq, h.at, (SELECT max(seq) FROM operator_panel.log l"
        " WHERE l.panel = h.panel AND l.generation = h.log_generation) FROM operator_panel.health h"
        " WHERE h.panel = %s AND h.log_seq > 0 ORDER BY h.generation DESC, h.seq DESC LIMIT 1",
        (panel.number,),
    ).fetchone()
    if row is not None and row[1] > (row[3] or 0):
        yield Finding(
            panel.name,
            "log",
            f"entries {(row[3] or 0) + 1} to {row[1]} are missing at the end: the centre had them at"
            f" {_time(row[2])}",
        )


def _gaps(db: "Database", panel: PanelRow, stream: str, explained: _Explained) -> Iterator[Finding]:
    """Numbers that are missing in a stream whose numbers follow one another."""
    rows = db.execute(
        "SELECT generation, before, seq, before_at, at FROM (SELECT generation, seq, at,"
        " lag(seq) OVER w AS before, lag(at) OVER w AS before_at"
        f" FROM operator_panel.{TABLES[stream]} WHERE panel = %s"
        " WINDOW w AS (PARTITION BY generation ORDER BY seq)) AS numbered"
        " WHERE before IS NULL OR seq > before + 1 ORDER BY generation, seq",
        (panel.number,),
    ).fetchall()
    for generation, before, seq, before_at, at in rows:
        begins = explained.beginnings.get((stream, generation), (1, ""))[0]
        upto = explained.pruned.get((stream, generation), (0, ""))[0]
        first = before + 1 if before is not None else begins
        if seq <= max(first, upto + 1):
            continue
        reason = explained.gaps.get((stream, generation, first, seq - 1), "")
        since = f"between {_time(before_at)} and {_time(at)}" if before_at else f"before {_time(at)}"
        told = f": {reason}" if reason else ""
        text = f"rows {first} to {seq - 1} are missing, {since}{told}"
        yield Finding(panel.name, stream, text, is_note=bool(reason))


def _time(at: datetime) -> str:
    return at.astimezone(UTC).isoformat(timespec="seconds")
