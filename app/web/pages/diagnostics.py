"""The page of diagnostics: its rows and values as texts."""

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, TypedDict, TypeVar
from urllib.parse import urlencode

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field

from app.cell.commands.machine_acts import MOST_DAYS
from app.cell.robot.traffic import MAX_COLUMNS, RoundTripSummary
from app.cell.session.doctor_process import DoctorProcess, FoundFault
from app.cell.session.looks import Look, NodeRoundTrips, Survey
from app.cell.session.session import RobotSession
from app.cell.view.clock_status import ClockStatus, ClockWord, clock_note, clock_status
from app.cell.view.diagnostics import (
    GraphTopicRow,
    NodeRow,
    ParameterRow,
    ServerRow,
    TopicRow,
    graph_topic_rows,
    node_rows,
    parameter_rows,
    robots_in,
    server_rows,
    topic_rows,
)
from app.cell.view.link_status import LinkStatus
from app.ros.dialects.peer_traits import EVERY_SENTENCES
from app.ros.graph.model import RobotGraph
from app.system.clock import format_age, format_time
from app.system.texts import (
    ENGLISH,
    Param,
    Text,
    TextLike,
    joined,
    number,
    render,
    rendered_if_known,
    say,
    text_in,
)
from app.system.version import installed_version
from app.web.acts import ActBody
from app.web.answers import ActAnswer

if TYPE_CHECKING:
    from app.cell.forward.status import ForwardStatus

# Values of the page of diagnostics as texts, in no language yet.

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


def clock_mark(status: ClockStatus) -> str:
    """The mark of the row of the clock."""
    if status.state in ("unknown", "simulated_awaited"):
        return "unknown"
    if status.state == "simulated":
        return "note"
    return "ok" if status.state == "even" else "problem"


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
    except (KeyError, ValueError):
        return ""
    known = isinstance(text, str) or rendered_if_known(text, ENGLISH) is not None
    return text if known else ""


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


def forward_waiting(status: "ForwardStatus") -> Text:
    """What the central database lacks."""
    about = {"size": size_text(status.size), "age": age_text(status.lag_s(time.time()))}
    return word("forward_waiting", rows=number(str(status.rows)), **about)


TEXTS: Final[dict[str, Any]] = {
    "word": word,
    "look_word": look_word,
    "rate_text": rate_text,
    "clock_mark": clock_mark,
    "size_text": size_text,
    "age_text": age_text,
    "qos_words": qos_words,
    "finding_text": finding_text,
    "remedy_text": remedy_text,
    "undecodable_text": undecodable_text,
    "forward_waiting": forward_waiting,
    "time_text": lambda wall: format_time(wall) if wall else NOTHING,
}


# What `/diagnostics` gets and answers, for programs.

View = Literal["topics", "servers", "graph", "nodes", "links"]
Form = Literal["text", "hex"]
State = Literal["ok", "problem", "unknown"]
MOST_NAME = 520


class DiagnosticsQuery(BaseModel):
    """`robot` is the id of one of several robots. The other fields are for the page only: `view` is
    the list that it shows, `search` a text that the rows contain, `look` the key of the topic that is
    looked into, `form` how; `paused`: the look goes on no longer for this request. `part=content` is
    the page without its frame; `rtt` is how long the last one took, in ms. `act` is the act whose
    receipt is shown."""

    model_config = ConfigDict(extra="forbid")

    robot: Annotated[str, Field(max_length=64)] = ""
    view: View = "topics"
    search: Annotated[str, Field(max_length=100)] = ""
    look: Annotated[str, Field(max_length=MOST_NAME)] = ""
    form: Form = "text"
    paused: bool = False
    part: Literal["", "content"] = ""
    rtt: Annotated[float, Field(ge=0, le=600_000)] | None = None
    act: Annotated[str, Field(max_length=400)] = ""


