"""The fault parcel: a zip for the vendor's service desk with what is known of one stop. Credentials are
in none of its parts: of the panel file only what is public (`app.system.public`), nothing of the
settings, the Zenoh configuration and the users. Log, alarms and story name people and values.

A part that can't be read is left out, and README.txt says why.
"""

import asyncio
import json
import re
import time
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.metadata import distributions
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

from app.cell.alarms import export as alarm_export
from app.cell.alarms.export import HistoryReader
from app.cell.alarms.history import HistoryFilter
from app.cell.alarms.report import NAME as STATES
from app.cell.alarms.store import NAME as ALARMS
from app.cell.history.recording import FOLDER, PRESS_TOPIC
from app.cell.session.stops import StopReader, StopStores, read_alarms
from app.cell.stops.shown import FOLDER as VIEWS
from app.cell.stops.shown import ShownView, from_bytes, shown_near
from app.cell.stops.sources import PanelNames
from app.cell.stops.story import AFTER_S, BEFORE_S, Stop, Story
from app.panel import Panel, load_panel
from app.panel.robot_panels import panel_of
from app.panel.widgets.trend import trends_of
from app.records.copy import as_line
from app.records.database import NAME as LOG
from app.records.database import Filter, LogRow, rows
from app.records.log_key import load_key
from app.records.reader import Readers
from app.records.reader import export as log_export
from app.records.shown_panel import read_manifest, runs, shown_at
from app.records.starts import list_digest, program_files, sha256
from app.records.verify import Chain, SignedPart
from app.ros.messages.names import possible_keys
from app.system.clock import iso_time
from app.system.errors import KioskError, LogError
from app.system.public import public_part
from app.system.settings import Settings, shipped_path
from app.tools.doctor.bundle import versions
from app.tools.doctor.machine import MB
from app.tools.doctor.shown_pages import Taker, page_files
from app.web.pages.compiled_templates import COMPILED
from app.web.pages.page_templates import PageTemplates
from app.web.routes.stops import sort_and_number, story_answer, story_context

TEMPLATE: Final = "stop-paper.html"
LOG_S: Final = 300.0  # of the log and the alarms, before and after what a story has
NEAR_S: Final = 600.0  # a stop is looked for in so long before and after a time
LATEST_S: Final = 7 * 86_400.0  # the newest stop is looked for
MOST_TEXT: Final = 8 * MB  # bytes of a part but a recording
MOST_ENTRIES: Final = 20_000  # of the log, and of the alarms; the newest are kept
MOST_RECORDED: Final = 128 * MB  # bytes of all recordings
MOST_SERIES: Final = 12  # of a panel of the layout
ROWS_AT_ONCE: Final = 500
FAULTS: Final = (KioskError, OSError, ValueError)  # with which a part is left out
PAGES: Final = "pages/"
_PATH: Final = re.compile(r"[A-Za-z0-9_.\[\]]+")  # of a field, as Foxglove reads it


class Moment(NamedTuple):
    """What a parcel is about: a time in seconds since the epoch, a robot's id ("" for the only one),
    and the key of the stop, "" where there is none, which `why` says."""

    at: float
    robot: str
    key: str
    why: str = ""

    @property
    def since(self) -> float:
        return self.at - BEFORE_S - LOG_S

    @property
    def until(self) -> float:
        return self.at + AFTER_S + LOG_S


class Reach(NamedTuple):
    """What a parcel may have beside the data folder: `taker` is who gets it, `now` what the robot's
    pages show now, as `app.cell.stops.shown` keeps it, None without a running server."""

    taker: Taker = Taker()
    now: bytes | None = None


@dataclass(slots=True)
class ParcelFile:
    """A parcel that is being written. `parts` are name, size and what it is; `left_out` what is not in
    it, and why; `notes` are sentences for the README."""

    file: zipfile.ZipFile
    parts: list[tuple[str, int, str]] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, name: str, about: str, content: str | bytes) -> None:
        data = content.encode("utf-8", "replace") if isinstance(content, str) else content
        if len(data) > MOST_TEXT:
            self.left_out.append((name, f"it is larger than {MOST_TEXT // MB} MB"))
            return
        self.file.writestr(name, data)
        self.parts.append((name, len(data), about))

    def add_json(self, name: str, about: str, value: Any) -> None:
        self.add(name, about, json.dumps(value, indent=1, ensure_ascii=False, default=str))

    @contextmanager
    def attempt(self, *names: str) -> Iterator[None]:
        """What can't be read in the block is left out."""
        try:
            yield
        except FAULTS as error:
            written = {name for name, _, _ in self.parts}
            self.left_out += [(name, f"{error}") for name in names if name not in written]


