"""Who may come in: the names the panel is known by, and no page but its own."""

import asyncio
from collections.abc import Mapping, MutableMapping

import httpx
import pytest
from starlette.responses import PlainTextResponse
from starlette.types import Receive, Scope, Send

from app.system.settings import LOOPBACK_HOSTS
from app.web.security import SECURITY_HEADERS, RequestGuard

pytestmark = pytest.mark.promise("security")

GUARDED = [
    ("POST", "/widgets/x"), ("GET", "/events"), ("GET", "/robots/r1/events"),
    ("GET", "/widgets/x/frame"), ("GET", "/widgets/x/map.png"),
    ("GET", "/robots/r1/widgets/x/map/0/1-2.png"),
]  # fmt: skip
HOSTS = (*LOOPBACK_HOSTS, "cell1.local", "10.0.0.7", "[fe80::1]")
Named = Mapping[str, str] | list[tuple[str, str]]
OWN = {"host": "localhost:8000"}


def answer_to(
    method: str,
    path: str,
    headers: Named,
    answer: PlainTextResponse | None = None,
    scheme: str = "http",
) -> httpx.Response:
    """What comes back through the doors; inside, everything is answered with "in"."""

    async def ask() -> httpx.Response:
        doors = RequestGuard(answer or PlainTextResponse("in"), HOSTS)
        transport = httpx.ASGITransport(doors)
        async with httpx.AsyncClient(
            transport=transport, base_url=f"{scheme}://localhost:8000"
        ) as client:
            return await client.request(method, path, headers=headers)

    return asyncio.run(ask())


def let_in(method: str, path: str, headers: Named) -> bool:
    answer = answer_to(method, path, headers)
    assert (answer.status_code, answer.text == "in") in ((200, True), (403, False))
    return answer.status_code == 200


@pytest.mark.parametrize(
    "host",
    [
        "localhost",
        "localhost:8000",
        "LocalHost:8000",
        "127.0.0.1",
        "127.0.0.1:80",
        "[::1]",
        "[::1]:8000",
        "[fe80::1]:8000",
        "cell1.local",
        "CELL1.local:8080",
        "10.0.0.7:8000",
    ],
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_the_panel_answers_to_its_names_at_any_port(method: str, host: str) -> None:
    assert let_in(method, "/widgets/x", {"host": host})


@pytest.mark.parametrize(
    "host",
    [
        "",
        "evil.example",
        "evil.example:8000",
        "localhost.evil.example",
        "evil.localhost",
        "localhost.",
        "127.0.0.10",
        "10.0.0.70:8000",
        "::1",
        "[::2]:8000",
        "evil@localhost",
        "localhost@evil.example",
        "localhost,evil.example",
    ],
)
@pytest.mark.parametrize("path", ["/", "/events", "/widgets/x", "/healthz"])
def test_a_host_that_is_no_name_of_the_panel_is_refused(path: str, host: str) -> None:
    answer = answer_to("GET", path, {"host": host})
    assert answer.status_code == 403
    assert answer.json() == {
        "error": f'"{host}" is not a name of this panel: KIOSK_HOSTS lists the names it answers to'
    }


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("localhost:8000", "http://localhost:8000"),
        ("localhost:8000", "http://LOCALHOST:8000"),
        ("cell1.local", "http://cell1.local"),
        ("127.0.0.1:8000", "http://127.0.0.1:8000"),
        ("[::1]:8000", "http://[::1]:8000"),
    ],
)
@pytest.mark.parametrize(("method", "path"), GUARDED)
def test_the_panels_own_page_may_press_and_listen(
    method: str, path: str, host: str, origin: str
) -> None:
    headers = {"host": host, "origin": origin, "sec-fetch-site": "same-origin"}
    assert let_in(method, path, headers)


