"""The units' log for a support bundle: how many lines of each level there were, and which errors. The
lines themselves have what operators typed and what other programs wrote, so none of them is in it."""

import builtins
import json
import re
import shutil
import subprocess
from collections import Counter
from collections.abc import Sequence
from threading import Timer
from typing import Any, Final

from app.system import errors

LAST_S: Final = 3600.0
UNITS: Final = ("operator-panel*", "zenoh-bridge*")
WITHIN_S: Final = 20.0
MOST_BYTES: Final = 16_000_000  # that are read, the newest first
MOST_LINES: Final = 20_000
LONGEST_LINE: Final = 4_000
_UNIT: Final = re.compile(r"(?:operator-panel|zenoh-bridge)[\w.@\-]{0,60}", re.ASCII)
_COLOURS: Final = re.compile(r"\x1b\[[\d;]{0,20}m")
_LEVEL: Final = re.compile(r"(?:\S{10,40} +|\[)(TRACE|DEBUG|INFO|WARN|ERROR|FATAL)\b")
_RAISED: Final = re.compile(r"\s*(?:[a-z]\w*\.){0,9}([A-Z]\w{1,40})(?=:|$)", re.ASCII)
ERRORS: Final = {*dir(builtins), *vars(errors), "ZError", "JSONDecodeError", "ValidationError"}


def journal(units: Sequence[str] = UNITS) -> bytes:
    """The last hour of the units' lines, the newest first, as JSON; b"" where there is no journal."""
    program = shutil.which("journalctl")
    if program is None:
        return b""
    options = ["--no-pager", "--quiet", "--reverse", "--output=json"]
    options += ["--output-fields=MESSAGE,_SYSTEMD_UNIT", f"--since=-{LAST_S:.0f}s"]
    options += [f"--lines={MOST_LINES}", *(f"--unit={unit}" for unit in units)]
    try:
        process = subprocess.Popen(
            [program, *options], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
    except OSError:
        return b""
    with process:
        timer = Timer(WITHIN_S, process.kill)
        timer.start()
        assert process.stdout is not None
        text = process.stdout.read(MOST_BYTES)
        timer.cancel()
        process.kill()
    return text


def journal_counts(text: bytes) -> dict[str, dict[str, int]]:
    """Unit → level or error → number of its lines; the unit "" for lines about the units."""
    counts: dict[str, Counter[str]] = {}
    for line in text.splitlines()[:MOST_LINES]:
        try:
            fields = json.loads(line)
        except (ValueError, RecursionError):
            continue  # one that was cut off
        unit, message = _text(fields, "_SYSTEMD_UNIT"), _text(fields, "MESSAGE")
        named = unit if _UNIT.fullmatch(unit) else ""
        counts.setdefault(named, Counter())[_kind(_COLOURS.sub("", message[:LONGEST_LINE]))] += 1
    return {unit: dict(levels) for unit, levels in sorted(counts.items())}


def _kind(message: str) -> str:
    if level := _LEVEL.match(message):
        return level[1]
    raised = _RAISED.match(message)
    return raised[1] if raised and raised[1] in ERRORS else "other"


def _text(fields: Any, name: str) -> str:
    """Bytes that are not UTF-8 come as numbers: they are no text of ours."""
    text = fields.get(name) if isinstance(fields, dict) else None
    return text if isinstance(text, str) else ""
