"""Maps of a robot are read beside the event loop: the newest counts, and nothing piles up."""

import asyncio
import threading
import time
from collections.abc import Callable, Coroutine
from functools import wraps
from types import SimpleNamespace as Context
from typing import Any, Final

import pytest

from app.cell.robot.maps import GRID_TYPE, TOO_FAST
from app.cell.session import maps
from app.cell.session.maps import MapListener, MapPictures
from app.ros.zenoh.sample import Sample
from app.system.errors import TooMany
from app.system.texts import Text
from tests.support.builders import BRIDGE, INTERFACES, NOW, panel_of, robot_there

MAP: Final = {"id": "hall", "kind": "map", "label": "Hall"}
TF: Final = "tf2_msgs/msg/TFMessage"
SIDE: Final = 4000
MOST_HELD_S: Final = 0.05  # the event loop, by a map of 4000 x 4000


def payload(value: int, side: int = 1, sec: int = 0) -> bytes:
    info = {"width": side, "height": side, "resolution": 1.0, "origin": {"orientation": {"w": 1.0}}}
    info["map_load_time"] = {"sec": sec}
    cells = [value] * (side * side)
    header = {"frame_id": "map", "stamp": {"sec": sec}}
    return INTERFACES.encode(GRID_TYPE, {"header": header, "info": info, "data": cells})


def sample(data: bytes, seq: int = 1) -> Sample:
    return Sample(data, seq, NOW, NOW, BRIDGE)


def in_a_loop(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    @wraps(test)
    def run(**fixtures: Any) -> None:
        asyncio.run(test(**fixtures))

    return run


class Listening:
    """A listener, and the keys that it reported."""

    def __init__(self, **keys: Any) -> None:
        panel = panel_of(MAP | keys)
        self.robot = robot_there(panel)
        self.changed: list[str] = []
        context: Any = Context(robot=self.robot, panel=panel, interfaces=INTERFACES)
        self.listener = MapListener(context, self.changed.append)

    async def reported(self, times: int) -> None:
        async with asyncio.timeout(20):
            while len(self.changed) < times:
                await asyncio.sleep(0.005)


@in_a_loop
async def test_of_many_maps_the_first_and_the_newest_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maps, "PAUSE_S", 0.05)
    listening = Listening()
    for value in range(50):
        listening.listener.take_map("map", sample(payload(value), value))
    await listening.reported(1)
    state = listening.robot.maps["map"]
    first = state.grid
    assert not state.is_behind
    for value in range(50, 101):
        listening.listener.take_map("map", sample(payload(value), value))
        assert (state.grid, state.is_behind) == (first, True)
    await listening.reported(2)
    assert not state.is_behind
    await asyncio.sleep(0.2)
    newest = listening.robot.maps["map"].grid
    assert first is not None
    assert newest is not None
    assert (bytes(first.cells), bytes(newest.cells)) == (b"\x31", b"\x64")
    assert len(listening.changed) == 2


@in_a_loop
async def test_the_same_map_again_is_the_same_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maps, "PAUSE_S", 0.0)
    listening = Listening()
    listening.listener.take_map("map", sample(payload(5)))
    await listening.reported(1)
    first = listening.robot.maps["map"].grid
    listening.listener.take_map("map", sample(payload(5, sec=9), 2))
    assert not listening.robot.maps["map"].is_behind
    await listening.reported(2)
    assert listening.robot.maps["map"].grid is first


@in_a_loop
async def test_a_large_map_that_comes_again_and_again_is_never_behind_for_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(maps, "COMPARED", 100)
    monkeypatch.setattr(maps, "PAUSE_S", 60.0)  # after the first
    listening = Listening()
    listening.listener.take_map("map", sample(payload(5, side=40)))
    await listening.reported(1)
    state = listening.robot.maps["map"]
    first = state.grid
    for number in range(2, 6):
        listening.listener.take_map("map", sample(payload(5, side=40, sec=number), number))
        assert state.is_behind  # until it is compared
        await listening.reported(number)
        assert (state.is_behind, state.grid, state.overtaken) == (False, first, 0)
    listening.listener.take_map("map", sample(payload(6, side=40), 9))
    await asyncio.sleep(0.05)
    assert (state.is_behind, state.grid) == (True, first)


