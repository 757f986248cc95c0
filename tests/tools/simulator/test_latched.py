"""The latched messages of simulated robots on Zenoh are numbered where those of real ones are."""

import pytest
import zenoh

from app.ros.dialects.dialect import DialectName, caches, numbered_publisher
from app.ros.messages import Interfaces
from app.ros.zenoh.config import config_to
from app.tools.simulator.zenoh import Way, Wire
from tests.support.parts import free_port, until


@pytest.mark.parametrize(("dialect", "numbered"), [("bridge", False), ("rmw_zenoh", True)])
def test_last_number_is_said_on_rmw_zenoh(dialect: DialectName, numbered: bool) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    listening = config_to(endpoint)
    listening.insert_json5("connect/endpoints", "[]")
    listening.insert_json5("listen/endpoints", f'["{endpoint}"]')
    listening.insert_json5("timestamping/enabled", "true")
    seen: list[str] = []
    said: list[int] = []
    with zenoh.open(listening) as robot, zenoh.open(config_to(endpoint)) as panel:
        publish = Wire(robot, Way(dialect, distro="jazzy"), Interfaces("jazzy")).publisher(
            "ready", "std_msgs/msg/Bool", latched=True
        )

        def hear(sample: zenoh.Sample) -> None:
            if len(number := sample.payload.to_bytes()) == 4:
                said.append(int.from_bytes(number, "little"))

        listeners = (
            panel.liveliness().declare_subscriber(
                caches("**"), lambda sample: seen.append(str(sample.key_expr)), history=True
            ),
            panel.declare_subscriber(caches("**"), hear),
        )
        until(lambda: seen, "its cache is there")
        publish(b"\x00\x01\x00\x00\x01")
        publish(b"\x00\x01\x00\x00\x00")
        assert bool(numbered_publisher(seen[0])) == numbered
        if numbered:
            until(lambda: 1 in said, "the number of the last message")
        del listeners
