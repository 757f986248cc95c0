"""Recordings around presses: what is in a file, how long, and what happens on a bad disk."""

import asyncio
import json
import os
import threading
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.records import Message
from rosbags.typesys import get_types_from_msg

from app.cell.commands.press import fingerprint
from app.cell.commands.receipts import PressRecorder, Receipt
from app.cell.history import recording
from app.cell.history.recording import (
    COPY_BELOW_BYTES,
    OVERHEAD_BYTES,
    PRESS_TOPIC,
    STOP_AFTER_S,
    STOPS,
    UNFINISHED,
    Channel,
    McapFile,
    Recorder,
    RecordingFolder,
    Recordings,
    RingBuffer,
    recording_name,
    to_buffered,
)
from app.cell.robot.state import RobotState, Sample
from app.cell.session.turn import StopReceipts
from app.panel import load_panel
from app.panel.rules import RecordRules
from app.ros.messages import Structure
from app.system.errors import PanelError
from tests.support.builders import DIALECT, HEARD, INTERFACES, KIOSK, TEXT, TRAITS, panel_of
from tests.support.parts import ROOT
from tests.support.waiting import pass_time, when

pytestmark = pytest.mark.promise("history")

CHANNEL = Channel("/heard", TEXT, "string data\n")
MB = 1_000_000
PAYLOAD = INTERFACES.encode(TEXT, {"data": "said"})


def sample(at: float, payload: bytes = PAYLOAD, sent: float | None = None) -> Sample:
    return Sample(payload, 1, at, 1_700_000_000 + at, "b1", sent=sent)


def texts(folder: Path) -> list[str]:
    return [INTERFACES.decode(TEXT, m.data).data for m in messages(folder, "/heard")]


def messages(folder: Path, topic: str) -> list[Message]:
    (path,) = folder.glob("*.mcap")
    with path.open("rb") as stream:
        return [message for _, _, message in make_reader(stream).iter_messages([topic])]


# The ring.


def test_ring_keeps_samples_within_its_age() -> None:
    ring = RingBuffer(10.0, MB)
    for at in (0.0, 5.0, 9.0, 12.0):
        ring.add(to_buffered("heard", sample(at)))
    assert [buffered.sample.at for buffered in ring.recent(12.0)] == [5.0, 9.0, 12.0]
    assert [buffered.sample.at for buffered in ring.recent(20.0)] == [12.0]
    assert list(ring.recent(99.0)) == []
    assert ring.size == 0


def test_what_is_older_than_asked_for_stays_in_the_ring() -> None:
    ring = RingBuffer(60.0, MB)
    for at in (0.0, 30.0, 55.0):
        ring.add(to_buffered("heard", sample(at)))
    assert [buffered.sample.at for buffered in ring.recent(60.0, 10.0)] == [55.0]
    assert [buffered.sample.at for buffered in ring.recent(60.0)] == [0.0, 30.0, 55.0]


def test_a_ring_holds_no_more_bytes_than_it_may_in_a_flood() -> None:
    ring = RingBuffer(10.0, 64 * MB)
    for number in range(20_000):  # ten seconds of 10 MB at 2 kHz
        ring.add(to_buffered("heard", sample(number / 2000, FLOOD)))
        assert ring.size <= 64 * MB
    assert len(list(ring.recent(10.0))) == 6


FLOOD = bytes(10 * MB)


def test_sample_larger_than_the_ring_displaces_no_other() -> None:
    ring = RingBuffer(10.0, MB)
    ring.add(to_buffered("heard", sample(1.0)))
    ring.add(to_buffered("heard", sample(2.0, FLOOD)))
    assert [buffered.sample.at for buffered in ring.recent(2.0)] == [1.0]


def test_small_samples_count_with_their_overhead() -> None:
    ring = RingBuffer(10.0, MB)
    for _ in range(10_000):
        ring.add(to_buffered("heard", sample(1.0, b"1234")))
    assert len(list(ring.recent(1.0))) == MB // (4 + OVERHEAD_BYTES)


class Shared:
    """A slice of a larger buffer, which stays as long as this does."""

    def __init__(self, size: int) -> None:
        self._size = size

    def __bytes__(self) -> bytes:
        return bytes(self._size)

    def __len__(self) -> int:
        return self._size