class LookQuery(BaseModel):
    """`topic` is the key of a topic, its name without the first slash; `form` is for the page."""

    model_config = ConfigDict(extra="forbid")

    topic: Annotated[str, Field(min_length=1, max_length=MOST_NAME)]
    robot: Annotated[str, Field(max_length=64)] = ""
    form: Form = "text"


class DiagnosticActBody(ActBody):
    """The same `id` again is the same act. `at` is when it was touched, in the server's own time.
    `robot` is the id of one of several robots, whose recording is shared. `version` is that of the
    release whose notice is postponed, for so many `days`."""

    robot: Annotated[str, Field(max_length=64)] = ""
    version: Annotated[str, Field(max_length=64)] = ""
    days: Annotated[int, Field(ge=1, le=MOST_DAYS)] = 1


class RoundTripsAnswer(BaseModel):
    """Milliseconds, over the last five minutes; `medians` are those of each five seconds."""

    least: float
    median: float
    most: float
    last: float
    medians: list[float]


class LinkAnswer(BaseModel):
    """A link: `state` is "ok", "wait" or "bad", `reason` why, "" for none. `trip_note` says by what its
    round trips are measured, or why there are none."""

    name: str
    state: Literal["ok", "wait", "bad"]
    text: str
    reason: str
    round_trips: RoundTripsAnswer | None = None
    trip_note: str = ""


class ClockAnswer(BaseModel):
    """The robot's clock. `skew_s` is by how many seconds it is ahead of the panel's (negative: behind),
    `within_s` how exact that is; null where it is not known, or time is simulated. `reason` is what is
    wrong, "" for nothing."""

    state: ClockWord
    text: str
    about: str
    reason: str
    skew_s: float | None
    within_s: float | None


class UndecodableAnswer(BaseModel):
    """The newest message of `size` bytes that could not be decoded, with its first bytes in
    hexadecimal."""

    first: str
    size: int
    reason: str
    at: AwareDatetime


class TopicAnswer(BaseModel):
    """A topic of the panel: `use` says whether it is subscribed to (`on_demand`: only while a browser
    shows it) or published."""

    name: str
    key: str
    expression: str
    type: str
    use: Literal["subscribed", "on_demand", "published"]
    state: State
    reason: str
    own_qos: str
    robot_qos: list[str]
    count: int
    rate_hz: float | None
    size: int | None
    age_s: float | None
    undecodable_count: int
    undecodable: UndecodableAnswer | None


class ServerAnswer(BaseModel):
    """A service or an action of one control, with its last result."""

    kind: Literal["service", "action"]
    widget: str
    label: str
    name: str
    type: str
    state: State
    reason: str
    running: bool
    outcome: str
    result: str


class ParameterAnswer(BaseModel):
    """A parameter of one control; `read_at` is when its node reported it."""

    widget: str
    label: str
    node: str
    name: str
    type: str
    state: State
    reason: str
    value: str
    read_at: AwareDatetime | None
    running: bool
    outcome: str
    result: str


class NodeAnswer(BaseModel):
    """A node, without what every node has."""

    name: str
    dds: str
    publishes: list[str]
    subscribes: list[str]
    services: list[str]
    actions: list[str]


class GraphTopicAnswer(BaseModel):
    """A topic of the robot's graph; `used` by this panel. `readers` are those of its bridges."""

    name: str
    key: str
    types: list[str]
    publishers: list[str]
    subscribers: list[str]
    publisher_qos: list[str]
    subscriber_qos: list[str]
    forwarding: Literal["forwarded", "denied", "lost"]
    used: bool
    readers: int | None


class GraphAnswer(BaseModel):
    """The ROS graph, as it was read last: `at` is null before that, `fault` why it can't be read."""

    at: AwareDatetime | None
    fault: str
    nodes: list[NodeAnswer]
    topics: list[GraphTopicAnswer]


class DoctorAnswer(BaseModel):
    """The last check: `at` and `well` are null before the first."""

    running: bool
    at: AwareDatetime | None
    fault: str
    well: bool | None
    findings: list[FoundFault]
    more: dict[str, int]
    facts: list[str]


