"""The support bundle: a zip of what one who helps from afar needs to know. Without secrets, of a
limited size, and listed before it is written."""

import csv
import io
import json
import os
import shutil
import subprocess
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from app.audit.export import csv_chunks
from app.audit.queries import Filter
from app.diagnose.doctor import Diagnosis, Options
from app.diagnose.machine import MB, ask_server
from app.diagnose.redaction import plain_without_secrets, without_secrets
from app.diagnose.screen import displays
from app.diagnose.versions import versions
from app.errors import LogError
from app.settings import PREFIX, VARIABLES, Settings

LAST_S: Final = 3600.0  # of logs
MOST_BYTES: Final = 4 * MB  # of one file; of a longer one the end is kept
UNITS: Final = ("operator-panel*", "zenoh-bridge*")
JOURNAL_S: Final = 20.0
TOO_LARGE: Final = f"left out: more than {MOST_BYTES} bytes"
CUT: Final = "(the beginning is left out)\n"
TYPED: Final = "values"  # the log's column with what operators typed in


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
    """Where parts come from; tests give others."""

    environment: Mapping[str, str]
    journal: Callable[[], str]


def journal(units: Sequence[str] = UNITS) -> str:
    """The last hour of the units' lines; "" where there is no journal."""
    program = shutil.which("journalctl")
    if program is None:
        return ""
    named = [f"--unit={unit}" for unit in units]
    options = ["--no-pager", "--quiet", "--output=short-iso", f"--since=-{LAST_S:.0f}s"]
    try:
        done = subprocess.run([program, *named, *options], capture_output=True, timeout=JOURNAL_S)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.decode(errors="replace")


def parts(
    settings: Settings, options: Options, found: Diagnosis, doctor: Mapping[str, Any], sources: Sources
) -> list[Part]:
    """The files, without secrets; what is not there is left out. `doctor` is what its `--json` says."""
    made = [
        _json("doctor.json", "findings of `operator-panel doctor`", doctor),
        _json("versions.json", "versions of the panel, its libraries and the system", versions()),
        _json("settings.json", "KIOSK_ variables", _settings(settings, sources.environment)),
        _json("machine.json", "load, memory, disk and screens", _machine(settings, found)),
        *_files(settings),
        *_logs(settings, found, sources),
        *_of_server(options, found),
        *(
            _json(
                f"graph{f'-{name}' if name else ''}.json", "ROS graph behind the bridges", asdict(graph)
            )
            for name, graph in found.graphs.items()
        ),
    ]
    return [one for one in made if one.text]


def _json(name: str, about: str, value: Any) -> Part:
    text = json.dumps(plain_without_secrets(value), indent=1, ensure_ascii=False, default=str)
    return Part(name, about, text if len(text) <= MOST_BYTES else json.dumps(TOO_LARGE))


def text_part(name: str, about: str, text: str) -> Part:
    """With the end of a long text."""
    if len(text) > MOST_BYTES:  # from the beginning of a line: a key is not cut from its secret
        end = text[-MOST_BYTES:]
        text = CUT + end.partition("\n")[2]
    return Part(name, about, without_secrets(text))


def _settings(settings: Settings, environment: Mapping[str, str]) -> dict[str, Any]:
    """Nothing else of the environment."""
    names = [PREFIX + name for name in VARIABLES]
    given = {name: environment[name] for name in names if name in environment}
    return {"environment": given, "in use": asdict(settings)}


def _machine(settings: Settings, found: Diagnosis) -> dict[str, Any]:
    facts: dict[str, Any] = {"time": time.strftime("%Y-%m-%dT%H:%M:%S%z"), "cpus": os.cpu_count()}
    with suppress(OSError):
        facts["load"] = os.getloadavg()
    with suppress(OSError):
        facts["memory"] = Path("/proc/meminfo").read_text().splitlines()[:5]
    with suppress(OSError):
        facts["uptime_s"] = float(Path("/proc/uptime").read_text().split()[0])
    folder = settings.data_folder(settings.mode or (found.panel.mode if found.panel else "live"))
    with suppress(OSError):
        facts["disk"] = shutil.disk_usage(folder)._asdict()
    with suppress(OSError):
        facts["data"] = {one.name: one.stat().st_size for one in folder.iterdir() if one.is_file()}
    facts["screens"] = [asdict(display) for display in displays()]
    return facts


def _files(settings: Settings) -> Iterator[Part]:
    named = (
        ("panel", settings.panel, "the panel file"),
        ("zenoh", settings.zenoh, "Zenoh configuration"),
    )
    for kind, path, about in named:
        with suppress(OSError):
            text = path.read_text(encoding="utf-8", errors="replace")
            yield text_part(f"{kind}/{path.name}", about, text)


def _logs(settings: Settings, found: Diagnosis, sources: Sources) -> Iterator[Part]:
    yield text_part("logs/journal.txt", "the units' log of the last hour", sources.journal())
    folder = settings.data_folder(settings.mode or (found.panel.mode if found.panel else "live"))
    with suppress(LogError, OSError):
        about = "operator's log of the last hour, without what was typed in"
        yield text_part("logs/operators-log.csv", about, _operators_log(folder))


def _operators_log(folder: Path) -> str:
    """CSV, as the page of the log gives it, but for the values of inputs."""
    since = int((time.time() - LAST_S) * 1000)
    chunks = csv_chunks(folder, Filter(since=since, every=True), None)
    rows = csv.DictReader(io.StringIO(b"".join(chunks).decode("utf-8-sig")))
    names = [name for name in rows.fieldnames or () if name != TYPED]
    text = io.StringIO()
    writer = csv.DictWriter(text, names, extrasaction="ignore")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _of_server(options: Options, found: Diagnosis) -> Iterator[Part]:
    """What a running server says; nothing without one."""
    if "server_running" not in found.report.codes():
        return
    queries = [("readyz.json", "/readyz", "whether the server reaches the robot")]
    robots = [f"/robots/{one.id}" for one in found.panel.robots] if found.panel else []
    queries += [
        (f"snapshot{base.replace('/', '-')}.txt", f"{base}/events?once=1", "what the pages show")
        for base in robots or [""]
    ]
    queries.append(("metrics.txt", "/metrics", "metrics"))
    for name, path, about in queries:
        answer = ask_server(options.host, options.port, path)
        if answer is not None:
            body = answer[1]
            yield text_part(f"state/{name}", about, body if isinstance(body, str) else json.dumps(body))


def write(file: Path, made: Sequence[Part]) -> int:
    """Writes the zip, readable by its owner only; its size. OSError, FileExistsError if it is there."""
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as raw, zipfile.ZipFile(raw, "w", zipfile.ZIP_DEFLATED) as packed:
        for part in made:
            packed.writestr(part.name, part.text)
    return file.stat().st_size
