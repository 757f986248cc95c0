"""A panel at two routers, each over a cable of its own, and the cable to the one that it is connected
to is pulled: nothing says so but silence. Everything is locked at once, with the reason; the panel
changes over when the lease is over. A robot at the other router is not locked."""

import time
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Final

import pytest

from tests.bridge.test_two_routers_on_bridge import PANEL, PAUSE_S, Presser
from tests.faults.net import Ring
from tests.support.parts import ROOT, Bridge, RosNode, Server, client_file, free_port, until
from tests.support.rmw import Router, router_file

pytestmark = pytest.mark.promise("locks")

PORT: Final = 7447
HERE: Final = f"tcp/0.0.0.0:{PORT}"
FIRST: Final = f"tcp/{Ring.FIRST}:{PORT}"  # as the panel reaches them
SECOND: Final = f"tcp/{Ring.SECOND}:{PORT}"
BETWEEN: Final = f"tcp/{Ring.BETWEEN}:{PORT}"  # the first one, as the second reaches it
OPEN: Final = "True"
QUIET_S: Final = 14.0  # longer than Zenoh waits for what a cut connection still has to send
ROBOTS: Final = """
[[robot]]
id = "r1"
name = "Robot 1"
connect = ["{first}"]
[[robot]]
id = "r2"
name = "Robot 2"
connect = ["{second}"]
"""


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as mine:
        yield mine


@pytest.fixture
def ring(stack: ExitStack) -> Ring:
    mine = Ring()
    stack.callback(mine.end)
    return mine


def routers(ring: Ring, stack: ExitStack, folder: Path, linked: tuple[str, ...] = ()) -> None:
    """One at each of the two corners; `linked` is what the second one connects to."""
    for side, name, connect in ((ring.first, "first", ()), (ring.second, "second", linked)):
        with side.inside():
            router = Router()
            router.configure(router_file(folder, name, HERE, connect))
            router.start()
        stack.callback(router.end)


def robot(domain: int, stack: ExitStack, *endpoints: str) -> RosNode:
    """A node that permits, behind a bridge at these routers."""
    bridge = Bridge(domain, options=[f"connect/endpoints={list(endpoints)}".replace("'", '"')])
    bridge.start()
    stack.callback(bridge.end)
    node = RosNode(domain)
    stack.callback(node.end)
    node.subscribe("/operation", "std_msgs/msg/String", depth=1000)
    node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    node.every("/operation_enabled", {"data": True}, 0.1)
    return node


def panel(ring: Ring, stack: ExitStack, folder: Path, robots: str = "") -> Server:
    """The test itself is at the panel's corner from then on."""
    file = folder / "cell.toml"
    file.write_text(PANEL.replace("[[page]]", f"{robots}[[page]]", 1))
    zenoh = client_file(folder, FIRST, SECOND)
    environment = {"KIOSK_PANEL": str(file), "KIOSK_ZENOH": str(zenoh), "KIOSK_MODE": "live"}
    stack.enter_context(ring.panel.inside())
    return stack.enter_context(Server(ROOT, free_port(), EXACT_LIVENESS="1", **environment))


def test_a_pulled_cable_locks_at_once_and_the_panel_changes_over(
    domain: int, ring: Ring, stack: ExitStack, tmp_path: Path
) -> None:
    routers(ring, stack, tmp_path, (BETWEEN,))
    with ring.second.inside():
        node = robot(domain + 4, stack, BETWEEN, f"tcp/127.0.0.1:{PORT}")
    server = panel(ring, stack, tmp_path)
    presser = Presser(server, "cut")
    until(presser.is_open, "it is open")
    before = set(presser.receipts)
    ring.cut()
    cut_at = time.monotonic()
    seen: dict[str, float] = {}  # each reason, and OPEN, with when it was shown first
    while seen.keys() <= {OPEN} or not presser.open_at:
        widget = server.widget("say")
        seen.setdefault(str(widget["reason"] or OPEN), time.monotonic() - cut_at)
        presser.press()
        assert time.monotonic() - cut_at < 60, "it is open again"
        time.sleep(PAUSE_S)
    pressed = {word: each for word, each in presser.receipts.items() if word not in before}
    print({reason: f"{at:.2f} s" for reason, at in seen.items()}, presser.open_at - cut_at)
    first, *others = [each for each in pressed.values() if each["outcome"] != "published"]
    # The press that was on its way says that it is not known, every later one why it is refused.
    assert (first["outcome"], first["code"]) == ("unknown", "press_bridge_no_response")
    assert {each["outcome"] for each in others} == {"refused"}
    codes = [str(each["code"]) for each in others]
    assert codes[0] == "link_bridge_silent"
    assert "link_unreachable_at" in codes, "after the lease"
    until(partial(presser.arrived, node), "what was published has arrived")
    heard = node.heard_data("/operation")
    assert len(heard) == len(set(heard)), "no press arrives twice"
    assert not presser.words("refused") & set(heard), "what was refused was not sent later"


@pytest.mark.long("fault")
def test_a_pulled_cable_locks_no_robot_at_another_router(
    domain: int, ring: Ring, stack: ExitStack, tmp_path: Path
) -> None:
    routers(ring, stack, tmp_path)
    nodes = []
    for number, side in enumerate((ring.first, ring.second)):
        with side.inside():
            nodes.append(robot(domain + 5 + number, stack, f"tcp/127.0.0.1:{PORT}"))
    server = panel(ring, stack, tmp_path, ROBOTS.format(first=FIRST, second=SECOND))
    cut_off, other = (Presser(server.robot(name), name) for name in ("r1", "r2"))
    for presser in (cut_off, other):
        until(presser.is_open, "open")
    opened = len(other.receipts)
    ring.cut()
    cut_at = time.monotonic()
    until(lambda: cut_off.press() == "refused", "the first robot is locked")
    print(f"locked after {time.monotonic() - cut_at:.2f} s")
    while time.monotonic() - cut_at < QUIET_S:
        assert other.press() == "published"
        assert cut_off.press() == "refused"
        time.sleep(PAUSE_S)
    assert len(other.receipts) > opened
    ring.plug()
    until(cut_off.is_open, "the first robot is there again")
    for presser, node in zip((cut_off, other), nodes, strict=True):
        until(partial(presser.arrived, node), "all")
        heard = node.heard_data("/operation")
        assert len(heard) == len(set(heard))
        assert not presser.words("refused") & set(heard)