class MqttAnswer(BaseModel):
    """The broker of `[alarms.mqtt]`: `state` is "connected", or why it is not, `since` when. `waiting`
    transitions are not published yet, `dropped` ones found no room."""

    address: str
    connected: bool
    state: str
    since: AwareDatetime | None
    last_error: str
    waiting: int
    published: int
    dropped: int


class ForwardAnswer(BaseModel):
    """The central database: `fault` is why nothing is sent, `since` when, `note` what is not as it
    should be. `rows` are not sent, the oldest of the time `oldest`, in about so many `bytes`;
    `unsent` are their numbers by stream. `sent` counts those of this run."""

    address: str
    connected: bool
    fault: str
    note: str
    since: AwareDatetime | None
    rows: int
    oldest: AwareDatetime | None
    bytes: int
    unsent: dict[str, int]
    sent: int


class MachineAnswer(BaseModel):
    """What is known of the panel's own PC, by `id`: "time" is its clock, "log-room" the room of
    the operator's log, "weaknesses" what a VEX file says, "release" a newer one. `reason` is what to
    do, "" for nothing."""

    id: str
    state: Literal["ok", "problem", "unknown", "note"]
    text: str
    about: str
    reason: str


class DiagnosticsAnswer(BaseModel):
    """`versions` are by the name of the program; `looks` are the keys of topics that are looked into
    now. `mqtt` is null for a panel without `[alarms.mqtt]`, `forward` for one without a central
    database."""

    versions: dict[str, str]
    links: list[LinkAnswer]
    clock: ClockAnswer
    topics: list[TopicAnswer]
    servers: list[ServerAnswer]
    parameters: list[ParameterAnswer]
    graph: GraphAnswer
    doctor: DoctorAnswer
    looks: list[str]
    mqtt: MqttAnswer | None
    forward: ForwardAnswer | None
    machine: list[MachineAnswer]


class LookedMessageAnswer(BaseModel):
    """A message: `number` counts those that arrived. `lines` are its fields, without the last
    `cut_lines`; none if it is not decoded, for `reason`. `hex_lines` are its bytes, without the last
    `cut_bytes`."""

    number: int
    at: AwareDatetime
    size: int
    lines: list[str]
    cut_lines: int
    reason: str
    hex_lines: list[str]
    cut_bytes: int


class LookAnswer(BaseModel):
    """The newest messages of a topic, the newest first, at most two of a second. `received` counts
    all."""

    topic: str
    types: list[str]
    received: int
    fault: str
    messages: list[LookedMessageAnswer]


class DiagnosticReceipt(ActAnswer):
    """The receipt of an act: `reason` is "" where it was done, `code` is its stable name. `recording`
    is the address of the recording that was shared, "" of other acts."""

    recording: str


# The page of diagnostics: its rows as texts.

MOST_ROWS: Final = 200  # of a list; the rest is counted
PLOT_WIDTH, PLOT_HEIGHT = 96, 32
SEVERITIES: Final = ("error", "warning", "note")
Row = TypeVar("Row", TopicRow, ServerRow, ParameterRow, NodeRow, GraphTopicRow)


@dataclass(frozen=True, slots=True)
class LinkRow:
    """A link with its lamp, what is known of its programs, and its round trips; `points` is their
    plot. `trip_note` says what was measured, or why nothing was."""

    id: str
    link: LinkStatus
    about: TextLike
    median: TextLike
    span: TextLike
    points: str
    trip_note: TextLike


class DiagnosticsContext(TypedDict):
    """The variables of `_diagnostics.html`. `more` is how many rows of the list are left out, as a
    sentence; `counts` are the rows of each list without a search."""

    query: DiagnosticsQuery
    links: list[LinkRow]
    robot_clock: ClockStatus
    findings: list[FoundFault]
    doctor: DoctorProcess
    doctor_at: TextLike
    counts: dict[View, int]
    topics: list[TopicRow]
    servers: list[ServerRow]
    parameters: list[ParameterRow]
    graph: list[GraphTopicRow]
    nodes: list[NodeRow]
    more: TextLike
    head: TextLike
    graph_note: TextLike
    looked: Look | None
    look_refused: TextLike
    address: Callable[..., str]


