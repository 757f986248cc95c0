"""Error codes of Nav2 as sentences."""

from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.commands.goals import error_paths
from app.panel.known_values import ERROR_CODE, NAV2_ERRORS, known_value
from app.panel.widgets.service_action import Action
from app.ros.messages import load_interfaces
from app.system.settings import panel_path
from app.system.texts import ENGLISH, render, sentences

FOLDERS: Final = (panel_path("mobile-robot").parent / "interfaces",)
NAVIGATE: Final = "nav2_msgs/action/NavigateToPose"


def action(type_name: str, **keys: Any) -> Action:
    about = {"id": "send", "kind": "action", "label": "Send", "action": "/go", "type": type_name}
    return Action.model_validate({**about, **keys})


def paths_of(widget: Action, folders: tuple[Path, ...] = FOLDERS) -> tuple[str, ...]:
    return error_paths(widget, load_interfaces("jazzy", folders))


@pytest.mark.parametrize("code", NAV2_ERRORS)
def test_each_code_has_a_sentence_with_the_code_and_what_to_do(code: int) -> None:
    sentence = known_value(NAVIGATE, ERROR_CODE, code)
    assert sentence is not None
    assert f"({code}). " in render(sentence)
    assert sentence.code in sentences(ENGLISH)


@pytest.mark.parametrize("code", [0, 100, 200, 999, 9000, 65535, None, "105"])
def test_code_that_says_nothing_has_none(code: object) -> None:
    assert known_value(NAVIGATE, ERROR_CODE, code) is None


def test_planner_has_the_same_sentences_for_one_pose_and_for_several() -> None:
    assert [NAV2_ERRORS[200 + n] for n in range(1, 9)] == [NAV2_ERRORS[300 + n] for n in range(1, 9)]


def test_only_actions_of_nav2_with_a_code_are_read() -> None:
    assert paths_of(action(NAVIGATE)) == (ERROR_CODE,)
    assert paths_of(action(NAVIGATE, result="arrived")) == (ERROR_CODE,)
    assert paths_of(action(NAVIGATE, result="error {error_code}")) == ()
    assert paths_of(action("example_interfaces/action/Fibonacci")) == ()


def test_result_without_a_code_is_not_read(tmp_path: Path) -> None:
    folder = tmp_path / "nav2_msgs/action"
    folder.mkdir(parents=True)
    (folder / "NavigateToPose.action").write_text("geometry_msgs/PoseStamped pose\n---\n---\n")
    assert paths_of(action(NAVIGATE), (tmp_path,)) == ()