@pytest.mark.parametrize(("size", "kind"), [(COPY_BELOW_BYTES - 1, bytes), (COPY_BELOW_BYTES, Shared)])
def test_a_small_payload_keeps_no_large_buffer(size: int, kind: type) -> None:
    buffered = to_buffered("heard", Sample(Shared(size), 1, 0.0, 0.0, None))
    assert type(buffered.sample.payload) is kind
    assert buffered.size == size + OVERHEAD_BYTES


# Definitions as text.


def test_every_definition_reads_back_as_it_was() -> None:
    for name, structure in INTERFACES.structures.items():
        if "/msg/" in name and not wide(structure):
            read = get_types_from_msg(INTERFACES.definition(name), name)
            assert [field for field, _ in read[name][1]] == [member.name for member in structure.fields]
            constants = {each: value for each, _, value in read[name][0]}
            assert constants == pytest.approx(dict(structure.constants))
            assert {inner for _, inner in structure.nested_fields()} <= read.keys()


def wide(structure: Structure) -> bool:
    """rosbags reads no wstring."""
    return any("wstring" in str(field.type) for field in structure.fields)


def test_a_definition_is_written_as_ros2msg_asks_for() -> None:
    line = "=" * 80
    assert INTERFACES.definition("geometry_msgs/msg/PointStamped") == (
        "std_msgs/Header header\ngeometry_msgs/Point point\n"
        f"{line}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        f"{line}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
        f"{line}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
    )
    assert "uint8 POWER_SUPPLY_STATUS_FULL=4\n" in INTERFACES.definition("sensor_msgs/msg/BatteryState")


# Files and their folder.


def test_file_names_sort_by_time_and_name_robot_and_widget() -> None:
    assert recording_name(1_700_000_000.5, "r1", "drive") == "20231114T221320.500Z-r1-drive"
    assert recording_name(1_700_000_000.5, "", "drive") == "20231114T221320.500Z-drive"


