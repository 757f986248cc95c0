"""A recording that is shared with Foxglove: its address, ranges, CORS, roles, end, and no token in a
log."""

import asyncio
import re
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Final

import httpx
import pytest
from mcap.reader import make_reader

from app.web.downloads import BYTES_MOST, COUNT_MOST, SharedRecordings, links_of
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.support.users import Browsers, add_user, log_rows
from tests.support.waiting import pass_time
from tests.web.test_recordings import PANEL, RECORD, topics

FOXGLOVE: Final = "https://app.foxglove.dev"
PIN: Final = "2580"
ACT: Final = "/diagnostics/foxglove"


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL + RECORD, KIOSK_LOG_LEVEL="debug") as mine:
        until(lambda: len(topics(mine).get("/boxes", ())) > 2, "some values have arrived")
        yield mine


def share(client: httpx.Client) -> str:
    """The address of a recording that this client shares."""
    receipt = client.post(ACT, json={}).raise_for_status().json()
    assert (receipt["outcome"], receipt["done"], receipt["reason"]) == ("succeeded", True, "")
    return str(receipt["recording"])


def test_what_is_shared_is_the_last_minute_and_stays_as_it_was(cell: Server) -> None:
    address = share(cell.http)
    assert re.fullmatch(re.escape(cell.url) + r"/recordings/shared/[A-Za-z0-9_-]{43}\.mcap", address), (
        address
    )
    whole = httpx.get(address, trust_env=False)  # without a cookie of the panel
    messages = [*make_reader(BytesIO(whole.content)).iter_messages()]
    assert {channel.topic for _, channel, _ in messages} == {"/boxes"}
    count = len(topics(cell)["/boxes"])
    until(lambda: len(topics(cell)["/boxes"]) > count, "more has arrived")
    assert httpx.get(address, trust_env=False).content == whole.content
    assert share(cell.http) != address


def test_a_shared_recording_has_ranges(cell: Server) -> None:
    address = share(cell.http)
    client = httpx.Client(trust_env=False)
    whole = client.get(address, headers={"origin": FOXGLOVE})
    content, size = whole.content, len(whole.content)
    assert (whole.status_code, whole.headers["content-length"]) == (200, str(size))
    assert whole.headers["accept-ranges"] == "bytes"
    for wanted, first, end in (
        ("bytes=0-7", 0, 8),
        ("bytes=5-5", 5, 6),
        (f"bytes={size - 9}-", size - 9, size),
        ("bytes=-8", size - 8, size),
        (f"bytes=-{size + 10}", 0, size),
        (f"bytes=10-{size + 10}", 10, size),
    ):
        part = client.get(address, headers={"range": wanted, "origin": FOXGLOVE})
        assert (part.status_code, part.content) == (206, content[first:end]), wanted
        assert part.headers["content-range"] == f"bytes {first}-{end - 1}/{size}"
        assert part.headers["content-length"] == str(end - first)
    for wanted in (f"bytes={size}-", "bytes=-0"):
        none = client.get(address, headers={"range": wanted})
        assert (none.status_code, none.content) == (416, b""), wanted
        assert none.headers["content-range"] == f"bytes */{size}"
        assert none.headers["access-control-allow-origin"] == FOXGLOVE
    for wanted in ("bytes=-", "bytes=9-3", "items=0-1", "bytes=a-b"):
        assert client.get(address, headers={"range": wanted}).status_code == 400, wanted
    several = client.get(address, headers={"range": "bytes=0-1,4-5"})
    assert several.headers["content-type"].startswith("multipart/byteranges")
    assert (several.status_code, content[4:6] in several.content) == (206, True)
    same = {"range": "bytes=0-7", "if-range": whole.headers["etag"]}
    assert client.get(address, headers=same).status_code == 206
    assert client.get(address, headers={**same, "if-range": '"other"'}).status_code == 200
    head = client.head(address)
    assert (head.status_code, head.content) == (200, b"")
    assert head.headers["content-length"] == str(size)
    client.close()


def test_only_foxglove_may_read_it_from_another_origin(cell: Server) -> None:
    address = share(cell.http)
    for origin in (FOXGLOVE, "https://example.com", "null"):
        headers = {"origin": origin, "sec-fetch-site": "cross-site"}
        answer = httpx.get(address, headers=headers, trust_env=False)
        assert answer.headers["access-control-allow-origin"] == FOXGLOVE
        assert "access-control-allow-credentials" not in answer.headers
        exposed = answer.headers["access-control-expose-headers"].lower().split(", ")
        assert {"accept-ranges", "content-length", "content-range", "etag"} <= {*exposed}
    asked = {
        "origin": FOXGLOVE,
        "sec-fetch-site": "cross-site",
        "access-control-request-method": "GET",
        "access-control-request-headers": "range",
        "access-control-request-private-network": "true",
    }
    preflight = httpx.options(address, headers=asked, trust_env=False)
    assert preflight.status_code == 204
    assert preflight.headers["access-control-allow-origin"] == FOXGLOVE
    assert "range" in preflight.headers["access-control-allow-headers"].lower()
    assert preflight.headers["access-control-allow-private-network"] == "true"
    for path in ("/recordings/last.mcap", ACT, "/widgets/boxes"):
        assert httpx.options(cell.url + path, headers=asked, trust_env=False).status_code == 403
    assert "access-control-allow-origin" not in cell.http.get("/recordings/last.mcap").headers


