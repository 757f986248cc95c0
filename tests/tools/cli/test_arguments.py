"""Types of arguments: what they take, and the sentence for what they do not."""

import argparse
from collections.abc import Callable

import pytest

from app.tools.cli.arguments import port, port_to_listen, seconds, whole_number
from app.tools.cli.command import main


@pytest.mark.parametrize(
    ("type_", "text", "value"),
    [
        (port, "1", 1),
        (port, "65535", 65535),
        (port_to_listen, "0", 0),
        (whole_number(2), "2", 2),
        (seconds(), "0.5", 0.5),
        (seconds(600), "600", 600),
    ],
)
def test_valid_argument_is_a_number(type_: Callable[[str], float], text: str, value: float) -> None:
    assert type_(text) == value


@pytest.mark.parametrize(
    ("type_", "text", "sentence"),
    [
        (port, "0", '"0" is not a port: 1 to 65535'),
        (port, "65536", '"65536" is not a port: 1 to 65535'),
        (port, "٣", "is not a port"),
        (port_to_listen, "-1", '"-1" is not a port: 1 to 65535, or 0 for any that is free'),
        (whole_number(2), "1", '"1" is not a whole number from 2 on'),
        (whole_number(1), "1.5", '"1.5" is not a whole number from 1 on'),
        (seconds(), "0", '"0" is not a time: a number of seconds above 0'),
        (seconds(), "inf", "is not a time"),
        (seconds(), "nan", "is not a time"),
        (seconds(600), "601", '"601" is not a time: up to 600 seconds'),
    ],
)
def test_invalid_argument_is_reported_with_a_sentence(
    type_: Callable[[str], float], text: str, sentence: str
) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as raised:
        type_(text)
    assert sentence in str(raised.value)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["hz", "/speed", "--window", "1"], '"1" is not a whole number from 2 on'),
        (["echo", "/speed", "--truncate-length", "-3"], '"-3" is not a whole number from 1 on'),
    ],
)
def test_a_count_that_is_none_is_a_sentence(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(words)
    assert sentence in capsys.readouterr().err