def moment_of(settings: Settings, panel: Panel, at: float | None, robot: str) -> Moment:
    """The stop nearest to a time, or the newest one (None). Without one near it, it is about the time
    itself. LogError without a time and without a stop."""
    now = time.time()
    since, until = (now - LATEST_S, now) if at is None else (at - NEAR_S, at + NEAR_S)
    why = "no stop is recorded within ten minutes of this time"
    try:
        with _reading(settings, panel) as reader:
            stops: list[Stop] = asyncio.run(reader.stops(since, until, robot or None))
    except FAULTS as error:
        stops, why = [], f"the stops can't be read: {error}"
    if at is None:
        if not stops:
            raise LogError("no stop of the last seven days is recorded: name a time with --at")
        nearest = stops[0]
    elif stops:
        nearest = min(stops, key=lambda stop: abs(stop.at - at))
    else:
        return Moment(at, robot or _robots(panel)[0], "", why)
    return Moment(nearest.at, nearest.robot, nearest.key)


def write_parcel(
    stream: IO[bytes],
    settings: Settings,
    panel: Panel,
    moment: Moment,
    language: str,
    reach: Reach,
) -> ParcelFile:
    """Writes the zip into a stream; OSError if that fails."""
    folder = _data_folder(settings, panel)
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as file:
        parcel = ParcelFile(file)
        _add_story(parcel, settings, panel, moment, language)
        _add_pages(parcel, settings, panel, moment, language, reach)
        _add_log(parcel, folder, moment, language)
        _add_alarms(parcel, folder, moment, language)
        _add_recordings(parcel, folder, panel, moment)
        _add_versions(parcel, folder, settings, moment)
        about = "the panel file: ids, names and types of ROS; texts and addresses are left out"
        parcel.add_json("panel.json", about, public_part(panel))
        parcel.add_json(
            "layout.json", "a layout for Lichtblick and Foxglove", layout(panel, moment.robot)
        )
        parcel.add("README.txt", "this list", _readme(parcel, moment))
    return parcel


def load(settings: Settings) -> Panel:
    return load_panel(settings.panel)


def _data_folder(settings: Settings, panel: Panel) -> Path:
    return settings.data_folder(settings.mode or panel.mode)


def _robots(panel: Panel) -> list[str]:
    return [str(robot.id) for robot in panel.robots] or [""]


@contextmanager
def _reading(settings: Settings, panel: Panel) -> Iterator[StopReader]:
    """A reader of the data folder, of a server that runs or not."""
    folder = _data_folder(settings, panel)
    log = Readers(folder) if (folder / LOG).exists() else None
    names = {str(robot.id): str(robot.name) for robot in panel.robots} or {"": ""}
    stores = StopStores(
        panel=panel,
        names={robot: PanelNames(panel_of(panel, robot or None)) for robot in names},
        robots=names,
        alarms=HistoryReader(folder / ALARMS),
        log=log,
        states=folder / STATES,
    )
    try:
        yield StopReader(stores)
    finally:
        if log is not None:
            log.close()
            log.stop()


# Its parts.


def _add_story(
    parcel: ParcelFile, settings: Settings, panel: Panel, moment: Moment, language: str
) -> None:
    """Not of some of the stores: without one of them it might name a wrong cause."""
    names = ("story.html", "story.json")
    if not moment.key:
        parcel.left_out += [(name, moment.why) for name in names]
        return
    with parcel.attempt(*names), _reading(settings, panel) as reader:
        story, end = asyncio.run(_told(reader, moment.key))
        own, robots = reader.names(story.stop.robot), panel.robot_names
        context = story_context(story, end, own, robots, True, language)
        templates = PageTemplates(shipped_path("templates"), compiled=shipped_path(COMPILED))
        html = templates.render(TEMPLATE, language, panel=panel, **context)
        parcel.add(names[0], "why the machine stopped, to read and to print", html)
        answer = story_answer(story, robots.get(story.stop.robot, ""), end, language)
        parcel.add_json(names[1], "the same for programs", answer)


