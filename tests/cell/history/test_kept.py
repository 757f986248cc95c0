"""Which of the kept recordings cover a time."""

from pathlib import Path
from typing import Final

from app.cell.history.kept import MOST_READ, has_unfinished, recording_of, recordings_of
from app.cell.history.recording import UNFINISHED, Channel, McapFile, recording_name

CHANNEL: Final = Channel("/heard", "std_msgs/msg/String", "string data\n")
AT: Final = 1_700_000_000.0


def recorded(
    folder: Path,
    at: float,
    robot: str = "",
    cause: str = "stop",
    before_s: float = 30.0,
    after_s: float = 5.0,
) -> str:
    """A recording that began at a time, with a message from before it and one from after it."""
    file = McapFile(folder, recording_name(at, robot, cause), {})
    for each in (at - before_s, at + after_s):
        file.add(CHANNEL, b"\0\1\0\0", round(each * 1e9), round(each * 1e9))
    return file.finish().name


def names(folder: Path, robot: str = "", at: float = AT) -> list[str]:
    return [each.name for each in recordings_of(folder, robot, at, at)]


def test_those_with_messages_on_both_sides_cover_it(tmp_path: Path) -> None:
    stop = recorded(tmp_path, AT + 0.1)
    later = recorded(tmp_path, AT + 60.0)
    press = recorded(tmp_path, AT - 3.0, cause="start", before_s=0.0)
    assert names(tmp_path) == [stop, press]
    assert names(tmp_path, at=AT + 40.0) == [later]
    assert names(tmp_path, at=AT + 600.0) == []
    assert names(tmp_path / "nothing") == []


def test_many_presses_after_a_stop_do_not_hide_its_recording(tmp_path: Path) -> None:
    stop = recorded(tmp_path, AT)
    for number in range(2 * MOST_READ):
        recorded(tmp_path, AT + 60.0 + number, cause="start", before_s=10.0)
    assert names(tmp_path) == [stop]


def test_each_robot_has_its_own(tmp_path: Path) -> None:
    own, other = (recorded(tmp_path, AT, robot) for robot in ("r1", "r10"))
    assert names(tmp_path, "r1") == [own]
    assert names(tmp_path, "r10") == [other]
    (tmp_path / f"{recording_name(AT, 'r1', 'stop')}{UNFINISHED}").touch()
    assert (has_unfinished(tmp_path, "r1"), has_unfinished(tmp_path, "r10")) == (True, False)


def test_after_a_lost_link_a_recording_ends_before_its_stop(tmp_path: Path) -> None:
    recorded(tmp_path, AT - 20.0, cause="start", before_s=5.0)
    own = recorded(tmp_path, AT + 0.1, after_s=-1.0)
    recorded(tmp_path, AT + 40.0, before_s=30.0)
    taken = recording_of(tmp_path, "", AT)
    assert taken is not None
    assert (taken.name, taken.until < AT) == (own, True)
    assert recording_of(tmp_path, "", AT - 200.0) is None


def test_of_several_the_one_with_the_most_before_it_is_taken(tmp_path: Path) -> None:
    recorded(tmp_path, AT - 1.0, cause="start", before_s=5.0)
    own = recorded(tmp_path, AT)
    taken = recording_of(tmp_path, "", AT)
    assert taken is not None
    assert taken.name == own
