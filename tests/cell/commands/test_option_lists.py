"""The options that a service lists: the texts of a list, or a text of each message of a list."""

import asyncio
from typing import Any, Final

import pytest

from app.cell.commands.services import OptionLists
from app.panel.checks.panel import find_faults
from app.panel.model import Panel
from app.ros.dialects.bridge_dialect import server_token
from tests.support.builders import BRIDGE, INTERFACES, FakeTransport, panel_of, robot_there

TYPE: Final = "rcl_interfaces/srv/DescribeParameters"
SOURCE: Final = {"service": "/programs", "type": TYPE, "field": "descriptors[].name"}
ANSWER: Final = {"descriptors": [{"name": "pick"}, {"name": "place"}]}


def panel_with(**source: Any) -> Panel:
    options = {**SOURCE, **source}
    return panel_of({"id": "p", "kind": "select", "label": "Program", "options_from": options})


class Listing(FakeTransport):
    """Answers each query with the programs."""

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]":
        answer: asyncio.Future[bytes | None] = asyncio.get_running_loop().create_future()
        answer.set_result(INTERFACES.encode(f"{TYPE}_Response", ANSWER))
        return answer


def test_a_text_of_each_message_of_a_list_is_an_option() -> None:
    async def scene() -> list[tuple[str, ...]]:
        panel, listed = panel_with(), asyncio.Event()
        robot = robot_there(panel)
        robot.graph.apply_token(server_token(BRIDGE, "SS", "programs", TYPE), True)
        lists = OptionLists(panel, INTERFACES, robot, Listing(), listed.set)
        lists.on_graph_change()
        await asyncio.wait_for(listed.wait(), 10)
        await lists.stop()
        return [known.texts for known in robot.option_lists.values()]

    assert asyncio.run(scene()) == [("pick", "place")]


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ({}, ""),
        ({"field": "descriptors[].range"}, "there is no"),
        ({"field": "descriptors[].type"}, "options are texts, like string"),
        ({"field": "names[].name"}, "there is no"),
        ({"field": "descriptors"}, "options are a list of texts"),
        (
            {
                "service": None,
                "topic": "/list",
                "type": "diagnostic_msgs/msg/DiagnosticArray",
                "field": "status[].name",
            },
            "read of a service's answer only",
        ),
    ],
)
def test_a_field_that_lists_no_texts_is_a_fault(source: dict[str, Any], words: str) -> None:
    faults = [fault.message for fault in find_faults(panel_with(**source), INTERFACES)]
    assert bool(faults) == bool(words), faults
    assert all(words in fault for fault in faults), faults
