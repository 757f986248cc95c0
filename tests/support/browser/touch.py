"""A panel with every input, and pages on touch screens."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from playwright.sync_api import BrowserContext, Page, expect

from tests.support.browser.browsers import SIZE, sized
from tests.support.browser.pages import place
from tests.support.parts import ENOUGH_S, Server, until
from tests.support.servers import demo_server

SIZES: Final = ((1280, 800), (1024, 600), (800, 480), (800, 1280))
MM_PER_PX: Final = 0.22
HEARD: Final = "[data-widget=heard] .value"  # where the page shows what the robot heard last
HUMAN_S: Final = 0.2  # between two keys
READER_S: Final = 0.01  # between two keys of a bar code reader
HALT: Final = "halt"  # the order that the interlock forbids
# The demo robot says on /last_heard what it heard: a press sets the interlock.
PANEL: Final = f"""
title = "Palletizing cell 2"
mode = "demo"
mm_per_px = {MM_PER_PX}
%s

[[interlock]]
id = "order"
label = "order"
topic = "/last_heard"
type = "std_msgs/msg/String"
field = "data"
not_equals = "{HALT} (/operation2)"

[[frame.widget]]
id = "stop"
kind = "publish"
role = "stop"
label = "Stop"
topic = "/operation"
type = "std_msgs/msg/String"
message = {{ data = "stop" }}

[[page]]
id = "setup"
title = "Setup"

[[page.group]]
title = "Program"
columns = 3
span = 7

[[page.group.widget]]
id = "speed"
kind = "number"
label = "Jog speed"
unit = "mm/s"
min = 10
max = 250
step = 10
default = 120
span = 2

[[page.group.widget]]
id = "jog"
kind = "hold"
label = "Left"
topic = "/operation1"
type = "std_msgs/msg/String"
message = {{ data = "left" }}
release = {{ data = "stopped" }}
rate_hz = 20
interlock = "order"

[[page.group.widget]]
id = "height"
kind = "slider"
label = "Box height"
min = 0.0
max = 400.0
default = 210.0
span = 2

[[page.group.widget]]
id = "load"
kind = "publish"
label = "Load"
topic = "/operation2"
type = "std_msgs/msg/String"
message = {{ data = "{{order}} {{speed}} {{height}} {{offset}}" }}

[[page.group.widget]]
id = "send"
kind = "publish"
label = "Send order"
topic = "/operation2"
type = "std_msgs/msg/String"
message = {{ data = "{{order}}" }}

[[page.group.widget]]
id = "order"
kind = "text"
label = "Order"
default = "4711"
max_length = 12
scan = true
span = 2

[[page.group]]
title = "Belt"
columns = 2
span = 5

[[page.group.widget]]
id = "belt"
kind = "parameter"
label = "Belt speed"
node = "/system_controller"
parameter = "speed"
type = "double"
unit = "mm/s"
span = 2

[[page.group.widget]]
id = "heard"
kind = "readout"
label = "Robot heard"
topic = "/last_heard"
type = "std_msgs/msg/String"
field = "data"
span = 2

[[page.group.widget]]
id = "offset"
kind = "number"
label = "Offset"
min = -2.5
max = 2.5
default = 0
span = 2

[[page.group.widget]]
id = "note"
kind = "text"
label = "Note"
span = 2

[[page]]
id = "other"
title = "Other"
"""


def touched_server(folder: Path, above: str = "", screen: str = "") -> Server:
    """A server with this panel; `above` are keys of the file, `screen` those of its table [screen]."""
    server = demo_server(folder, PANEL % (above + (f"\n[screen]\n{screen}" if screen else "")))
    permit(server)
    return server


def permit(server: Server, order: str = "4711") -> None:
    """Presses so that the interlock permits, or with HALT forbids."""
    server.http.post("/widgets/send", json={"inputs": {"order": order}})
    permits = order != HALT
    until(lambda: server.snapshot()["interlocks"]["order"]["enabled"] is permits, f"order {order}")


@contextmanager
def opened(context: BrowserContext, server: Server, path: str = "/") -> Iterator[Page]:
    """A page of the server with its scripts; an error on its console fails the test."""
    context.set_default_timeout(1000 * ENOUGH_S)
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    yield loaded(page, server, path)
    context.close()
    assert errors == []


def loaded(page: Page, server: Server, path: str = "/") -> Page:
    """Loads a page of the server, with its scripts."""
    page.goto(server.url + path)
    expect(page.locator("html[data-floor]")).to_be_attached()
    return page


def touched(page: Page, server: Server, size: tuple[int, int] = SIZE) -> Page:
    """The server's first page with its scripts, on a touch screen."""
    loaded(sized(page, *size), server)
    if page.locator("template:is(#keypad, #keyboard)").count():
        expect(page.locator("body[data-touch-entry]")).to_be_attached()
    return page


class Keys:
    """A keyboard, or a bar code reader, with `apart_s` seconds between its keys."""

    def __init__(self, page: Page, apart_s: float) -> None:
        self._session = page.context.new_cdp_session(page)
        self._apart_s = apart_s
        self._now = float(page.evaluate("performance.timeOrigin + performance.now()")) / 1000

    def type(self, text: str, apart_s: float | None = None) -> None:
        """Each character; a line feed is Enter. `apart_s`: another time between these keys."""
        for character in text:
            self._now += self._apart_s if apart_s is None else apart_s
            enter = {"key": "Enter", "code": "Enter", "text": "\r", "windowsVirtualKeyCode": 13}
            code = "Space" if character == " " else f"Key{character.upper()}"
            about: dict[str, Any] = (
                enter if character == "\n" else {"key": character, "code": code, "text": character}
            )
            if character == " ":
                about["windowsVirtualKeyCode"] = 32
            for kind in ("keyDown", "keyUp"):
                up = {} if kind == "keyDown" else {"text": ""}
                self._session.send(
                    "Input.dispatchKeyEvent", {"type": kind, "timestamp": self._now, **about, **up}
                )


def overlap(page: Page, selector: str, other: str) -> bool:
    """Whether two visible elements share a part of the screen."""
    first, second = place(page.locator(selector)), place(page.locator(other))
    return (
        min(first["x"] + first["width"], second["x"] + second["width"]) - max(first["x"], second["x"])
        > 1
        and min(first["y"] + first["height"], second["y"] + second["height"])
        - max(first["y"], second["y"])
        > 1
    )


def settled(page: Page) -> None:
    """Waits until elements below a sheet can be pressed again."""
    expect(page.locator("body:not([data-settling])")).to_be_attached()
