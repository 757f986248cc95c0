"""`python -m bench.whole`: what the whole kiosk takes, on the real bridge: the server, Chromium, and
what watches the screen (`operator-panel kiosk`, without a compositor).

The page is that of the reference system: a text, two buttons that an interlock locks, and a value.
Measured: from the start of all at once to a button that can be pressed; memory and processor time at
rest and with 10 messages a second; the closed loop: a real node permits, the button opens, a script
presses it at once, and the node has the command. Memory is shared with any other Chromium that runs on
the machine. With `QUICK=1` it takes some seconds, to check that it works. Prints JSON.
"""

import json
import os
import statistics
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

from playwright.sync_api import Page, sync_playwright

from bench.kiosk import BUTTON, HEAD, PAGE, READOUT
from bench.parts import COMMAND, ENABLED, Meter, family, pss_mib, rss_mib
from tests.support.browser.screen import KioskScreen
from tests.support.parts import Bridge, RosNode, free_port, live, until

QUICK: Final = bool(os.environ.get("QUICK"))
DOMAIN: Final = 98
FOR_S: Final = 3.0 if QUICK else 20.0
LOOPS: Final = 3 if QUICK else 40
HZ: Final = 10.0
TAP_AGAIN_S: Final = 0.8  # a button takes no second press before
COUNT: Final = "/count"
PANEL: Final = (
    HEAD
    + PAGE
    + BUTTON.format(n=1, topic=COMMAND)
    + BUTTON.format(n=2, topic="/operation2")
    + READOUT.format(id=COUNT[1:], topic=COUNT, type="std_msgs/msg/Float64")
)
FIRST: Final = '[data-widget="operation1"] button[type="submit"]'
IS_OPEN: Final = f"document.querySelector({FIRST!r})?.disabled === false"
PRESS: Final = """(button) => {
  const press = () => button.disabled || button.click();
  new MutationObserver(press).observe(button, { attributes: true, attributeFilter: ["disabled"] });
}"""


class WholeKiosk:
    """A node, the bridge, the server and a browser, until the stack is closed."""

    def __init__(self, stack: ExitStack) -> None:
        bridge = Bridge(DOMAIN)
        bridge.start()
        stack.callback(bridge.end)
        self.robot = RosNode(DOMAIN, "robot")
        stack.callback(self.robot.end)
        self.robot.advertise(ENABLED, "std_msgs/msg/Bool", durability="transient_local")
        self.robot.advertise(COUNT, "std_msgs/msg/Float64")
        self.robot.subscribe(COMMAND, "std_msgs/msg/String", depth=1000)
        self.robot.publish(ENABLED, {"data": True})
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="bench-whole-")))
        (folder / "panel.toml").write_text(PANEL)
        self._playwright = stack.enter_context(sync_playwright())
        panel, port = folder / "panel.toml", free_port()
        began = time.monotonic()
        self._screen = KioskScreen(
            f"http://127.0.0.1:{port}", folder / "screen", "--compositor=none", f"--panel={panel}"
        )
        stack.callback(self._screen.end)
        server = live(bridge.endpoint, folder, port, KIOSK_PANEL=str(panel))
        stack.callback(server.end)
        until(lambda: self._screen.evaluate(IS_OPEN), "the button is open", every_s=0.01)
        self.live_s = time.monotonic() - began
        self._roots = server.process.pid, self._screen.process.pid

    def pids(self) -> set[int]:
        return family(self._roots)

    @contextmanager
    def attached(self) -> Iterator[Page]:
        """The page, with a second client of DevTools beside the watcher."""
        browser = self._playwright.chromium.connect_over_cdp(f"http://127.0.0.1:{self._screen.port}")
        try:
            yield browser.contexts[0].pages[0]
        finally:
            browser.close()  # closes only the connection

    def cost(self) -> dict[str, float]:
        """Over `FOR_S`: memory at the end, and processor time in % of one core."""
        meter = Meter(self.pids)
        time.sleep(FOR_S)
        return {
            "cpu_percent": round(meter.percent(), 1),
            "pss_mib": round(pss_mib(self.pids())),
            "rss_mib": round(rss_mib(self.pids())),
        }

    def loaded(self) -> dict[str, float]:
        """The cost with a value that changes `HZ` times a second."""

        def say() -> None:
            for number in range(round(HZ * (FOR_S + 1))):
                self.robot.publish(COUNT, {"data": number / 7})
                time.sleep(1 / HZ)

        saying = threading.Thread(target=say)
        saying.start()
        time.sleep(0.5)
        figures = self.cost()
        saying.join()
        return figures

    def closed_loop(self) -> dict[str, float]:
        """Milliseconds from the node's permission to the command that it has."""
        with self.attached() as page:
            page.locator(FIRST).evaluate(PRESS)
            page.locator("h1, h2").first.dispatch_event("pointerdown")  # as the first touch of a page
        spent: list[float] = []
        for _ in range(LOOPS):
            self.robot.publish(ENABLED, {"data": False})
            time.sleep(TAP_AGAIN_S)
            began = time.monotonic()
            self.robot.publish(ENABLED, {"data": True})
            until(lambda: len(self.robot.heard(COMMAND)) > len(spent), "the node has the command")
            spent.append(1000 * (self.robot.heard_at(COMMAND)[-1] - began))
        return {"p50_ms": round(statistics.median(spent), 1), "longest_ms": round(max(spent), 1)}


def main() -> None:
    with ExitStack() as stack:
        kiosk = WholeKiosk(stack)
        figures: dict[str, Any] = {"load_before": os.getloadavg()[0], "live_s": round(kiosk.live_s, 2)}
        time.sleep(2)
        figures["at rest"] = kiosk.cost()
        figures[f"{HZ:g} Hz"] = kiosk.loaded()
        figures["closed loop"] = kiosk.closed_loop()
        print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
