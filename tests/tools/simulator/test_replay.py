"""Recordings are replayed as they are: MCAP files, rosbag2's SQLite files and folders."""

import json
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any, Final

import pytest
import zenoh
import zstandard
from mcap.writer import Writer

from app.panel import load_panel
from app.ros.messages.names import Qos
from app.system.errors import RecordingError
from app.tools.simulator.bag import PAUSE_S, Recording, ReplayedRobot, missing
from app.tools.simulator.known_types import Moment
from app.tools.simulator.zenoh import ANY_PORT, serve
from tests.support.builders import BOOL, INTERFACES, TEXT
from tests.support.parts import ROOT, Process, Server, free_port, until, zenoh_file

pytestmark = pytest.mark.promise("demo")

START_NS: Final = 1_700_000_000 * 10**9
JOINTS: Final = "sensor_msgs/msg/JointState"
QOS: Final = (
    "- history: 1\n  depth: 1\n  reliability: {reliability}\n  durability: {durability}\n"
    "  deadline: {{sec: 0, nsec: 0}}\n  lifespan: {{sec: 0, nsec: 0}}\n  liveliness: 1\n"
    "  liveliness_lease_duration: {{sec: 0, nsec: 0}}\n  avoid_ros_namespace_conventions: false\n"
)
LATCHED: Final = QOS.format(reliability=1, durability=1)
SENSOR: Final = QOS.format(reliability=2, durability=2)
# Topic → type, offered QoS.
TOPICS: Final[Mapping[str, tuple[str, str]]] = {
    "/operation_enabled": (BOOL, LATCHED),
    "/last_heard": (TEXT, ""),
    "/joint_states": (JOINTS, SENSOR),
}
JOINT_PAYLOAD: Final = INTERFACES.encode(JOINTS, {"name": ["a"], "position": [0.25]})
# (seconds, topic, payload)
MESSAGES: Final[tuple[tuple[float, str, bytes], ...]] = (
    (0.0, "/operation_enabled", INTERFACES.encode(BOOL, {"data": True})),
    (0.1, "/last_heard", INTERFACES.encode(TEXT, {"data": "first"})),
    (0.2, "/joint_states", JOINT_PAYLOAD),
    (0.6, "/last_heard", INTERFACES.encode(TEXT, {"data": "second"})),
)


def mcap_file(folder: Path, *, also_json: bool = False, relative: bool = False) -> Path:
    """As rosbag2 and this panel write it, or with names without the first slash."""
    path = folder / "cell.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        channels = {}
        for topic, (name, qos) in TOPICS.items():
            schema = writer.register_schema(name, "ros2msg", INTERFACES.definition(name).encode())
            about = {"offered_qos_profiles": qos}
            recorded = topic.removeprefix("/") if relative else topic
            channels[topic] = writer.register_channel(recorded, "cdr", schema, about)
        for at, topic, payload in MESSAGES:
            now = START_NS + int(at * 1e9)
            writer.add_message(channels[topic], now, payload, now)
        if also_json:
            schema = writer.register_schema("web_ui/Press", "jsonschema", b"{}")
            presses = writer.register_channel("/web_ui/presses", "json", schema)
            writer.add_message(presses, START_NS, json.dumps({"id": "1"}).encode(), START_NS)
        writer.finish()
    return path


def sqlite_file(folder: Path, pack: Callable[[bytes], bytes] = bytes) -> Path:
    """A .db3 file as rosbag2 of ROS 2 Humble writes it; `pack` is what it does to each message."""
    path = folder / "cell_0.db3"
    with closing(sqlite3.connect(path)) as base:
        base.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
            " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)"
        )
        base.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
            " timestamp INTEGER NOT NULL, data BLOB NOT NULL)"
        )
        ids = {topic: number for number, topic in enumerate(TOPICS, 1)}
        for topic, (name, qos) in TOPICS.items():
            base.execute("INSERT INTO topics VALUES(?, ?, ?, 'cdr', ?)", (ids[topic], topic, name, qos))
        for at, topic, payload in MESSAGES:
            row = (ids[topic], START_NS + int(at * 1e9), pack(payload))
            base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", row)
        base.commit()
    return path


