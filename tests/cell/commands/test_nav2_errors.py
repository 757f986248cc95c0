"""Error codes of Nav2 as sentences."""

from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.commands.nav2_errors import CODE, SENTENCES, code_path, sentence_of
from app.panel.widgets.service_action import Action
from app.ros.messages import load_interfaces
from app.system.settings import panel_path
from app.system.texts import ENGLISH, render, sentences

FOLDERS: Final = (panel_path("mobile-robot").parent / "interfaces",)
NAVIGATE: Final = "nav2_msgs/action/NavigateToPose"


def action(type_name: str, **keys: Any) -> Action:
    about = {"id": "send", "kind": "action", "label": "Send", "action": "/go", "type": type_name}
    return Action.model_validate({**about, **keys})


def path_of(widget: Action, folders: tuple[Path, ...] = FOLDERS) -> str | None:
    return code_path(widget, load_interfaces("jazzy", folders))


@pytest.mark.parametrize("code", SENTENCES)
def test_each_code_has_a_sentence_with_the_code_and_what_to_do(code: int) -> None:
    sentence = sentence_of(code)
    assert sentence is not None
    assert f"({code}). " in render(sentence)
    assert sentence.code in sentences(ENGLISH)


@pytest.mark.parametrize("code", [0, 100, 200, 999, 9000, 65535, None, "105"])
def test_code_that_says_nothing_has_none(code: object) -> None:
    assert sentence_of(code) is None


def test_planner_has_the_same_sentences_for_one_pose_and_for_several() -> None:
    assert [SENTENCES[200 + code] for code in range(1, 9)] == [SENTENCES[300 + n] for n in range(1, 9)]


def test_only_actions_of_nav2_with_a_code_are_read() -> None:
    assert path_of(action(NAVIGATE)) == CODE
    assert path_of(action(NAVIGATE, result="arrived")) == CODE
    assert path_of(action(NAVIGATE, result="error {error_code}")) is None
    assert path_of(action("example_interfaces/action/Fibonacci")) is None


def test_result_without_a_code_is_not_read(tmp_path: Path) -> None:
    folder = tmp_path / "nav2_msgs/action"
    folder.mkdir(parents=True)
    (folder / "NavigateToPose.action").write_text("geometry_msgs/PoseStamped pose\n---\n---\n")
    assert path_of(action(NAVIGATE), (tmp_path,)) is None
