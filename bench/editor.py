"""`python -m bench.editor`: how long an edit takes to the screen of the editor, from the key press to
the frame in which the page is drawn again, with 300 widgets on 20 pages and a robot with 1,000 topics.

The robot speaks Zenoh like one behind a bridge; `operator-panel edit --live` lists it, and Chromium
shows the editor. Needs no bridge and no ROS 2. With `QUICK=1` some seconds. Prints a table: of each row
the half and the ninth tenth of all edits, in ms.
"""

import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from playwright.sync_api import Page, expect, sync_playwright

from app.tools.editor.checked import DocumentChecker
from app.tools.editor.document import Document, SetValue
from bench.light import cpu_s
from bench.over_zenoh import OverZenoh
from tests.support.editor import EditorServer, editing
from tests.support.parts import CHROMIUM, CHROMIUM_FLAGS, zenoh_file

QUICK: Final = bool(os.environ.get("QUICK"))
EDITS: Final = 5 if QUICK else 40
PAGES: Final = 20
GROUPS: Final = 5  # of a page
WIDGETS: Final = 3  # of a group
TOPICS: Final = 1_000
ASKED_MS: Final = 100
TYPES: Final = ("Float64", "Bool", "String")
WIDGET: Final = (
    'kind = "readout"\nfield = "data"\nunit = "mm"',
    'kind = "indicator"\nfield = "data"\nstates = [{ value = true, text = "On", shape = "circle" }]',
    'kind = "publish"\nmessage = { data = "go" }\ninterlock = "ready"',
)
HEAD: Final = """\
title = "Line"  # as on its plate
language = "en"

[[interlock]]
id = "ready"
label = "Ready"
topic = "/t1"
type = "std_msgs/msg/Bool"
field = "data"
"""
# Notes when a key was pressed, and each frame after the page was drawn again, by the page's own clock.
WATCH: Final = """() => {
  const frames = document.getElementById("frames");
  const note = (event) => {
    window.edited = { before: frames.dataset.drawn, pressed: event.timeStamp, shown: 0 };
  };
  addEventListener("keydown", note, true);
  new MutationObserver(() => {
    const now = window.edited;
    if (!now || now.drawn || frames.dataset.drawn === now.before) return;
    now.drawn = performance.now();
    requestAnimationFrame(() => setTimeout(() => { now.shown = performance.now(); }));
  }).observe(frames, { attributeFilter: ["data-drawn"] });
}"""
# What happened since the key press: {part: ms}.
READ: Final = """() => {
  const { pressed, drawn, shown } = window.edited;
  const entries = performance.getEntriesByType("resource").filter((it) => it.startTime >= pressed);
  const edit = entries.find((entry) => entry.name.endsWith("/edits"));
  const page = entries.find((entry) => entry.name.includes("?drawn="));
  return {
    whole: shown - pressed, "edit posted": edit.startTime - pressed, "edit answered": edit.duration,
    "page asked for": page.startTime - edit.responseEnd, "page answered": page.duration,
    "page changed": drawn - page.responseEnd, frame: shown - drawn,
  };
}"""
PARTS: Final = {
    "edit posted": "key press → POST",
    "edit answered": "the POST's answer: document, check, journal",
    "page asked for": "answer → GET of the page",
    "page answered": "the page drawn by the server",
    "page changed": "parsed, compared, changed in the iframe",
    "frame": "until the frame is there",
    "whole": "**key press → shown**",
}


def panel_text() -> str:
    """A panel file of 20 pages with 300 widgets."""
    lines = [HEAD]
    number = 0
    for page in range(PAGES):
        lines.append(f'\n# Cell {page}.\n[[page]]\nid = "page{page}"\ntitle = "Page {page}"\n')
        for group in range(GROUPS):
            lines.append(f'\n[[page.group]]\ntitle = "Group {group}"\nspan = 4\n')
            for widget in range(WIDGETS):
                lines.append(
                    f'\n[[page.group.widget]]\nid = "w{number}"  # here\nlabel = "No. {number}"\n'
                    f'topic = "/t{number}"\ntype = "std_msgs/msg/{TYPES[widget]}"\n{WIDGET[widget]}\n'
                )
                number += 1
    return "".join(lines)


class TopicRobot(OverZenoh):
    """Has 1,000 topics, of which the panel uses 300."""

    def __init__(self) -> None:
        super().__init__()
        for number in range(TOPICS):
            self._kept.append(self._token("MP", f"/t{number}", TYPES[number % WIDGETS]))


