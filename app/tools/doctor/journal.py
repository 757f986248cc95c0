"""The units' log for a support bundle: each line by the program's own sentence, with the parameters
that are known to be harmless. What operators typed, and what others wrote, is left out."""

import ast
import builtins
import json
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from threading import Timer
from typing import Any, Final

from app.system import errors
from app.system.settings import PACKAGE
from app.tools.doctor.redaction import (
    HEX,
    ID,
    LEFT_OUT,
    NUMBER,
    ROS_KEY,
    ROS_TYPE,
    Rule,
    redact,
    rules,
    words,
)

LAST_S: Final = 3600.0
UNITS: Final = ("operator-panel*", "zenoh-bridge*")
WITHIN_S: Final = 20.0
MOST_BYTES: Final = 16_000_000  # that are read, the newest first
MOST_LINES: Final = 20_000
LONGEST_LINE: Final = 4_000
FIELDS: Final = "MESSAGE,PRIORITY,_SYSTEMD_UNIT,UNIT"
LEVELS: Final = ("debug", "info", "warning", "error", "exception", "critical", "log")
LEAST_LETTERS: Final = 5  # of a sentence that tells anything
GAP: Final = "…"
_SLOT: Final = re.compile(r"%(\.\*)?[-+ #0]*\d*(?:\.\d+)?([sdifgrx%])")
_ROS_LINE: Final = re.compile(r"\[(DEBUG|INFO|WARN|ERROR|FATAL)\] \[[\d.]+\] \[\w+\]: (.*)", re.DOTALL)
_BRIDGE: Final = re.compile(
    r"\S{10,40} +(TRACE|DEBUG|INFO|WARN|ERROR) [^{}]{0,80}?(zenoh\w*(?:::\w+)*): "
)
_FRAME: Final = re.compile(r'\s*File "[^"\n]*?/(app/[\w/]+\.py)", line (\d{1,6}), in ')
_RAISED: Final = re.compile(r"\s*(?:[a-z]\w*\.){0,9}([A-Z]\w{1,40})(?=:|$)", re.ASCII)
_COLOURS: Final = re.compile(r"\x1b\[[\d;]{0,20}m")
_BRIDGES: Final = "zenoh-bridge"
_PRESS: Final = re.compile(r"[0-9a-f\-]{8,40}")
_UNIT: Final = re.compile(r"(?:operator-panel|zenoh-bridge)[\w.@\-]{0,60}", re.ASCII)
# Arguments of the program's own log calls, as they are written there.
ARGUMENTS: Final = rules(
    ("press.id press.press press_id goal.press_id", _PRESS),
    ("receipt.id body.id", _PRESS),
    ("press.widget.id widget.id receipt.widget", ID),
    ("key topic node widget.node node.name request.service widget.action", ROS_KEY),
    ("zid self.head.hash", HEX),
    ("type_name", ROS_TYPE),
    ("unit", _UNIT),
    ("exit_code", words("exited killed dumped")),
    ("exit_status", re.compile(r"\d{1,3}/[A-Z_\-]{1,20}")),
)
ERRORS: Final = {*dir(builtins), *vars(errors), "ZError", "JSONDecodeError", "ValidationError"}
# Lines of systemd and of the web server.
OTHERS: Final[tuple[tuple[str, ...], ...]] = (
    ("Started server process [%d]",),
    ("Finished server process [%d]",),
    ("Waiting for application startup.",),
    ("Application startup complete.",),
    ("Application startup failed. Exiting.",),
    ("Waiting for application shutdown.",),
    ("Application shutdown complete.",),
    ("Shutting down",),
    ("Uvicorn running on %s",),
    ("Traceback (most recent call last):",),
    ("Starting %s - %s", "unit"),
    ("Started %s - %s", "unit"),
    ("Stopping %s - %s", "unit"),
    ("Stopped %s - %s", "unit"),
    ("%s: Main process exited, code=%s, status=%s", "unit", "exit_code", "exit_status"),
    ("%s: Failed with result %s", "unit"),
    ("%s: Scheduled restart job, restart counter is at %d.", "unit"),
    ("%s: Watchdog timeout (limit %s)!", "unit"),
    ("%s: A process of this unit has been killed by the OOM killer.", "unit"),
    ("%s: Consumed %s CPU time%s", "unit"),
    ("%s: Deactivated successfully.", "unit"),
)


@dataclass(frozen=True, slots=True)
class Sentence:
    """A sentence of the program: `fixed` are the texts around its slots, of which each has a rule."""

    fixed: tuple[str, ...]
    slots: tuple[Rule, ...]

    def shown(self, line: str) -> str | None:
        """The line with its harmless parameters; None if it is not this sentence. What follows a
        parameter that is left out may be a part of it, so it is left out too. Linear."""
        if not line.startswith(self.fixed[0]):
            return None
        parts, at, trusted = [self.fixed[0]], len(self.fixed[0]), True
        for rule, text in zip(self.slots, self.fixed[1:], strict=True):
            end = line.find(text, at) if text else len(line)
            if end < 0:
                return None
            kept = redact(line[at:end], rule) if trusted else LEFT_OUT
            trusted = kept != LEFT_OUT
            parts += [kept if trusted else GAP, text]
            at = end + len(text)
        return "".join(parts) if at == len(line) or not trusted else None


