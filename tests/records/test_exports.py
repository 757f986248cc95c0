"""The operator's log is exported and searched beside presses and holds, which it must not disturb."""

import asyncio
import csv
import io
import json
import os
import signal
import socket
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AsyncExitStack, contextmanager, suppress
from pathlib import Path
from statistics import median
from typing import Any

import httpx
import pytest

from app.records import Filter, OperatorLog, Origin, database, new_entry, reader
from app.records.database import NAME
from app.records.reader import FIELDS, export
from app.records.store import Store
from app.system import worker
from app.system.errors import LogError, TooMany
from app.web import downloads
from tests.support.holds import PANEL, permit
from tests.support.operator_log import run
from tests.support.parts import Bridge, RosNode, Server, http_client, until
from tests.support.servers import live_server
from tests.web.test_hold_socket import Socket, opened

ENTRIES = 100_000
EXPORTERS = 4
TRIES = 20
HELD_S = 1.0  # beside four exports the loop stood still for half a second, again and again
PRESSES = 40

SAY = """
[[page.widget]]
id = "say"
kind = "publish"
label = "Say"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "x" }
"""
# Rows as a server would have written them, but for their hashes: no one verifies these.
FILL = """
WITH RECURSIVE number(n) AS (SELECT 2 UNION ALL SELECT n + 1 FROM number WHERE n < :last)
INSERT INTO entry SELECT n, 1763700000000 + n, 'boot0000', n * 1000, iif(n % 2, 'closed', 'pressed'),
  iif(n % 2, n - 1, NULL), '10.0.0.7', 'ab12ab12ab12', 'Panel 2', '', 'p' || (n / 2), 'say', 'press',
  '{"message": "hello number ' || (n / 2) || '"}', '0123456789abcdef-12345',
  iif(n % 2, 'permitted', ''), iif(n % 2, '0123456789abcdef-12345', ''), iif(n % 2, 'published', ''),
  iif(n % 2, 'Sent on /said at 10:04:32.', ''), hex(randomblob(32)), hex(randomblob(32)), '' FROM number
"""
# As a browser that saves it, again and again; how many bytes it got of each, and the status.
EXPORTER = """
import http.client, sys, time
while True:
    line = http.client.HTTPConnection("127.0.0.1", int(sys.argv[1]))
    line.request("GET", "/log.csv?every=true")
    answer, got = line.getresponse(), 0
    while piece := answer.read(65536):
        got += len(piece)
    print(answer.status, got, flush=True)
    if answer.status == 429:
        time.sleep(0.2)
"""


def large(folder: Path, last: int = ENTRIES) -> Path:
    folder.mkdir(exist_ok=True)
    store = Store(folder, "boot0")
    store.append([new_entry("began", values={"mode": "live"})])
    store.close()
    with sqlite3.connect(folder / NAME) as db:
        db.execute(FILL, {"last": last})
    db.close()
    return folder


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return large(tmp_path_factory.mktemp("data"))


@pytest.fixture
def kiosk(
    bridge: Bridge,
    jogger: RosNode,
    data: Path,
    tmp_path: Path,
    servers: Callable[[Server], Server],
) -> Server:
    mine = servers(live_server(bridge, tmp_path, PANEL + SAY, KIOSK_DATA=str(data)))
    permit(mine, jogger, True)
    return mine


@contextmanager
def exporting(kiosk: Server) -> Iterator[list[subprocess.Popen[str]]]:
    """Programs that take exports all the while."""
    command = [sys.executable, "-c", EXPORTER, str(kiosk.port)]
    processes = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(EXPORTERS)]
    try:
        yield processes
    finally:
        for process in processes:
            process.kill()
            process.communicate()


@contextmanager
def unread(kiosk: Server, count: int) -> Iterator[None]:
    """Who asks for exports and reads none of them."""
    wish = f"GET /log.csv?every=true HTTP/1.1\r\nhost: 127.0.0.1:{kiosk.port}\r\n\r\n".encode()
    lines = [socket.create_connection(("127.0.0.1", kiosk.port)) for _ in range(count)]
    try:
        for line in lines:
            line.sendall(wish)
        yield
    finally:
        for line in lines:
            line.close()


@contextmanager
def searching(kiosk: Server) -> Iterator[list[int]]:
    """Who searches for what no entry has; the statuses."""
    ends, statuses = threading.Event(), list[int]()

    def search() -> None:
        with http_client(kiosk.url, 30) as http:
            while not ends.wait(0.2):
                answer = http.get("/log?text=nothing-has-it")
                assert (answer.status_code == 429) is ("retry-after" in answer.headers)
                statuses.append(answer.status_code)

    threads = [threading.Thread(target=search) for _ in range(4)]
    for thread in threads:
        thread.start()
    try:
        yield statuses
    finally:
        ends.set()
        for thread in threads:
            thread.join()


