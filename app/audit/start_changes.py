"""What has changed from one start of the server to the next, by the names of keys. Pure."""

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from app.audit.entry import LONGEST_VALUES
from app.audit.start_files import PANEL, Manifest, without_secret
from app.toml_values import key_text, value_text

LONGEST: Final = 80  # characters of a value
MOST_ENTRIES: Final = 10  # of one start; the rest is counted
ARROW: Final = "→"
ABSENT: Final = "–"
MORE: Final = "… more"
# The groups of files whose changes are named by file; the program's are many, and its list is one.
BY_FILE: Final = ("templates", "styles", "definitions", "catalogues", "pictures", "fonts")


def flat(tables: Mapping[str, Any]) -> dict[str, str]:
    """Dotted key → its value as TOML writes it. A table of a list is named by its id, else by its
    number from 1; `… order` is the order of those with an id."""
    return dict(_flat("", tables))


def _flat(place: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _flat(f"{place}.{key_text(key)}" if place else key_text(key), inner)
    elif isinstance(value, list) and value and all(isinstance(item, Mapping) for item in value):
        names = [_name_in_list(item, number) for number, item in enumerate(value, 1)]
        for name, item in zip(names, value, strict=True):
            yield from _flat(f"{place}.{name}", item)
        yield f"{place} order", ", ".join(names)
    else:
        text = value_text(value) if isinstance(value, bool | int | float | str | list) else str(value)
        yield place, text


def _name_in_list(table: Mapping[str, Any], number: int) -> str:
    name = table.get("id")
    return key_text(name) if isinstance(name, str) and name else str(number)


def changed_keys(old: Mapping[str, str], new: Mapping[str, str]) -> dict[str, str]:
    """Key → `old → new`, in the order of the new file, then those that are gone; secrets are hidden. An
    order counts as changed only if what is in both stands otherwise."""
    names = [*new, *(name for name in old if name not in new)]
    return {
        name: f"{_shown(name, old)} {ARROW} {_shown(name, new)}"
        for name in names
        if old.get(name) != new.get(name) and not _same_order(name, old, new)
    }


def _same_order(name: str, old: Mapping[str, str], new: Mapping[str, str]) -> bool:
    if not name.endswith(" order"):
        return False
    before, after = (tables.get(name, "").split(", ") for tables in (old, new))
    common = set(before) & set(after)
    return [each for each in before if each in common] == [each for each in after if each in common]


def _shown(name: str, tables: Mapping[str, str]) -> str:
    """A value, cut and without a secret."""
    text = tables.get(name)
    if text is None:
        return ABSENT
    return _cut(without_secret(name.rpartition(".")[2], text))


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"


def parse_panel(data: bytes) -> dict[str, str] | None:
    """The keys of a panel file; None if that is no TOML."""
    try:
        return flat(tomllib.loads(data.decode("utf-8-sig")))
    except (ValueError, RecursionError):
        return None


def changes(
    old: Manifest, new: Manifest, old_panel: bytes | None, new_panel: bytes | None
) -> dict[str, str]:
    """What → `old → new`: version, settings, users with their roles, keys of the panel file, other
    files. `old_panel` is None if it is not kept."""
    own = {"version": old.version} | dict(old.settings)
    result = changed_keys(own, {"version": new.version} | dict(new.settings))
    result |= _user_changes(old.users, new.users)
    before, after = (dict(manifest.files) for manifest in (old, new))
    if _hashes(before, PANEL) != _hashes(after, PANEL):
        result |= _panel_changes(old_panel, new_panel)
    for group in BY_FILE:
        files = changed_keys(_short_hashes(before, group), _short_hashes(after, group))
        result |= {f"{group}: {name}": text for name, text in files.items()}
    for group in ("zenoh", "program"):
        if before.get(group) != after.get(group):
            result[group] = f"{_hash(before, group)} {ARROW} {_hash(after, group)}"
    return result


def _user_changes(old: Mapping[str, str] | None, new: Mapping[str, str] | None) -> dict[str, str]:
    """Users and tokens that are new, gone, or have other rights. None: not known."""
    if old is None or new is None:
        return {}
    names = [*new, *(name for name in old if name not in new)]
    texts = {name: (old.get(name, ABSENT), new.get(name, ABSENT)) for name in names}
    return {
        name: f"{_cut(before)} {ARROW} {_cut(after)}"
        for name, (before, after) in texts.items()
        if before != after
    }


def _panel_changes(old_panel: bytes | None, new_panel: bytes | None) -> dict[str, str]:
    old = parse_panel(old_panel) if old_panel is not None else None
    new = parse_panel(new_panel) if new_panel is not None else None
    if old is None or new is None:
        return {"panel file": "changed; one of the two is not kept, so its keys are not known"}
    return changed_keys(old, new) or {"panel file": "changed, but no key: comments or its form"}


def _hashes(files: Mapping[str, Mapping[str, str]], group: str) -> list[str]:
    return sorted(files.get(group, {}).values())


def _short_hashes(files: Mapping[str, Mapping[str, str]], group: str) -> dict[str, str]:
    return {name: digest[:12] for name, digest in files.get(group, {}).items()}


def _hash(files: Mapping[str, Mapping[str, str]], group: str) -> str:
    """The hash of a group with one file."""
    return "".join(digest[:12] for digest in files.get(group, {}).values()) or ABSENT


def in_entries(changed: Mapping[str, str]) -> Sequence[dict[str, str]]:
    """The changes as the values of as few entries as hold them; the last one counts what is left."""
    batches: list[dict[str, str]] = [{}]
    for number, (name, text) in enumerate(changed.items()):
        batch = batches[-1]
        room = LONGEST_VALUES - len(MORE) - 20
        if batch and len(json.dumps(batch | {name: text}, ensure_ascii=False)) > room:
            if len(batches) == MOST_ENTRIES:
                batch[MORE] = str(len(changed) - number)
                break
            batch = {}
            batches.append(batch)
        batch[name] = text
    return [batch for batch in batches if batch]
