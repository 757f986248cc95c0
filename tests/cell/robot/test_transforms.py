"""The transforms of a robot: looked up, interpolated, bounded, and named where they are missing."""

import math
from types import SimpleNamespace as Message
from typing import Any, Final

import pytest

from app.cell.robot.transforms import MAX_FRAMES, PROBLEM_S, TF_TYPE, LocatedFrame, TransformTree
from app.system.errors import DecodeError
from app.system.texts import Text
from tests.support.builders import INTERFACES

EVERY_S: Final = 0.02


def transform(
    parent: str,
    child: str,
    stamp: float = 0.0,
    *,
    x: float = 0.0,
    y: float = 0.0,
    yaw: float = 0.0,
    **turn: float,
) -> Any:
    rotation = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)} | turn
    stamped = Message(sec=int(stamp), nanosec=round(stamp % 1 * 1e9))
    place = Message(x=x, y=y, z=0.0)
    return Message(
        header=Message(frame_id=parent, stamp=stamped),
        child_frame_id=child,
        transform=Message(translation=place, rotation=Message(**rotation)),
    )


def transforms_of(*transforms: Any) -> Any:
    """A message with these."""
    return Message(transforms=transforms)


def tree_with(*moving: Any, static: tuple[Any, ...] = (), at: float = 100.0) -> TransformTree:
    tree = TransformTree()
    tree.record(Message(transforms=static), at, is_static=True)
    for message in moving:
        tree.record(Message(transforms=[message]), at, is_static=False)
    return tree


def located(tree: TransformTree, base: str = "base_link", fixed: str = "map") -> LocatedFrame:
    result = tree.locate(base, fixed)
    assert isinstance(result, LocatedFrame), result
    return result


def code(tree: TransformTree, base: str = "base_link", fixed: str = "map") -> str:
    missing = tree.locate(base, fixed)
    assert isinstance(missing, Text)
    return missing.code


def test_a_pose_goes_over_all_frames_between_the_two() -> None:
    tree = tree_with(
        transform("map", "odom", 1.0, x=1.0, yaw=math.pi / 2),
        transform("odom", "base_link", 1.0, x=2.0),
        static=(transform("base_link", "laser", x=0.5, yaw=math.pi),),
    )
    assert located(tree).pose == pytest.approx((1.0, 2.0, math.pi / 2))
    assert located(tree, "laser").pose == pytest.approx((1.0, 2.5, -math.pi / 2))
    assert located(tree, "map", "base_link").pose == pytest.approx((-2.0, 1.0, -math.pi / 2))
    mounted = located(tree, "laser", "base_link")
    assert mounted.pose == pytest.approx((0.5, 0.0, math.pi))
    assert (mounted.at, mounted.stamp) == (math.inf, None)


def test_a_pose_is_that_of_the_newest_time_at_which_all_are_known() -> None:
    tree = tree_with(
        transform("map", "odom", 10.0),
        transform("odom", "base_link", 9.0, x=0.0),
        transform("odom", "base_link", 11.0, x=2.0, yaw=1.0),
    )
    result = located(tree)
    assert result.pose == pytest.approx((1.0, 0.0, 0.5), abs=0.01)
    assert result.stamp == 10.0


def test_its_age_is_that_of_the_oldest_transform_that_moves() -> None:
    tree = tree_with(transform("map", "odom", 1.0), at=100.0)
    tree.record(Message(transforms=[transform("odom", "base_link", 1.0)]), 105.0, is_static=False)
    assert located(tree).at == 100.0


def test_a_jump_back_of_the_robots_clock_begins_again() -> None:
    tree = tree_with(
        transform("map", "base_link", 1000.0, x=1.0), transform("map", "base_link", 3.0, x=7.0)
    )
    assert located(tree).pose.x == 7.0
    late = tree_with(
        transform("map", "base_link", 1000.0, x=1.0), transform("map", "base_link", 999.0, x=7.0)
    )
    assert located(late).pose.x == 1.0


