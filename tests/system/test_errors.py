"""The error tree: what it is called, which status it has, how it reads."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.system import errors
from app.system.errors import Fault, FieldError, KioskError, PanelError, os_error_text
from app.system.texts import say


@pytest.mark.parametrize(
    ("name", "status"),
    [("FieldError", 422), ("InputError", 422), ("NotFound", 404), ("LinkError", 503)],
)
def test_an_error_that_reaches_a_client_has_its_http_status(name: str, status: int) -> None:
    assert getattr(errors, name).status == status


@pytest.mark.parametrize("name", ["SettingsError", "PanelError", "InterfaceError", "DecodeError"])
def test_an_error_that_no_client_is_to_blame_for_is_500(name: str) -> None:
    assert getattr(errors, name).status == 500


def below(kind: type[KioskError]) -> Iterator[type[KioskError]]:
    for subclass in kind.__subclasses__():
        yield subclass
        yield from below(subclass)


def test_the_tree_in_the_docstring_has_every_error() -> None:
    assert errors.__doc__ is not None
    drawn = [line.split()[1] for line in errors.__doc__.splitlines() if "──" in line]
    own = (kind.__name__ for kind in below(KioskError) if kind.__module__ == errors.__name__)
    assert sorted(drawn) == sorted(own)


def test_a_fault_reads_place_then_message() -> None:
    assert str(Fault("page[0].widget[2].topic", "is missing")) == "page[0].widget[2].topic: is missing"


def test_a_fault_of_the_whole_file_has_no_place() -> None:
    assert str(Fault("", "No such file or directory")) == "No such file or directory"


def test_a_panel_error_lists_the_file_and_each_fault_on_a_line() -> None:
    error = PanelError("cell.toml", (Fault("title", "is missing"), Fault("page", "is missing")))
    assert str(error).splitlines() == [
        "cell.toml can't be used:",
        "  title: is missing",
        "  page: is missing",
    ]


@pytest.mark.parametrize(("field", "text"), [("a.b[1]", "a.b[1]: too long"), ("", "too long")])
def test_a_field_error_names_its_field(field: str, text: str) -> None:
    assert str(FieldError(field, "too long")) == text


def test_an_error_of_the_system_is_a_sentence_of_the_catalogue() -> None:
    assert os_error_text(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))) == say("disk_full")


def test_an_error_of_the_system_names_its_file() -> None:
    with pytest.raises(OSError, match="/gone/away") as raised:
        Path("/gone/away").read_bytes()
    assert os_error_text(raised.value) == say(
        "with_file", why=say("disk_file_not_found"), file="/gone/away"
    )


def test_a_rare_error_of_the_system_is_in_its_own_words() -> None:
    assert os_error_text(OSError(errno.EMFILE, "Too many open files")) == "too many open files"
    assert os_error_text(OSError("no number")) == "no number"
