"""Which requests come from a page in a frame, which pages may be framed, and by whom."""

from collections.abc import Iterator, Mapping

import pytest
from pydantic import ValidationError

from app.panel.rules import EmbedRules
from app.web.caller import Caller, frame_ancestors, only_shows
from tests.support.holds import PANEL
from tests.support.parts import Server
from tests.support.servers import demo_server

ORIGIN = "https://dashboard.example"
FRAMED = "http://127.0.0.1/pages/one?embed=1"


def caller(query: str, headers: Mapping[str, str]) -> Caller:
    raw = [(name.encode(), value.encode()) for name, value in headers.items()]
    return Caller(
        {
            "type": "http",
            "path": "/pages/one",
            "query_string": query.encode(),
            "headers": [(b"host", b"localhost"), *raw],
            "scheme": "http",
        }
    )


@pytest.mark.parametrize(
    ("query", "headers", "page", "request_"),
    [
        ("", {}, False, False),
        ("embed=1", {}, True, True),
        ("embed=0", {}, False, False),
        ("receipt=1&embed=1", {}, True, True),
        ("", {"sec-fetch-dest": "document"}, False, False),
        ("embed=1", {"sec-fetch-dest": "document"}, True, True),
        ("", {"sec-fetch-dest": "iframe"}, True, True),
        ("", {"sec-fetch-dest": "object"}, True, True),
        ("", {"referer": FRAMED}, True, True),
        ("", {"referer": FRAMED, "sec-fetch-dest": "document"}, False, True),  # a link in a new window
        ("", {"referer": FRAMED, "sec-fetch-dest": "empty"}, True, True),
        ("", {"referer": "http://["}, False, False),
        ("", {"sec-fetch-storage-access": "none"}, True, True),
    ],
)
def test_a_request_of_a_frame_is_known(
    query: str, headers: dict[str, str], page: bool, request_: bool
) -> None:
    asked = caller(query, headers)
    assert (asked.embedded, asked.from_frame) == (page, request_)


def test_controls_are_never_embedded_unless_said() -> None:
    none, shown, all_ = (
        EmbedRules(),
        EmbedRules(origins=(ORIGIN,)),
        EmbedRules(origins=(ORIGIN,), controls=True),
    )
    assert [only_shows(rules, True) for rules in (none, shown, all_)] == [False, True, False]
    assert [only_shows(rules, False) for rules in (none, shown, all_)] == [False, False, False]
    assert [frame_ancestors(rules, True) for rules in (none, shown)] == ["'none'", ORIGIN]
    assert frame_ancestors(shown, False) == "'none'"


@pytest.mark.parametrize(
    "origin",
    ["*", "https://*.example", "dashboard.example", "https://a.example/", "https://A.example", "'self'",
     "https://a.example; script-src *", "file:///", "https://a b", "https://user@a.example"],
)  # fmt: skip
def test_an_origin_is_a_scheme_a_host_and_a_port(origin: str) -> None:
    with pytest.raises(ValidationError):
        EmbedRules(origins=(origin,))


@pytest.mark.parametrize(
    "origin", [ORIGIN, "http://192.0.2.20:3000", "http://localhost:8080", "http://[::1]:80"]
)
def test_origins_are_accepted(origin: str) -> None:
    assert EmbedRules(origins=(origin,)).origins == (origin,)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    panel = f'{PANEL}\n[embed]\norigins = ["{ORIGIN}"]\n'
    with demo_server(tmp_path_factory.mktemp("cell"), panel) as mine:
        yield mine


def policy(server: Server, path: str, **headers: str) -> str:
    answer = server.http.get(path, headers={"accept": "text/html", **headers})
    return str(answer.headers["content-security-policy"])


def test_only_pages_for_frames_may_be_framed(cell: Server) -> None:
    assert f"frame-ancestors {ORIGIN}" in policy(cell, "/pages/one?embed=1")
    assert "form-action 'none'" in policy(cell, "/pages/one?embed=1")
    for path in ("/pages/one", "/", "/log?text=x", "/none?embed=1", "/log"):
        assert "frame-ancestors 'none'" in policy(cell, path), path


def test_a_frame_gets_the_page_that_is_for_it(cell: Server) -> None:
    answer = cell.http.get("/pages/one?receipt=x", headers={"sec-fetch-dest": "iframe"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/pages/one?receipt=x&embed=1")
    answer = cell.http.get("/", headers={"sec-fetch-dest": "iframe"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/?embed=1")


def test_controls_in_a_frame_are_locked(cell: Server) -> None:
    text = cell.http.get("/events?once=1&embed=1").text
    assert '"role":"embedded"' in text
    assert '"enabled":true' not in text.split('"widgets"')[1]
    assert '"role":"embedded"' in cell.http.get("/events?once=1", headers={"referer": FRAMED}).text
    assert '"role":"embedded"' not in cell.http.get("/events?once=1").text


@pytest.mark.parametrize(
    "headers",
    [{"referer": FRAMED}, {"sec-fetch-dest": "iframe"}, {"sec-fetch-storage-access": "active"}],
)
def test_press_from_a_frame_is_refused(cell: Server, headers: dict[str, str]) -> None:
    for path in ("/widgets/jog", "/display", "/control/take"):
        answer = cell.http.post(path, headers=headers)
        assert answer.status_code == 403
        assert answer.json() == {"error": "a page in a frame asked for this: open the panel itself"}