@pytest.mark.parametrize(
    "origin",
    [
        "null",
        "",
        "http://evil.example",
        "http://localhost",
        "http://localhost:8001",
        "http://localhost:80000",
        "http://127.0.0.1:8000",
        "http://[::1]:8000",
        "http://evil@localhost:8000",
        "http://localhost:8000.evil.example",
        "localhost:8000",
        "file://",
    ],
)
@pytest.mark.parametrize(("method", "path"), GUARDED)
def test_a_page_of_another_origin_may_neither_press_nor_listen(
    method: str, path: str, origin: str
) -> None:
    answer = answer_to(method, path, {**OWN, "origin": origin})
    assert answer.status_code == 403
    assert answer.json() == {"error": f'a page of "{origin}" asked for this'}


@pytest.mark.parametrize("site", ["cross-site", "same-site", "", "Same-Origin", "other"])
@pytest.mark.parametrize(("method", "path"), GUARDED)
def test_a_page_of_another_site_may_neither_press_nor_listen(method: str, path: str, site: str) -> None:
    answer = answer_to(method, path, {**OWN, "sec-fetch-site": site})
    assert answer.status_code == 403
    assert answer.json() == {"error": f"a page of another site ({site}) asked for this"}


@pytest.mark.parametrize(
    ("scheme", "origin", "enters"),
    [
        ("http", "http://localhost:8000", True),
        ("http", "https://localhost:8000", False),
        ("https", "https://localhost:8000", True),
        ("https", "http://localhost:8000", False),
        ("http", "chrome-extension://localhost:8000", False),
        ("http", "//localhost:8000", False),
    ],
)
def test_a_page_of_the_same_host_with_another_scheme_is_another_one(
    scheme: str, origin: str, enters: bool
) -> None:
    answer = answer_to("POST", "/widgets/x", {**OWN, "origin": origin}, scheme=scheme)
    assert (answer.status_code == 200) is enters
    assert ("KIOSK_PROXIES" in answer.text) is ((scheme, origin[:5]) == ("http", "https"))


def test_an_own_origin_does_not_excuse_another_site() -> None:
    headers = {**OWN, "origin": "http://localhost:8000", "sec-fetch-site": "cross-site"}
    assert not let_in("POST", "/widgets/x", headers)


@pytest.mark.parametrize(
    "more",
    [("host", "evil.example"), ("origin", "http://evil.example"), ("sec-fetch-site", "cross-site")],
)
def test_a_header_that_comes_twice_hides_nothing(more: tuple[str, str]) -> None:
    own = [
        ("host", "localhost:8000"),
        ("origin", "http://localhost:8000"),
        ("sec-fetch-site", "same-origin"),
    ]
    assert let_in("POST", "/widgets/x", own)
    assert not let_in("POST", "/widgets/x", [*own, more])


@pytest.mark.parametrize("method", ["POST", "PUT", "PATCH", "DELETE", "OPTIONS"])
def test_every_method_that_may_change_something_is_guarded(method: str) -> None:
    assert let_in(method, "/", OWN)
    assert not let_in(method, "/", {**OWN, "sec-fetch-site": "cross-site"})


@pytest.mark.parametrize("headers", [{}, {"sec-fetch-site": "none"}])
@pytest.mark.parametrize(("method", "path"), GUARDED)
def test_a_program_that_is_no_browser_may_press_and_listen(
    method: str, path: str, headers: Mapping[str, str]
) -> None:
    assert let_in(method, path, {**OWN, **headers})


@pytest.mark.parametrize("path", ["/", "/pages/one", "/static/r1/kiosk.css", "/healthz", "/metrics"])
def test_a_link_on_another_site_may_lead_to_the_panel(path: str) -> None:
    assert let_in("GET", path, {**OWN, "sec-fetch-site": "cross-site"})


def test_the_head_of_the_stream_is_guarded_like_the_stream() -> None:
    assert answer_to("HEAD", "/events", {**OWN, "sec-fetch-site": "cross-site"}).status_code == 403


@pytest.mark.parametrize("host", ["localhost:8000", "evil.example"])
def test_every_answer_has_the_security_headers(host: str) -> None:
    headers = answer_to("GET", "/", {"host": host}).headers
    assert {name: headers.get(name) for name in SECURITY_HEADERS} == SECURITY_HEADERS
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert "unsafe" not in headers["content-security-policy"]


