"""A recipe with its history, and the names that it may have. Pure."""

import re
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from app.i18n import Text, TextLike, say
from app.panel.values import same_value

MAX_RECIPES: Final = 200  # of a set
MAX_VERSIONS: Final = 50  # of a recipe; the oldest are dropped
LONGEST_NAME: Final = 60
ID: Final = re.compile(r"[a-z0-9][a-z0-9_]{0,63}")

Values = Mapping[str, Any]
Act = Literal["created", "saved", "renamed", "restored", "imported"]


@dataclass(frozen=True, slots=True)
class Version:
    """What a recipe was after one change: `number` counts its changes from 1 on, `at` is when (seconds
    since the epoch), `by` who made it."""

    number: int
    at: float
    by: str
    act: Act
    name: str
    values: Values


@dataclass(frozen=True, slots=True)
class Recipe:
    """A recipe; the last of its `versions` is what it is now."""

    id: str
    versions: tuple[Version, ...]

    @property
    def now(self) -> Version:
        return self.versions[-1]

    @property
    def name(self) -> str:
        return self.now.name

    @property
    def values(self) -> Values:
        return self.now.values

    def version(self, number: int) -> Version | None:
        """One of its versions; None if it is not kept."""
        return next((version for version in self.versions if version.number == number), None)

    def changed(
        self, act: Act, at: float, by: str, *, name: str = "", values: Values | None = None
    ) -> "Recipe":
        """The recipe after a change; without `name` and `values` those stay."""
        kept = dict(self.values if values is None else values)
        new = Version(self.now.number + 1, at, by, act, name or self.name, kept)
        return replace(self, versions=(*self.versions, new)[-MAX_VERSIONS:])


@dataclass(frozen=True, slots=True)
class BrokenRecipe:
    """A file that can't be read as a recipe, and why."""

    id: str
    reason: TextLike


@dataclass(frozen=True, slots=True)
class Difference:
    """The value of one field before and after; None for none."""

    field: str
    old: Any = None
    new: Any = None


def new_recipe(recipe_id: str, act: Act, at: float, by: str, name: str, values: Values) -> Recipe:
    """A recipe with its first version."""
    return Recipe(recipe_id, (Version(1, at, by, act, name, dict(values)),))


def differences(fields: Iterable[str], old: Values, new: Values) -> list[Difference]:
    """The fields whose values differ."""
    return [
        Difference(name, old.get(name), new.get(name))
        for name in fields
        if (name in old) != (name in new) or not same_value(old.get(name), new.get(name))
    ]


def clean_name(text: str) -> str:
    """A typed name as it is kept: without spaces at its ends, one between words."""
    return " ".join(unicodedata.normalize("NFC", text).split())


def name_fault(name: str, taken: Iterable[str]) -> Text | None:
    """Why a clean name can't be given; `taken` are those of the other recipes."""
    if not name:
        return say("recipe_name_empty")
    if len(name) > LONGEST_NAME:
        return say("recipe_name_too_long", most=LONGEST_NAME)
    if not name.isprintable():
        return say("recipe_name_unprintable")
    if name.casefold() in {other.casefold() for other in taken}:
        return say("recipe_name_taken", name=name)
    return None


def id_for(name: str, taken: Iterable[str]) -> str:
    """An id of a-z, 0-9 and "_" for a name, which also names its file: no path is made of what was
    typed."""
    plain = unicodedata.normalize("NFKD", name).replace("×", "x").lower()
    start = (
        re.sub(r"[^a-z0-9]+", "_", plain.encode("ascii", "ignore").decode()).strip("_")[:50] or "recipe"
    )
    known, number, made = set(taken), 1, start
    while made in known:
        number += 1
        made = f"{start}_{number}"
    return made