def folder_of_rosbag2(
    folder: Path, *, qos: str | None = None, mode: str = "", more: int = 0, mcap: bool = False
) -> Path:
    """A folder whose metadata.yaml names its file: with another QoS than the file (`qos`), with `more`
    messages than the file, or with a `mode` of compression."""
    bag = folder / "bag"
    bag.mkdir()
    pack = zstandard.ZstdCompressor().compress if mode == "MESSAGE" else bytes
    name = (mcap_file(bag) if mcap else sqlite_file(bag, pack)).name
    counts = {topic: sum(t == topic for _, t, _ in MESSAGES) for topic in TOPICS}
    topics = [
        {
            "topic_metadata": {
                "name": topic,
                "type": kind,
                "serialization_format": "cdr",
                "offered_qos_profiles": offered if qos is None else qos,
            },
            "message_count": counts[topic],
        }
        for topic, (kind, offered) in TOPICS.items()
    ]
    about = {
        "version": 5,
        "storage_identifier": "mcap" if mcap else "sqlite3",
        "duration": {"nanoseconds": int(MESSAGES[-1][0] * 1e9)},
        "starting_time": {"nanoseconds_since_epoch": START_NS},
        "message_count": len(MESSAGES) + more,
        "topics_with_message_count": topics,
        "compression_format": "zstd" if mode else "",
        "compression_mode": mode,
        "relative_file_paths": [name],
        "files": [],
    }
    # JSON is YAML.
    (bag / "metadata.yaml").write_text(json.dumps({"rosbag2_bagfile_information": about}))
    return bag


@pytest.fixture
def opened() -> Iterator[Callable[[Path], Recording]]:
    """Recordings, closed at the end."""
    with ExitStack() as stack:
        yield lambda path: stack.enter_context(closing(Recording(path)))


Opened = Callable[[Path], Recording]
FORMS: Final = pytest.mark.parametrize("made", [mcap_file, sqlite_file, folder_of_rosbag2])
Generator = Callable[[Path], Path]


def stepped(robot: ReplayedRobot, times: Iterable[float]) -> list[tuple[float, str, bytes]]:
    return [(t, *said) for t in times for said in robot.step(Moment(100 + t, START_NS))]


@FORMS
def test_a_recording_has_its_topics_types_and_qos(
    made: Generator, tmp_path: Path, opened: Opened
) -> None:
    recording = opened(made(tmp_path))
    topics = recording.topics
    assert {topic: recorded.type for topic, recorded in topics.items()} == {
        topic: name for topic, (name, _) in TOPICS.items()
    }
    assert topics["/operation_enabled"].qos == Qos(True, True, 1)
    assert topics["/joint_states"].qos == Qos(False, False, 1)
    assert topics["/last_heard"].qos == Qos()
    assert recording.duration_s == pytest.approx(0.6)
    assert recording.notes == []


@FORMS
def test_each_message_comes_in_its_time_as_it_was_recorded(
    made: Generator, tmp_path: Path, opened: Opened
) -> None:
    robot = ReplayedRobot(opened(made(tmp_path)))
    times = [0, 0.1, 0.2, 0.3, 0.5, 0.7]
    assert stepped(robot, times) == [
        (min(t for t in times if t >= at), topic, payload) for at, topic, payload in MESSAGES
    ]


def test_names_without_the_first_slash_are_those_of_ros_topics(tmp_path: Path, opened: Opened) -> None:
    recording = opened(mcap_file(tmp_path, relative=True))
    assert set(recording.topics) == set(TOPICS)
    assert [message.topic for message in recording.messages()] == [topic for _, topic, _ in MESSAGES]


@pytest.mark.parametrize("mcap", [False, True])
@pytest.mark.parametrize("qos", ["", LATCHED + SENSOR])
def test_a_folder_whose_metadata_has_other_qos_than_its_file_is_replayed_whole(
    tmp_path: Path, opened: Opened, qos: str, mcap: bool
) -> None:
    recording = opened(folder_of_rosbag2(tmp_path, qos=qos, mcap=mcap))
    assert [message.payload for message in recording.messages()] == [
        payload for *_, payload in MESSAGES
    ]
    assert recording.topics["/joint_states"].qos == (Qos(True, True, 1) if qos else Qos())


def test_messages_that_are_compressed_are_replayed_as_cdr(tmp_path: Path, opened: Opened) -> None:
    """From the folder, whose metadata.yaml says so, and from its file alone, which does not."""
    folder = folder_of_rosbag2(tmp_path, mode="MESSAGE")
    for path in (folder, folder / "cell_0.db3"):
        assert [message.payload for message in opened(path).messages()] == [
            payload for *_, payload in MESSAGES
        ]


