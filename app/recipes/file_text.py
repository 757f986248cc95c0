"""The text of a recipe's file, in TOML, and a recipe from it. Pure."""

import math
import tomllib
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any, Final, get_args

from app.i18n import Text, say
from app.recipes.recipe import LONGEST_NAME, MAX_VERSIONS, Act, BrokenRecipe, Recipe, Version
from app.toml_values import key_text, value_text

MOST_BYTES: Final = 1_000_000  # of a file
MAX_DEPTH: Final = 4  # of lists and tables in a value
HEAD: Final = (
    "# A recipe of the operator panel. It is changed by the panel: stop that before you edit it.\n"
)
ACTS: Final = get_args(Act)


class RecipeFileError(ValueError):
    """Why a text is no recipe."""

    def __init__(self, reason: Text) -> None:
        super().__init__(str(reason))
        self.reason = reason


def recipe_text(recipe: Recipe) -> str:
    """The file of a recipe: its versions, the newest first. The oldest are left out if it would be too
    long."""
    versions = list(recipe.versions)
    while True:
        text = HEAD + "".join(
            line for version in reversed(versions) for line in _version_lines(version)
        )
        if len(text.encode()) <= MOST_BYTES or len(versions) == 1:
            return text
        versions = versions[len(versions) // 2 :]


def recipe_of(recipe_id: str, content: bytes) -> Recipe | BrokenRecipe:
    """The recipe in a file, or why it is none."""
    try:
        return Recipe(recipe_id, _versions(content))
    except RecipeFileError as error:
        return BrokenRecipe(recipe_id, error.reason)


def _versions(content: bytes) -> tuple[Version, ...]:
    if len(content) > MOST_BYTES:
        raise RecipeFileError(say("recipe_file_too_long"))
    try:
        tables = tomllib.loads(content.decode())
    except (ValueError, RecursionError) as error:
        raise RecipeFileError(say("recipe_file_no_toml", why=str(error)[:200])) from None
    rows = tables.get("version")
    if not isinstance(rows, list) or not rows or len(rows) > MAX_VERSIONS:
        raise RecipeFileError(say("recipe_file_incomplete", key="version"))
    versions = sorted((_version(row) for row in rows), key=lambda version: version.number)
    if len({version.number for version in versions}) < len(versions):
        raise RecipeFileError(say("recipe_file_incomplete", key="number"))
    return tuple(versions)


def _version(row: Any) -> Version:
    kinds: Mapping[str, type[Any]] = {
        "number": int, "at": datetime, "by": str, "act": str, "name": str, "values": dict,
    }  # fmt: skip
    if not isinstance(row, dict):
        raise RecipeFileError(say("recipe_file_incomplete", key="version"))
    for key, kind in kinds.items():
        if not isinstance(row.get(key), kind) or isinstance(row[key], bool):
            raise RecipeFileError(say("recipe_file_incomplete", key=key))
    at, act, name = row["at"], row["act"], row["name"]
    if row["number"] < 1 or act not in ACTS or not 0 < len(name) <= LONGEST_NAME or at.tzinfo is None:
        raise RecipeFileError(say("recipe_file_incomplete", key="version"))
    for key, value in row["values"].items():
        if not is_plain(value):
            raise RecipeFileError(say("recipe_file_incomplete", key=key))
    return Version(row["number"], at.timestamp(), row["by"], act, name, row["values"])


def is_plain(value: Any, depth: int = 0) -> bool:
    """Whether a value can be kept: what TOML and JSON both have."""
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, bool | int | str):
        return True
    inner = value.values() if isinstance(value, Mapping) else value
    if not isinstance(value, Mapping | list | tuple) or depth == MAX_DEPTH:
        return False
    return all(is_plain(item, depth + 1) for item in inner)


def _version_lines(version: Version) -> Iterator[str]:
    at = datetime.fromtimestamp(version.at, UTC).isoformat(timespec="milliseconds")
    yield "\n[[version]]\n"
    yield f"number = {version.number}\nat = {at}\nby = {value_text(version.by)}\n"
    yield f"act = {value_text(version.act)}\nname = {value_text(version.name)}\n[version.values]\n"
    yield from (f"{key_text(name)} = {value_text(value)}\n" for name, value in version.values.items())