def versions() -> dict[str, str]:
    """By the name of the program or library."""
    return {"operator-panel": installed_version(), "eclipse-zenoh": version("eclipse-zenoh")}


def diagnostics_context(
    session: RobotSession,
    survey: Survey,
    doctor: DoctorProcess,
    query: DiagnosticsQuery,
    looked: Look | None,
    look_refused: TextLike,
    language: str,
    page_trips: RoundTripSummary | None,
) -> DiagnosticsContext:
    """The page as it is now. Only the list that is shown has rows. `page_trips` are the round trips of
    the browser."""
    panel, robot, now = session.panel, session.robot, time.monotonic()
    behind = robots_in(survey.graph, robot.graph.every_peer)
    topics = topic_rows(panel, robot, now)
    servers, parameters = server_rows(panel, robot, now), parameter_rows(panel, robot)
    graph, nodes = (
        graph_topic_rows(behind, {row.key for row in topics}, survey.lost_topics),
        node_rows(behind),
    )
    counts: dict[View, int] = {
        "topics": len(topics),
        "servers": len(servers) + len(parameters),
        "graph": len(graph),
        "nodes": len(nodes),
    }
    lists = Lists(query, language)
    return DiagnosticsContext(
        query=query,
        links=link_rows(session, survey, behind, page_trips, now),
        robot_clock=clock_status(robot, now),
        findings=_findings(doctor),
        doctor=doctor,
        doctor_at=format_time(doctor.wall) if doctor.wall else "",
        counts=counts,
        topics=lists.shown("topics", topics),
        servers=lists.shown("servers", servers),
        parameters=lists.shown("servers", parameters),
        graph=lists.shown("graph", graph),
        nodes=lists.shown("nodes", nodes),
        more=word("more_rows", count=lists.left_out) if lists.left_out else "",
        head=_head(query.view, topics, behind, survey),
        graph_note=_graph_note(survey),
        looked=looked,
        look_refused=look_refused,
        address=lambda **changed: _address(query, **changed),
    )


class Lists:
    """The rows of the chosen list that contain the text which is searched for."""

    def __init__(self, query: DiagnosticsQuery, language: str) -> None:
        self._query = query
        self._wanted = query.search.strip().lower()
        self._language = language
        self.left_out = 0

    def shown(self, view: View, rows: Sequence[Row]) -> list[Row]:
        if self._query.view not in (view, "links" if view == "topics" else view):
            return []
        matching = [row for row in rows if not self._wanted or self._wanted in self._text(row)]
        self.left_out += max(len(matching) - MOST_ROWS, 0)
        return matching[:MOST_ROWS]

    def _text(self, row: Row) -> str:
        match row:
            case TopicRow():
                parts = [row.name, row.type]
            case ServerRow():
                parts = [row.name, row.type, render(row.label, self._language)]
            case ParameterRow():
                parts = [row.node, row.name, render(row.label, self._language)]
            case NodeRow():
                parts = [row.name, *row.publishes, *row.subscribes, *row.services, *row.actions]
            case GraphTopicRow():
                parts = [row.name, *row.types, *row.publishers, *row.subscribers]
        return " ".join(parts).lower()


def _address(query: DiagnosticsQuery, **changed: str) -> str:
    """The query of the page with some of its fields changed; those with their usual value are left
    out."""
    kept = query.model_dump(include={"robot", "view", "search", "look", "form"}) | changed
    usual = {"view": "topics", "form": "text"}
    return urlencode({name: value for name, value in kept.items() if value != usual.get(name, "")})


def _findings(doctor: DoctorProcess) -> list[FoundFault]:
    every = doctor.report.findings if doctor.report else []
    return [finding for severity in SEVERITIES for finding in every if finding.severity == severity]