def test_a_simulated_time_that_begins_again_makes_older_stamps_count() -> None:
    tree = tree_with(transform("map", "base_link", 3.0, x=3.0), at=100.0)
    tree.record(transforms_of(transform("map", "base_link", 1.0, x=1.0)), 101.0, is_static=False)
    assert (located(tree).pose.x, located(tree).at) == (3.0, 100.0)  # not newer
    tree.restart()
    tree.record(transforms_of(transform("map", "base_link", 1.0, x=1.0)), 102.0, is_static=False)
    assert (located(tree).pose.x, located(tree).at) == (1.0, 102.0)
    tree.record(transforms_of(transform("map", "base_link", 0.5, x=0.5)), 103.0, is_static=False)
    assert located(tree).pose.x == 1.0


def test_what_is_missing_is_named() -> None:
    assert code(TransformTree()) == "transform_unknown"
    assert code(tree_with(transform("map", "odom"))) == "transform_unknown"
    assert (
        code(tree_with(transform("map", "odom"), transform("world", "base_link")))
        == "transform_unconnected"
    )
    loop = tree_with(transform("b", "base_link"), transform("base_link", "b"), transform("map", "odom"))
    assert code(loop) == "transform_loop"


@pytest.mark.parametrize(
    ("bad", "expected"),
    [
        (transform("odom", "base_link", w=0.0), "transform_no_rotation"),
        (transform("odom", "base_link", w=math.nan), "transform_no_rotation"),
        (transform("odom", "base_link", x=math.inf), "transform_no_rotation"),
        (transform("", "base_link"), "transform_no_frame"),
        (transform("base_link", "base_link"), "transform_no_frame"),
    ],
)
def test_a_transform_that_is_none_is_not_taken_and_named(bad: Any, expected: str) -> None:
    assert code(tree_with(transform("map", "odom"), bad)) == expected


def test_a_frame_with_two_parents_is_not_located_for_a_while() -> None:
    tree = tree_with(
        transform("map", "odom"), transform("odom", "base_link"), transform("other", "base_link")
    )
    assert code(tree) == "transform_two_parents"
    back = Message(transforms=[transform("odom", "base_link", 2.0, x=3.0)])
    tree.record(back, 101.0, is_static=False)
    assert code(tree) == "transform_two_parents"  # the way is there, but which parent is right?
    assert code(tree, "base_link", "odom") == "transform_two_parents"
    assert located(tree, "odom", "map").pose.x == 0.0
    further = Message(transforms=[transform("odom", "base_link", 9.0, x=4.0)])
    tree.record(further, 101.5 + PROBLEM_S, is_static=False)
    assert located(tree).pose.x == 3.0  # at the newest common time


def test_frames_and_times_are_bounded() -> None:
    tree = tree_with(*(transform("map", f"frame_{number}") for number in range(MAX_FRAMES + 50)))
    assert len(tree) == MAX_FRAMES
    assert code(tree) == "transforms_full"
    long = tree_with(*(transform("map", "base_link", number * EVERY_S) for number in range(10_000)))
    assert sum(len(frame.stamps) for frame in long._frames.values()) <= 100


@pytest.mark.parametrize("stamp", [0.0, 96.0])
def test_a_robot_whose_stamps_do_not_go_on_gets_old(stamp: float) -> None:
    tree = tree_with(transform("map", "base_link", 100.0 if stamp else 0.0, x=1.0), at=10.0)
    tree.record(
        Message(transforms=[transform("map", "base_link", stamp, x=50.0)]), 20.0, is_static=False
    )
    assert (located(tree).pose.x, located(tree).at) == (1.0, 10.0)


def test_after_a_cut_the_robot_is_where_it_was_and_a_new_run_is_not_mixed_with_the_old() -> None:
    tree = tree_with(
        transform("odom", "base_link", 1.0, x=2.0), static=(transform("map", "odom", x=1.0),)
    )
    assert not located(tree).is_cut
    tree.cut(120.0)
    assert (located(tree).is_cut, located(tree).pose.x, located(tree).at) == (True, 3.0, 100.0)
    moved = transform("odom", "base_link", 1.0, x=7.0)  # the robot has begun again, not localized yet
    tree.record(Message(transforms=[moved]), 130.0, is_static=False)
    assert code(tree) == "transform_unknown"
    tree.record(Message(transforms=[transform("map", "odom", x=5.0)]), 131.0, is_static=True)
    assert (located(tree).is_cut, located(tree).pose.x) == (False, 12.0)


