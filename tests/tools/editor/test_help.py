"""What the forms say of keys, in the languages of the editor."""

import re
import tomllib
from typing import Final

import pytest

from app.panel.reference.schema import WORDS
from app.tools.editor.forms import form_of, schema
from app.tools.editor.help import BETWEEN, help_in, help_texts, plain_words

LANGUAGES: Final = ("de", "ja")
NAMES: Final = re.compile(r"\{[^}]+\}|[a-z0-9]+(?:_[a-z0-9]+)+|[a-z0-9_]+/msg/[A-Za-z]+")


def descriptions() -> set[str]:
    """All that the forms and the list of parts say of tables and keys, in plain words."""
    tables = schema().values()
    texts = [*WORDS["tables"].values(), *(table.get("description", "") for table in tables)]
    texts += [key.get("description", "") for table in tables for key in table["properties"].values()]
    return {plain for text in texts if text for plain in plain_words(text).split(BETWEEN)}


@pytest.mark.parametrize("language", LANGUAGES)
def test_each_sentence_of_the_reference_is_translated(language: str) -> None:
    known = help_texts(language)
    assert descriptions() - known.keys() == set()
    assert known.keys() - descriptions() == set()


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_is_written_in_a_file_or_a_message_is_the_same_in_each_language(language: str) -> None:
    def names(text: str) -> list[str]:
        return sorted(set(NAMES.findall(text)))

    known = help_texts(language)
    assert [text for text, said in known.items() if names(text) != names(said)] == []


def test_brackets_of_a_file_are_for_its_text_and_not_for_its_form() -> None:
    assert plain_words("Of the [[place]] tables, or [1, 2]") == "Of the place tables, or [1, 2]"
    assert {text for text in descriptions() if "[[" in text and "[[0." not in text} == set()


def test_texts_of_one_key_are_translated_each() -> None:
    assert help_in("The QoS of `topic`.\n\nIs `new`.", "de") == "Die QoS von topic.\n\nIs new."


def test_what_is_not_translated_is_english() -> None:
    assert help_in("The `id` of [a thing](x.md).", "de") == "The id of a thing."
    assert help_in("Raised below this value.", "../de") == "Raised below this value."


@pytest.mark.parametrize(
    ("language", "text"),
    [
        ("en", "Raised below this value."),
        ("de", "Kommt unter diesem Wert."),
        ("ja", "この値を下回ると発生します。"),
    ],
)
def test_a_form_speaks_the_language_of_who_edits(language: str, text: str) -> None:
    tables = tomllib.loads('[[alarm]]\nid = "low"\ntopic = "/a"\nlow = 1.0\n')
    form = form_of(tables, ("alarm", 0), language=language)
    assert next(field for field in form.fields if field.key == "low").plain_help == text
