"""The fields of forms: what is described is what is checked."""

from typing import Any

import pytest

from app.system.errors import InputError
from app.web.requests import SINCE, FormFields

FORM = FormFields(
    {"id": {"pattern": "^[a-z]{1,9}$"}, "way": {"enum": ["pin", "badge"]}, "_since": SINCE},
    {r"^group-": {"maxLength": 4}},
)
EMPTY = {"id": "", "way": "", "_since": "", "group-a": ""}


def test_an_empty_field_is_none() -> None:
    assert FORM.filled(EMPTY) == {}
    assert FORM.filled(EMPTY | {"id": "abc"}) == {"id": "abc"}


def test_the_description_permits_what_is_taken() -> None:
    schema: dict[str, Any] = FORM.schema
    assert schema["properties"]["id"] == {"type": "string", "pattern": "^$|^[a-z]{1,9}$"}
    assert schema["properties"]["way"] == {"type": "string", "enum": ["", "pin", "badge"]}
    assert schema["patternProperties"] == {r"^group-": {"type": "string", "maxLength": 4}}
    assert schema["additionalProperties"] is False


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("id", "ABC"),
        ("id", "abc\n"),
        ("way", "password"),
        ("group-a", "false"),
        ("_since", "nan"),
        ("_since", "1e5"),
        ("other", ""),
    ],
)
def test_what_is_not_described_is_refused(name: str, text: str) -> None:
    with pytest.raises(InputError, match=f'"{name}"' if name == "other" else f"^{name}"):
        FORM.filled({name: text})


def test_values_of_inputs_may_be_empty() -> None:
    form = FormFields({"-id": {"pattern": "^[a-z]+$"}}, has_values=True)
    assert form.filled({"-id": "", "note": ""}) == {"note": ""}
    assert form.schema["additionalProperties"] == {"type": "string"}
