"""The messages in the shipped file are those of rosbags, which a kiosk does not have."""

import json

import pytest

from app.ros.messages import DISTROS, load_interfaces
from app.ros.messages.definitions import Structure
from app.ros.messages.distributions import MESSAGES
from app.ros.messages.make_builtin import messages_text, rosbags_messages


def test_the_shipped_file_is_made_from_the_locked_rosbags() -> None:
    assert MESSAGES.read_text() == messages_text(), "`python -m app.ros.messages.make_builtin`"


@pytest.mark.parametrize("distro", DISTROS)
def test_each_message_is_read_as_it_is_in_rosbags(distro: str) -> None:
    read, messages = load_interfaces(distro).structures, list(rosbags_messages(distro))
    assert len(messages) >= 150
    for message in messages:
        assert written(read[message.name]) == written(message)


def written(message: Structure) -> tuple[str, str]:
    """Also the types of constants, and those of values: 0.0 and false equal 0."""
    constants = {
        name: (message.constant_types[name], value) for name, value in message.constants.items()
    }
    return repr(message.fields), repr(constants)


def test_a_definition_has_a_row_with_all_its_distributions() -> None:
    rows = json.loads(MESSAGES.read_text())
    definitions = [json.dumps(definition) for _, *definition in rows]
    assert len(set(definitions)) == len(definitions)
    assert {tuple(distros) for distros, *_ in rows} >= {DISTROS, DISTROS[:-2], ("lyrical", "rolling")}
