"""What is said about a Zenoh configuration that Zenoh does not take."""

from pathlib import Path

import pytest

from app.ros.zenoh.config import config_from
from app.system.errors import SettingsError


@pytest.mark.parametrize(
    ("text", "connect", "words"),
    [
        ('{ mode: "peer" listen: 1 }', (), "line 1, column 9: expected boolean or null"),
        ('{\n  mode: "pear" }', (), "line 2, column 9: unknown variant `pear`"),
        ("not json", (), "line 1, column 1: expected array"),
        ("{}", ("tcp",), "Endpoints must be of the form <protocol>/<address>"),
    ],
)
def test_the_message_has_the_line_and_no_names_of_zenohs_source(
    tmp_path: Path, text: str, connect: tuple[str, ...], words: str
) -> None:
    path = tmp_path / "zenoh.json5"
    path.write_text(text)
    with pytest.raises(SettingsError) as raised:
        config_from(path, connect)
    assert words in str(raised.value)
    assert not [
        name for name in ("Json5Err", "Message {", "Location", ".rs:") if name in str(raised.value)
    ]
