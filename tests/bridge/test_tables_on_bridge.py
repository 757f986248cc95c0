"""Many entries of a real node, over the real bridge: the worst is in the first row."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server

ARRAY: Final = "diagnostic_msgs/msg/DiagnosticArray"
PANEL: Final = """
title = "Cell"
mode = "live"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "parts"
kind = "table"
label = "Parts"
topic = "/diagnostics"
type = "diagnostic_msgs/msg/DiagnosticArray"
field = "status"
rows_shown = 6
sort = { first = "largest", by = "level" }
KEY
[[page.widget.column]]
label = "Level"
field = "level"
states = [
  { value = "OK", text = "OK", shape = "circle" },
  { value = "ERROR", text = "Error", shape = "cross", colour = "red" },
]
[[page.widget.column]]
label = "Part"
field = "name"
"""


def statuses(count: int, bad: int) -> list[dict[str, Any]]:
    return [{"level": 2 * (number == bad), "name": f"part {number}"} for number in range(count)]


@pytest.mark.parametrize("key", ["", 'key = "name"'])
@pytest.mark.parametrize(("count", "bad"), [(120, 100), (300, 250)])
def test_an_error_among_many_entries_is_in_the_first_row(
    bridge: Bridge, node: RosNode, count: int, bad: int, key: str, tmp_path: Path
) -> None:
    node.advertise("/diagnostics", ARRAY)
    node.every("/diagnostics", {"status": statuses(count, bad)}, 0.2)
    with live_server(bridge, tmp_path, PANEL.replace("KEY", key)) as kiosk:
        until(rows_of(kiosk), "the entries are read")
        shown = kiosk.widget("parts")
        first, *others = [[cell["text"] for cell in row["cells"]] for row in shown["table_rows"]]
        assert first == ["Error", f"part {bad}"]
        assert {level for level, _ in others} == {"OK"}
        assert (len(others), shown["said"]) == (5, f"and {count - 6} more")
    node.withdraw("/diagnostics")


def rows_of(kiosk: Server) -> Callable[[], Any]:
    return lambda: kiosk.widget("parts")["table_rows"]
