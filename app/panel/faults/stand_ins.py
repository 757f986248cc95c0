"""Stand-ins for faulty tables, so that the rest of a panel file can be checked."""

import copy
import re
from dataclasses import dataclass, field
from typing import Any, Final

from pydantic import ValidationError

from app.errors import Fault
from app.panel.base import ID, FileContext
from app.panel.faults.table_keys import widget_path
from app.panel.faults.toml_lines import Path
from app.panel.faults.wording import closest_name
from app.panel.model import Panel

TABLES: Final = ("interlock", "condition", "page", "frame", "robot", "alarm")


@dataclass(frozen=True, slots=True)
class StandIns:
    """The tables of a panel with stand-ins. `faulty` are the ids of the replaced widgets. `undecidable`
    are kinds of causes that can't be checked: the existing "interlock"s, "input"s, "control"s or
    "alarm"s, the topics that the panel "listens" to, the "action"s of conditions and alarms, the
    "group"s of alarms, or the "figure"s of robots."""

    tables: dict[str, Any]
    faulty: set[str] = field(default_factory=set)
    undecidable: set[str] = field(default_factory=set)

    def validate(self, context: FileContext) -> Panel | None:
        """The panel; None if it still has faults of shape."""
        try:
            return Panel.model_validate(self.tables, context=context)
        except ValidationError:
            return None

    def is_real(self, fault: Fault) -> bool:
        """Whether a fault is one of the file, and not caused by a stand-in."""
        return fault.cause.partition(" ")[0] not in self.undecidable


def make_stand_ins(tables: dict[str, Any], error: ValidationError) -> StandIns | None:
    """The stand-ins for the tables in `error`; None if the rest can't be checked."""
    rest = StandIns(copy.deepcopy(tables))
    for fault in error.errors():
        if path := widget_path(fault["loc"]):
            _widget(rest, tables, path)
            continue
        match fault["loc"]:
            case ("interfaces" | "distro", *_):
                return None  # all types may be different
            case ("page", int(p), "group", int(g), str(key), *_):
                rest.tables["page"][p]["group"][g].pop(key, None)
                rest.undecidable.update(("input", "control", "listens"))
            case ("page", int(p), str(key), *_):
                page = rest.tables["page"][p]
                page.pop(key, None)
                rest.tables["page"][p] = {"id": f"faulty_{p}", "title": "?"} | page
                rest.undecidable.update(("input", "control", "listens", "page"))
            case ("interlock" | "condition" as name, int(i), *_):
                stand_in = _stand_in(tables[name][i], f"{name}_{i}")
                rest.tables[name][i] = stand_in | {"topic": f"/faulty_{name}_{i}"}
                rest.undecidable.update(("listens", "action", *_unnamed("interlock", tables[name][i])))
            case ("alarm", int(i), *_):
                stand_in = _stand_in(tables["alarm"][i], str(i))
                rest.tables["alarm"][i] = {"id": stand_in["id"], "text": "?", "lost": "link"}
                unnamed = _unnamed("alarm", tables["alarm"][i])
                rest.undecidable.update(("listens", "action", "group", *unnamed))
            case ("robot", int(r), key, *_):
                if key == "overview":  # the header of the next robot may be missing below it
                    rest.undecidable.add("robot")
                names = {"name": f"?{r}", "namespace": f"/faulty_{r}"}
                rest.undecidable.update(("figure", *_unnamed("robot", tables["robot"][r])))
                rest.tables["robot"][r] = {"id": _stand_in(tables["robot"][r], str(r))["id"], **names}
            case (str(key),) if closest_name(key, ("interfaces", "distro")):
                return None
            case (str(key), *_):
                rest.tables.pop(key, None)
                rest.tables.setdefault("title", "?")
                rest.undecidable.update(("control", "state"))
                if closest_name(key, ("pictures",)):
                    rest.undecidable.add("picture")
                if closest_name(key, TABLES):
                    rest.undecidable.update(("interlock", "listens", "page", "robot", "alarm"))
                    rest.undecidable.add("group")
    return rest


def _widget(rest: StandIns, tables: dict[str, Any], path: Path) -> None:
    old: Any = tables
    around: Any = rest.tables
    for step in path[:-1]:
        old, around = old[step], around[step]
    old = old[path[-1]]
    stand_in = _stand_in(old, "_".join(str(step) for step in path if isinstance(step, int)))
    around[path[-1]] = stand_in | {"kind": "text"}
    rest.faulty.add(stand_in["id"])
    rest.undecidable.update(("listens", "control", *_unnamed("input", old)))


def _stand_in(old: Any, number: str) -> dict[str, Any]:
    """A table with the id of the replaced one, so that references to it are valid."""
    return {"id": f"faulty_{number}" if _unnamed("", old) else old["id"], "label": "?"}


def _unnamed(kind: str, old: Any) -> list[str]:
    """[kind] if the table has no valid id, else []."""
    known = old.get("id") if isinstance(old, dict) else None
    return [] if isinstance(known, str) and re.fullmatch(ID, known) else [kind]
