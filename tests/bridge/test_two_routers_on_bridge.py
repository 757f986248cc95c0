"""A panel and the real bridge at two Zenoh routers, of which one is killed: the panel changes over."""

import json
import time
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.parts import ROOT, Bridge, RosNode, Server, client_file, free_port, until
from tests.support.rmw import LinkedRouters

PANEL: Final = """
title = "Cell"
interlock = [{ id = "operation", topic = "/operation_enabled", max_age_s = 1.0 }]
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "message"
kind = "text"
label = "Message"
[[page.widget]]
id = "say"
kind = "publish"
label = "Say"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "{message}" }
interlock = "operation"
"""
CHANGE_OVER_S: Final = 8.0
PAUSE_S: Final = 0.05  # between two presses


@pytest.fixture
def routers(tmp_path: Path) -> Iterator[LinkedRouters]:
    mine = LinkedRouters(tmp_path)
    mine.start()
    yield mine
    mine.end()


@pytest.fixture
def robot(domain: int, routers: LinkedRouters) -> Iterator[RosNode]:
    """A node behind a bridge that is connected to both routers."""
    both = json.dumps(routers.endpoints)
    bridge = Bridge(domain + 2, options=[f"connect/endpoints={both}"])
    bridge.start()
    node = RosNode(bridge.domain)
    node.subscribe("/operation", "std_msgs/msg/String", depth=1000)
    node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    yield node
    node.end()
    bridge.end()


@pytest.fixture
def panel(routers: LinkedRouters, tmp_path: Path) -> Iterator[Server]:
    file = tmp_path / "cell.toml"
    file.write_text(PANEL)
    zenoh = client_file(tmp_path, *routers.endpoints)
    environment = {"KIOSK_PANEL": str(file), "KIOSK_ZENOH": str(zenoh), "KIOSK_MODE": "live"}
    with Server(ROOT, free_port(), **environment) as mine:
        yield mine


class Presser:
    """Presses again and again, each time with another text, and keeps the receipts."""

    def __init__(self, server: Server, name: str) -> None:
        self._server, self._name = server, name
        self.receipts: dict[str, dict[str, Any]] = {}
        self.open_at = 0.0  # the first of the newest presses in a row that were published

    def press(self) -> str:
        """The outcome."""
        word = f"{self._name}-{len(self.receipts)}"
        body = {"inputs": {"message": word}, "id": f"press-{word}"}
        receipt: dict[str, Any] = self._server.http.post(
            f"{self._server.base}/widgets/say", json=body
        ).json()
        self.receipts[word] = receipt
        if receipt["outcome"] != "published":
            self.open_at = 0.0
        elif not self.open_at:
            self.open_at = time.monotonic()
        return str(receipt["outcome"])

    def is_open(self) -> bool:
        """Presses once more."""
        return self.press() == "published"

    def arrived(self, robot: RosNode) -> bool:
        """All that was published."""
        return self.words("published") <= set(robot.heard_data("/operation"))

    def words(self, outcome: str) -> set[str]:
        return {word for word, each in self.receipts.items() if each["outcome"] == outcome}


def test_the_panel_changes_over_when_a_router_dies(
    routers: LinkedRouters, robot: RosNode, panel: Server
) -> None:
    robot.every("/operation_enabled", {"data": True}, 0.1)
    until(lambda: panel.widget("say")["enabled"], "the permission comes through a router")
    for number, router in enumerate(routers.routers):
        presser = Presser(panel, f"router{number}")
        until(presser.is_open, "it is open")
        router.kill()
        killed_at = time.monotonic()
        while time.monotonic() - killed_at < CHANGE_OVER_S:
            presser.press()
            time.sleep(PAUSE_S)
        took = max(0.0, presser.open_at - killed_at)
        refused = {each["code"] for each in presser.receipts.values() if each["outcome"] == "refused"}
        outcomes = Counter(str(each["outcome"]) for each in presser.receipts.values())
        print(f"router {number}: open after {took:.2f} s, {dict(outcomes)}, {refused}")
        assert presser.open_at, "it is open again"
        until(partial(presser.arrived, robot), "all")
        heard = robot.heard_data("/operation")
        assert len(heard) == len(set(heard)), "no press arrives twice"
        assert not presser.words("refused") & set(heard), "what was refused was not sent later"
        assert set(outcomes) <= {"published", "refused", "unknown"}
        router.start()
        until(panel.ready, "it is there")
