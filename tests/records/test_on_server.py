"""The operator's log of a whole server: its page, its CSV, a full disk, two servers on one folder."""

import csv
import html
import io
import itertools
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from app.records.database import NAME
from app.records.principal import new_token, public_id
from app.records.verify import verify
from app.web.caller import COOKIE
from tests.support.browser.pages import follow
from tests.support.holds import PANEL as HOLDING
from tests.support.parts import REFERENCE, ROOT, Process, Server, free_port, sends, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("log")

FULL = "The operator's log cannot be written: no space left on device."
# A data folder on a disk of its own, which only the server and its children see.
SMALL_DISK = ["unshare", "--mount", "sh", "-c"]
MOUNT = 'mount -t tmpfs -o size=2m tmpfs "$KIOSK_DATA" && exec "$@"'


def panel_with(folder: Path, tables: str) -> str:
    """The shipped panel with more in it."""
    path = folder / "panel.toml"
    text = REFERENCE.read_text()
    path.write_text(text.replace("[[interlock]]", f"{tables}\n[[interlock]]", 1))
    return str(path)


def inside(server: Server) -> Path:
    """The server's data folder as the server sees it."""
    return Path(f"/proc/{server.process.pid}/root{server.data}")


def page_text(server: Server, path: str) -> str:
    """A page's source with its texts as they are read."""
    return html.unescape(server.http.get(path).text)


def fill(folder: Path) -> Path:
    """Leaves no byte on the disk."""
    filler = folder / "filler"
    with filler.open("wb", buffering=0) as file:
        for size in (65536, 4096, 512, 1):
            try:
                while True:
                    file.write(b"x" * size)
            except OSError:
                continue
    return filler


def small_disk(tmp_path: Path, tables: str = "") -> Server:
    panel = panel_with(tmp_path, tables)
    return Server(ROOT, before=[*SMALL_DISK, MOUNT, "sh"], KIOSK_PANEL=panel)


def own_alarms(server: Server) -> dict[str, str]:
    """The states of the panel's own alarms."""
    rows = server.http.get("/alarms").json()["alarms"]
    return {row["id"]: row["state"] for row in rows if row["source"] == "panel"}


def press_until_full(server: Server) -> None:
    filler = fill(inside(server))
    assert filler.exists()
    for number in range(500):
        if FULL in server.press("operation", f"fills {number}").text:
            return
    raise AssertionError("a full disk took 500 presses")


