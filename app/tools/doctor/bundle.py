"""The support bundle: a zip of what one who helps from afar needs to know. Only what is known to be
harmless is in it, it is of a limited size, and listed before it is written."""

import io
import json
import os
import platform
import re
import shutil
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from app.records.database import Filter, LogRow, rows
from app.ros.zenoh.config import summary
from app.system.errors import LogError, SettingsError
from app.system.public import public_part
from app.system.settings import APP, PREFIX, VARIABLES, Settings
from app.system.version import installed_version
from app.tools.doctor.doctor import Diagnosis, Options
from app.tools.doctor.journal import LAST_S, journal_counts
from app.tools.doctor.machine import MB, ask_server, displays
from app.tools.doctor.redaction import public_code, public_entry, public_report

# A sample of Prometheus's text format, or the type of one.
_METRIC: Final = re.compile(
    r"# TYPE \w{1,80} \w{1,20}|"
    r'\w{1,80}(?:\{(?:\w{1,40}="[\w/.\-]{0,100}",?){0,9}\})? [\d.eE+\-]{1,30}',
    re.ASCII,
)


def public_metrics(text: str) -> str:
    return "".join(f"{line}\n" for line in text.split("\n") if _METRIC.fullmatch(line))


# The versions of the panel, of what it is made with, and of the system under it.

PACKAGES: Final = ("eclipse-zenoh", "fastapi", "uvicorn", "starlette", "pydantic", "mcap")


def versions() -> dict[str, str]:
    """Name → version."""
    system = platform.freedesktop_os_release().get("PRETTY_NAME", "") if _has_release() else ""
    return {
        APP: installed_version(),
        "python": platform.python_version(),
        **{name: installed_version(name) for name in PACKAGES},
        "system": system or platform.system(),
        "kernel": platform.release(),
        "machine": platform.machine(),
    }


def _has_release() -> bool:
    try:
        return bool(platform.freedesktop_os_release())
    except OSError:
        return False


MOST_BYTES: Final = 4 * MB  # of one file; of a longer one the end is kept
MOST_PRESSES: Final = 20_000  # rows of the operator's log
TOO_LARGE: Final = f"left out: more than {MOST_BYTES} bytes"
CUT: Final = "(the beginning is left out)\n"
# The files of the data folder.
_DATA: Final = re.compile(r"(?:operators-log|trends)\.sqlite3(?:-wal|-shm)?|server\.lock")
ROWS_AT_ONCE: Final = 500


@dataclass(frozen=True, slots=True)
class Part:
    """A file of the bundle: `about` says what it is, for the list."""

    name: str
    about: str
    text: str

    @property
    def size(self) -> int:
        return len(self.text.encode())


@dataclass(frozen=True, slots=True, kw_only=True)
class Sources:
    """Where parts come from; tests give others. `journal` is as of `app.tools.doctor.journal`."""

    environment: Mapping[str, str]
    journal: Callable[[], bytes]


def parts(settings: Settings, options: Options, diagnosis: Diagnosis, sources: Sources) -> list[Part]:
    """The files, without what may be a secret; what is not there is left out."""
    journal = journal_counts(sources.journal())
    report = public_report(diagnosis, installed_version())
    made = [
        _json("doctor.json", "findings of `operator-panel doctor`", report),
        _json("versions.json", "versions of the panel, its libraries and the system", versions()),
        _json("settings.json", "KIOSK_ variables", _settings(settings, sources.environment)),
        _json("machine.json", "load, memory, disk and screens", _machine(settings, diagnosis)),
        *_configuration(settings, diagnosis),
        _json("logs/journal.json", "lines of the units' log, counted", journal),
        *_operators_log(_data_folder(settings, diagnosis)),
        *_of_server(options, diagnosis),
        *(
            _json(f"graph{f'-{name}' if name else ''}.json", "ROS graph", public_part(graph))
            for name, graph in diagnosis.graphs.items()
        ),
    ]
    return [part for part in made if part.text]


def _json(name: str, about: str, value: Any) -> Part:
    text = json.dumps(value, indent=1, ensure_ascii=False, default=str)
    return Part(name, about, text if len(text) <= MOST_BYTES else json.dumps(TOO_LARGE))


