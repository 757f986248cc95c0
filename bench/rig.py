"""The test rig of all phases: the robot, the real bridge, Chromium."""

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final

from playwright.sync_api import sync_playwright

from bench.browser import Chromium, Watched
from bench.parts import robot
from bench.peer import Peer, Place, Running
from bench.unattended import Unattended
from tests.support.parts import Bridge
from tests.support.rmw import Router

DOMAIN: Final = 97
SAID_EVERY_S: Final = 0.05
WARM_TOGGLES: Final = 20


@dataclass(frozen=True)
class Sizes:
    """The number and duration of measurements."""

    rounds: int = 3
    toggles: int = 170  # per peer and round
    presses: int = 60
    cost_rounds: int = 3
    window_s: float = 3.0  # per measurement of a cost
    crowds: tuple[int, ...] = (1, 50, 200, 500)
    stalled_s: float = 30.0
    before_stall_s: float = 3.0
    growth_s: float = 1.0
    growth_points: tuple[int, ...] = (0, 1, 2, 3)


QUICK: Final = Sizes(
    rounds=1,
    toggles=40,
    presses=20,
    cost_rounds=1,
    window_s=0.7,
    crowds=(1, 50),
    stalled_s=2.0,
    before_stall_s=1.0,
    growth_s=0.3,
    growth_points=(0, 2, 3),
)


@contextmanager
def scratch(peer: Peer) -> Iterator[Path]:
    """A temporary folder for a peer."""
    with tempfile.TemporaryDirectory(prefix=f"bench-{peer.id}-") as folder:
        yield Path(folder)


class Rig:
    """A context manager that ends everything it started."""

    def __init__(self, sizes: Sizes) -> None:
        self.sizes = sizes
        self.started_s = 0.0
        self._stack = ExitStack()

    def __enter__(self) -> "Rig":
        with ExitStack() as stack:
            self.robot = robot(DOMAIN)
            stack.callback(self.robot.end)
            self._playwright = stack.enter_context(sync_playwright())
            self.chromium = stack.enter_context(self.another_chromium())
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stack.__exit__(kind, error, trace)

    @contextmanager
    def another_chromium(self) -> Iterator[Chromium]:
        chromium = Chromium(self._playwright)
        try:
            yield chromium
        finally:
            chromium.close()

    @contextmanager
    def bridge(self) -> Iterator[str]:
        """Runs the real bridge within the block; yields its locator."""
        bridge = Bridge(DOMAIN)
        bridge.start()
        try:
            yield bridge.endpoint
        finally:
            bridge.end()

    @contextmanager
    def router(self) -> Iterator[str]:
        """Runs a router with the robot's node on rmw_zenoh within the block; yields its locator."""
        router = Router()
        router.start()
        try:
            self.robot("join", router=router.endpoint)
            yield router.endpoint
        finally:
            self.robot("leave")
            router.end()

    @contextmanager
    def running(
        self,
        peer: Peer,
        topics: Sequence[str] = (),
        router: str = "",
        buttons: int = 1,
        folder: Path | None = None,
    ) -> Iterator[Running]:
        """Runs a peer's server within the block, without other peers. Without a `folder` it gets a new
        one."""
        with ExitStack() as stack:
            folder = folder or stack.enter_context(scratch(peer))
            place = Place(router or self.robot.first, DOMAIN, folder, tuple(topics), buttons)
            self.robot("offer", way=peer.robot, topics=list(topics))
            began = time.monotonic()
            server = peer.start(place)
            self.started_s = time.monotonic() - began  # until the first HTTP response
            stack.callback(server.end)
            stack.callback(self.robot, "quiet")
            yield server

    @contextmanager
    def page(
        self, peer: Peer, server: Running, way: str, topics: Sequence[str] = ()
    ) -> Iterator[Watched]:
        """The peer's page, with the robot's permission shown."""
        with self.chromium.page(server.url, peer.shown, topics) as page:
            self.permit(way, page)
            yield page

    @contextmanager
    def unattended(
        self, peer: Peer, server: Running, topics: Sequence[str] = (), way: str = ""
    ) -> Iterator[Unattended]:
        """A separate browser with the peer's page, with the robot's permission shown. `way` is the
        robot's transport if it is not the peer's own. At the end the page has to show `topics`."""
        with tempfile.TemporaryDirectory(
            prefix="bench-chromium-", ignore_cleanup_errors=True
        ) as profile:
            browser = Unattended(self._playwright, Path(profile))
            try:
                with browser.attached() as page:
                    page.goto(server.url)
                    self.permit(way or peer.robot, Watched(page, peer.shown))
                yield browser
                with browser.attached() as page:
                    Watched(page, peer.shown, topics).until_shown()
            finally:
                browser.close()

    def permit(self, way: str, page: Watched) -> None:
        self.robot("repeat", way=way, values=[True], period_s=SAID_EVERY_S)
        shown = page.until_permitted()
        self.robot("quiet")
        assert shown, "the page did not show the robot's permission"

    def warm(self, way: str) -> None:
        self.robot("toggle", way=way, count=WARM_TOGGLES, least_s=0.01, most_s=0.02)