def test_another_token_opens_nothing(cell: Server) -> None:
    address = share(cell.http)
    random = f"{cell.url}/recordings/shared/{'a' * 43}.mcap"
    for wrong in (address.replace(".mcap", "x.mcap"), address[:-6] + ".mcap", random):
        assert httpx.get(wrong, trust_env=False).status_code == 404, wrong
    answer = cell.http.get("/recordings/shared/short.mcap")
    assert answer.status_code == 422


def test_the_oldest_of_too_many_ends(cell: Server) -> None:
    addresses = [share(cell.http) for _ in range(COUNT_MOST + 1)]
    statuses = [httpx.get(address, trust_env=False).status_code for address in addresses]
    assert statuses == [404] + [200] * COUNT_MOST


def test_the_same_act_again_shares_nothing_more(cell: Server) -> None:
    first, again = (cell.http.post(ACT, json={"id": "again-1"}).json() for _ in range(2))
    assert first["recording"] == again["recording"] != ""
    other = cell.http.post("/diagnostics/check", json={"id": "again-1"}).json()
    assert (other["outcome"], other["recording"]) == ("refused", "")


def test_no_token_is_in_a_log_or_in_the_support_bundle(cell: Server) -> None:
    address = share(cell.http)
    token = address.rpartition("/")[2].removesuffix(".mcap")
    for method in ("GET", "HEAD", "OPTIONS"):
        httpx.request(method, address, trust_env=False)
    page = cell.http.get("/diagnostics", headers={"accept": "text/html"}).text
    assert token in page
    cell.http.get("/healthz?after")
    until(lambda: "/healthz?after" in cell.process.text, "the requests are logged")
    assert "/recordings/shared/***" in cell.process.text
    assert token not in cell.process.text
    assert token not in cell.http.get("/log.csv").text
    assert token not in cell.http.get("/metrics").text
    rows = [row for row in log_rows(cell.http) if row["action"] == "diagnostics_foxglove"]
    assert rows


def test_only_those_who_may_fetch_the_recording_share_it(browsers: Browsers, tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    for role in ("operator", "maintenance"):
        add_user(data, role, role, pin=PIN)
    panel = PANEL + RECORD
    with demo_server(tmp_path, panel, KIOSK_DATA=str(data)) as server:
        for name in ("", "operator"):
            opened = browsers.opened(server.url)
            if name:
                opened = browsers.signed_in(server.url, name, pin=PIN)
            refused = opened.post(ACT, json={})
            assert (refused.status_code, refused.json()["recording"]) == (403, "")
            assert opened.get("/recordings/last.mcap").status_code == 403
        permitted = browsers.signed_in(server.url, "maintenance", pin=PIN)
        address = share(permitted)
        assert httpx.get(address, trust_env=False).status_code == 200


def test_a_panel_that_records_nothing_shares_nothing(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL) as server:
        assert server.http.post(ACT, json={}).status_code == 404
        page = server.http.get("/diagnostics", headers={"accept": "text/html"}).text
        assert ACT not in page


def test_a_recording_ends_and_large_ones_end_the_oldest() -> None:
    async def shared() -> None:
        recordings = SharedRecordings(valid_s=0.05)
        recording = recordings.share(b"abc", "", "a1")
        assert recordings.by_token(recording.token) is recording
        await pass_time(0.2)
        assert recordings.by_token(recording.token) is None
        assert recordings.by_act("a1") is None
        assert recordings.latest("") is None
        many = SharedRecordings()
        half = bytes(BYTES_MOST // 2 + 1)
        first, second = many.share(half, "", "b1"), many.share(half, "", "b2")
        assert many.by_token(first.token) is None
        assert many.latest("") is second
        assert many.latest("other") is None

    asyncio.run(shared())


def test_the_links_are_those_of_foxglove() -> None:
    async def links() -> None:
        recording = SharedRecordings().share(b"abc", "", "a1")
        made = links_of(recording, "https://panel.local/cell1/")
        file = f"https%3A%2F%2Fpanel.local%2Fcell1%2Frecordings%2Fshared%2F{recording.token}.mcap"
        assert made.browser == f"https://app.foxglove.dev/~/view?ds=remote-file&ds.url={file}"
        assert made.desktop == f"foxglove://open?ds=remote-file&ds.url={file}"
        assert recording.token not in repr(recording)

    asyncio.run(links())