def text_part(name: str, about: str, text: str) -> Part:
    """With the end of a long text, from the beginning of a line."""
    if len(text) > MOST_BYTES:
        text = CUT + text[-MOST_BYTES:].partition("\n")[2]
    return Part(name, about, text)


def _settings(settings: Settings, environment: Mapping[str, str]) -> dict[str, Any]:
    """Which variables are set, and the settings in use. Nothing else of the environment."""
    return {
        "set": [PREFIX + name for name in VARIABLES if PREFIX + name in environment],
        "in use": public_part(settings),
    }


def _data_folder(settings: Settings, diagnosis: Diagnosis) -> Path:
    return settings.data_folder(settings.mode or (diagnosis.panel.mode if diagnosis.panel else "live"))


def _machine(settings: Settings, diagnosis: Diagnosis) -> dict[str, Any]:
    facts: dict[str, Any] = {"time": time.strftime("%Y-%m-%dT%H:%M:%S%z"), "cpus": os.cpu_count()}
    with suppress(OSError):
        facts["load"] = os.getloadavg()
    with suppress(OSError):
        facts["memory"] = Path("/proc/meminfo").read_text().splitlines()[:5]
    with suppress(OSError):
        facts["uptime_s"] = float(Path("/proc/uptime").read_text().split()[0])
    folder = _data_folder(settings, diagnosis)
    with suppress(OSError):
        facts["disk"] = shutil.disk_usage(folder)._asdict()
    with suppress(OSError):
        files = [file for file in folder.iterdir() if file.is_file()]
        facts["data"] = {file.name: file.stat().st_size for file in files if _DATA.fullmatch(file.name)}
        facts["other files"] = len(files) - len(facts["data"])
    facts["screens"] = [asdict(display) for display in displays()]
    return facts


def _configuration(settings: Settings, diagnosis: Diagnosis) -> Iterator[Part]:
    """A file that can't be read is a finding."""
    if diagnosis.panel is not None:
        keys = public_part(diagnosis.panel)
        yield _json("panel.json", "the panel file: ids, names and types of ROS", keys)
    with suppress(SettingsError):
        about = "Zenoh configuration: its endpoints"
        yield _json("zenoh.json", about, public_part(summary(settings.zenoh)))


def _operators_log(folder: Path) -> Iterator[Part]:
    with suppress(LogError, OSError):
        about = "operator's log, without values and texts"
        lines = (json.dumps(public_entry(row)) for row in _presses(folder))
        yield text_part("logs/operators-log.jsonl", about, "".join(f"{line}\n" for line in lines))


def _presses(folder: Path) -> list[LogRow]:
    """The entries of the last hour, the oldest first."""
    wanted, presses = Filter(since=int((time.time() - LAST_S) * 1000), every=True), list[LogRow]()
    while len(presses) < MOST_PRESSES:
        before = presses[-1].entry.seq if presses else None
        more = rows(folder, wanted, before, ROWS_AT_ONCE)
        presses += more
        if len(more) < ROWS_AT_ONCE:
            break
    return presses[::-1]


def _of_server(options: Options, diagnosis: Diagnosis) -> Iterator[Part]:
    """What a running server says; nothing without one."""
    if "server_running" not in diagnosis.report.codes():
        return

    def ask(path: str) -> Any:
        answer = ask_server(options.host, options.port, path)
        return None if answer is None else answer[1]

    ready = ask("/readyz")
    if isinstance(ready, Mapping):
        told = {"ready": ready.get("status") == "ready", "code": public_code(ready.get("code", ""))}
        yield _json("state/readyz.json", "whether the server reaches the robot", told)
    yield text_part("state/metrics.txt", "metrics", public_metrics(str(ask("/metrics"))))


def packed(made: Sequence[Part]) -> bytes:
    """The zip."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as file:
        for part in made:
            file.writestr(part.name, part.text)
    return content.getvalue()


def write(file: Path, made: Sequence[Part]) -> int:
    """Writes the zip, readable by its owner only; its size. OSError, FileExistsError if it is there."""
    content = packed(made)
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as raw:
        raw.write(content)
    return len(content)