async def _told(reader: StopReader, key: str) -> tuple[Story, float | None]:
    story = await reader.story(*sort_and_number(key))
    return story, await reader.end_of(story.stop)


def _add_pages(
    parcel: ParcelFile, settings: Settings, panel: Panel, moment: Moment, language: str, reach: Reach
) -> None:
    """As they were shown at the stop, else as they are now."""
    robot = moment.robot or _robots(panel)[0]  # of an alarm of the panel itself the first one
    nearest = shown_near(_data_folder(settings, panel), robot, moment.at)
    parcel.left_out += nearest.faults
    why = "what the pages showed at this moment was not kept"
    if nearest.shown is not None:
        try:
            _draw(parcel, settings, panel, nearest.shown, language, reach.taker, True)
            return
        except FAULTS as error:
            why = f"what the pages showed at the stop can't be drawn: {error}"
    if reach.now is None:
        now = "; the page of the stop in the panel gives a parcel with the pages as they are then"
        parcel.left_out.append((PAGES, f"{why}{now}"))
        return
    with parcel.attempt(PAGES):
        _draw(parcel, settings, panel, from_bytes(reach.now), language, reach.taker, False)
        parcel.notes.append(f"The pages are not those of the stop: {why}.")


def _draw(
    parcel: ParcelFile, settings: Settings, panel: Panel, shown: ShownView, language: str, taker: Taker,
    at_stop: bool,
) -> None:  # fmt: skip
    at = iso_time(shown.at)
    when = f"at the stop, {at}" if at_stop else f"at {at}, when this was made"
    for page, html, why in page_files(settings, panel, shown, taker, language, at_stop):
        name = f"{PAGES}{page}.html"
        if why:
            parcel.left_out.append((name, why))
        else:
            parcel.add(name, f'the page "{page}" as it was shown {when}', html)
    parcel.left_out += [(f"{VIEWS}: {part}", "it was too large to be kept") for part in shown.left_out]


def _add_log(parcel: ParcelFile, folder: Path, moment: Moment, language: str) -> None:
    names = ("log.jsonl", "log.csv")
    if not (folder / LOG).exists():
        parcel.left_out += [(name, "there is no operator's log") for name in names]
        return
    wanted = Filter(since=round(moment.since * 1000), until=round(moment.until * 1000), every=True)
    with parcel.attempt(*names):
        every = _entries(folder, wanted)
        lines = _newest(as_line(row.entry) for row in every)
        entries = every[: len(lines)][::-1]
        if len(lines) < len(every) or len(every) >= MOST_ENTRIES:
            parcel.notes.append(f"The log had more entries: it has the newest {len(lines)}.")
        text = "".join(f"{line}\n" for line in lines)
        parcel.add(names[0], "the operator's log, an entry a line, with the chain of hashes", text)
        csv = _cut(log_export(folder, wanted, None, language=language))
        parcel.add(names[1], "the same as a table", csv)
        if entries:
            parcel.notes.append(_chain(entries))


def _entries(folder: Path, wanted: Filter) -> list[LogRow]:
    """The newest first."""
    entries: list[LogRow] = []
    while len(entries) < MOST_ENTRIES:
        before = entries[-1].entry.seq if entries else None
        more = rows(folder, wanted, before, ROWS_AT_ONCE)
        entries += more
        if len(more) < ROWS_AT_ONCE:
            break
    return entries


def _newest(lines: Iterable[str]) -> list[str]:
    """Of lines, the newest first, as many as a part may have, the oldest first."""
    kept: list[str] = []
    size = 0
    for line in lines:
        size += len(line.encode()) + 2
        if size > MOST_TEXT:
            break
        kept.append(line)
    return kept[::-1]