def test_recording_of_a_killed_process_is_finished_at_the_next_start(tmp_path: Path) -> None:
    left_by_a_killed_process(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["a" + UNFINISHED]
    RecordingFolder(tmp_path, 100 * MB).open()
    (path,) = tmp_path.iterdir()
    assert path.name == "a.recovered.mcap"
    assert texts(tmp_path) == ["said"]
    assert [json.loads(m.data)["id"] for m in messages(tmp_path, PRESS_TOPIC)] == ["p1"]


def left_by_a_killed_process(folder: Path) -> None:
    pid = os.fork()
    if pid == 0:
        file = McapFile(folder, "a", {"panel": "Cell"})
        file.add(CHANNEL, PAYLOAD, 1, 1)
        file.add_press({"id": "p1"}, 2)
        os._exit(0)
    os.waitpid(pid, 0)


def test_an_empty_half_is_removed(tmp_path: Path) -> None:
    (tmp_path / f"a{UNFINISHED}").write_bytes(b"")
    (tmp_path / f"b{UNFINISHED}").write_bytes(os.urandom(1000))
    RecordingFolder(tmp_path, 100 * MB).open()
    assert list(tmp_path.iterdir()) == []


def test_recording_that_another_process_writes_is_left_alone(tmp_path: Path) -> None:
    file = McapFile(tmp_path, "a", {})
    file.add(CHANNEL, PAYLOAD, 1, 1)
    RecordingFolder(tmp_path, 100 * MB).open()
    assert file.finish() == tmp_path / "a.mcap"
    assert texts(tmp_path) == ["said"]


def test_a_clock_that_was_set_back_does_not_make_the_newest_recording_the_oldest(
    tmp_path: Path,
) -> None:
    year = 365 * 86_400.0
    moments = [time.time() + year + number for number in range(3)] + [time.time()]
    files = [tmp_path / f"{recording_name(moment, '', 'drive')}.mcap" for moment in moments]
    for file in files:
        file.write_bytes(bytes(300))
    RecordingFolder(tmp_path, 700).make_room(0)
    assert [file for file in files if file.exists()] == files[2:]


def test_the_oldest_recordings_go_and_nothing_else(tmp_path: Path) -> None:
    for number in range(10):
        (tmp_path / f"2026-{number}.mcap").write_bytes(bytes(MB))
    (tmp_path / "notes.txt").write_bytes(bytes(20 * MB))
    RecordingFolder(tmp_path, 5 * MB).make_room(2 * MB)
    kept = sorted(path.name for path in tmp_path.iterdir())
    assert kept == ["2026-7.mcap", "2026-8.mcap", "2026-9.mcap", "notes.txt"]


def test_a_recording_that_someone_removes_at_the_same_time_counts_nothing(tmp_path: Path) -> None:
    (tmp_path / "2026-1.mcap").symlink_to(tmp_path / "removed")
    kept = tmp_path / "2026-2.mcap"
    kept.write_bytes(bytes(MB))
    RecordingFolder(tmp_path, MB).make_room(0)
    assert kept.exists()


# Around presses.


class Cell:
    """A recorder on real files, with the loop that it needs."""

    def __init__(self, folder: Path, **rules: Any) -> None:
        self.folder = folder
        self.rules = RecordRules(**{"before_s": 5.0, "after_s": 0.2, "max_mb": 16.0, **rules})
        self.panel = panel_of(HEARD)
        self.recordings = Recordings(folder, self.rules.max_mb, 1)
        robot = RobotState(self.panel, INTERFACES, DIALECT, TRAITS, KIOSK)
        self.recorder = Recorder(self.panel, self.rules, INTERFACES, robot, "", self.recordings)
        self.notified = 0
        self.recordings.add_listener(self._count)
        self.recordings.start()

    def _count(self) -> None:
        self.notified += 1

    def says(self, text: str, ago: float = 0.0) -> None:
        payload = INTERFACES.encode(TEXT, {"data": text})
        at = time.monotonic() - ago
        self.recorder.record_sample("heard", Sample(payload, 1, at, time.time() - ago, "b1", sent=1.5))

    def press(
        self,
        press_id: str = "p1",
        outcome: Any = "published",
        recorder: PressRecorder | None = None,
    ) -> None:
        recorder = recorder or self.recorder
        recorder.record_press(press_id, "free", "10.0.0.1", {"message": "hello"})
        at, inputs = "2026-01-01T00:00:00.000+00:00", {"message": "hello"}
        recorder.record_receipt(
            Receipt(press_id, "free", outcome, "Sent.", at, "", inputs, fingerprint(inputs))
        )

    async def finished(self, count: int = 1) -> None:
        await when(lambda: len(list(self.folder.glob("*.mcap"))) >= count)
        idle = threading.Event()  # the writer looks at the folder once more
        self.recordings.enqueue(0, idle.set)
        assert await asyncio.to_thread(idle.wait, 10)

    def end(self) -> None:
        self.recorder.stop()
        self.recordings.stop()


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., None]:
    """Runs what a test does with a cell, on a loop of its own."""

    def on_a_loop(test: Callable[[Cell], Coroutine[Any, Any, None]], **rules: Any) -> None:
        async def all_() -> None:
            cell = Cell(tmp_path / "recordings", **rules)
            try:
                await test(cell)
            finally:
                cell.end()

        asyncio.run(all_())

    return on_a_loop


