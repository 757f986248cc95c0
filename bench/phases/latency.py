"""Latency. Down: the robot's put → the DOM has changed. Up: pointer released → received by the
robot."""

import random
import time
from collections.abc import Sequence
from typing import Final

from bench.browser import Watched
from bench.peer import Peer
from bench.report.figures import Matched, percentile, presses_matched, toggles_matched
from bench.rig import Rig

GAP_S: Final = (0.015, 0.025)  # random, so that it does not synchronise with a peer's timers
BETWEEN_PRESSES_S: Final = (0.04, 0.06)
SETTLE_S: Final = 0.4
BUTTONS: Final = 20  # on this panel's page each accepts another press only after 0.7 s


def down(rig: Rig, peer: Peer, over: str = "", router: str = "") -> dict[str, float]:
    """One round of one peer. `over` is the robot's transport if it is not the peer's own; `router` is
    the locator that the peer connects to then."""
    way = over or peer.robot
    with (
        rig.running(peer, router=router) as server,
        rig.unattended(peer, server, way=way) as browser,
    ):
        with browser.attached() as page:
            watched = Watched(page, peer.shown)
            rig.warm(way)
            clock = watched.clock()
            watched.watch()
        time.sleep(SETTLE_S)
        said = rig.robot("toggle", way=way, count=rig.sizes.toggles, least_s=GAP_S[0], most_s=GAP_S[1])
        time.sleep(SETTLE_S)
        with browser.attached() as page:
            toggles = Watched(page, peer.shown).take("toggles")
        shown = [(clock.ns(at) / 1e6, value) for at, value in toggles]
        matched = toggles_matched([(at / 1e6, value) for at, value in said], shown)
        return figures_of(matched, clock.doubt_ms)


def up(rig: Rig, peer: Peer, router: str = "") -> dict[str, float]:
    """One round of one peer, with the locator that it connects to."""
    way = peer.robot
    with (
        rig.running(peer, router=router, buttons=BUTTONS) as server,
        rig.page(peer, server, way) as page,
    ):
        time.sleep(SETTLE_S)
        clock = page.clock()
        page.watch()
        _press(rig, peer, page, ["warm"] * BUTTONS)
        time.sleep(SETTLE_S)
        page.take("ups")
        rig.robot("heard", way=way)
        texts = [f"press {number}" for number in range(rig.sizes.presses)]
        pressed = _press(rig, peer, page, texts)
        time.sleep(SETTLE_S)
        released = [clock.ns(at) / 1e6 for at in page.take("ups")]
        heard = [(at / 1e6, text) for at, text in rig.robot("heard", way=way)]
        matched, twice = presses_matched(dict(zip(pressed, released, strict=True)), heard)
        return figures_of(matched, clock.doubt_ms) | {
            "twice": twice,
            "locked": len(texts) - len(pressed),
        }


def _press(rig: Rig, peer: Peer, page: Watched, texts: Sequence[str]) -> list[str]:
    """Presses with each text; returns the texts for which the button was not locked."""
    pressed = []
    for turn, text in enumerate(texts):
        if page.press(peer.button, turn, text):
            pressed.append(text)
        time.sleep(random.uniform(*BETWEEN_PRESSES_S))
    return pressed


def figures_of(matched: Matched, doubt_ms: float) -> dict[str, float]:
    """The figures of a round; `doubt_ms` is the uncertainty of the page's clock."""
    return {
        "p50": percentile(matched.ms, 50),
        "p99": percentile(matched.ms, 99),
        "events": len(matched.ms),
        "lost": matched.lost,
        "doubt_ms": doubt_ms,
    }
