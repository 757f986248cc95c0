"""The dashboards of deploy/grafana: every query is run, as the reader, on a real PostgreSQL with a
week of 50 panels' data."""

import json
import re
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

import pytest
from ruamel.yaml import YAML

from deploy.grafana_dashboards import DASHBOARDS, texts
from tests.support.parts import ROOT
from tests.support.postgres import SCHEMA, Cluster, new_database

pytestmark = pytest.mark.promise("history")

GRAFANA: Final = ROOT / "deploy/grafana"
FILES: Final = sorted((GRAFANA / "dashboards").glob("*.json"))
PANELS: Final = 50
DAYS: Final = 7
QUERY_WITHIN_S: Final = 20.0  # of a machine with other work; alone the slowest takes a tenth
SECONDS: Final = {"1m": 60, "5m": 300, "10m": 600, "1h": 3600}
# Each panel's week: a press in 5 min with its result, each tenth refused; an alarm in 30 min, some of
# which chatter or flood; a state in 20 min; four pens; a minute of health.
FILL: Final = """
SET search_path = operator_panel;
INSERT INTO panel (name, site, key, writer)
  SELECT 'cell ' || n, 'line ' || n % 5, 'key' || n, 'cell1' FROM generate_series(1, {panels}) n;
INSERT INTO log SELECT p.id, 0, s.n, s.at, (extract(epoch FROM s.at) * 1000)::bigint, 'boot',
    s.n * 1000,
    CASE WHEN s.n % 40 = 0 THEN 'access' WHEN s.n % 2 = 1 THEN 'pressed' ELSE 'closed' END,
    CASE WHEN s.n % 2 = 0 THEN s.n - 1 END, '10.0.0.' || s.n % 9, '',
    CASE WHEN s.n % 7 = 0 THEN '' ELSE 'user ' || s.n % 6 END, '', md5(s.n::text),
    'widget' || s.n % 11, CASE WHEN s.n % 40 = 0 THEN 'sign_in' ELSE 'press' END, '{{}}', '',
    CASE WHEN s.n % 20 = 0 THEN 'interlock_not_permitted' ELSE '' END, '',
    CASE WHEN s.n % 20 = 0 THEN 'refused' WHEN s.n % 2 = 0 THEN 'published' ELSE '' END,
    'The robot does not permit it', '', '', ''
  FROM panel p, LATERAL (SELECT n, now() - interval '{days} days' + n * interval '150 s' AS at
    FROM generate_series(1, {days} * 576) n) s;
INSERT INTO alarm SELECT p.id, 0, s.n, s.at, 'air' || s.n % 13, '', 'air', 1 + (s.n % 20 > 0)::int
    + (s.n % 5 > 0)::int,
    CASE s.n % 3 WHEN 1 THEN 'raised' WHEN 2 THEN 'acknowledged' ELSE 'returned' END,
    CASE s.n % 3 WHEN 0 THEN 'normal' ELSE 'active' END, s.n,
    CASE s.n % 3 WHEN 2 THEN 'acknowledge' ELSE '' END,
    CASE s.n % 3 WHEN 2 THEN 'user 1' ELSE '' END, 'Air ' || s.n % 13 || ' low', 4, 5,
    30.0 * (s.n % 3), '{{}}'
  FROM panel p, LATERAL (SELECT n, now() - interval '{days} days' + n * interval '600 s' AS at
    FROM generate_series(1, {days} * 144) n) s;
INSERT INTO alarm SELECT p.id, 0, 100000 + n,
    date_trunc('hour', now() - interval '2 days') + n * interval '5 s', 'flood', '', 'air', 2, 'raised',
    'active', n, '', '', 'Flood', 1, 2, NULL, '{{}}' FROM panel p, generate_series(1, 60) n
  WHERE p.id % 10 = 0;
INSERT INTO state SELECT p.id, 0, n, now() - interval '{days} days' + n * interval '20 min', '',
    (ARRAY['Running', 'Waiting', 'Stopped', ''])[1 + n % 4], 'run', 'green', n % 4 < 3
  FROM panel p, generate_series(1, {days} * 72) n;
INSERT INTO pen SELECT p.id, 0, n, '', '/value' || n, 'std_msgs/msg/Float64', 'data'
  FROM panel p, generate_series(1, 4) n;
INSERT INTO trend SELECT p.id, 0, k, 60, m * 4 + k,
    date_trunc('minute', now()) - interval '2 days' + m * interval '1 minute', m - 1, m + 1, m, m
  FROM panel p, generate_series(1, 4) k, generate_series(1, 2 * 1440) m;
INSERT INTO trend_detail SELECT p.id, 0, k, 1, now() - interval '1 day' + s * interval '1 second',
    s - 1, s + 1, s FROM panel p, generate_series(1, 4) k, generate_series(1, 60) s;
INSERT INTO detail_request (panel, pens, since, until, asked_by, status, rows)
  SELECT p.id, '{{/value1}}', now() - interval '1 day', now(), 'ann', 'done', 60 FROM panel p;
INSERT INTO recipe SELECT p.id, 0, n, now() - n * interval '3 h', 'user 2', '', 'save', 'boxes/small',
    'succeeded', 'Saved', '{{}}' FROM panel p, generate_series(1, 20) n;
INSERT INTO health SELECT p.id, 0, n, now() - interval '2 days' + n * interval '1 min', '0.1.0',
    n * 60, n * 2.5, 120000000, 9000000000, 50000000, n % 3, 0.5, 0.01, 0, 1
  FROM panel p, generate_series(1, 2 * 1440) n;
INSERT INTO gap VALUES (1, 'alarms', 0, 5, 9, 'removed in the cell before it was sent');
ANALYZE;
"""