def press_s(kiosk: Server) -> float:
    """How long a press takes, the median of some."""
    times = []
    for _ in range(PRESSES):
        began = time.monotonic()
        assert kiosk.http.post("/widgets/say", json={"inputs": {}}).status_code == 200
        times.append(time.monotonic() - began)
    return median(times)


def held_for(socket: Socket, seconds: float) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if socket.beat()["state"] != "held":
            return False
        time.sleep(0.05)
    return True


def holds(kiosk: Server) -> bool:
    """Whether a hold lasts: a busy machine alone may end one."""
    for _ in range(TRIES):
        with opened(kiosk) as socket:
            if socket.begin()["state"] == "held" and held_for(socket, HELD_S):
                return True
    return False


@pytest.mark.long("real time")
def test_exports_and_searches_disturb_neither_presses_nor_holds(kiosk: Server) -> None:
    alone = press_s(kiosk)
    with exporting(kiosk), searching(kiosk) as statuses, unread(kiosk, 50):
        until(lambda: {200, 429} <= set(statuses), "some search, others get 429", 30)
        assert press_s(kiosk) < 12 * alone + 0.05
        assert holds(kiosk)


@pytest.mark.long("flood")
def test_exports_run_one_at_a_time_and_are_complete(kiosk: Server) -> None:
    with exporting(kiosk) as (first, *_), unread(kiosk, 10):
        assert first.stdout is not None
        first_statuses = {line.split()[0] for line, _ in zip(first.stdout, range(3), strict=False)}
        assert "429" in first_statuses or "200" in first_statuses
    refused: list[httpx.Response] = []

    def whole() -> httpx.Response | None:
        answer = kiosk.http.get("/log.csv?every=true&before=20000", timeout=60)
        if answer.status_code == 200:
            return answer
        refused.append(answer)
        return None

    few = "/log.csv?before=20"
    until(lambda: kiosk.http.get(few).status_code == 200, "they are gone")
    for _ in range(5):
        assert kiosk.http.get(few).status_code == 200
    with kiosk.http.stream("GET", "/log.csv?every=true", timeout=60) as export:
        assert export.status_code == 200
        assert whole() is None
    answer = until(whole, "the place is free when who had it is gone")
    assert (refused[0].status_code, refused[0].headers["retry-after"]) == (429, "10")
    assert "is already being exported" in refused[0].json()["error"]
    assert answer.headers["content-encoding"] == "gzip"
    rows = list(csv.DictReader(io.StringIO(answer.text.removeprefix("\ufeff"), newline="")))
    assert [int(row["seq"]) for row in rows] == list(range(19_999, 0, -1))
    plain = kiosk.http.get(
        "/log.csv?every=true&before=20000", headers={"accept-encoding": "identity"}, timeout=60
    )
    assert "content-encoding" not in plain.headers
    assert plain.content == answer.content


def children(pid: int) -> list[int]:
    pids: list[int] = []
    for task in Path(f"/proc/{pid}/task/").iterdir():
        with suppress(FileNotFoundError, ProcessLookupError):  # the thread has ended
            pids += map(int, (task / "children").read_text().split())
    return pids


def test_an_export_that_breaks_off_is_not_taken_for_whole(kiosk: Server) -> None:
    with kiosk.http.stream("GET", "/log.csv?every=true", timeout=30) as export:
        (child,) = until(lambda: children(kiosk.process.pid), "its process runs")
        os.kill(child, signal.SIGKILL)
        with pytest.raises(httpx.RemoteProtocolError):
            export.read()
    until(lambda: not children(kiosk.process.pid), "it is gone")
    until(lambda: "an export of the operator's log broke off" in kiosk.process.text, "it is said")
    assert "Traceback" not in kiosk.process.text
    assert kiosk.http.get("/log.csv?before=100").status_code == 200


@pytest.mark.long("flood")
def test_client_that_leaves_an_export_leaves_no_process_and_no_log_line(kiosk: Server) -> None:
    with unread(kiosk, 1):
        until(lambda: children(kiosk.process.pid), "its process runs")
    until(lambda: not children(kiosk.process.pid), "it is gone")
    assert "export" not in kiosk.process.text
    assert "Traceback" not in kiosk.process.text


@pytest.mark.long("real time")
def test_the_end_of_the_server_waits_for_no_export(kiosk: Server) -> None:
    with exporting(kiosk):
        until(lambda: children(kiosk.process.pid), "its process runs")
        began = time.monotonic()
        kiosk.end()
        assert time.monotonic() - began < 15  # it took 20 s, and a traceback


