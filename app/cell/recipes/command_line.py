"""Changes of recipes by the command line, for the log of the server that runs or starts next.

`recipes/changes.json` lists them by number, with the old and new values. A change is listed before its
recipe is written: one without that version on the disk was cut off, and did not happen.
"""

import json
import logging
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from app.cell.recipes.book import write_file
from app.cell.recipes.recipe import Difference, Recipe, differences, differences_text
from app.panel.widgets.recipe_load import RecipeLoad
from app.records.entry import Entry, Origin, new_entry
from app.system.texts import TextLike, say

log = logging.getLogger("kiosk.recipes")

NAME: Final = "changes.json"
LOGGED: Final = "changes.logged"  # the number of the last change that is in the operator's log
MOST_KEPT: Final = 1000
ACTION: Final = "recipe_import"

Stamp = tuple[int, int, int]  # of a version of the file


@dataclass(frozen=True, slots=True)
class LineChange:
    """The import of one recipe: `version` is its new one, `at` ISO 8601, `by` the system account; `old`
    and `new` have the values that differ."""

    number: int
    at: str
    by: str
    set: str
    recipe: str
    name: str
    version: int
    old: Mapping[str, Any]
    new: Mapping[str, Any]

    @property
    def differences(self) -> list[Difference]:
        return [Difference(name, self.old.get(name), new) for name, new in self.new.items()]


class LineChanges:
    """The file of one data folder. The lock of the recipes' folder has to be held for `add`."""

    def __init__(self, folder: Path) -> None:
        """`folder` is that of all sets."""
        self._path = folder / NAME
        self._logged = folder / LOGGED

    def stamp(self) -> Stamp | None:
        """Changes with each version of the file; None without a file."""
        try:
            about = self._path.stat()
        except OSError:
            return None
        return about.st_mtime_ns, about.st_ino, about.st_size

    def read(self) -> list[LineChange]:
        """The changes, the oldest first; none without a file, or where it can't be read."""
        try:
            rows: Any = json.loads(self._path.read_text(encoding="utf-8"))
            return [LineChange(**row) for row in rows["changes"]]
        except FileNotFoundError:
            return []
        except (OSError, ValueError, KeyError, TypeError) as error:
            log.error("%s can not be read: %s", self._path, error)
            return []

    def add(
        self, load: RecipeLoad, known: Mapping[str, Recipe], puts: Iterable[Recipe], by: str
    ) -> None:
        """Lists recipes that are about to be written; `known` are those of the set before. OSError if
        the disk refuses it."""
        changes = self.read()
        fields = [field.id for field in load.fields]
        for recipe in puts:
            before = known[recipe.id].values if recipe.id in known else {}
            changed = differences(fields, before, recipe.values)
            changes.append(
                LineChange(
                    number=changes[-1].number + 1 if changes else self.logged() + 1,
                    at=datetime.fromtimestamp(recipe.now.at, UTC).isoformat(timespec="seconds"),
                    by=by,
                    set=load.id,
                    recipe=recipe.id,
                    name=recipe.name,
                    version=recipe.now.number,
                    old={change.field: change.old for change in changed},
                    new={change.field: change.new for change in changed},
                )
            )
        rows = [asdict(change) for change in changes[-MOST_KEPT:]]
        text = json.dumps({"changes": rows}, ensure_ascii=False, indent=1)
        write_file(self._path, text.encode())

    def logged(self) -> int:
        """The number of the last change that is in the operator's log; 0 for none."""
        try:
            return int(self._logged.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return 0

    def set_logged(self, number: int) -> None:
        """Keeps it; OSError if the disk refuses it."""
        write_file(self._logged, f"{number}\n".encode())


def line_entry(change: LineChange, load: RecipeLoad | None) -> Entry:
    """The entry of the operator's log; `load` is the set, None if the panel has it no more."""
    label: TextLike = change.set if load is None else load.label
    fields = () if load is None else load.fields
    changes = differences_text(fields, change.differences) or say("recipe_no_change")
    reason = say(
        "log_recipe_command_line",
        set=label, name=change.name, by=change.by, at=change.at, changes=changes,
    )  # fmt: skip
    values = {
        "set": change.set, "recipe": change.recipe, "version": change.version, "at": change.at,
        "old": dict(change.old), "new": dict(change.new),
    }  # fmt: skip
    origin = Origin(address="", who=change.by)
    return new_entry("recipe", origin, values, reason, action=ACTION, outcome="succeeded")


def account() -> str:
    """The system account that runs the command line."""
    import getpass

    return os.environ.get("SUDO_USER") or getpass.getuser()