def sentence(text: str, arguments: Sequence[str] = ()) -> Sentence:
    """Of a format of `logging`, with its arguments as they are written in the source."""
    fixed, slots, at, left = [""], list[Rule](), 0, list(arguments)
    for slot in _SLOT.finditer(text):
        fixed[-1] += text[at : slot.start()]
        at = slot.end()
        if slot[2] == "%":
            fixed[-1] += "%"
            continue
        if slot[1] and left:  # the width
            left.pop(0)
        argument = left.pop(0) if left else ""
        slots.append(NUMBER if slot[2] in "difgx" else ARGUMENTS.get(argument))
        fixed.append("")
    fixed[-1] += text[at:]
    return Sentence(tuple(fixed), tuple(slots))


@cache
def sentences() -> tuple[Sentence, ...]:
    """All sentences that this program and those around it log, the most exact first."""
    other_sentences = {sentence(text, arguments) for text, *arguments in OTHERS}
    for file in sorted(PACKAGE.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if "log." in text:
            other_sentences |= set(_logged(ast.parse(text)))
    telling = [known for known in other_sentences if _letters(known) >= LEAST_LETTERS]
    return tuple(sorted(telling, key=lambda s: (-len(s.fixed[0]), -_letters(s), s.fixed)))


def _letters(sentence: Sentence) -> int:
    return sum(map(str.isalpha, "".join(sentence.fixed)))


def _logged(tree: ast.AST) -> Iterator[Sentence]:
    for call in ast.walk(tree):
        if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Attribute):
            continue
        if call.func.attr not in LEVELS or not ast.unparse(call.func.value).endswith("log"):
            continue
        arguments = call.args[1:] if call.func.attr == "log" else call.args
        if arguments and isinstance(text := arguments[0], ast.Constant) and isinstance(text.value, str):
            yield sentence(text.value, [ast.unparse(argument) for argument in arguments[1:]])


def redact_line(line: str, unit: str = "") -> str:
    """A line of a unit's log without what may be a secret."""
    line = _COLOURS.sub("", line[:LONGEST_LINE])
    if unit.startswith(_BRIDGES) and (bridge := _BRIDGE.match(line)) is not None:
        return f"{bridge[1]} {bridge[2]}: {GAP}"
    if (own := _ROS_LINE.fullmatch(line)) is not None:
        return f"{own[1]} {_sentence_of(own[2])}"
    if (frame := _FRAME.match(line)) is not None and (PACKAGE.parent / frame[1]).is_file():
        return f"  {frame[1]}, line {frame[2]}"
    if (raised := _RAISED.match(line)) is not None and raised[1] in ERRORS:
        return f"{raised[1]}: {GAP}"
    return _sentence_of(line)


def _sentence_of(text: str) -> str:
    """A robot's name may stand before a sentence."""
    for rest in (text, text.partition(": ")[2]):
        for sentence in sentences():
            if (shown := sentence.shown(rest)) is not None:
                return shown if rest is text else f"{GAP}: {shown}"
    return LEFT_OUT


def journal(units: Sequence[str] = UNITS) -> bytes:
    """The last hour of the units' lines, the newest first, as JSON; b"" where there is no journal."""
    program = shutil.which("journalctl")
    if program is None:
        return b""
    options = ["--no-pager", "--quiet", "--reverse", "--output=json", f"--output-fields={FIELDS}"]
    options += [f"--since=-{LAST_S:.0f}s", f"--lines={MOST_LINES}", *(f"--unit={u}" for u in units)]
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


def redact_journal(text: bytes) -> str:
    """Its lines in their order: time, unit, level and sentence."""
    lines = [_line(entry) for entry in text.splitlines()[:MOST_LINES]]
    return "".join(f"{line}\n" for line in reversed(lines) if line)


def _line(entry: bytes) -> str:
    try:
        fields = json.loads(entry)
        moment = datetime.fromtimestamp(int(fields["__REALTIME_TIMESTAMP"]) / 1e6, UTC)
    except (ValueError, KeyError, TypeError, OverflowError, OSError, RecursionError):
        return ""  # one that was cut off
    unit = redact(_text(fields, "_SYSTEMD_UNIT"), _UNIT)
    if unit == LEFT_OUT:  # a line of systemd's about the unit
        unit = redact(_text(fields, "UNIT"), _UNIT)
    at = moment.isoformat(timespec="milliseconds")
    return f"{at} {unit} {redact_line(_text(fields, 'MESSAGE'), unit)}"


def _text(fields: Any, name: str) -> str:
    """Bytes that are not UTF-8 come as numbers: they are no sentence of ours."""
    text = fields.get(name)
    return text if isinstance(text, str) else ""
