"""Chromium: opens pages, reads their clocks, observes what they show, and presses buttons."""

import json
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Final

from playwright.sync_api import Browser, CDPSession, Page, Playwright, ViewportSize
from playwright.sync_api import Error as PlaywrightError

from bench.parts import family
from tests.support.parts import CHROMIUM, CHROMIUM_FLAGS

VIEWPORT: Final[ViewportSize] = {"width": 1280, "height": 800}
WITHIN_MS: Final = 15_000
TEXT_INPUT: Final = "#text, #input-text"
ROUND_TRIPS: Final = 20
TEXT_FRAME: Final = 1

# Records changes of the DOM with the page's time, by MutationObserver.
WATCH: Final = """([shown, values]) => {
  const bench = (window.bench = { toggles: [], texts: [], ups: [] });
  const root = document.querySelector(shown);
  new MutationObserver(() => bench.toggles.push([performance.now(), !root.hasAttribute("disabled")]))
    .observe(root, { attributes: true, attributeFilter: ["disabled"] });
  for (const [index, value] of values.entries()) {
    const element = document.querySelector(value);
    const note = () => bench.texts.push([performance.now(), index, element.textContent.slice(0, 11)]);
    new MutationObserver(note)
      .observe(element, { childList: true, characterData: true, subtree: true });
  }
  addEventListener("pointerup", () => bench.ups.push(performance.now()), true);
}"""

# Injected before the page's scripts: the page's time when it first shows the permission.
SHOWN_AT: Final = """(() => {
  window.benchShownAt = 0;
  const look = () => {
    const root = document.querySelector(SELECTOR);
    if (!root || root.hasAttribute("disabled")) return;
    window.benchShownAt = performance.now();
    observer.disconnect();
  };
  const observer = new MutationObserver(look);
  observer.observe(document, { subtree: true, childList: true, attributes: true });
})()"""

# Like WATCH for values, but injected before the page's scripts, and across the page's own reloads.
KEEP: Final = """((values) => {
  const origin = performance.timeOrigin;
  const moved = (texts, by) => texts.map(([at, index, text]) => [at + by, index, text]);
  const kept = moved(JSON.parse(sessionStorage.getItem("bench") ?? "[]"), -origin);
  const last = [];
  window.benchKept = kept;
  const look = () => {
    for (const [index, value] of values.entries()) {
      const text = document.querySelector(value)?.textContent.slice(0, 11);
      if (!text?.startsWith("#") || text === last[index]) continue;
      last[index] = text;
      kept.push([performance.now(), index, text]);
    }
  };
  const observer = new MutationObserver(look);
  observer.observe(document, { subtree: true, childList: true, characterData: true });
  addEventListener("pagehide", () => {
    sessionStorage.setItem("bench", JSON.stringify(moved(kept.slice(-20000), origin)));
  });
})"""

TYPE: Final = """([input, buttons, turn, text]) => {
  const entry = document.querySelector(input);
  entry.value = text;
  entry.dispatchEvent(new Event("input", { bubbles: true }));
  const all = document.querySelectorAll(buttons);
  const button = all[turn % all.length];
  button.scrollIntoView({ block: "nearest" });
  const box = button.getBoundingClientRect();
  return [box.x + box.width / 2, box.y + box.height / 2, !button.hasAttribute("disabled")];
}"""


def value_of(topic: str) -> str:
    """The selector of the element that shows a topic, for peers and for the panel's widgets."""
    return f'[data-topic="{topic}"], [data-widget="{topic[1:]}"] .value'


@dataclass(frozen=True)
class Clock:
    """Converts a page's time (ms) to CLOCK_MONOTONIC (ns), from the page's start as Chromium reports
    it."""

    began_ns: float
    doubt_ms: float  # the uncertainty that the shortest round trips to the page leave

    def ns(self, page_ms: float) -> float:
        return self.began_ns + page_ms * 1e6