def test_a_recording_goes_from_before_a_press_to_after_it(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        cell.says("too old", ago=6.0)
        cell.says("before", ago=4.0)
        cell.press()
        cell.says("after")
        await cell.finished()
        cell.says("too late")
        assert texts(cell.folder) == ["before", "after"]
        received = messages(cell.folder, "/heard")
        assert received[1].log_time - received[0].log_time == pytest.approx(4e9, rel=0.1)
        assert {message.publish_time for message in received} == {1_500_000_000}
        presses = [json.loads(m.data) for m in messages(cell.folder, PRESS_TOPIC)]
        assert [press["outcome"] for press in presses] == [None, "published"]
        assert presses[1] == {
            "id": "p1",
            "widget": "free",
            "who": "10.0.0.1",
            "values": {"message": "hello"},
            "outcome": "published",
            "reason": "Sent.",
            "at": "2026-01-01T00:00:00.000+00:00",
        }

    run(test)


def test_presses_during_a_recording_prolong_the_same_file(run: Callable[..., None]) -> None:
    after_s = 60.0

    async def test(cell: Cell) -> None:
        for number in range(8):  # each well within the window of the last, together longer than one
            cell.press(f"p{number}", "refused" if number % 2 else "published")
            await pass_time(after_s / 4)
        await pass_time(after_s)
        await cell.finished()
        presses = [json.loads(m.data)["id"] for m in messages(cell.folder, PRESS_TOPIC)]
        assert presses == [f"p{number}" for number in range(8) for _ in range(2)]

    run(test, after_s=after_s)


def test_a_recording_waits_for_the_receipt(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        cell.recorder.record_press("slow", "free", "10.0.0.1", {})
        await pass_time(0.5)  # longer than after_s
        assert list(cell.folder.glob("*.mcap")) == []
        cell.press("slow", "timed_out")
        await cell.finished()
        presses = [json.loads(m.data)["outcome"] for m in messages(cell.folder, PRESS_TOPIC)]
        assert presses[-1] == "timed_out"

    run(test)


def test_a_full_file_takes_no_more_samples_and_the_next_press_begins_another(
    run: Callable[..., None],
) -> None:
    async def test(cell: Cell) -> None:
        cell.press("p1")
        noise = os.urandom(MB // 2).hex()
        for _ in range(10):
            cell.says(noise)
        cell.press("p2")
        cell.says(noise)
        await cell.finished(2)
        first, second = sorted(cell.folder.glob("*.mcap"))
        assert MB // 2 < first.stat().st_size < 32 * MB / 4
        with first.open("rb") as stream:
            (about, left_out) = make_reader(stream).iter_metadata()
        assert about.metadata["panel"] == "Cell"
        assert int(left_out.metadata["samples"]) > 0
        with second.open("rb") as stream:  # what came before has room, and what comes after too
            assert len(list(make_reader(stream).iter_messages(["/heard"]))) == 4

    run(test, max_mb=32.0)


async def next_millisecond() -> None:
    began = time.time_ns() // 10**6
    await when(lambda: time.time_ns() // 10**6 > began)


def test_the_folder_stays_within_its_bound(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        for number in range(12):
            cell.says(os.urandom(MB).hex())
            cell.press(f"p{number}")
            cell.recorder.stop()
            await next_millisecond()  # a name is of its millisecond
        cell.recordings.stop()
        size = sum(path.stat().st_size for path in cell.folder.iterdir())
        assert 0 < size <= 16 * MB

    run(test, before_s=0.0)


def test_a_disk_that_takes_nothing_is_reported_and_a_press_tries_again(
    run: Callable[..., None], caplog: pytest.LogCaptureFixture
) -> None:
    async def test(cell: Cell) -> None:
        cell.press()
        await cell.finished()
        for path in cell.folder.iterdir():
            path.unlink()
        cell.folder.rmdir()
        cell.folder.write_text("in the way")
        cell.press()
        await when(lambda: cell.notified)
        assert "Presses are not recorded: " in str(cell.recordings.fault)
        assert "They are sent as usual." in str(cell.recordings.fault)
        cell.folder.unlink()
        cell.press("p3")
        cell.recorder.stop()
        await cell.finished()
        await when(lambda: cell.notified >= 2)
        assert (cell.recordings.fault, cell.notified) == ("", 2)

    run(test)
    assert "recording stopped, in " in caplog.text


def test_a_disk_that_stands_still_costs_no_memory_and_no_time(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        gate = os.pipe()

        def hang() -> None:
            os.read(gate[0], 1)

        cell.recordings.enqueue(0, hang)
        cell.press()
        flood = sample(time.monotonic(), FLOOD)
        began = time.monotonic()
        for _ in range(200):
            cell.recorder.record_sample("heard", flood)
        assert time.monotonic() - began < 5  # the disk would never let go
        assert cell.recordings._writer.waiting <= 128 * 1024 * 1024
        os.write(gate[1], b"1")
        cell.recorder.stop()
        await cell.finished()
        for end in gate:
            os.close(end)

    run(test, max_mb=10_000.0)


# The panel file.


def test_panel_file_selects_the_recorded_topics(tmp_path: Path) -> None:
    path = tmp_path / "panel.toml"
    shipped = (ROOT / "app/panel.toml").read_text()
    path.write_text(
        shipped.replace("[[interlock]]", '[record]\ntopics = ["/nowhere"]\n[[interlock]]', 1)
    )
    with pytest.raises(PanelError, match=r"record.topics\[0\], line \d+: /nowhere is no topic"):
        load_panel(path)
    path.write_text(shipped.replace("[[interlock]]", "[record]\nmax_mb = 1\n[[interlock]]", 1))
    with pytest.raises(PanelError, match=r"record.max_mb, line \d+: .*16"):
        load_panel(path)
    path.write_text(shipped.replace("[[interlock]]", "[record]\n[[interlock]]", 1))
    assert load_panel(path).record == RecordRules()
    assert load_panel(ROOT / "app/panel.toml").record is None


def test_maps_and_their_updates_are_recorded_only_where_they_are_named(tmp_path: Path) -> None:
    layers = [{"shows": "costmap", "topic": "/costmap"}, {"shows": "scan", "topic": "/scan"}]
    panel = panel_of({"id": "hall", "kind": "map", "label": "Hall", "layer": layers})
    robot = RobotState(panel, INTERFACES, DIALECT, TRAITS, KIOSK)

    async def recorded(rules: RecordRules) -> set[str]:
        recordings = Recordings(tmp_path, 16.0, 1)
        return {*Recorder(panel, rules, INTERFACES, robot, "", recordings).keys}

    usual = asyncio.run(recorded(RecordRules()))
    assert usual - {"operation_enabled"} == {"tf", "tf_static", "scan"}
    named = RecordRules(topics=("/map_updates",))
    assert asyncio.run(recorded(named)) == {"map_updates"}


# Around stops.


def said_in(path: Path) -> list[str]:
    with path.open("rb") as stream:
        read = make_reader(stream).iter_messages(["/heard"])
        return [INTERFACES.decode(TEXT, message.data).data for _, _, message in read]


def files_of(cell: Cell) -> list[Path]:
    return sorted(cell.folder.glob("*.mcap"))


def test_a_stop_begins_a_recording_of_the_half_minute_before_it(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        cell.says("too old", ago=40.0)
        cell.says("before", ago=25.0)
        cell.recorder.record_stop()
        cell.says("after")
        cell.recorder.record_stop()  # the state and an alarm of one stop
        await pass_time(STOP_AFTER_S)
        await cell.finished()
        (path,) = files_of(cell)
        assert path.name.endswith("Z-stop.mcap")
        assert said_in(path) == ["before", "after"]

    run(test)


def test_a_stop_soon_after_a_press_has_its_half_minute_too(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        cell.says("before", ago=25.0)
        cell.press()
        cell.recorder.record_stop()
        cell.says("after")
        cell.press("p2")  # extends the recording of the stop
        await pass_time(STOP_AFTER_S)
        await cell.finished(2)
        by_cause = {path.name.rpartition("-")[2]: said_in(path) for path in files_of(cell)}
        assert by_cause == {"free.mcap": [], "stop.mcap": ["before", "after"]}

    run(test)


def test_a_goal_that_is_aborted_is_a_stop(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        cell.says("before", ago=25.0)
        recorder = StopReceipts(cell.recorder, cell.recorder.record_stop)
        cell.press(outcome="aborted", recorder=recorder)
        await pass_time(STOP_AFTER_S)
        await cell.finished(2)
        stop = next(path for path in files_of(cell) if path.name.endswith("-stop.mcap"))
        assert said_in(stop) == ["before"]

    run(test)


def test_a_machine_that_stops_again_and_again_does_not_fill_the_folder(
    run: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording, "STOP_AFTER_S", 0.0)

    async def test(cell: Cell) -> None:
        for _ in range(20):
            cell.recorder.record_stop()
            cell.recorder.stop()
            await asyncio.sleep(0.002)  # file names have milliseconds
        await cell.finished(round(STOPS.burst))
        assert len(files_of(cell)) == STOPS.burst

    run(test)
