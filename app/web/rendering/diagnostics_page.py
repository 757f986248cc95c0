"""The page of diagnostics: its rows as texts."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Final, TypedDict, TypeVar
from urllib.parse import urlencode

from app.clock import format_time
from app.i18n import TextLike, joined, render
from app.robot.round_trips import KEPT, RoundTripSummary
from app.runtime.doctor_process import DoctorProcess, FoundFault
from app.runtime.graph_survey import Survey
from app.runtime.live_look import Look
from app.runtime.robot_session import RobotSession
from app.survey.model import RobotGraph
from app.version import installed_version
from app.view.diagnostic_graph import (
    GraphTopicRow,
    NodeRow,
    graph_topic_rows,
    node_rows,
    robots_in,
)
from app.view.diagnostic_rows import (
    ParameterRow,
    ServerRow,
    TopicRow,
    parameter_rows,
    server_rows,
    topic_rows,
)
from app.view.link_status import LinkStatus
from app.web.diagnostics_answer import DiagnosticsQuery, View
from app.web.rendering.diagnostics_texts import NOTHING, milliseconds, trip_note, word

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
    graph, nodes = graph_topic_rows(behind, {row.key for row in topics}, survey.lost), node_rows(behind)
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
    return [
        _link_row(
            name,
            link,
            about.get(name, ""),
            trips.get(name),
            trip_note(name, link, trips.get(name), session.node_trips),
        )
        for name, link in session.publisher.view["link"].items()
    ]


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
    step = PLOT_WIDTH / (KEPT - 1)
    begin = PLOT_WIDTH - step * (len(trips.medians) - 1)
    return " ".join(
        f"{begin + step * i:.0f},{(PLOT_HEIGHT - 3) * (1 - seconds / highest) + 1:.0f}"
        for i, seconds in enumerate(trips.medians)
    )