@contextmanager
def shown(folder: Path) -> Iterator[tuple[EditorServer, Page]]:
    """The editor of the panel file, and a browser with its page."""
    robot = TopicRobot()
    zenoh = str(zenoh_file(folder, robot.locator))
    try:
        with (
            editing(folder, panel_text(), "--live", KIOSK_ZENOH=zenoh) as editor,
            sync_playwright() as play,
        ):
            browser = play.chromium.launch(executable_path=str(CHROMIUM), args=CHROMIUM_FLAGS)
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            page.goto(editor.address)
            expect(page.frame_locator("#frames iframe:not(.coming)").locator("#at-w0")).to_be_visible()
            expect(page.locator("#frames")).to_have_attribute("data-live", "1")
            expect(page.locator("#faults")).not_to_be_empty()  # all panes are there
            page.evaluate(WATCH)
            yield editor, page
            browser.close()
    finally:
        robot.close()


def edits(editor: EditorServer, page: Page, press: Callable[[int], None]) -> list[dict[str, float]]:
    """The parts of each edit by `press`, and the CPU time of the server, in ms."""
    rows = []
    for number in range(EDITS + 1):
        page.evaluate("() => performance.clearResourceTimings()")
        page.wait_for_timeout(1000)  # sessions, panes and frames of the edit before have followed
        used = cpu_s(editor.process.pid)
        press(number)
        page.wait_for_function("() => window.edited?.shown", polling=20)
        rows.append(page.evaluate(READ) | {"cpu": 1000 * (cpu_s(editor.process.pid) - used)})
    return rows[1:]  # the first one warms up


def widths(editor: EditorServer, page: Page) -> list[dict[str, float]]:
    box = page.frame_locator("#frames iframe:not(.coming)").locator("#at-w0").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 5, box["y"] + 5)
    expect(page.locator(".ring.chosen")).to_be_visible()
    page.locator("#overlay").focus()
    keys = ("Shift+ArrowLeft", "Shift+ArrowRight")
    return edits(editor, page, lambda number: page.keyboard.press(keys[number % 2]))


def labels(editor: EditorServer, page: Page) -> list[dict[str, float]]:
    """A label is typed, and Enter pressed, while the robot's topics are listed."""
    page.get_by_role("tab", name="Robot").click()
    expect(page.locator(".offer").nth(TOPICS - 1)).to_be_attached()

    def press(number: int) -> None:
        field = page.locator("#form").get_by_label("Label", exact=False).first
        field.fill(f"Label {number}")
        field.press("Enter")

    return edits(editor, page, press)


def alone() -> Iterator[tuple[str, list[float]]]:
    """CPU time of the edit of the document and of its check, without a server."""
    document, checker = Document(panel_text()), DocumentChecker(Path("panel.toml"))
    checker.check(document)
    times: dict[str, list[float]] = {"edit of the document": [], "check": []}
    for number in range(EDITS):
        path = ("page", number % PAGES, "group", 1, "widget", 1, "label")
        began = time.thread_time()
        document.apply([SetValue(path, f"Label {number}")], "")
        edited = time.thread_time()
        assert checker.check(document).panel is not None
        times["edit of the document"].append(1000 * (edited - began))
        times["check"].append(1000 * (time.thread_time() - edited))
    yield from times.items()


def main() -> None:
    print("| what | half | nine tenths | asked |\n| --- | --- | --- | --- |", flush=True)
    for name, times in alone():
        print(_row(f"{name}, CPU time alone", times), flush=True)
    with tempfile.TemporaryDirectory() as folder, shown(Path(folder)) as (editor, page):
        ways = ("wider or narrower by a key", widths), ("a label, beside the topics", labels)
        for way, measure in ways:
            rows = measure(editor, page)
            for part, name in PARTS.items():
                asked = str(ASKED_MS) if part == "whole" else ""
                print(_row(f"{way}: {name}", [row[part] for row in rows], asked), flush=True)
            print(_row(f"{way}: CPU time of the server", [row["cpu"] for row in rows]), flush=True)


def _row(name: str, times: Sequence[float], asked: str = "") -> str:
    ninth = statistics.quantiles(times, n=10)[-1]
    return f"| {name} | {statistics.median(times):.0f} ms | {ninth:.0f} ms | {asked} |"


if __name__ == "__main__":
    main()
