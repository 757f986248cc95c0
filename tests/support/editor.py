"""The editor of a panel file, as `operator-panel edit` starts it."""

import os
import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
from playwright.sync_api import Error as PlaywrightError
from playwright.sync_api import FloatRect, FrameLocator, Locator, Page, expect

from tests.support.parts import until
from tests.support.processes import command
from tests.support.processes.command import COMMAND

# Two pages; the simulated robot opens and closes its gripper.
PANEL = """\
title = "Cell"  # the first line
language = "en"
languages = ["en", "de"]
screens = ["1280x800", "1024x600"]

# What the belt does.
[[page]]
id = "cell"
title = { en = "Cell", de = "Zelle" }
icon = "factory"

[[page.group]]
title = "Belt"
span = 6

[[page.group.widget]]
id = "speed"
kind = "readout"
label = "Speed"      # shown large
topic = "/speed"
type = "std_msgs/msg/Float64"
field = "data"
span = 6

[[page.group.widget]]
id = "ready"
kind = "indicator"
label = "Ready"
topic = "/ready"
type = "std_msgs/msg/Bool"
field = "data"
span = 6
states = [
  { value = true, text = "Ready", shape = "circle" },
  { value = false, text = "Not ready", shape = "cross", colour = "white" },
]

[[page.group]]
title = "Gripper"
span = 6

[[page.group.widget]]
id = "open"
kind = "call"
label = "Open"
service = "/gripper/open"
type = "std_srvs/srv/Trigger"
span = 6

[[page]]
id = "watch"
title = "Watch"

[[page.widget]]
id = "load"
kind = "readout"
label = "Load"
topic = "/load"
type = "std_msgs/msg/Float64"
field = "data"
"""


class EditorServer:
    """A running editor; `http` is a client that has its token, and has signed in as the `engineer`
    "name:password". One that listens on all addresses is reached on this machine."""

    def __init__(self, file: Path, *options: str, engineer: str = "", **environment: str) -> None:
        self.file = file
        env = {**os.environ, "XDG_STATE_HOME": str(file.parent / "state"), **environment}
        self.process = command.start(COMMAND, "edit", str(file), "--port", "0", *options, env=env)
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip().replace("//0.0.0.0:", "//127.0.0.1:")
        assert self.address.startswith("http"), self.process.stderr and self.process.stderr.read()
        self.url = self.address.partition("/?")[0]
        self.http = httpx.Client(
            base_url=self.url, timeout=60, headers={"accept-language": "en"}, verify=not engineer
        )
        until(lambda: self.http.get(self.address).status_code == 303, "the editor answers")
        if engineer:
            named = dict(zip(("name", "secret"), engineer.split(":"), strict=True))
            assert self.http.post("/sign-in", data=named).status_code == 303
        until(lambda: self.state()["faults"] or self.state()["live"] > 0, "the preview's sessions run")

    def state(self) -> dict[str, Any]:
        known: dict[str, Any] = self.http.get("/state").json()
        return known

    def edit(self, *edits: Mapping[str, Any], revision: int | None = None) -> httpx.Response:
        known = self.state()["revision"] if revision is None else revision
        return self.http.post("/edits", json={"revision": known, "edits": edits})

    def part(self, name: str, **query: str) -> str:
        return self.http.get(f"/parts/{name}", params=query).raise_for_status().text

    def kill(self) -> None:
        self.process.kill()

    def end(self) -> None:
        self.http.close()
        with suppress(ProcessLookupError):  # it was killed
            self.process.send_signal(signal.SIGINT)
        command.finished(self.process)


def preview(page: Page) -> FrameLocator:
    """The panel's own page in the editor's."""
    return page.frame_locator("#frames iframe:not(.coming)")


def box_of(page: Page, selector: str) -> FloatRect:
    """Where an element of the preview is on the screen, in px. A frame that takes the place of the one
    before has none for a moment."""
    boxes: list[FloatRect] = []

    def is_there() -> bool:
        with suppress(PlaywrightError):
            box = preview(page).locator(selector).bounding_box(timeout=1000)
            boxes.extend([box] if box else [])
        return bool(boxes)

    until(is_there, f"{selector} is shown")
    return boxes[-1]


def middle(box: FloatRect) -> tuple[float, float]:
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag_line(page: Page, line: Locator, x: float, y: float) -> None:
    """Drags a line of the panes "Robot" and "Parts" to a point of the window. The list comes again when
    it has other rows: a line that goes at that moment is taken again."""
    ghost = page.locator(".ghost")

    def is_dragged() -> bool:
        with suppress(PlaywrightError):
            line.scroll_into_view_if_needed(timeout=1000)
            box = line.bounding_box(timeout=1000)
            if box is not None:
                page.mouse.move(box["x"] + 60, box["y"] + 12)
                page.mouse.down()
                page.mouse.move(box["x"] + 80, box["y"] + 20)
                page.mouse.move(x, y, steps=4)
                if ghost.is_visible():
                    return True
                page.mouse.up()
        return False

    until(is_dragged, "a line is dragged")
    page.mouse.up()
    expect(ghost).to_have_count(0)


@contextmanager
def editing(
    folder: Path, text: str = PANEL, *options: str, **environment: str
) -> Iterator[EditorServer]:
    """The editor of a file `cell.toml` with this text."""
    file = folder / "cell.toml"
    file.write_text(text)
    editor = EditorServer(file, *options, **environment)
    try:
        yield editor
    finally:
        editor.end()
