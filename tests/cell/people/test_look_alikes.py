"""Names that a person reads as another one, and names that only seem so."""

import pytest

from app.cell.people.look_alikes import look_alike, mixes_scripts


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("Сосо", "Coco"),  # Cyrillic
        ("ΚΑΤΟ", "KATO"),  # Greek
        ("Line 1O", "Line 10"),
        ("IIse", "Ilse"),
        ("Bern", "Bem"),
        ("Ｓａｔｏ", "Sato"),  # wide
        ("M.Sato", "M. Sato"),
    ],
)
def test_a_name_that_looks_like_another_one_is_found(name: str, other: str) -> None:
    assert look_alike(name, ("J. Brandt", other)) == other


@pytest.mark.parametrize(
    "name", ["Müller", "Muller", "Anna", "Анна", "佐藤", "サトウ", "Иванов", "Line 2", "Ål", "Łukasz"]
)
def test_other_names_are_other_names(name: str) -> None:
    others = ["Mueller", "Änna", "Hanna", "加藤", "サドウ", "Петров", "Line 1", "Al", "Lukasz", name]
    assert look_alike(name, others) == ""


@pytest.mark.parametrize(
    ("name", "mixed"),
    [
        ("Аnna", True),  # Cyrillic and Latin
        ("Annα", True),  # Greek
        ("佐藤 Anna", False),
        ("田中さん", False),
        ("コーヒー係", False),
        ("김 Anna", False),
        ("Ｓａｔｏ さとう", False),
        ("M. O'Neil-Ångström 2", False),
        ("Иванов И.", False),
        ("李さん 김", True),
    ],
)
def test_scripts_of_one_language_may_be_mixed_in_a_name(name: str, mixed: bool) -> None:
    assert mixes_scripts(name) is mixed
