"""`python -m deploy.grafana_dashboards`: writes the dashboards of deploy/grafana from the tables below.

A dashboard has rows of panels, a panel one query on the tables of the central database
(app/tools/central/sql). Grafana replaces `$__timeFilter(…)`, `$__timeGroup(…)` and the variables; the
tests do the same on a real PostgreSQL.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

FOLDER: Final = Path(__file__).parent / "grafana" / "dashboards"
SOURCE: Final = {"type": "grafana-postgresql-datasource", "uid": "operator-panel"}
WIDTH: Final = 24  # of Grafana's grid
SCHEMA: Final = 39


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """A panel of a dashboard: `kind` is Grafana's name of it, `width` of 24, `unit` Grafana's name of a
    unit. `limits` are the values from which it is orange and red."""

    title: str
    kind: str
    query: str
    about: str = ""
    width: int = 12
    height: int = 8
    unit: str = ""
    limits: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Dashboard:
    """`variables` are chosen above it, besides the cells: name → query."""

    name: str
    title: str
    about: str
    views: Sequence[View]
    variables: Mapping[str, str] = field(default_factory=dict)
    since: str = "now-7d"


CELLS: Final = "SELECT name FROM operator_panel.panel WHERE retired IS NULL ORDER BY name"
CHOSEN: Final = "p.name IN (${cell:sqlstring})"
JOIN: Final = "JOIN operator_panel.panel p ON p.id = {0}.panel"


def rows_of(table: str, alias: str) -> str:
    """The rows of a table in the time and of the cells that are chosen."""
    return (
        f"FROM operator_panel.{table} {alias} {JOIN.format(alias)}"
        f" WHERE $__timeFilter({alias}.at) AND {CHOSEN}"
    )


def pens_rows(table: str) -> str:
    """The rows `t` of a table of trends, with their pens `n`, in the time and of what is chosen."""
    return (
        f"FROM operator_panel.{table} t JOIN operator_panel.pen n ON n.panel = t.panel"
        f" AND n.generation = t.generation AND n.number = t.pen {JOIN.format('t')}"
        f" WHERE $__timeFilter(t.at) AND {CHOSEN}"
        " AND n.topic || ' ' || n.field IN (${field:sqlstring})"
    )


RAISED: Final = f"{rows_of('alarm', 'a')} AND a.event = 'raised'"
PER_10_MIN: Final = (
    "SELECT $__timeGroup(a.at, '10m') AS span, p.name AS cell, count(*) AS raised"
    f" {RAISED} GROUP BY 1, 2"
)
# When a robot was in a state: until the next row of the same robot, or now.
PERIODS: Final = (
    "SELECT p.name AS cell, s.robot, s.state, s.recorded, s.at,"
    " lead(s.at, 1, now()) OVER (PARTITION BY s.panel, s.robot ORDER BY s.generation, s.seq) - s.at"
    f" AS lasted {rows_of('state', 's')}"
)
# A press with the last entry about it.
PRESSES: Final = (
    "SELECT e.panel, e.generation, e.seq, e.at, e.who, e.widget, e.robot, p.name AS cell"
    f" {rows_of('log', 'e')} AND e.kind = 'pressed' AND e.action = 'press'"
)
RESULTS: Final = (
    f"{rows_of('log', 'e')} AND e.outcome <> '' AND e.kind IN ('closed', 'corrected', 'refused')"
)
NEWEST_HEALTH: Final = (
    "SELECT DISTINCT ON (h.panel) h.*, p.name AS cell, p.site FROM operator_panel.health h"
    f" {JOIN.format('h')} WHERE {CHOSEN} AND h.at > now() - interval '40 days'"
    " ORDER BY h.panel, h.generation DESC, h.seq DESC"
)

DASHBOARDS: Final = (
    Dashboard(
        name="alarms",
        title="Alarms over cells",
        about="After EEMUA 191: an operator can handle about one alarm in ten minutes; more than ten in"
        " ten minutes are a flood.",
        views=(
            View(
                title="Alarms an hour and cell",
                kind="stat",
                width=6,
                height=4,
                limits=(6, 12),
                about="EEMUA 191: up to 6 are acceptable, above 12 are over-demanding",
                query="SELECT count(*)::float8 / greatest(1, extract(epoch FROM"
                " $__timeTo()::timestamptz - $__timeFrom()::timestamptz) / 3600.0"
                f" * count(DISTINCT p.id)) AS an_hour {RAISED}",
            ),
            View(
                title="Most in ten minutes",
                kind="stat",
                width=6,
                height=4,
                limits=(10, 20),
                query=f"SELECT coalesce(max(raised), 0) AS most FROM ({PER_10_MIN}) AS spans",
            ),
            View(
                title="Time in floods",
                kind="stat",
                width=6,
                height=4,
                unit="percentunit",
                limits=(0.01, 0.05),
                about="Share of ten-minute spans with more than ten alarms",
                query="SELECT count(*) FILTER (WHERE raised > 10) / greatest(1.0, extract(epoch FROM"
                " $__timeTo()::timestamptz - $__timeFrom()::timestamptz) / 600.0"
                f" * count(DISTINCT cell)) AS share FROM ({PER_10_MIN}) AS spans",
            ),
            View(
                title="Until acknowledged, median",
                kind="stat",
                width=6,
                height=4,
                unit="s",
                query="SELECT percentile_cont(0.5) WITHIN GROUP (ORDER BY a.lasted_s) AS seconds"
                f" {rows_of('alarm', 'a')} AND a.event = 'acknowledged'",
            ),
            View(
                title="Alarms in ten minutes",
                kind="timeseries",
                width=16,
                limits=(10, 20),
                query="SELECT $__timeGroup(a.at, '10m') AS time, p.name AS metric, count(*) AS raised"
                f" {RAISED} GROUP BY 1, 2 ORDER BY 1",
            ),
            View(
                title="By priority",
                kind="piechart",
                width=8,
                about="Near 5 % high, 15 % medium, 80 % low",
                query="SELECT CASE a.priority WHEN 1 THEN 'high' WHEN 2 THEN 'medium' WHEN 3 THEN 'low'"
                " ELSE 'diagnostic' END AS priority, count(*) AS raised"
                f" {RAISED} GROUP BY 1 ORDER BY 1",
            ),
            View(
                title="Most frequent",
                kind="table",
                query=f"SELECT a.text AS alarm, p.name AS cell, count(*) AS raised {RAISED}"
                " GROUP BY 1, 2 ORDER BY 3 DESC LIMIT 20",
            ),
            View(
                title="Chattering: three times or more in a minute",
                kind="table",
                query="SELECT alarm, cell, max(raised) AS most_in_a_minute"
                " FROM (SELECT a.text AS alarm,"
                f" p.name AS cell, $__timeGroup(a.at, '1m') AS span, count(*) AS raised {RAISED}"
                " GROUP BY 1, 2, 3) AS spans WHERE raised >= 3 GROUP BY 1, 2 ORDER BY 3 DESC LIMIT 20",
            ),
            View(
                title="Standing for more than a day",
                kind="table",
                query="SELECT cell, alarm, since, state FROM (SELECT DISTINCT ON (a.panel, a.alarm)"
                " p.name AS cell, a.text AS alarm, a.at AS since, a.state, a.event"
                f" FROM operator_panel.alarm a {JOIN.format('a')} WHERE {CHOSEN}"
                " AND a.at > now() - interval '400 days'"
                " ORDER BY a.panel, a.alarm, a.generation DESC, a.seq DESC) AS newest"
                " WHERE state IN ('active', 'latched', 'unknown')"
                " AND since < now() - interval '1 day' ORDER BY since LIMIT 50",
            ),
            View(
                title="By cell",
                kind="table",
                query="SELECT p.site, p.name AS cell, count(*) AS raised,"
                " count(*) FILTER (WHERE a.priority = 1) AS high,"
                f" count(DISTINCT a.alarm) AS different {RAISED} GROUP BY 1, 2 ORDER BY 3 DESC",
            ),
        ),
    ),
    Dashboard(
        name="states",
        title="Machine states",
        about="When each machine was in which state. Times without a record are not counted.",
        since="now-24h",
        views=(
            View(
                title="States",
                kind="state-timeline",
                width=24,
                height=12,
                query="SELECT s.at AS time,"
                " p.name || CASE s.robot WHEN '' THEN '' ELSE ' ' || s.robot END AS metric,"
                " CASE WHEN s.recorded THEN s.state END AS state"
                f" {rows_of('state', 's')} ORDER BY 1",
            ),
            View(
                title="Share of time",
                kind="table",
                query="SELECT cell, robot, state, sum(extract(epoch FROM lasted)) AS seconds,"
                " sum(extract(epoch FROM lasted)) / sum(sum(extract(epoch FROM lasted)))"
                f" OVER (PARTITION BY cell, robot) AS share FROM ({PERIODS}) AS periods"
                " WHERE recorded GROUP BY 1, 2, 3 ORDER BY 1, 2, 4 DESC",
            ),
            View(
                title="Over all cells",
                kind="piechart",
                unit="s",
                query="SELECT state, sum(extract(epoch FROM lasted)) AS seconds"
                f" FROM ({PERIODS}) AS periods WHERE recorded GROUP BY 1 ORDER BY 2 DESC",
            ),
            View(
                title="Changes an hour",
                kind="timeseries",
                query="SELECT $__timeGroup(s.at, '1h') AS time, p.name AS metric, count(*) AS changes"
                f" {rows_of('state', 's')} GROUP BY 1, 2 ORDER BY 1",
            ),
            View(
                title="Longest of each state",
                kind="table",
                query="SELECT DISTINCT ON (cell, robot, state) cell, robot, state, at AS since,"
                f" extract(epoch FROM lasted) AS seconds FROM ({PERIODS}) AS periods WHERE recorded"
                " ORDER BY cell, robot, state, lasted DESC",
            ),
        ),
    ),
    Dashboard(
        name="presses",
        title="Presses and refusals",
        about="What operators pressed, and why it was refused.",
        views=(
            View(
                title="Results an hour",
                kind="timeseries",
                width=16,
                query="SELECT $__timeGroup(e.at, '1h') AS time, e.outcome AS metric,"
                f" count(*) AS presses {RESULTS} GROUP BY 1, 2 ORDER BY 1",
            ),
            View(
                title="Results",
                kind="piechart",
                width=8,
                query=f"SELECT e.outcome, count(*) AS presses {RESULTS} GROUP BY 1 ORDER BY 2 DESC",
            ),
            View(
                title="Why refused",
                kind="table",
                query="SELECT e.verdict AS code, min(e.reason) AS reason, count(*) AS refused,"
                f" count(DISTINCT p.id) AS cells {RESULTS} AND e.outcome = 'refused'"
                " GROUP BY 1 ORDER BY 3 DESC LIMIT 30",
            ),
            View(
                title="Refused most",
                kind="table",
                query="SELECT p.name AS cell, e.widget, count(*) AS refused"
                f" {RESULTS} AND e.outcome = 'refused' GROUP BY 1, 2 ORDER BY 3 DESC LIMIT 30",
            ),
            View(
                title="From the press to its result",
                kind="table",
                query="SELECT x.cell, x.widget, count(*) AS presses,"
                " percentile_cont(0.5) WITHIN GROUP (ORDER BY r.at_ms - x.at_ms) AS p50_ms,"
                " percentile_cont(0.99) WITHIN GROUP (ORDER BY r.at_ms - x.at_ms) AS p99_ms"
                f" FROM (SELECT e.at_ms, {PRESSES.removeprefix('SELECT ')}) AS x"
                " JOIN operator_panel.log r ON r.panel = x.panel AND r.generation = x.generation"
                " AND r.of = x.seq AND r.kind = 'closed' AND $__timeFilter(r.at)"
                " GROUP BY 1, 2 ORDER BY 5 DESC NULLS LAST LIMIT 30",
            ),
            View(
                title="Presses by cell",
                kind="barchart",
                query=f"SELECT cell, count(*) AS presses FROM ({PRESSES}) AS presses"
                " GROUP BY 1 ORDER BY 2 DESC",
            ),
        ),
    ),
    Dashboard(
        name="people",
        title="Who did what",
        about="From the operators' logs of all cells. `operator-panel central verify` proves them.",
        since="now-24h",
        variables={
            "who": "SELECT DISTINCT who FROM operator_panel.log WHERE who <> ''"
            " AND at > now() - interval '31 days' ORDER BY 1"
        },
        views=(
            View(
                title="Entries",
                kind="table",
                width=24,
                height=12,
                query="SELECT e.at AS time, p.name AS cell, e.who, e.kind, e.action, e.robot, e.widget,"
                f" e.outcome, e.reason {rows_of('log', 'e')}"
                " AND e.who IN (${who:sqlstring}) AND e.kind <> 'signed'"
                " ORDER BY e.at DESC LIMIT 500",
            ),
            View(
                title="By person",
                kind="table",
                query="SELECT e.who, count(*) FILTER (WHERE e.kind = 'pressed') AS presses,"
                " count(*) FILTER (WHERE e.outcome = 'refused') AS refused,"
                " count(DISTINCT p.id) AS cells, max(e.at) AS last"
                f" {rows_of('log', 'e')} AND e.who <> '' GROUP BY 1 ORDER BY 2 DESC",
            ),
            View(
                title="Sign-ins that were refused",
                kind="table",
                query="SELECT e.at AS time, p.name AS cell, e.address, e.widget, e.reason"
                f" {rows_of('log', 'e')} AND e.kind = 'access' AND e.outcome = 'refused'"
                " ORDER BY e.at DESC LIMIT 100",
            ),
            View(
                title="Changes of recipes",
                kind="table",
                query="SELECT r.at AS time, p.name AS cell, r.who, r.action, r.object, r.reason"
                f" {rows_of('recipe', 'r')} ORDER BY r.at DESC LIMIT 100",
            ),
            View(
                title="Acts on alarms",
                kind="table",
                query="SELECT a.at AS time, p.name AS cell, a.who, a.act, a.text AS alarm"
                f" {rows_of('alarm', 'a')} AND a.act <> '' ORDER BY a.at DESC LIMIT 100",
            ),
        ),
    ),
    Dashboard(
        name="trends",
        title="Trends",
        about="A value a minute: lowest, highest and mean. The seconds are in the cell, until"
        " operator-panel central ask has asked for them.",
        since="now-24h",
        variables={
            "field": "SELECT DISTINCT topic || ' ' || field FROM operator_panel.pen ORDER BY 1"
        },
        views=(
            *(
                View(
                title=title,
                kind="timeseries",
                width=24,
                query="SELECT $__timeGroup(t.at, $__interval) AS time,"
                f" p.name || ' ' || n.robot || n.topic AS metric, {column}"
                f" {pens_rows('trend')} GROUP BY 1, 2 ORDER BY 1",
                )
                for title, column in (
                    ("Mean", "sum(t.mean * t.count) / sum(t.count) AS mean"),
                    ("Highest", "max(t.high) AS highest"),
                    ("Lowest", "min(t.low) AS lowest"),
                )
            ),
            View(
                title="Range",
                kind="table",
                width=24,
                query="SELECT p.name AS cell, n.robot, n.topic, n.field, min(t.low) AS lowest,"
                " sum(t.mean * t.count) / sum(t.count) AS mean, max(t.high) AS highest,"
                " count(*) AS minutes"
                f" {pens_rows('trend')} GROUP BY 1, 2, 3, 4 ORDER BY 1",
            ),
            View(
                title="Details that were asked for",
                kind="timeseries",
                width=24,
                about="The last value of each second or ten, where a cell has sent them",
                query="SELECT t.at AS time, p.name || ' ' || n.robot || n.topic AS metric, t.last"
                f" {pens_rows('trend_detail')} ORDER BY 1",
            ),
            View(
                title="Requests for details",
                kind="table",
                width=24,
                query="SELECT p.name AS cell, array_to_string(r.pens, ', ') AS pens, r.since, r.until,"
                " r.asked_by, r.asked_at, r.status, r.rows, r.reason"
                f" FROM operator_panel.detail_request r {JOIN.format('r')} WHERE {CHOSEN}"
                " ORDER BY r.id DESC LIMIT 100",
            ),
        ),
    ),
    Dashboard(
        name="health",
        title="Health of panels",
        about="Once a minute from each panel.",
        since="now-24h",
        views=(
            View(
                title="Panels that were not heard of for five minutes",
                kind="stat",
                width=6,
                height=4,
                limits=(1, 2),
                query=f"SELECT count(*) AS panels FROM operator_panel.panel p WHERE {CHOSEN}"
                " AND p.retired IS NULL AND NOT EXISTS (SELECT 1 FROM operator_panel.health h"
                " WHERE h.panel = p.id AND h.at > now() - interval '5 minutes')",
            ),
            View(
                title="Rows that wait in the cells",
                kind="stat",
                width=6,
                height=4,
                limits=(10_000, 100_000),
                query=f"SELECT coalesce(sum(unsent), 0) AS rows FROM ({NEWEST_HEALTH}) AS newest",
            ),
            View(
                title="Least disk",
                kind="stat",
                width=6,
                height=4,
                unit="bytes",
                query=f"SELECT min(disk_free_bytes) AS bytes FROM ({NEWEST_HEALTH}) AS newest",
            ),
            View(
                title="Largest difference of clocks",
                kind="stat",
                width=6,
                height=4,
                unit="s",
                limits=(1, 5),
                query=f"SELECT max(abs(clock_ahead_s)) AS seconds FROM ({NEWEST_HEALTH}) AS newest",
            ),
            View(
                title="Panels",
                kind="table",
                width=24,
                height=12,
                query="SELECT site, cell, version, at AS last, extract(epoch FROM now() - at) AS age_s,"
                " up_s, memory_bytes, disk_free_bytes, data_bytes, unsent, lag_s, clock_ahead_s"
                f" FROM ({NEWEST_HEALTH}) AS newest ORDER BY age_s DESC",
            ),
            *(
                View(
                    title=title,
                    kind="timeseries",
                    unit=unit,
                    query="SELECT $__timeGroup(h.at, $__interval) AS time, p.name AS metric,"
                    f" {column} {rows_of('health', 'h')} GROUP BY 1, 2 ORDER BY 1",
                )
                for title, unit, column in (
                    ("Memory", "bytes", "max(h.memory_bytes) AS memory"),
                    ("CPU, share of a core", "percentunit",
                     "greatest(0, (max(h.cpu_s) - min(h.cpu_s)) / greatest(1, extract(epoch FROM"
                     " max(h.at) - min(h.at)))) AS cpu"),
                    ("Free disk", "bytes", "min(h.disk_free_bytes) AS free"),
                    ("Age of the oldest row that waits", "s", "max(h.lag_s) AS lag"),
                )
            ),
            View(
                title="Gaps: rows that a cell had removed before they were sent",
                kind="table",
                width=24,
                query='SELECT p.name AS cell, g.stream, g.first, g."last", g.reason, g.at AS noted'
                f" FROM operator_panel.gap g {JOIN.format('g')} WHERE {CHOSEN}"
                " ORDER BY g.at DESC LIMIT 100",
            ),
        ),
    ),
)  # fmt: skip


def as_grafana(dashboard: Dashboard) -> dict[str, Any]:
    """A dashboard as Grafana reads it."""
    return {
        "uid": f"operator-panel-{dashboard.name}",
        "title": dashboard.title,
        "description": dashboard.about,
        "tags": ["operator-panel"],
        "schemaVersion": SCHEMA,
        "editable": True,
        "time": {"from": dashboard.since, "to": "now"},
        "refresh": "1m",
        "templating": {"list": [*_variables({"cell": CELLS, **dashboard.variables})]},
        "panels": [*_panels(dashboard.views)],
    }


def _variables(queries: Mapping[str, str]) -> Iterable[dict[str, Any]]:
    for name, query in queries.items():
        yield {
            "name": name,
            "type": "query",
            "datasource": SOURCE,
            "query": query,
            "refresh": 2,
            "multi": True,
            "includeAll": True,
            "current": {"text": ["All"], "value": ["$__all"]},
        }


def _panels(views: Iterable[View]) -> Iterable[dict[str, Any]]:
    x = y = tallest = 0
    for number, view in enumerate(views, 1):
        if x + view.width > WIDTH:
            x, y, tallest = 0, y + tallest, 0
        is_series = view.kind in ("timeseries", "state-timeline")
        yield {
            "id": number,
            "type": view.kind,
            "title": view.title,
            "description": view.about,
            "gridPos": {"x": x, "y": y, "w": view.width, "h": view.height},
            "datasource": SOURCE,
            "interval": "1m",
            "fieldConfig": {"defaults": _defaults(view), "overrides": []},
            "targets": [
                {
                    "refId": "A",
                    "datasource": SOURCE,
                    "format": "time_series" if is_series else "table",
                    "rawQuery": True,
                    "editorMode": "code",
                    "rawSql": view.query,
                }
            ],
        }
        x, tallest = x + view.width, max(tallest, view.height)


def _defaults(view: View) -> dict[str, Any]:
    defaults: dict[str, Any] = {"unit": view.unit} if view.unit else {}
    if view.limits is not None:
        orange, red = view.limits
        steps = [
            {"color": "text", "value": None},
            {"color": "orange", "value": orange},
            {"color": "red", "value": red},
        ]
        defaults["thresholds"] = {"mode": "absolute", "steps": steps}
    return defaults


def texts() -> dict[str, str]:
    """The files by their names."""
    return {
        f"{dashboard.name}.json": json.dumps(as_grafana(dashboard), indent=1) + "\n"
        for dashboard in DASHBOARDS
    }


if __name__ == "__main__":
    for file_name, text in texts().items():
        (FOLDER / file_name).write_text(text)