@in_a_loop
async def test_a_map_that_changes_faster_than_it_is_read_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(maps, "PAUSE_S", 0.2)
    listening = Listening()
    state = listening.robot.maps["map"]
    for value in range(2 * TOO_FAST):
        listening.listener.take_map("map", sample(payload(value), value))
    assert state.is_too_fast
    await listening.reported(1)
    async with asyncio.timeout(20):
        while state.is_too_fast:  # all that came are read
            await asyncio.sleep(0.01)
    assert (state.is_behind, state.overtaken) == (False, 0)


@in_a_loop
async def test_a_map_that_can_not_be_read_replaces_the_one_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(maps, "PAUSE_S", 0.0)
    listening = Listening()
    for number, data in enumerate((payload(5), b"\0\1\0\0", payload(6)), start=1):
        listening.listener.take_map("map", sample(data, number))
        await listening.reported(number)
        state = listening.robot.maps["map"]
        if number == 2:
            assert state.grid is None
            assert isinstance(state.problem, Text)
            assert state.problem.code == "map_incomplete"
    assert (state.grid is not None, state.problem) == (True, "")


UPDATE: Final = "map_msgs/msg/OccupancyGridUpdate"


def update(value: int, at: float = NOW, frame: str = "map") -> Sample:
    fields = {"header": {"frame_id": frame}, "width": 1, "height": 1, "data": [value]}
    return sample(INTERFACES.encode(UPDATE, fields))._replace(at=at)


async def cells_are(listening: Listening, cells: list[int]) -> None:
    async with asyncio.timeout(20):
        while (grid := listening.robot.maps["map"].grid) is None or [*grid.cells] != cells:
            await asyncio.sleep(0.005)


@in_a_loop
async def test_updates_count_after_a_whole_map_in_their_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maps, "PAUSE_S", 0.0)
    listening = Listening()
    listening.listener.record_sample("map_updates", update(9))  # of no map
    listening.listener.take_map("map", sample(payload(5)))
    await cells_are(listening, [5])
    for value in (1, 2, 3):
        listening.listener.record_sample("map_updates", update(value))
    await cells_are(listening, [3])
    listening.listener.take_map("map", sample(payload(6))._replace(at=NOW + 2.0))
    listening.listener.record_sample("map_updates", update(7, NOW + 1.0))  # from before this map
    listening.listener.record_sample("map_updates", update(8, NOW + 3.0))
    await cells_are(listening, [8])
    assert listening.robot.maps["map"].doubt == ""


@in_a_loop
async def test_an_update_that_does_not_fit_makes_the_map_doubtful_until_a_whole_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(maps, "PAUSE_S", 0.0)
    listening = Listening()
    listening.listener.take_map("map", sample(payload(5)))
    await listening.reported(1)
    listening.listener.record_sample("map_updates", update(1, frame="odom"))
    await listening.reported(2)
    doubt = listening.robot.maps["map"].doubt
    assert isinstance(doubt, Text)
    assert doubt.code == "map_update_frame"
    listening.listener.take_map("map", sample(payload(6)))
    await cells_are(listening, [6])
    assert listening.robot.maps["map"].doubt == ""


@in_a_loop
async def test_updates_that_come_too_fast_are_bounded_and_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(maps, "PAUSE_S", 0.0)
    listening = Listening()
    listening.listener.take_map("map", sample(payload(5)))
    await cells_are(listening, [5])
    for value in range(maps.MAX_UPDATES + 1):
        listening.listener.record_sample("map_updates", update(value % 100))
    assert len(listening.listener._updates["map"]) == maps.MAX_UPDATES
    doubt = listening.robot.maps["map"].doubt
    assert isinstance(doubt, Text)
    assert doubt.code == "map_updates_lost"


@in_a_loop
async def test_updates_of_another_session_and_of_before_a_cut_are_not_applied() -> None:
    listening = Listening()
    listening.listener.take_map("map", sample(payload(5)))
    await cells_are(listening, [5])
    listening.listener.record_sample("map_updates", update(1)._replace(source="0123456789abcdef"))
    listening.robot.mark_link_lost()
    async with asyncio.timeout(20):
        while listening.listener._reading:
            await asyncio.sleep(0.005)
    listening.listener.record_sample("map_updates", update(2, time.monotonic()))
    assert listening.listener._reading == set()
    assert len(listening.listener._updates["map"]) == 0