@pytest.mark.parametrize(
    ("pack", "words"),
    [
        (lambda payload: b"\x04\x22\x4d\x18" + payload, "is neither CDR nor compressed by zstd"),
        (lambda payload: zstandard.ZstdCompressor().compress(payload)[:-2], "is cut off"),
    ],
    ids=["lz4", "cut"],
)
def test_a_message_that_is_no_cdr_is_not_replayed(
    tmp_path: Path, opened: Opened, pack: Callable[[bytes], bytes], words: str
) -> None:
    recording = opened(sqlite_file(tmp_path, pack))
    with pytest.raises(RecordingError, match=words) as raised:
        list(recording.messages())
    assert str(raised.value).endswith("saves the messages that are whole")


def test_messages_that_a_folder_names_and_its_files_lack_are_noted(
    tmp_path: Path, opened: Opened
) -> None:
    (note,) = opened(folder_of_rosbag2(tmp_path, more=3)).notes
    assert note.endswith("its files have 4 messages, its metadata.yaml names 7")


@pytest.mark.parametrize("kept", [1, 8, 100, 200, -1, -9, -50])
@pytest.mark.parametrize("in_folder", [False, True])
def test_truncated_recording_is_named_with_the_remedy(
    tmp_path: Path, kept: int, in_folder: bool
) -> None:
    path = folder_of_rosbag2(tmp_path, mcap=True) if in_folder else mcap_file(tmp_path)
    file = path / "cell.mcap" if in_folder else path
    file.write_bytes(file.read_bytes()[:kept])
    with pytest.raises(RecordingError) as raised:
        Recording(path)
    helps = f"`mcap recover {file} -o recovered.mcap` saves the messages that are whole"
    problem = (
        "can't be read: it is not an MCAP file" if kept == 1 else "was not finished, or is cut off"
    )
    assert str(raised.value) in (f"{file} {problem}", f"{file} {problem}; {helps}")


def test_a_file_of_messages_that_are_not_there_ends_with_an_error(
    tmp_path: Path, opened: Opened, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = opened(sqlite_file(tmp_path))
    monkeypatch.setattr(recording._file, "messages", lambda _: iter(()))
    with pytest.raises(RecordingError, match="it has 0 of 4 messages"):
        list(recording.messages())


def test_the_rate_is_how_many_times_as_fast(tmp_path: Path, opened: Opened) -> None:
    fast = ReplayedRobot(opened(mcap_file(tmp_path)), rate=2)
    assert [t for t, *_ in stepped(fast, [0, 0.05, 0.1, 0.2, 0.3])] == [0, 0.05, 0.1, 0.3]


def test_replay_ends_or_repeats_after_a_pause(tmp_path: Path, opened: Opened) -> None:
    path, ended = mcap_file(tmp_path), []
    once = ReplayedRobot(opened(path), ended=lambda: ended.append("once"))
    assert len(stepped(once, [0, 1, 1 + PAUSE_S])) == len(MESSAGES)
    assert ended
    loop = ReplayedRobot(opened(path), loop=True, ended=lambda: ended.append("loop"))
    said = stepped(loop, [0, 0.6, 0.6 + PAUSE_S, 1.3 + PAUSE_S, 1.4 + PAUSE_S])
    assert len(said) == 2 * len(MESSAGES)
    assert "loop" not in ended


def test_recorded_topic_that_is_not_of_ros_is_left_out_and_named(
    tmp_path: Path, opened: Opened
) -> None:
    recording = opened(mcap_file(tmp_path, also_json=True))
    assert set(recording.topics) == set(TOPICS)
    assert len(list(recording.messages())) == len(MESSAGES)
    (note,) = recording.notes
    assert note.startswith("/web_ui/presses")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("gone.mcap", None, "does not exist: it must be an .mcap or a .db3 file, or a folder"),
        ("cell.bag", b"#ROSBAG V2.0\n", "is not a recording: it must be"),
        ("cell_0.db3.zstd", b"", "is a compressed file of a bag: play its folder, or unpack it"),
        ("cell.mcap", b"no mcap at all", "can't be read"),
        ("cell.db3", b"no database at all", "can't be read"),
        ("empty.mcap", b"", "can't be read"),
    ],
)
def test_recording_that_cannot_be_replayed_is_named(
    tmp_path: Path, name: str, content: bytes | None, words: str
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RecordingError) as raised:
        Recording(path)
    assert f"{path} {words}" in str(raised.value)


def test_a_folder_without_metadata_and_a_file_without_messages_are_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"has no metadata\.yaml"):
        Recording(tmp_path)
    path = tmp_path / "empty.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        writer.finish()
    with pytest.raises(RecordingError, match=r"has no message of a ROS 2 topic in CDR"):
        Recording(path)