@pytest.mark.parametrize("scheme", ["http", "https"])
def test_answers_over_https_ask_for_https_from_then_on(scheme: str) -> None:
    for media_type in ("text/html", "text/event-stream"):
        answer = PlainTextResponse("in", media_type=media_type)
        headers = answer_to("GET", "/", OWN, answer, scheme).headers
        assert ("strict-transport-security" in headers) == (scheme == "https")


@pytest.mark.parametrize("media_type", ["text/css", "text/javascript", "text/event-stream"])
def test_responses_that_are_not_documents_have_the_general_security_headers(media_type: str) -> None:
    headers = answer_to("GET", "/", OWN, PlainTextResponse("in", media_type=media_type)).headers
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["cross-origin-resource-policy"] == "same-origin"
    assert "content-security-policy" not in headers


def test_an_answer_may_set_a_security_header_itself() -> None:
    own = PlainTextResponse("in", headers={"referrer-policy": "no-referrer"})
    assert answer_to("GET", "/", OWN, own).headers.get_list("referrer-policy") == ["no-referrer"]


def test_other_asgi_scopes_pass() -> None:
    passed: list[str] = []

    async def inside(scope: Scope, receive: Receive, send: Send) -> None:
        passed.append(scope["type"])

    async def nothing() -> dict[str, str]:
        return {}

    async def nowhere(message: object) -> None:
        raise AssertionError(message)

    asyncio.run(RequestGuard(inside, HOSTS)({"type": "lifespan"}, nothing, nowhere))
    assert passed == ["lifespan"]


@pytest.mark.parametrize("origin", ["http://[", "//", "http://localhost:8000.evil", "localhost:8000"])
def test_an_origin_that_is_none_is_refused(origin: str) -> None:
    assert not let_in("POST", "/widgets/x", {**OWN, "origin": origin})


@pytest.mark.parametrize("host", ["[::1", "[::1]evil.com", "localhost:80@evil", "localhost:"])
def test_host_that_only_begins_like_an_allowed_name_is_refused(host: str) -> None:
    assert not let_in("GET", "/", {"host": host})


def wanted_socket(headers: Mapping[str, str], *extensions: str) -> list[dict[str, object]]:
    """What goes out when a WebSocket to `/widgets/x/hold` is wanted; inside, it is accepted."""
    sent: list[dict[str, object]] = []

    async def inside(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "websocket.accept"})

    async def receive() -> dict[str, str]:
        return {"type": "websocket.connect"}

    async def send(message: MutableMapping[str, object]) -> None:
        sent.append(dict(message))

    scope = {
        "type": "websocket",
        "scheme": "ws",
        "path": "/widgets/x/hold",
        "headers": [(name.encode(), value.encode()) for name, value in headers.items()],
        "extensions": {key: {} for key in extensions},
    }
    asyncio.run(RequestGuard(inside, HOSTS)(scope, receive, send))
    return sent


@pytest.mark.parametrize("headers", [{}, {"origin": "http://localhost:8000"}])
def test_the_panels_own_page_and_programs_may_hold(headers: Mapping[str, str]) -> None:
    assert wanted_socket({**OWN, **headers}) == [{"type": "websocket.accept"}]


@pytest.mark.parametrize(
    "headers",
    [
        {**OWN, "origin": "http://evil.example"},
        {**OWN, "origin": "null"},
        {**OWN, "origin": "http://localhost:8001"},
        {**OWN, "sec-fetch-site": "cross-site"},
        {"host": "evil.example", "origin": "http://evil.example"},
        {},
    ],
)
def test_another_sites_page_and_another_name_may_not_hold(headers: Mapping[str, str]) -> None:
    start, body = wanted_socket(headers, "websocket.http.response")
    assert (start["type"], start["status"]) == ("websocket.http.response.start", 403)
    assert isinstance(body["body"], bytes)
    assert b"error" in body["body"]
    assert wanted_socket(headers) == [{"type": "websocket.close", "code": 1008, "reason": ""}]