def test_frames_of_before_a_cut_make_room() -> None:
    tree = tree_with(*(transform("map", f"frame_{number}") for number in range(MAX_FRAMES + 1)))
    tree.cut(120.0)
    tree.record(Message(transforms=[transform("map", "base_link", x=1.0)]), 130.0, is_static=False)
    assert located(tree).pose.x == 1.0
    assert len(tree) == 1


def test_where_a_frame_was_at_a_time_of_the_robot() -> None:
    tree = tree_with(
        transform("map", "base_link", 10.0, x=0.0), transform("map", "base_link", 11.0, x=2.0)
    )
    for wanted, x in ((10.5, 1.0), (11.0, 2.0), (12.0, 2.0), (9.0, 0.0)):
        result = tree.locate("base_link", "map", wanted)
        assert isinstance(result, LocatedFrame)
        assert result.pose.x == pytest.approx(x)
        assert result.stamp == min(wanted, 11.0)


def test_what_was_wrong_with_another_frame_is_not_why_a_way_is_missing() -> None:
    tree = tree_with(transform("map", "odom"), transform("gripper", "finger", w=0.0))
    assert code(tree) == "transform_unknown"


def test_what_was_wrong_with_a_frame_is_forgotten_when_its_transforms_are_right() -> None:
    tree = tree_with(transform("odom", "base_link", w=0.0), transform("map", "other"), at=1.0)
    assert code(tree) == "transform_no_rotation"
    right = Message(transforms=[transform("odom", "base_link", 1.0)])
    tree.record(right, 2.0 + PROBLEM_S, is_static=False)
    assert code(tree) == "transform_unconnected"


def test_frames_that_come_more_often_than_is_shown_are_kept_for_as_long() -> None:
    often = [transform("map", "base_link", number / 500, x=number / 500) for number in range(2_000)]
    tree = tree_with(*often)
    result = tree.locate("base_link", "map", 2.5)
    assert isinstance(result, LocatedFrame)
    assert result.pose.x == pytest.approx(2.5)
    assert located(tree).pose.x == pytest.approx(often[-1].transform.translation.x)


def message_of(*transforms: Any) -> bytes:
    def fields(each: Any) -> Any:
        nested = vars(each) if isinstance(each, Message) else None
        return each if nested is None else {name: fields(value) for name, value in nested.items()}

    return INTERFACES.encode(TF_TYPE, {"transforms": [fields(each) for each in transforms]})


def test_bytes_are_read_as_the_message_is() -> None:
    sent = [transform("map", "odom", 1.25, x=1.0, yaw=1.0), transform("odom", "base_link", 1.5, y=2.0)]
    tree = TransformTree()
    tree.record_bytes(message_of(*sent), 3.0, is_static=False)
    decoded = tree_with(*sent, at=3.0)
    assert located(tree) == located(decoded)
    big = bytearray(INTERFACES.encode("std_msgs/msg/UInt32", {"data": 0}))
    big[1] = 0  # big-endian
    tree.record_bytes(bytes(big), 4.0, is_static=False)


@pytest.mark.parametrize(
    "broken",
    [
        b"",
        b"\0\1\0\0",
        b"\0\1\0\0\xff\xff\xff\xff",
        message_of(transform("map", "odom"))[:-8],
        message_of(transform("map", "odom")) + bytes(16),
        message_of(transform("map", "odom")).replace(b"map\0", b"map!"),
    ],
)
def test_bytes_that_are_no_transforms_are_an_error(broken: bytes) -> None:
    with pytest.raises(DecodeError):
        TransformTree().record_bytes(broken, 1.0, is_static=False)
