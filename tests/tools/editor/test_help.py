"""What the forms say of keys, in the languages of the editor."""

import tomllib

import pytest

from app.tools.editor.forms import form_of, schema
from app.tools.editor.help import help_in, help_texts, plain_words

LANGUAGES = ("de", "ja")


def descriptions() -> set[str]:
    """All that the reference says, in plain words."""
    tables = schema().values()
    texts = [table.get("description", "") for table in tables]
    texts += [key.get("description", "") for table in tables for key in table["properties"].values()]
    return {plain_words(text) for text in texts if text}


@pytest.mark.parametrize("language", LANGUAGES)
def test_each_translation_is_of_a_sentence_of_the_reference(language: str) -> None:
    assert help_texts(language).keys() - descriptions() == set()


def test_both_languages_have_the_same_sentences() -> None:
    german, japanese = map(help_texts, LANGUAGES)
    assert german.keys() == japanese.keys()
    assert len(german) > 250


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