def _chain(entries: list[LogRow]) -> str:
    """What the hashes of the slice say of it."""
    first, last = entries[0].entry, entries[-1].entry
    chain = Chain("", "", SignedPart(()))
    fault = chain.begin_at(first)
    for row in entries[1:]:
        fault = fault or chain.fault(row.entry)
    held = f"the chain does not hold: {fault}" if fault else "each follows the one before it"
    return (
        f"log.jsonl has the entries {first.seq} to {last.seq}: {held}. The last hash is {last.hash}. On"
        " the panel's PC `operator-panel log verify --against log.jsonl` compares them with the whole"
        " log, and tells by which signature they are proven."
    )


def _cut(pieces: Iterable[bytes]) -> bytes:
    """As much as a part may have, up to the end of a line."""
    text = bytearray()
    for piece in pieces:
        text += piece
        if len(text) > MOST_TEXT:
            return bytes(text[: text.rfind(b"\n", 0, MOST_TEXT) + 1])
    return bytes(text)


def _add_alarms(parcel: ParcelFile, folder: Path, moment: Moment, language: str) -> None:
    names = ("alarms.json", "alarms.csv")
    path = folder / ALARMS
    if not path.exists():
        parcel.left_out += [(name, "no alarm was recorded") for name in names]
        return
    wanted = HistoryFilter(since=moment.since, until=moment.until)
    with parcel.attempt(*names):
        history = read_alarms(path, wanted=wanted, most=MOST_ENTRIES)
        details = _newest(
            json.dumps({**row._asdict(), "at": iso_time(row.at), "record": json.loads(row.record)})
            for row in history
        )
        if len(details) < len(history) or len(history) >= MOST_ENTRIES:
            parcel.notes.append(f"There was more of alarms: it has the newest {len(details)}.")
        text = ",\n".join(details)
        parcel.add(names[0], "what happened to alarms, with all details", f"[{text}]\n")
        csv = _cut(alarm_export.export(path, wanted, False, language))
        parcel.add(names[1], "the same as a table", csv)


def _add_recordings(parcel: ParcelFile, folder: Path, panel: Panel, moment: Moment) -> None:
    name = f"{FOLDER}/"
    if panel.record is None:
        parcel.left_out.append((name, "the panel records nothing: its file has no [record]"))
        return
    from app.cell.history.kept import has_unfinished, recordings_of  # imports MCAP

    recorded = folder / FOLDER
    kept = recordings_of(recorded, moment.robot, moment.at - BEFORE_S, moment.at + AFTER_S)
    kept.sort(key=lambda each: not each.since <= moment.at <= each.until)
    if has_unfinished(recorded, moment.robot):
        parcel.notes.append(
            "A recording was still being written: make the parcel again"
            f" {panel.record.after_s:g} s after the last press or stop."
        )
    if not kept:
        parcel.left_out.append((name, "no finished recording has this moment"))
    left = MOST_RECORDED
    for each in kept:
        if each.size > left:
            why = f"{each.size / MB:.0f} MB, with which all are more than {MOST_RECORDED // MB} MB"
            parcel.left_out.append((f"{name}{each.name}", why))
            continue
        with parcel.attempt(f"{name}{each.name}"):
            parcel.file.write(recorded / each.name, f"{name}{each.name}", zipfile.ZIP_STORED)
            left -= each.size
            about = f"messages from {iso_time(each.since)} to {iso_time(each.until)}"
            parcel.parts.append((f"{name}{each.name}", each.size, about))


def _add_versions(parcel: ParcelFile, folder: Path, settings: Settings, moment: Moment) -> None:
    about: dict[str, Any] = {"versions": versions(), "dependencies": dependencies()}
    with suppress(OSError):
        about["panel_sha256"] = sha256(settings.panel.read_bytes())
        about["program_sha256"] = list_digest(program_files())
    if (folder / LOG).exists():
        with parcel.attempt("versions at the stop"):
            now = round(time.time() * 1000)
            shown = shown_at(runs(folder), round(moment.at * 1000), now)
            at_stop: dict[str, Any] = {"entry": shown.run.seq, "doubts": shown.doubts}
            about["at_the_stop"] = at_stop
            manifest = read_manifest(folder, shown.run)
            at_stop |= {"version": manifest.version, "sha256": manifest.digests()}
            if at_stop["sha256"].get("panel") != about.get("panel_sha256"):
                parcel.notes.append("The panel file has been changed since: panel.json is the new one.")
        with suppress(*FAULTS):
            key = load_key(folder)
            about["log_key"] = key.public if key else ""
    text = "versions and hashes of the panel, its program and its dependencies, now and at the stop"
    parcel.add_json("versions.json", text, about)


