"""What a camera shows beside its picture."""

from app.cell.robot.state import RobotState
from app.cell.robot.topics import CameraTopicState
from app.cell.view.displays import camera
from app.panel.widgets.displays import Camera
from app.system.texts import Text
from tests.support.builders import endpoint, panel_of, robot_there

CAMERA = {"id": "cam", "kind": "camera", "label": "Camera", "topic": "/cam"}
RECEIVED = 100.0


def shown(robot: RobotState, widget: Camera, now: float) -> tuple[str, str, float]:
    attributes, until = camera(widget, robot, now)
    note = attributes["note"]
    return attributes["state"], note.code if isinstance(note, Text) else note, until


def subscribed() -> tuple[RobotState, Camera, CameraTopicState]:
    panel = panel_of(CAMERA)
    robot = robot_there(panel)
    (widget,) = (w for w in panel.widgets() if isinstance(w, Camera))
    received = robot.camera_topics[robot.key("/cam")] = CameraTopicState(RECEIVED, 0.0)
    return robot, widget, received


def test_camera_is_unknown_while_no_page_shows_it() -> None:
    robot, widget, _ = subscribed()
    robot.camera_topics.clear()
    assert shown(robot, widget, RECEIVED) == ("waiting", "readout_waiting", float("inf"))


def test_a_picture_is_old_after_a_second_and_its_age_counts() -> None:
    robot, widget, _ = subscribed()
    assert shown(robot, widget, RECEIVED + 0.9) == ("live", "", RECEIVED + 1)
    assert shown(robot, widget, RECEIVED + 1.5) == ("old", "camera_old", RECEIVED + 2)
    assert shown(robot, widget, RECEIVED + 130) == ("old", "camera_old", RECEIVED + 180)


def test_a_picture_that_can_not_be_shown_says_why() -> None:
    robot, widget, received = subscribed()
    received.problem = "broken"
    assert shown(robot, widget, RECEIVED)[:2] == ("unreadable", "broken")


def test_a_topic_of_another_type_says_so() -> None:
    robot, widget, _ = subscribed()
    endpoint(robot, "MP", "/cam", "sensor_msgs/msg/Image")
    assert shown(robot, widget, RECEIVED)[:2] == ("unreadable", "topic_wrong_type")


def test_a_cameras_topic_is_subscribed_to_on_demand_only() -> None:
    panel = panel_of(CAMERA)
    assert "/cam" not in panel.subscriptions()
    assert panel.on_demand() == {"/cam": "sensor_msgs/msg/CompressedImage"}