@pytest.fixture(scope="module")
def filled(postgres: Cluster) -> Cluster:
    """With the data of all panels."""
    new_database(postgres, template=SCHEMA)
    with postgres.connect() as db:
        for statement in FILL.format(panels=PANELS, days=DAYS).split(";\n"):
            db.execute(statement) if statement.strip() else None
    return postgres


def expanded(query: str, variables: dict[str, list[str]]) -> str:
    """A query as Grafana sends it, for the last days up to now."""
    until = datetime.now(UTC)
    begin, end = (f"'{at.isoformat()}'" for at in (until - timedelta(days=DAYS), until))
    query = query.replace("$__interval", "'10m'")
    query = re.sub(r"\$__timeFilter\(([\w.]+)\)", rf"\1 BETWEEN {begin} AND {end}", query)
    query = re.sub(
        r"\$__timeGroup\(([\w.]+), '(\w+)'\)",
        lambda m: f"floor(extract(epoch from {m[1]})/{SECONDS[m[2]]})*{SECONDS[m[2]]}",
        query,
    )
    query = query.replace("$__timeFrom()", begin).replace("$__timeTo()", end)
    for name, values in variables.items():
        chosen = ",".join("'" + value.replace("'", "''") + "'" for value in values)
        query = query.replace(f"${{{name}:sqlstring}}", chosen)
    assert "$" not in query, f"Grafana's words that the test does not know: {query}"
    return query


def read(server: Cluster, query: str) -> tuple[list[str], list[tuple[Any, ...]]]:
    with server.connect(user="grafana") as db:
        began = time.monotonic()
        cursor = db.execute(query)
        rows = cursor.fetchall()
        assert time.monotonic() - began < QUERY_WITHIN_S, query
        assert cursor.description is not None
        return [column.name for column in cursor.description], rows


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_query_answers_with_the_data_of_fifty_panels(filled: Cluster, file: Path) -> None:
    dashboard = json.loads(file.read_text())
    variables = {}
    for variable in dashboard["templating"]["list"]:
        _, rows = read(filled, variable["query"])
        variables[variable["name"]] = [row[0] for row in rows]
    assert len(variables["cell"]) == PANELS
    for panel in dashboard["panels"]:
        (target,) = panel["targets"]
        columns, rows = read(filled, expanded(target["rawSql"], variables))
        assert rows, panel["title"]
        assert any(value is not None for value in rows[0]), panel["title"]
        if target["format"] == "time_series":
            assert columns[:2] == ["time", "metric"], panel["title"]
            assert len({row[1] for row in rows}) >= 2, panel["title"]
        if panel["type"] == "stat":
            assert len(rows) == 1, panel["title"]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_query_of_one_cell_has_no_other(filled: Cluster, file: Path) -> None:
    dashboard = json.loads(file.read_text())
    more = {"who": ["user 1"], "field": ["/value1 data"]}
    for panel in dashboard["panels"]:
        query = expanded(panel["targets"][0]["rawSql"], {"cell": ["cell 10"], **more})
        columns, rows = read(filled, query)
        for name in {"cell", "metric"} & set(columns):
            cells = {str(row[columns.index(name)]) for row in rows}
            if panel["title"] != "Results an hour":
                assert all("cell 10" in cell for cell in cells), panel["title"]


