"""A recording of what a real node said around real presses, read by MCAP's reader and by ROS 2."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader

from tests.ros.messages.test_cdr_on_ros import RosCodec
from tests.support.holds import PANEL, PATIENT
from tests.support.parts import REFERENCE, Bridge, RosNode, Server, live, until
from tests.support.servers import demo_server
from tests.web.test_hold_socket import held, opened

pytestmark = pytest.mark.promise("history")

LOG = "rcl_interfaces/msg/Log"
RECORD = "[record]\nbefore_s = 10\nafter_s = {after_s}\n"
READOUT = f"""
[[page.widget]]
id = "robot_log"
kind = "readout"
label = "Log"
topic = "/robot_log"
type = "{LOG}"
field = "msg"
"""
Record = tuple[Schema, Channel, Message]


@pytest.fixture
def codec() -> Iterator[RosCodec]:
    mine = RosCodec()
    yield mine
    mine.end()


def record(after_s: float) -> str:
    """That a press is recorded until so long after it: a busy machine does what belongs together
    within that time."""
    return RECORD.format(after_s=after_s)


def recording(bridge: Bridge, folder: Path, after_s: float = 6) -> Server:
    """A kiosk with the shipped panel and a readout, that records."""
    shipped = REFERENCE.read_text()
    panel = folder / "panel.toml"
    panel.write_text(shipped.replace("[[interlock]]", f"{record(after_s)}[[interlock]]", 1) + READOUT)
    return live(bridge.endpoint, folder, KIOSK_PANEL=str(panel), KIOSK_DATA=str(folder / "data"))


def files(folder: Path) -> list[Path]:
    return sorted((folder / "data/recordings").glob("*.mcap"))


def records(path: Path) -> dict[str, list[Record]]:
    by_topic: dict[str, list[Record]] = {}
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            by_topic.setdefault(channel.topic, []).append((schema, channel, message))
    return by_topic


def shows(kiosk: Server, widget: str, text: str) -> bool:
    return text in str(kiosk.widget(widget)["text"])


def says(node: RosNode, kiosk: Server, text: str) -> None:
    """The robot says it until the kiosk shows it."""
    fields: Mapping[str, Any] = {"stamp": {"sec": 7, "nanosec": 8}, "level": 20, "msg": text}
    until(
        lambda: (node.publish("/robot_log", fields), shows(kiosk, "robot_log", text))[1],
        f"{text} is shown",
        every_s=0.05,
    )


def test_recording_around_a_press_is_read_by_ros_2(
    own_bridge: Bridge,
    own_node: RosNode,
    tmp_path: Path,
    servers: Callable[[Server], Server],
    codec: RosCodec,
) -> None:
    kiosk = servers(recording(own_bridge, tmp_path))
    until(kiosk.ready, "ready")
    own_node.advertise("/robot_log", LOG)
    says(own_node, kiosk, "before")
    pressed = kiosk.press("operation", "hello", id="p1").json()
    refused = kiosk.press("operation1", "no", id="p2").json()
    assert refused["outcome"] == "refused"
    says(own_node, kiosk, "after")
    until(lambda: files(tmp_path), "the recording is finished")
    (path,) = files(tmp_path)
    assert path.name.endswith("Z-operation.mcap")
    by_topic = records(path)
    assert set(by_topic) == {"/robot_log", "/web_ui/presses"}
    decoded = []
    for schema, channel, message in by_topic["/robot_log"]:
        assert (schema.name, schema.encoding, channel.message_encoding) == (LOG, "ros2msg", "cdr")
        assert b"\nMSG: builtin_interfaces/Time\nint32 sec\n" in schema.data
        assert 0 <= message.log_time - message.publish_time < 60e9  # received after the bridge had it
        decoded.append(codec.decode(schema.name, message.data))
    assert decoded[0]["stamp"] == {"sec": 7, "nanosec": 8}
    assert [line["msg"] for line in decoded] == sorted((line["msg"] for line in decoded), reverse=True)
    assert {line["msg"] for line in decoded} == {"before", "after"}
    assert presses(by_topic) == [
        ("p1", None, None),
        ("p1", "published" if pressed["outcome"] == "published" else "unknown", pressed["reason"]),
        ("p2", None, None),
        ("p2", "refused", refused["reason"]),
    ]
    pressed_at = by_topic["/web_ui/presses"][0][2].log_time
    times = [message.log_time for _, _, message in by_topic["/robot_log"]]
    assert min(times) >= pressed_at - 10.1e9
    assert min(times) < pressed_at < max(times)


def presses(by_topic: Mapping[str, list[Record]]) -> list[tuple[str, str | None, str | None]]:
    recorded = []
    for schema, channel, message in by_topic["/web_ui/presses"]:
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        press = json.loads(message.data)
        assert set(press) == set(json.loads(schema.data)["properties"])
        assert press["who"] == "a program (127.0.0.1)"
        recorded.append((press["id"], press["outcome"], press["reason"]))
    return recorded


def test_a_hold_is_recorded_from_its_begin_to_its_end(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    data = str(tmp_path / "data")
    kiosk = servers(demo_server(tmp_path, PANEL + record(4), app=PATIENT, KIOSK_DATA=data))
    with opened(kiosk) as socket:
        assert socket.begin(inputs={"speed": 99})["state"] == "refused"
    with held(kiosk) as socket:
        assert socket.beat()["state"] == "held"
        socket.say(do="end", why="released", lease=socket.lease)
        ended = socket.hear()
    until(lambda: files(tmp_path), "the recording is finished")
    (path,) = files(tmp_path)
    assert path.name.endswith("Z-jog.mcap")
    recorded = presses(records(path))
    assert [press[1] for press in recorded[:2]] == [None, "refused"]
    assert recorded[-2:] == [
        (socket.lease, None, None),
        (socket.lease, ended["outcome"], ended["reason"]),
    ]


def test_next_server_finishes_the_recording_of_a_killed_server(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(recording(own_bridge, tmp_path, after_s=60))
    until(kiosk.ready, "ready")
    own_node.advertise("/robot_log", LOG)
    says(own_node, kiosk, "before")
    kiosk.press("operation", "hello", id="p1")
    until(lambda: list((tmp_path / "data/recordings").iterdir()), "it is being recorded")
    (unfinished,) = (tmp_path / "data/recordings").iterdir()
    until(lambda: presses_in(unfinished) == 2, "the press and its outcome are written")
    kiosk.process.kill()
    assert files(tmp_path) == []
    servers(recording(own_bridge, tmp_path))
    until(lambda: files(tmp_path), "it is recovered")
    (path,) = files(tmp_path)
    assert path.name.endswith("Z-operation.recovered.mcap")
    assert [press[0] for press in presses(records(path))] == ["p1"] * 2


def presses_in(unfinished: Path) -> int:
    """How many messages of presses can be read of a recording that is still being written."""
    topics: dict[int, str] = {}
    count = 0
    with unfinished.open("rb") as stream, suppress(Exception):
        for record in StreamReader(stream).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                count += topics[record.channel_id] == "/web_ui/presses"
    return count


def test_full_disk_is_reported_and_presses_work_without_recording(
    own_bridge: Bridge, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data/recordings").write_text("not a folder")
    kiosk = servers(recording(own_bridge, tmp_path))
    until(kiosk.ready, "ready")
    assert kiosk.press("operation", "hello").status_code == 200
    until(lambda: "Presses are not recorded" in kiosk.snapshot()["notice"]["fault"], "it is shown")
    assert kiosk.widget("operation")["enabled"]
    assert kiosk.press("operation", "again").status_code == 200
    assert kiosk.process.count("recording stopped, in ")