class Watched:
    """An open page of a peer."""

    def __init__(self, page: Page, peer_shown: str, topics: Sequence[str] = ()) -> None:
        self.page = page
        self._shown = peer_shown
        self._topics = topics

    def until_permitted(self) -> bool:
        """Waits until the page shows the robot's permission; False at the timeout."""
        with suppress(PlaywrightError):
            self.page.wait_for_selector(f":is({self._shown}):not([disabled])", timeout=WITHIN_MS)
            return True
        return False

    def until_shown(self) -> None:
        """Waits until each topic shows a numbered text of the robot."""
        for topic in self._topics:
            self.page.wait_for_function(
                "(value) => document.querySelector(value)?.textContent.startsWith('#')",
                arg=value_of(topic),
                timeout=WITHIN_MS,
            )

    def watch(self) -> None:
        self.page.evaluate(WATCH, [self._shown, [value_of(topic) for topic in self._topics]])

    def take(self, list_name: str) -> list[Any]:
        """Returns and clears the recorded `toggles`, `texts` or `ups`."""
        return list(self.page.evaluate(f"bench.{list_name}.splice(0)"))

    def kept(self) -> list[Any]:
        """(page's time, index of the topic, text) of everything that was shown, for a page opened with
        `keep`."""
        return list(self.page.evaluate("benchKept"))

    def clock(self) -> Clock:
        """The page's clock. Chromium's TimeTicks are CLOCK_MONOTONIC: the start of the page's time is
        read from Chromium, and checked by round trips."""
        session = self.page.context.new_cdp_session(self.page)
        session.send("Performance.enable", {"timeDomain": "timeTicks"})
        metrics = session.send("Performance.getMetrics")["metrics"]
        session.detach()
        began = next(metric["value"] for metric in metrics if metric["name"] == "NavigationStart") * 1e9
        least, most = float("-inf"), float("inf")
        for _ in range(ROUND_TRIPS):
            before = time.monotonic_ns()
            now = self.page.evaluate("performance.now()") * 1e6
            after = time.monotonic_ns()
            least, most = max(least, before - now), min(most, after - now)
        outside = max(least - began, began - most, 0.0)
        return Clock(began, max(outside, (most - least) / 2) / 1e6)

    def press(self, buttons: str, turn: int, text: str) -> bool:
        """Types a text and presses a button; False if the button is locked."""
        x, y, open_ = self.page.evaluate(TYPE, [TEXT_INPUT, buttons, turn, text])
        if not open_:
            return False
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.up()
        return True


class Chromium:
    """A browser. Pages are open only while they are measured."""

    def __init__(self, playwright: Playwright) -> None:
        self._browser: Browser = playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=CHROMIUM_FLAGS,
            handle_sigint=False,
            handle_sigterm=False,
            handle_sighup=False,
        )
        session = self._browser.new_browser_cdp_session()
        processes = session.send("SystemInfo.getProcessInfo")["processInfo"]
        session.detach()
        self._root = next(int(process["id"]) for process in processes if process["type"] == "browser")
        self.version = self._browser.version

    def pids(self) -> set[int]:
        return family((self._root,))

    @contextmanager
    def page(
        self, url: str, shown: str, topics: Sequence[str] = (), keep: bool = False
    ) -> Iterator[Watched]:
        """A loaded page in its own context; `keep`: see `Watched.kept`."""
        with self.blank() as page:
            if keep:
                page.add_init_script(f"{KEEP}({json.dumps([value_of(topic) for topic in topics])})")
            page.goto(url)
            yield Watched(page, shown, topics)

    @contextmanager
    def blank(self) -> Iterator[Page]:
        context = self._browser.new_context(viewport=VIEWPORT)
        context.set_default_timeout(WITHIN_MS)
        try:
            yield context.new_page()
        finally:
            with suppress(PlaywrightError):
                context.close()

    def load(self, url: str, shown: str) -> tuple[float, int]:
        """(ms from the request until the robot's permission is shown, bytes over the wire), with an
        empty cache."""
        with self.blank() as page:
            page.add_init_script(SHOWN_AT.replace("SELECTOR", repr(shown)))
            wire = Wire(page.context.new_cdp_session(page))
            page.goto(url, wait_until="commit")
            page.wait_for_function("() => window.benchShownAt > 0", timeout=WITHIN_MS)
            shown_at = float(page.evaluate("window.benchShownAt"))
            page.wait_for_load_state("load")
            return shown_at, wire.bytes

    def close(self) -> None:
        with suppress(PlaywrightError):
            self._browser.close()


class Wire:
    """Counts the bytes that a page receives, compressed, with headers and streams."""

    def __init__(self, session: CDPSession) -> None:
        self._sizes: dict[str, int] = {}
        self._messages = 0
        session.on("Network.responseReceived", self._answered)
        session.on("Network.dataReceived", self._more)
        session.on("Network.loadingFinished", self._whole)
        session.on("Network.webSocketFrameReceived", self._message)
        session.send("Network.enable")

    @property
    def bytes(self) -> int:
        return sum(self._sizes.values()) + self._messages

    def _answered(self, event: Any) -> None:
        self._sizes[event["requestId"]] = int(event["response"]["encodedDataLength"])

    def _more(self, event: Any) -> None:
        known = self._sizes.get(event["requestId"], 0)
        self._sizes[event["requestId"]] = known + int(event["encodedDataLength"])

    def _whole(self, event: Any) -> None:
        self._sizes[event["requestId"]] = int(event["encodedDataLength"])

    def _message(self, event: Any) -> None:
        frame = event["response"]
        length = len(frame["payloadData"])
        self._messages += length if frame["opcode"] == TEXT_FRAME else length * 3 // 4  # base64