def dependencies() -> dict[str, dict[str, str]]:
    """Name → version, and the hash of its list of files with their hashes, of what is installed."""
    return {
        str(each.metadata["Name"]): {
            "version": each.version,
            "record_sha256": sha256(record.encode()) if (record := each.read_text("RECORD")) else "",
        }
        for each in sorted(distributions(), key=lambda each: str(each.metadata["Name"]).lower())
    }


# The layout for Lichtblick and Foxglove: topics and fields of the panel file.


def layout(panel: Panel, robot: str) -> dict[str, Any]:
    """Curves of trends and of alarms with limits, the state and conditions as bands, and presses."""
    own = panel_of(panel, robot or None)
    namespace = next((each.namespace for each in panel.robots if each.id == robot), panel.namespace)

    def paths(values: Iterable[tuple[str, str]]) -> list[str]:
        known = (
            f"/{possible_keys(topic, namespace)[0]}.{field}"
            for topic, field in values
            if _PATH.fullmatch(field)
        )
        return list(dict.fromkeys(known))[:MOST_SERIES]

    curves = [(pen.topic, pen.field) for trend in trends_of(own) for pen in trend.pens]
    curves += [alarm.limited_value for alarm in own.alarms if alarm.limited_value]
    states = [(own.state.topic, own.state.field)] if own.state else []
    states += [(each.topic, each.field) for each in own.named_conditions]
    at = {"timestampMethod": "receiveTime"}
    panels: dict[str, dict[str, Any]] = {}
    if bands := paths(states):
        panels["StateTransitions!states"] = {
            "isSynced": True,
            "paths": [{"value": path} | at for path in bands],
        }
    if lines := paths(curves):
        panels["Plot!curves"] = {
            "paths": [{"value": path, "enabled": True} | at for path in lines],
            "showXAxisLabels": True,
            "showYAxisLabels": True,
            "showLegend": True,
            "legendDisplay": "floating",
            "showPlotValuesInLegend": True,
            "isSynced": True,
            "xAxisVal": "timestamp",
            "sidebarDimension": 240,
        }
    panels["RawMessages!presses"] = {
        "topicPath": PRESS_TOPIC,
        "diffEnabled": False,
        "diffMethod": "custom",
        "diffTopicPath": "",
        "showFullMessageForDiff": False,
    }
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _below(list(panels)),
    }


def _below(names: list[str]) -> Any:
    """Panels one below the other."""
    first, *rest = names
    return {"direction": "column", "first": first, "second": _below(rest)} if rest else first


def _readme(parcel: ParcelFile, moment: Moment) -> str:
    about = f"Stop {moment.key}" if moment.key else "No stop"
    robot = f", robot {moment.robot}" if moment.robot else ""
    lines = [
        "FAULT PARCEL OF OPERATOR-PANEL",
        "",
        f"{about} at {iso_time(moment.at)}{robot}. Made at {iso_time(time.time())}.",
        "Story, log, alarms and recordings have names of people and what they entered.",
        "Passwords, PINs, tokens and the Zenoh configuration are in no part.",
        "",
        "WHAT IT HAS",
        *(f"  {name:24} {size:>11,} bytes  {text}" for name, size, text in parcel.parts),
    ]
    if parcel.left_out:
        lines += ["", "WHAT IS LEFT OUT"]
        lines += [f"  {name}: {' '.join(why.split())}" for name, why in parcel.left_out]
    if parcel.notes:
        lines += ["", "NOTES", *(f"  {note}" for note in parcel.notes)]
    opening = "Open a recording in Lichtblick or Foxglove, then import layout.json as its layout."
    return "\n".join([*lines, "", opening, ""])
