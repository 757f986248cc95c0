"""The settings of the forwarder: a wrong one is a sentence that names the key, its value, and what is
right."""

from pathlib import Path
from typing import Final

import pytest

from app.cell.forward.config import STREAMS, parse_connection, read_central, read_forward
from app.system.errors import SettingsError

RIGHT: Final = (
    '[forward]\npanel = "cell 1"\nconnection = "host=history.plant dbname=plant user=cell1"\n'
)


def written(folder: Path, text: str) -> Path:
    path = folder / "forward.toml"
    path.write_text(text)
    return path


def test_the_shortest_settings_check_the_server_s_name(tmp_path: Path) -> None:
    config = read_forward(written(tmp_path, RIGHT))
    assert (config.panel, config.site, config.streams) == ("cell 1", "", STREAMS)
    assert config.connection.is_encrypted
    assert config.connection.keys["sslrootcert"] == "system"
    assert config.connection.address == "history.plant:5432"
    assert config.connection.password_file is None


def test_files_are_beside_the_settings(tmp_path: Path) -> None:
    more = 'password_file = "secret"\nstreams = ["alarms", "log"]\nkeep_days = 90\nbatch = 100\n'
    text = RIGHT.replace("user=cell1", "user=cell1 sslrootcert=plant.pem sslmode=verify-ca")
    config = read_forward(written(tmp_path, text + more))
    assert config.connection.password_file == tmp_path / "secret"
    assert config.connection.keys["sslrootcert"] == str(tmp_path / "plant.pem")
    assert not config.connection.is_encrypted
    assert config.streams == ("log", "alarms")
    assert (config.keep_days, config.batch) == (90, 100)


def test_the_centre_s_connection_goes_before_that_of_the_cell(tmp_path: Path) -> None:
    own = '[central]\nconnection = "host=history.plant dbname=plant user=owner"\n'
    assert read_central(written(tmp_path, RIGHT)).keys["user"] == "cell1"
    assert read_central(written(tmp_path, RIGHT + own)).keys["user"] == "owner"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('panel = "cell 1"\n', "", "[forward] panel is missing: a name of 1 to 80 characters"),
        ('"cell 1"', '" cell"', '[forward] panel is " cell": it must be a name'),
        ('"cell 1"', "3", "[forward] panel is 3: it must be a name"),
        ("[forward]", "[forwards]", 'has "forwards": there are [forward] and [central]'),
        ("[forward]", "forward = 3\n[central]", "forward must be a table"),
        ('panel = "cell 1"', 'panle = "cell 1"', '[forward] has no key panle: did you mean "panel"?'),
        ("user=cell1", "user=cell1 password=x1y2", "connection has password: a secret stands in"),
        ("user=cell1", "colour=red", "connection has colour: there are host, hostaddr"),
        ("dbname=plant ", "", "connection has no dbname"),
        ("host=history.plant", "host", "connection is not a list of key=value"),
        (
            'connection = "host=history.plant dbname=plant user=cell1"',
            "connection = 3",
            "connection is 3",
        ),
        ("[forward]", "[forward]\nkeep_days = 0", "keep_days is 0: it must be a number of days from 1"),
        ("[forward]", "[forward]\nbatch = 2.5", "batch is 2.5: it must be a number of rows from 1"),
        ("[forward]", "[forward]\nkeep_mb = true", "keep_mb is True: it must be a number of megabytes"),
        (
            "[forward]",
            '[forward]\nstreams = ["logs"]',
            "streams is ['logs']: it must be a list of log,",
        ),
        ("[forward]", "[forward]\nstreams = []", "streams is []: it must be a list of log,"),
        ("[forward]", "[forward]\npassword_file = 1", "password_file is 1: it must be the path of"),
        ("[forward]", "[forward", "is not a TOML file"),
    ],
)
def test_a_wrong_setting_is_named(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in RIGHT
    with pytest.raises(SettingsError) as caught:
        read_forward(written(tmp_path, RIGHT.replace(old, new)))
    assert words in str(caught.value)
    assert "forward.toml" in str(caught.value)
    assert "x1y2" not in str(caught.value)  # never the secret itself


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"none\.toml \(KIOSK_FORWARD\) can't be read"):
        read_forward(tmp_path / "none.toml")


def test_both_forms_of_a_connection_string_are_read() -> None:
    by_uri = parse_connection("postgresql://cell%201@history.plant:5433/plant?sslmode=verify-full")
    by_pairs = parse_connection(
        r"user='cell 1' host = history.plant port=5433 dbname=plant sslmode=verify-full"
    )
    assert by_uri == by_pairs
    with pytest.raises(ValueError, match="a secret stands in password_file"):
        parse_connection("postgresql://cell:secret@history.plant/plant")