def test_topics_missing_in_a_recording_are_named(tmp_path: Path, opened: Opened) -> None:
    panel = load_panel(ROOT / "docs/examples/palletizer.toml")
    lacks = list(missing(panel, opened(mcap_file(tmp_path)).topics))
    assert "the recording has no /boxes (std_msgs/msg/UInt32), which the panel listens to" in lacks
    assert lacks[-1].startswith(
        "a recording does not answer: no node receives what the panel publishes"
    )


def test_a_recording_that_is_cut_off_ends_with_status_2(tmp_path: Path) -> None:
    path = mcap_file(tmp_path)
    path.write_bytes(path.read_bytes()[:-60])
    command = [sys.executable, "-m", "app.simulator", "tcp/127.0.0.1:0", "--bag", str(path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, "mcap recover" in done.stderr) == (2, True), done.stderr


def replaying(path: Path, endpoint: str, *options: str) -> Process:
    command = [sys.executable, "-m", "app.simulator", endpoint, "--bag", str(path), *options]
    simulator = Process(command, {}, cwd=ROOT)
    until(lambda: "listening" in simulator.text, "it listens")
    return simulator


@pytest.mark.long("table")
@FORMS
def test_a_zenoh_session_receives_the_bytes(made: Generator, tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config = zenoh.Config()
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    simulator = replaying(made(tmp_path), endpoint, "--loop", "--rate", "2")
    try:
        with zenoh.open(config) as session:
            received: list[tuple[str, bytes]] = []
            session.declare_subscriber(
                "**",
                lambda sample: received.append((str(sample.key_expr), sample.payload.to_bytes())),
            )
            wanted = {(topic[1:], payload) for _, topic, payload in MESSAGES}
            until(lambda: wanted <= set(received), "every message is received")
    finally:
        assert simulator.end() == 0, simulator.text


@pytest.mark.long("detail")
def test_panel_shows_the_recorded_values(tmp_path: Path, servers: Callable[[Server], Server]) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    simulator = replaying(mcap_file(tmp_path), endpoint, "--loop")
    try:
        environment: dict[str, Any] = {"KIOSK_ZENOH": str(zenoh_file(tmp_path, endpoint))}
        kiosk = servers(Server(ROOT, KIOSK_MODE="live", **environment))
        until(lambda: kiosk.widget("last_heard")["text"] == "first", "it shows the first")
        until(lambda: kiosk.widget("last_heard")["text"] == "second", "it shows the second")
        banner = "SIMULATED ROBOT"
        until(lambda: kiosk.snapshot()["notice"]["banner"] == banner, "the banner says so")
    finally:
        assert simulator.end() == 0, simulator.text


def test_replay_command_ends_with_the_recording(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    simulator = replaying(sqlite_file(tmp_path), endpoint)
    try:
        assert simulator.wait(30) == 0
        assert "3 topic(s), 0.6 s" in simulator.text
    finally:
        simulator.end()


@pytest.mark.long("table")
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--bag", "/nowhere/cell.mcap"], "demo robot: /nowhere/cell.mcap does not exist: it must be"),
        (["--loop"], "--loop and --rate are of a recording: give --bag too"),
        (["--bag", "x", "--rate", "0"], '"0" is not a rate: more than 0'),
        (["nowhere.toml"], "nowhere.toml can't be used"),
        (["a.toml", "tcp/127.0.0.1:0", "/r1", "more"], '"more" is one argument too many'),
        (["tcp/127.0.0.1:0", "r1"], '"r1" is not a ROS 2 namespace'),
    ],
)
def test_a_mistake_on_the_command_line_is_one_sentence(words: list[str], sentence: str) -> None:
    command = [sys.executable, "-m", "app.simulator", *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, sentence in done.stderr) == (2, True), done.stderr
    assert "Traceback" not in done.stderr


class Failing(ReplayedRobot):
    """A recording that is damaged behind its first message."""

    def step(self, moment: Moment) -> Iterator[tuple[str, bytes]]:
        raise RecordingError("cell.mcap is damaged: no chunk")


def test_a_recording_that_is_damaged_later_ends_the_program(tmp_path: Path, opened: Opened) -> None:
    robot = Failing(opened(mcap_file(tmp_path)))
    with pytest.raises(RecordingError, match="is damaged"):
        serve(ANY_PORT, {"": robot}, INTERFACES, threading.Event(), lambda: None)


def test_damage_is_named(tmp_path: Path, opened: Opened) -> None:
    path = mcap_file(tmp_path)
    data = bytearray(path.read_bytes())
    data[150:170] = bytes(20)
    path.write_bytes(data)
    recording = opened(path)
    with pytest.raises(RecordingError, match=r"cell\.mcap is damaged: "):
        list(recording.messages())
