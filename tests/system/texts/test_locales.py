"""Numbers and times as each language writes them."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.system.clock import format_datetime, format_time
from app.system.texts import date_and_time, number, render, say, sentences, text_in, time_of_day
from app.system.texts.catalogue import ENGLISH, catalogues_in, files
from app.system.texts.check import faults
from app.system.texts.locales import OWN_NAMES, babel_name, own_name
from tests.support.catalogues import write_catalogue


@pytest.fixture(autouse=True)
def _catalogues(tmp_path: Path) -> Iterator[None]:
    for language in ("de", "fr", "fi", "ja", "qps"):
        write_catalogue(tmp_path, language, {"age_seconds": "{number} s"})
    with catalogues_in(tmp_path):
        yield


@pytest.mark.parametrize(
    ("text", "language", "shown"),
    [
        ("-1,234.5", "en", "−1,234.5"),
        ("-1,234.5", "ja", "−1,234.5"),
        ("-1,234.5", "de", "−1.234,5"),
        ("-1,234.5", "fr", "−1\u202f234,5"),
        ("-0.5", "fi", "\u22120,5"),
        ("1e-07", "de", "1e−07"),
        ("NaN", "de", "NaN"),
        ("0.5", "qps", "0.5"),
    ],
)
def test_a_number_is_written_as_its_reader_does(text: str, language: str, shown: str) -> None:
    assert render(number(text, "mm"), language) == f"{shown} mm"


def test_a_number_that_all_write_alike_is_a_text() -> None:
    assert (number("42"), number("42", "mm")) == ("42", "42 mm")


def test_a_number_in_a_sentence_comes_back_from_json() -> None:
    text = say("interlock_stale", topic="/a", limit=number("0.5"))
    assert text_in(json.dumps(text.as_json())) == text
    assert "0,5 s" in render(text, "de")
    assert "0.5 s" in render(text)


def test_times_and_dates_are_written_as_their_reader_does() -> None:
    at = date_and_time("2026-11-05 09:02:11")
    read = {language: render(at, language) for language in ("en", "de", "ja", "fi", "qps")}
    assert read == {
        "en": "2026-11-05 09:02:11",
        "de": "05.11.2026 09:02:11",
        "ja": "2026/11/05 09:02:11",
        "fi": "5.11.2026 09.02.11",
        "qps": "2026-11-05 09:02:11",
    }
    assert render(time_of_day("09:02:11"), "fi") == "09.02.11"


@pytest.mark.usefixtures("utc")
def test_the_clock_gives_values_that_are_rendered_later() -> None:
    assert render(format_time(61.9), "de") == "00:01:01"
    assert render(format_datetime(61.0), "de") == "01.01.1970 00:01:01"


def test_a_language_is_named_in_itself() -> None:
    assert [own_name(tag) for tag in ("en", "ja", "de", "fr", "pt-BR", "qps")] == [
        "English",
        "日本語",
        "Deutsch",
        "Français",
        "Português (Brasil)",
        "qps",
    ]
    assert {tag: babel_name(tag) for tag in OWN_NAMES} == OWN_NAMES


def test_a_catalogue_whose_language_has_no_name_or_another_decimal_sign_is_found(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "more"
    folder.mkdir()
    for language in ("de", "xyz"):
        write_catalogue(folder, language, sentences(ENGLISH))
    known = {ENGLISH: files()[ENGLISH], "de": folder / "de.po", "xyz": folder / "xyz.po"}
    assert list(faults(known)) == [
        'de.po: keypad_decimal is ".", and numbers in this language have ","',
        'xyz.po: "xyz" has no name: it must be a tag of BCP 47 that CLDR knows, like pt-BR',
    ]