@pytest.mark.usefixtures("namespaces")
def test_a_full_disk_locks_and_opens_again_by_itself(
    tmp_path: Path, servers: Callable[[Server], Server], page: Page
) -> None:
    kiosk = servers(small_disk(tmp_path))
    until(kiosk.ready, "ready")
    page.goto(kiosk.url)
    expect(page.get_by_role("button", name="Publish", exact=True)).to_be_enabled()
    press_until_full(kiosk)
    for refused in [kiosk.by(way).press("operation", "never sent") for way in ("post", "socket")]:
        assert (refused.status_code, refused.json()["outcome"]) == (503, "refused")
        assert FULL in refused.json()["reason"]
    expect(page.get_by_role("button", name="Publish", exact=True)).to_be_disabled()
    expect(page.locator("#why-operation")).to_contain_text(FULL)
    expect(page.locator("#fault")).to_contain_text(FULL)
    assert FULL in page_text(kiosk, "/")
    assert kiosk.http.get("/readyz").json()["code"] == "log"
    assert FULL in page_text(kiosk, "/log")
    until(lambda: own_alarms(kiosk).get("panel_log") == "active", "the alarm is raised")
    (inside(kiosk) / "filler").unlink()
    expect(page.get_by_role("button", name="Publish", exact=True)).to_be_enabled(timeout=20_000)
    expect(page.locator("#fault")).to_be_hidden()
    until(lambda: sends(kiosk, "sent again"), "a press is sent")
    until(lambda: own_alarms(kiosk)["panel_log"] == "returned", "the alarm returns")
    assert own_alarms(kiosk)["panel_disk"] == "active"  # the whole disk is smaller than the limit
    assert kiosk.http.get("/log.csv?text=never+sent").text.count("\n") == 1
    assert "could not be written from" in page_text(kiosk, "/log?outcome=resumed")
    until(lambda: "sent again" in kiosk.widget("last_heard")["text"], "the robot has it")
    command = [sys.executable, "-m", "app.log", "verify", "--data", str(kiosk.data)]
    enter = ["nsenter", "--mount", "--target", str(kiosk.process.pid)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([*enter, *command], env=environment, check=True, capture_output=True)
    assert done.stdout.startswith(b"ok, ")


@pytest.mark.usefixtures("namespaces")
def test_one_setting_permits_presses_without_a_log(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(small_disk(tmp_path, "[log]\nrequired = false\n"))
    until(kiosk.ready, "ready")
    fill(inside(kiosk))
    for _ in range(500):
        until(lambda: sends(kiosk, "fills"), "a press is sent")
        if kiosk.snapshot()["notice"]["fault"]:
            break
    fault = kiosk.snapshot()["notice"]["fault"]
    assert fault == (
        "The operator's log cannot be written, so nothing is logged: no space left on device."
    )
    until(kiosk.ready, "presses need no log")
    until(lambda: sends(kiosk, "unlogged"), "a press is sent")
    until(lambda: "unlogged" in kiosk.widget("last_heard")["text"], "the robot has it")


def test_a_garbage_file_is_kept_aside_and_a_new_log_begun(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    (tmp_path / NAME).write_bytes(b"garbage" * 1000)
    kiosk = servers(Server(ROOT, KIOSK_DATA=str(tmp_path)))
    (aside,) = tmp_path.glob("*damaged*")
    assert aside.read_bytes() == b"garbage" * 1000
    assert kiosk.process.count(f"it is kept as {aside.name}")
    assert aside.name in page_text(kiosk, "/log")


def test_a_log_that_is_switched_off_keeps_nothing(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    panel = panel_with(tmp_path, "[log]\nenabled = false\n")
    # Not forked from a process that has read the message types already.
    kiosk = servers(Server(ROOT, KIOSK_PANEL=panel, PYTHONUNBUFFERED="1"))
    until(kiosk.ready, "ready")
    until(lambda: sends(kiosk, "x"), "a press is sent")
    assert "operator's log is switched off" in page_text(kiosk, "/log")
    assert kiosk.http.get("/log.csv").status_code == 404
    assert 'href="/log"' not in page_text(kiosk, "/")
    assert {file.name for file in kiosk.data.iterdir()} == {"server.lock"}


@contextmanager
def started(data: Path, *options: str, **env: str) -> Iterator[Process]:
    """A server that need not answer, and all its workers."""
    command = [sys.executable, "-m", "uvicorn", "app.main:app", "--port", str(free_port()), *options]
    process = Process(command, {"KIOSK_DATA": str(data), **env}, cwd=ROOT, start_new_session=True)
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.end()


def test_a_second_server_on_the_folder_does_not_start(demo: Server) -> None:
    with started(demo.data) as second:
        until(lambda: not second.running, "it ends")
        assert second.wait(1) != 0
        until(lambda: "startup failed" in second.text, "all is said")
    assert f"{demo.data} is in use by process {demo.process.pid} since 2" in second.text
    assert f"--port {demo.port}" in second.text
    assert "Traceback" not in second.text
    assert demo.press("operation", "still here").json()["outcome"] == "published"


def test_a_second_worker_does_not_start(tmp_path: Path) -> None:
    panel = panel_with(tmp_path, "[log]\nenabled = false\n")
    with started(tmp_path, "--workers", "2", KIOSK_PANEL=panel) as server:
        until(lambda: f"{tmp_path} is in use by process" in server.text, "it is said")
        assert server.count("one worker")
        assert "Traceback" not in server.text


def test_the_head_is_said_at_the_start_and_the_page_has_the_count(demo: Server) -> None:
    until(lambda: "operator's log: " in demo.process.text, "the head is logged")
    match = re.search(r"operator's log: (\d+) entries, head ([0-9a-f]{64})", demo.process.text)
    assert match
    demo.press("operation", "for the head")
    head = verify(demo.data)
    page = demo.http.get("/log").text
    assert f"Entries: {head.count}" in page
    assert head.head not in page  # a check sum is nothing for an operator: the export has it


def test_a_logged_press_shows_on_the_page_with_its_outcome(demo: Server) -> None:
    token = new_token()
    demo.http.cookies.set(COOKIE, token, domain="127.0.0.1")
    number = itertools.count(1)

    def published() -> dict[str, Any] | None:
        """A server that stood still for a moment refuses what came in the meantime."""
        name = f"shown-{next(number)}"
        receipt = demo.press("operation", "for <b>the</b> log", id=name).json()
        return {**receipt, "name": name} if receipt["outcome"] == "published" else None

    receipt = until(published, "a press comes through")
    demo.http.cookies.clear()
    source = demo.http.get("/log").text
    assert "for &lt;b&gt;the&lt;/b&gt; log" in source
    assert receipt["reason"] in source
    (line,) = as_rows(demo.http.get(f"/log.csv?text={receipt['name']}").text)
    assert (line["press"], line["outcome"], line["browser"], line["address"]) == (
        receipt["name"], "published", public_id(token), "127.0.0.1",
    )  # fmt: skip


def test_a_filter_narrows_page_and_csv_alike(demo: Server) -> None:
    demo.press("operation", "find-me", id="found-1")
    demo.press("operation", "find-me" * 20, id="found-2")
    for query, ids in (
        ("text=find-me", ["found-2", "found-1"]),
        ("text=find-me&outcome=refused", ["found-2"]),
        ("text=find-me&widget=operation&who=127.0.0.1", ["found-2", "found-1"]),
        ("text=find-me&widget=operation1", []),
        ("text=find-me&until=2020-01-01T00:00", []),
        ("text=find-me&since=2020-01-01T00:00", ["found-2", "found-1"]),
        ("text=find-me&every=true&outcome=pressed", ["found-2", "found-1"]),
    ):
        assert [row["press"] for row in as_rows(demo.http.get(f"/log.csv?{query}").text)] == ids
        assert page_text(demo, f"/log?{query}").count("<tr data-kind") == len(ids), query


def test_holds_can_be_filtered_by_and_have_their_names(tmp_path: Path) -> None:
    with demo_server(tmp_path, HOLDING) as server:
        assert '<option value="jog">Jog</option>' in server.http.get("/log").text


def test_a_bad_filter_is_named(demo: Server) -> None:
    answer = demo.http.get("/log?since=yesterday")
    assert answer.status_code == 422
    assert 'since: "yesterday" is no time' in answer.json()["error"]
    for query in ("before=0", "before=x", "nothing=1", f"text={'x' * 101}"):
        assert demo.http.get(f"/log?{query}").status_code == 422


def test_the_csv_is_whole_and_no_formula(demo: Server) -> None:
    for number in range(30):
        demo.press("operation", f'"quoted", {number}', id=f"-csv-{number}")
    answer = demo.http.get("/log.csv?every=true&text=csv-")
    assert answer.headers["content-type"] == "text/csv; charset=utf-8"
    assert answer.content.startswith(b"\xef\xbb\xbfseq,at,")
    assert answer.content.endswith(b"\r\n")
    lines = as_rows(answer.text)
    assert len(lines) == 60
    assert [int(line["seq"]) for line in lines] == sorted((int(r["seq"]) for r in lines), reverse=True)
    assert lines[0]["press"].startswith("'-csv-")  # a spreadsheet would take it for a formula
    assert '"quoted\\"' not in lines[0]["reason"]
    assert "quoted" in lines[0]["values"]


def as_rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text.removeprefix("\ufeff"), newline="")))


@pytest.mark.parametrize(
    ("width", "height"), [(1280, 800), pytest.param(1024, 600, marks=pytest.mark.long("detail"))]
)
def test_the_page_works_without_scripts(
    demo: Server, chromium: Browser, width: int, height: int
) -> None:
    for number in range(60):
        demo.press("operation", f"turn {number}")
    context = chromium.new_context(
        java_script_enabled=False, viewport={"width": width, "height": height}
    )
    try:
        page = context.new_page()
        page.goto(demo.url)
        page.get_by_role("button", name="Menu").click()
        page.get_by_role("link", name="Log").click()
        expect(page.get_by_role("heading", name="Operator's log")).to_be_visible()
        page.get_by_label("Text").fill("turn")
        page.get_by_role("button", name="Show").click()
        rows = page.locator("tr[data-number]")
        expect(rows).to_have_count(50)
        newest = rows.first.get_attribute("data-number") or ""
        follow(page.get_by_role("link", name="Older"))
        assert rows.first.get_attribute("data-number") != newest
        page.get_by_role("link", name="Newest").click()
        expect(rows.first).to_have_attribute("data-number", newest)
        small = page.evaluate(
            "() => [...document.querySelectorAll('a, button, input:not([type=checkbox]), select')]"
            ".filter((e) => e.checkVisibility() && e.getBoundingClientRect().height < 44)"
            ".map((e) => e.outerHTML)"
        )
        assert small == []
        wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert wide <= 0
        table = page.locator(".entries")
        assert table.evaluate("(e) => e.scrollWidth - e.clientWidth") <= 0
        cells = rows.first.locator("td")
        expect(cells.nth(2)).to_contain_text(re.compile("Message turn"))
        expect(cells.nth(3)).to_contain_text(re.compile("Sent at"))
    finally:
        context.close()


def test_demo_without_a_folder_uses_a_separate_folder(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    servers(Server(ROOT, KIOSK_DATA="", XDG_STATE_HOME=str(tmp_path)))
    assert (tmp_path / "operator-panel/demo" / NAME).exists()
    assert [path.name for path in (tmp_path / "operator-panel").iterdir()] == ["demo"]


def test_the_command_finds_the_servers_own_log(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(Server(ROOT, KIOSK_DATA=str(tmp_path)))
    until(kiosk.ready, "ready")
    for number in range(100):
        kiosk.press("operation", f"number {number}")
    done = subprocess.run(
        [sys.executable, "-m", "app.log", "verify"],
        cwd=ROOT,
        env={**os.environ, "KIOSK_DATA": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=20,
        check=False,
    )
    assert done.returncode == 0
    line = re.match(r"ok, (\d+) entries, head (\w+)\n", done.stdout)
    assert line, done.stdout
    count = int(line[1])  # with the start and its signature; later the clock's state is added too
    assert count >= 202
    assert verify(tmp_path, known_head=line[2]).fault == ""
    assert f"the {count - 2} entries after it are proven by the chain only" in done.stdout