def _head(
    view: View, topics: Sequence[TopicRow], behind: Sequence[RobotGraph], survey: Survey
) -> TextLike:
    """What stands above the list."""
    if view in ("graph", "nodes"):
        return word("graph_at", time=format_time(survey.wall)) if survey.wall else ""
    heard = [row for row in topics if row.use == "subscribed"]
    arrived = word("arrived", arrived=sum(row.size is not None for row in heard), count=len(heard))
    readers = sum(bool(r.endpoint) and r.direction == "pub" for robot in behind for r in robot.routes)
    if not any(robot.bridges for robot in behind):
        return arrived
    return joined([arrived, word("bridge_readers", count=readers)], "between_names")


def _graph_note(survey: Survey) -> TextLike:
    if survey.fault:
        return word("graph_fault", why=survey.fault)
    return "" if survey.wall else word("unread")


def link_rows(
    session: RobotSession,
    survey: Survey,
    behind: Sequence[RobotGraph],
    page_trips: RoundTripSummary | None,
    now: float,
) -> list[LinkRow]:
    """The three links; the first is measured by the browser."""
    trips = {
        "server": page_trips,
        "bridge": session.robot.round_trips.summary(now),
        "node": session.node_trips.summary(now),
    }
    about = {
        "server": f"operator-panel {installed_version()}",
        "bridge": _peer_about(survey, behind),
        "node": _nodes_about(behind),
    }
    note = clock_note(session.robot, now)  # it has a row to itself
    return [
        _link_row(
            name,
            {**link, "reason": _without(link["reason"], note)},
            about.get(name, ""),
            trips.get(name),
            trip_note(name, link, trips.get(name), session.node_trips),
        )
        for name, link in session.publisher.view["link"].items()
    ]


def _without(reason: TextLike, note: TextLike) -> TextLike:
    """The lines without one of them."""
    if isinstance(reason, Text) and reason.code == "between_lines":
        parts = dict(reason.params)["parts"]
        assert isinstance(parts, tuple)
        return joined([part for part in parts if part != note], "between_lines")
    return "" if reason == note else reason


def _link_row(
    name: str, link: LinkStatus, about: TextLike, trips: RoundTripSummary | None, note: TextLike
) -> LinkRow:
    if trips is None:
        return LinkRow(name, link, about, NOTHING, "", "", note)
    least, median, most = (milliseconds(1000 * s) for s in (trips.least, trips.median, trips.most))
    span = word("from_to", least=least, most=most)
    return LinkRow(name, link, about, median, span, plot(trips), note)


def _peer_about(survey: Survey, behind: Sequence[RobotGraph]) -> TextLike:
    ours, theirs = version("eclipse-zenoh"), ", ".join(survey.zenoh)
    differ = theirs not in ("", ours)
    zenoh = word("versions", ours=ours, theirs=theirs) if differ else f"Zenoh {ours}"
    known = dict.fromkeys(bridge.version.lstrip("v") for robot in behind for bridge in robot.bridges)
    bridges = [word("bridge", version=known_version) for known_version in known if known_version]
    return joined([zenoh, *bridges], "between_names")


def _nodes_about(behind: Sequence[RobotGraph]) -> TextLike:
    nodes = [node for robot in behind for node in robot.nodes]
    topics = sum(len(robot.topics) for robot in behind)
    vendors = sorted({node.dds for node in nodes} - {""})
    return joined([word("counts", nodes=len(nodes), topics=topics), *vendors], "between_names")


def plot(trips: RoundTripSummary) -> str:
    """The points of a polyline: the newest at the right, zero at the bottom."""
    highest = max(*trips.medians, 1e-4)
    step = PLOT_WIDTH / (MAX_COLUMNS - 1)
    begin = PLOT_WIDTH - step * (len(trips.medians) - 1)
    return " ".join(
        f"{begin + step * i:.0f},{(PLOT_HEIGHT - 3) * (1 - seconds / highest) + 1:.0f}"
        for i, seconds in enumerate(trips.medians)
    )
