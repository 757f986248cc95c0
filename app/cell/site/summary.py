"""The summary of a cell, JSON: made of the views that its own pages show, and read by walls. Pure.

What is read may be from anyone who may publish at a router: each size and type is checked.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from datetime import datetime
from typing import Annotated, Any, Final, Literal, NamedTuple, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints, ValidationError
from pydantic_core import to_json

from app.cell.alarms.shown import AlarmRow, AlarmsView
from app.cell.permission.control import ControlView
from app.cell.view.kinds import Attributes
from app.cell.view.link_status import Lamp
from app.cell.view.overview import NOT_RAISED, tile
from app.cell.view.view import View
from app.panel.rules import CHUNK, MAX_FIGURES, WALL_URL
from app.system.clock import iso_time
from app.system.errors import InputError
from app.system.texts import PanelText, TextLike, render

EVERY_S: Final = 5.0  # between two summaries in which nothing has changed
MAX_BYTES: Final = 32_768  # of a summary
MAX_TEXT: Final = 200  # characters
MAX_ALARMS: Final = 5  # that are named; the others are counted
MAX_LINKS: Final = 100

# Texts as the cell's panel file has them: one for all readers, or one for each language.
Words = str | Mapping[str, str]
# What the machine does, the least quiet last. `unknown`: the cell does not know it now.
Kind = Literal["running", "waiting", "manual", "unknown", "fault"]
KINDS: Final[tuple[Kind, ...]] = get_args(Kind)
# By the shape of a state in `[state]`. Another shape says that the machine waits.
KIND_OF_SHAPE: Final[Mapping[str, Kind]] = {"play": "running", "circle": "manual", "cross": "fault"}


class RobotNow(NamedTuple):
    """A robot of the cell: its view, its lamp, and for how many seconds its state has been so."""

    view: View
    lamp: Lamp
    state_s: float | None


class FigureNow(NamedTuple):
    """A readout of the summary: its attributes, as pages show them."""

    id: str
    label: TextLike
    unit: TextLike
    attributes: Attributes


class About(NamedTuple):
    """What a summary says of the cell itself. `twin` is the URL of another cell with the same name, or
    its instance; "" without one."""

    site: str
    cell: str
    url: str
    version: str
    instance: str
    languages: Collection[str]
    simulated: bool = False
    twin: str = ""


def summary_of(
    about: About, robots: Sequence[RobotNow], figures: Sequence[FigureNow], wall: float
) -> dict[str, Any]:
    """The summary at `wall` (seconds since the epoch), but for `at`. Of several robots the state is
    that of the least quiet one."""

    def words(text: TextLike) -> Words:
        return in_languages(text, about.languages)

    states = [(_state(robot, words), robot.state_s) for robot in robots]
    state, state_s = max(states, key=lambda each: KINDS.index(each[0]["kind"]))
    alarms, control = robots[0].view["alarms"], robots[0].view["control"]
    return {
        "site": about.site,
        "cell": about.cell,
        "url": about.url,
        "state": state,
        "since": "" if state_s is None else iso_time(round(wall - state_s)),
        **_alarms(alarms, words),
        "figures": [_figure(figure, words) for figure in figures],
        "control": _control(control, words),
        "version": about.version,
        "links": [
            {"robot": words(robot.lamp["name"]), "state": robot.lamp["state"]} for robot in robots
        ][:MAX_LINKS],
        "simulated": about.simulated,
        "twin": about.twin[:MAX_TEXT],
        "instance": about.instance,
    }


def payload_of(summary: Mapping[str, Any], wall: float) -> bytes:
    """What is published of a summary at `wall` (seconds since the epoch)."""
    return to_json({**summary, "at": iso_time(wall)})


def in_languages(text: TextLike, languages: Collection[str]) -> Words:
    """A text in each of the languages; one for all if it is the same in them."""
    own = text.own if isinstance(text, PanelText) else next(iter(languages), "en")
    texts = {tag: render(text, tag)[:MAX_TEXT] for tag in dict.fromkeys((own, *languages))}
    every = [*dict.fromkeys(texts.values())]
    return every[0] if len(every) == 1 else texts


def _state(robot: RobotNow, words: Any) -> dict[str, Any]:
    """From the tile of an overview: the same word and shape."""
    shown = tile(robot.view, robot.lamp, "", None)
    kind: Kind = KIND_OF_SHAPE.get(shown["shape"], "waiting")
    if shown["state"] != "live":
        kind = "unknown"
    elif shown["colour"] == "red":
        kind = "fault"
    elif robot.view["widgets"].get("machine_state") is None:
        kind = "running"  # a panel without `[state]` knows only that the robot is there
    return {
        "kind": kind,
        "text": words(shown["text"]),
        "shape": shown["shape"],
        "colour": shown["colour"],
    }


def _alarms(alarms: AlarmsView, words: Any) -> dict[str, Any]:
    counts = alarms["priorities"]
    listed = [row for row in alarms["rows"].values() if row["state"] not in NOT_RAISED]
    return {
        "alarms": {priority: count["standing"] for priority, count in counts.items()},
        "unacknowledged": {priority: count["unacknowledged"] for priority, count in counts.items()},
        "alarm_list": [_alarm(row, words) for row in listed[:MAX_ALARMS]],
    }


def _alarm(row: AlarmRow, words: Any) -> dict[str, Any]:
    return {
        "id": row["id"][:MAX_TEXT],
        "priority": row["priority"],
        "text": words(row["text"]),
        "state": row["state"],
        "acknowledged": row["acknowledged"],
        "since": row["since"],
    }


def _figure(figure: FigureNow, words: Any) -> dict[str, Any]:
    return {
        "id": figure.id,
        "label": words(figure.label),
        "text": words(figure.attributes.get("text", "")),
        "unit": words(figure.unit),
        "state": figure.attributes.get("state", "waiting"),
    }


def _control(control: ControlView, words: Any) -> dict[str, Any]:
    return {"required": control["required"], "holder": words(control["holder_name"])}


# What a wall reads. A key that is not known is ignored: a newer panel may have more.

MIN_YEAR, MAX_YEAR = 2000, 2100
Tag = Annotated[str, StringConstraints(pattern=r"^[A-Za-z]{2,3}(-[A-Za-z0-9]{1,8})*$", max_length=35)]
ShortText = Annotated[str, StringConstraints(max_length=MAX_TEXT)]
ReadWords = ShortText | Annotated[dict[Tag, ShortText], Field(min_length=1, max_length=12)]


def _check_time(text: str) -> str:
    if not text:
        return text
    at = datetime.fromisoformat(text)  # ValueError for what is none
    if at.tzinfo is None or not MIN_YEAR <= at.year <= MAX_YEAR:
        raise ValueError("is a time without its offset, or in no year of ours")
    return text


Time = Annotated[str, StringConstraints(max_length=40), AfterValidator(_check_time)]
Count = Annotated[int, Field(ge=0, le=1_000_000)]
Priority = Literal["1", "2", "3", "4"]


class _Read(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)


class ReadState(_Read):
    kind: Kind
    text: ReadWords
    shape: Annotated[str, StringConstraints(pattern=r"^[a-z]{1,20}$")]
    colour: Annotated[str, StringConstraints(pattern=r"^[a-z]{1,20}$")]


class ReadAlarm(_Read):
    id: ShortText
    priority: Annotated[int, Field(ge=1, le=4)]
    text: ReadWords
    state: Literal["active", "returned", "latched", "unknown"]
    acknowledged: bool
    since: Time


class ReadFigure(_Read):
    id: ShortText
    label: ReadWords
    text: ReadWords
    unit: ReadWords
    state: Literal["waiting", "live", "old", "unreadable", "missing"]


class ReadControl(_Read):
    required: bool
    holder: ReadWords


class ReadLink(_Read):
    robot: ReadWords
    state: Literal["ok", "wait", "bad"]


class Summary(_Read):
    """The summary of a cell as a wall reads it."""

    site: Annotated[str, StringConstraints(pattern=CHUNK)]
    cell: Annotated[str, StringConstraints(pattern=CHUNK)]
    url: Annotated[str, StringConstraints(max_length=300)]
    state: ReadState
    since: Time
    alarms: dict[Priority, Count]
    unacknowledged: dict[Priority, Count]
    alarm_list: Annotated[tuple[ReadAlarm, ...], Field(strict=False, max_length=MAX_ALARMS)]
    figures: Annotated[tuple[ReadFigure, ...], Field(strict=False, max_length=MAX_FIGURES)]
    control: ReadControl
    version: Annotated[str, StringConstraints(max_length=60)]
    links: Annotated[tuple[ReadLink, ...], Field(strict=False, max_length=MAX_LINKS)]
    simulated: bool
    twin: ShortText
    instance: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,64}$")]
    at: Time


def read_summary(payload: bytes, site: str, cell: str) -> Summary:
    """The summary that was published for a cell; InputError says what is wrong with it."""
    if len(payload) > MAX_BYTES:
        raise InputError(f"{len(payload)} bytes: a summary has {MAX_BYTES} at most")
    try:
        read = Summary.model_validate_json(payload)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))[:80]
        raise InputError(f"{place or 'it'}: {first['msg'][:100]}") from None
    if (read.site, read.cell) != (site, cell):
        raise InputError("it is that of another cell")
    if not _is_link(read.url):
        raise InputError("url: it is no http:// or https:// address")
    return read


def _is_link(url: str) -> bool:
    return not url or re.fullmatch(WALL_URL, url) is not None


def said_in(words: Words, language: str) -> str:
    """The text for a reader of a language; else in the first that the cell has."""
    if isinstance(words, str):
        return words
    return words.get(language) or next(iter(words.values()))