# Without a server.


def test_two_search_at_a_time_and_the_server_itself_waits_for_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on = threading.Event()
    monkeypatch.setattr(reader, "rows", lambda *_: [] if go_on.wait(10) else None)

    async def work(log: OperatorLog) -> None:
        searches = [asyncio.create_task(log.rows(Filter(), None, 10)) for _ in range(2)]
        await asyncio.sleep(0)
        with pytest.raises(TooMany, match="is being searched") as refused:
            await log.rows(Filter(), None, 10)
        assert (refused.value.status, refused.value.retry_after_s) == (429, 2)
        assert await log.open_presses("", ["say"], 0) == []
        go_on.set()
        assert await asyncio.gather(*searches) == [[], []]
        assert await log.rows(Filter(), None, 10) == []

    run(tmp_path, work)


def test_an_export_that_no_client_reads_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(downloads, "TAKEN_WITHIN_S", 0.2)
    large(tmp_path, 10_000)
    sent: list[Any] = []

    async def never() -> Any:
        await asyncio.Event().wait()

    async def send(message: Any) -> None:
        sent.append(message)
        if len(sent) > 2:
            await asyncio.Event().wait()

    async def work(log: OperatorLog) -> None:
        before = children(os.getpid())
        async with AsyncExitStack() as stack:
            export = await stack.enter_async_context(log.export(Filter(every=True), None, False))
            answer = downloads.Exported(
                export, await export.next_result(), {}, stack.pop_all(), "operator's log", ".csv"
            )
        await answer({"type": "http"}, never, send)
        assert [message.get("more_body") for message in sent] == [None, True, True]
        assert children(os.getpid()) == before
        async with log.export(Filter(), None, False) as export:
            assert (await export.next_result()).startswith(b"\xef\xbb\xbfseq,at,")

    run(tmp_path, work)
    assert "was not taken for 0.2 s" in caplog.text


def test_export_of_an_unreadable_log_says_why(tmp_path: Path) -> None:
    async def work() -> None:
        mine = reader.Readers(tmp_path)
        async with mine.export(Filter(), None, True) as export:
            with pytest.raises(LogError, match="cannot be read: no such file or folder"):
                await export.next_result()
        mine.stop()

    asyncio.run(work())


def test_where_no_process_can_be_begun_an_export_says_why_and_leaves_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    large(tmp_path, 10)

    async def work(log: OperatorLog) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(worker, "COMMAND", (str(tmp_path / "gone"),))
            for _ in range(2):
                async with log.export(Filter(), None, False) as export:
                    with pytest.raises(LogError, match="cannot be read: no such file or folder"):
                        await export.next_result()
        async with log.export(Filter(), None, False) as export:
            assert (await export.next_result()).startswith(b"\xef\xbb\xbfseq,at,")

    run(tmp_path, work)


def test_a_search_that_takes_long_is_done_by_another_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader, "QUICK_S", 0.0)
    monkeypatch.setattr(database, "STEPS_BETWEEN_CHECKS", 1)
    large(tmp_path, 100)

    async def work(log: OperatorLog) -> None:
        matching = await log.rows(Filter(text="number 3"), 90, 3)
        assert [row.entry.seq for row in matching] == [79, 77, 75]
        assert matching == database.rows(tmp_path, Filter(text="number 3"), 90, 3)
        log.close()
        with pytest.raises(LogError, match="shutting down"):
            await log.rows(Filter(), None, 3)

    run(tmp_path, work)


def test_a_csv_has_every_column_of_an_entry_and_no_formula(tmp_path: Path) -> None:
    store = Store(tmp_path, "boot1")
    origin = Origin(address="10.0.0.7", who="=cmd()", seen="\tx")
    texts = {"press": "-1", "widget": "a\u202eb", "reason": 'said "no",\nand no'}
    (written,) = store.append([new_entry("refused", origin, {"text": "+\x7f"}, **texts)])
    store.close()
    text = b"".join(export(tmp_path, Filter(), None)).decode()
    (row,) = csv.DictReader(io.StringIO(text.removeprefix("\ufeff"), newline=""))
    assert tuple(row) == FIELDS
    assert set(FIELDS) == {*written._fields, "pressed_at"}
    assert (row["who"], row["seen"], row["press"]) == ("'=cmd()", "'\tx", "'-1")
    assert (row["widget"], row["reason"]) == ("a\\u202eb", 'said "no",\nand no')
    assert json.loads(row["values"]) == {"text": "+\x7f"}
    assert (row["hash"], row["pressed_at"], row["of"]) == (written.hash, "", "")
    assert row["at"].endswith("+00:00")