def test_figures_are_those_of_the_data(filled: Cluster) -> None:
    def figures(dashboard: str, title: str, **variables: list[str]) -> Any:
        about = json.loads((GRAFANA / f"dashboards/{dashboard}.json").read_text())
        (panel,) = (panel for panel in about["panels"] if panel["title"] == title)
        query = expanded(panel["targets"][0]["rawSql"], {"cell": ["cell 10"], **variables})
        return read(filled, query)[1]

    assert figures("alarms", "Most in ten minutes")[0][0] >= 59
    an_hour = figures("alarms", "Alarms an hour and cell")[0][0]
    assert an_hour == pytest.approx((DAYS * 48 + 60) / (DAYS * 24), rel=0.02)
    assert 0 < figures("alarms", "Time in floods")[0][0] < 0.01
    assert figures("alarms", "Chattering: three times or more in a minute")[0][2] >= 12
    shares = {row[2]: row[4] for row in figures("states", "Share of time")}
    assert all(float(share) == pytest.approx(1 / 3, abs=0.02) for share in shares.values())
    assert figures("health", "Panels that were not heard of for five minutes") == [(0,)]
    ranges = figures("trends", "Range", field=["/value1 data"])
    assert ranges[0][4] < ranges[0][5] < ranges[0][6]
    ((_, _, _, p50, p99),) = figures("presses", "From the press to its result")[:1]
    assert p50 == p99 == pytest.approx(150_000)


def test_the_files_are_those_of_the_table() -> None:
    assert {file.name: file.read_text() for file in FILES} == texts(), (
        "python -m deploy.grafana_dashboards"
    )
    assert len(FILES) == len(DASHBOARDS) == 6


def test_panels_have_a_place_each() -> None:
    for dashboard in map(json.loads, texts().values()):
        taken: set[tuple[int, int]] = set()
        for panel in dashboard["panels"]:
            at = panel["gridPos"]
            cells = {
                (x, y)
                for x in range(at["x"], at["x"] + at["w"])
                for y in range(at["y"], at["y"] + at["h"])
            }
            assert not taken & cells, panel["title"]
            assert at["x"] + at["w"] <= 24
            taken |= cells


def test_the_compose_file_names_what_is_there() -> None:
    compose = YAML(typ="safe").load(GRAFANA / "compose.yaml")
    grafana = compose["services"]["grafana"]
    for volume in grafana["volumes"]:
        source = str(volume).partition(":")[0]
        assert source in compose["volumes"] or (GRAFANA / source).is_dir()
    assert set(grafana["secrets"]) | {"postgres"} == set(compose["secrets"])
    (source,) = YAML(typ="safe").load(GRAFANA / "provisioning/datasources/operator-panel.yaml")[
        "datasources"
    ]
    uids = {
        target["datasource"]["uid"]
        for text in texts().values()
        for panel in json.loads(text)["panels"]
        for target in panel["targets"]
    }
    assert uids == {source["uid"]}
    named = set(re.findall(r"\$\{(\w+)\}", json.dumps(source)))
    assert named <= grafana["environment"].keys()
    assert [name for name in compose["services"]["postgres"]["ports"]] == ["5432:5432"]