@in_a_loop
async def test_of_many_scans_the_newest_is_read_and_others_go_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(maps, "LAYER_PAUSE_S", 0.0)
    listening = Listening(layer=[{"shows": "scan", "topic": "/scan"}])
    scan = "sensor_msgs/msg/LaserScan"
    limits = {"range_max": 9.0, "angle_increment": 0.1}
    fields = {"header": {"frame_id": "laser"}, "ranges": [1.0], **limits}
    good = INTERFACES.encode(scan, fields)
    for _ in range(50):
        listening.listener.take_map("scan", sample(good[:-4]))
    listening.listener.take_map("map", sample(payload(5)))
    await listening.reported(2)
    state = listening.robot.map_layers["scan"]
    assert isinstance(state.problem, Text)
    assert (state.problem.code, state.shape) == ("map_layer_incomplete", None)
    await cells_are(listening, [5])
    listening.listener.take_map("scan", sample(good))
    await listening.reported(3)
    assert state.problem == ""
    assert state.shape is not None
    assert [*state.shape.points] == [1.0, 0.0]


@pytest.mark.long("real time")
@in_a_loop
async def test_a_large_map_does_not_hold_the_event_loop() -> None:
    listening, data = Listening(), payload(0, SIDE)
    longest = 0.0
    listening.listener.take_map("map", sample(data))
    while not listening.changed:
        began = time.monotonic()
        await asyncio.sleep(0.001)
        longest = max(longest, time.monotonic() - began)
    print(f"the event loop was held for {1000 * longest:.1f} ms")
    assert longest < MOST_HELD_S


def test_transforms_are_those_of_all_messages_and_a_broken_one_is_counted() -> None:
    listening = Listening()
    turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    for key, parent, child in (("tf_static", "map", "odom"), ("tf", "odom", "base_link")):
        way = {"translation": {"x": 1.0, "y": 0.0, "z": 0.0}, "rotation": turn}
        stamped = {"header": {"frame_id": parent}, "child_frame_id": child, "transform": way}
        data = INTERFACES.encode(TF, {"transforms": [stamped]})
        listening.listener.record_sample(key, sample(data))
    listening.listener.record_sample("tf", sample(b"\0\1\0\0\xff\xff\xff\xff"))
    located = listening.robot.transforms.locate("base_link", "map")
    assert getattr(located, "pose", None) == (2.0, 0.0, 0.0)
    assert listening.robot.traffic.undecodable["tf"] == 1


def test_a_map_with_a_pose_topic_does_not_read_transforms() -> None:
    assert Listening(pose={"topic": "/pose"}).listener.keys == {"map_updates"}
    assert Listening().listener.keys == {"tf", "tf_static", "map_updates"}
    scan = {"shows": "scan", "topic": "/scan"}
    placed = Listening(pose={"topic": "/pose"}, layer=[scan])
    assert placed.listener.keys == {"tf", "tf_static", "map_updates"}


def test_transforms_of_another_session_are_not_the_robots() -> None:
    listening = Listening()
    way = {"translation": {"x": 1.0, "y": 0.0, "z": 0.0}, "rotation": {"w": 1.0}}
    stamped = {"header": {"frame_id": "map"}, "child_frame_id": "base_link", "transform": way}
    data = INTERFACES.encode(TF, {"transforms": [stamped]})
    foreign = sample(data)._replace(source="0123456789abcdef")
    listening.listener.record_sample("tf", foreign)
    assert len(listening.robot.transforms) == 0
    listening.listener.record_sample("tf", sample(data))
    assert len(listening.robot.transforms) == 1


@in_a_loop
async def test_pictures_are_made_one_at_a_time_kept_and_bounded() -> None:
    pictures, running, most = MapPictures(), 0, 0
    goes_on = threading.Event()

    def make() -> bytes:
        nonlocal running, most
        running += 1
        most = max(most, running)
        goes_on.wait(10)
        running -= 1
        return b"picture"

    asked = [asyncio.ensure_future(pictures.picture(n % 4, make)) for n in range(12)]
    others = [asyncio.ensure_future(pictures.picture(n, make)) for n in range(4, maps.MAX_WAITING)]
    await asyncio.sleep(0.05)
    with pytest.raises(TooMany):
        await pictures.picture("one more", make)
    goes_on.set()
    assert await asyncio.gather(*asked, *others) == [b"picture"] * (8 + maps.MAX_WAITING)
    assert most == 1
    assert await pictures.picture(0, lambda: b"another") == b"picture"


@in_a_loop
async def test_a_map_that_waited_over_a_cut_is_of_before_it() -> None:
    listening = Listening()
    listening.listener.take_map("map", sample(payload(5))._replace(at=time.monotonic()))
    listening.robot.mark_link_lost()
    await listening.reported(1)
    assert listening.robot.maps["map"].is_cut
