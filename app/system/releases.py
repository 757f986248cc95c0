"""A newer release in a folder, signed with a pinned key: what is there to be installed."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.system.errors import SettingsError
from app.system.minisign import check_signed, parse_keys
from app.system.printable import one_line

WHEEL: Final = re.compile(r"operator_panel-([0-9][0-9A-Za-z.+!]*)-.*\.whl")
VERSION: Final = re.compile(r"([0-9]+(?:\.[0-9]+)*)[.]?(dev|a|b|rc|post)?([0-9]+)?")
SUFFIXES: Final = {"dev": 0, "a": 1, "b": 2, "rc": 3, "": 4, "post": 5}


@dataclass(frozen=True, slots=True)
class NewRelease:
    """The wheel of a newer release; `fault` is why `operator-panel update` would not take it, "" if it
    would, and `signed` what its signature says."""

    file: Path
    version: str
    signed: str = ""
    fault: str = ""


def version_key(version: str) -> tuple[tuple[int, ...], int, int]:
    """Orders versions such as "0.9.1", "0.10.0rc1" and "0.10.0": the numbers, then what stands behind
    them and its number."""
    match = VERSION.match(version.lower())
    if match is None:
        return (), 0, 0
    numbers = [int(number) for number in match[1].split(".")]
    while numbers and not numbers[-1]:
        numbers.pop()  # 1.0 is 1
    return tuple(numbers), SUFFIXES.get(match[2] or "", 0), int(match[3] or 0)


def newest_release(folder: Path, version: str, keys: Path) -> NewRelease | None:
    """The newest wheel in the folder that is newer than `version`; None without one. One whose
    signature does not fit is told only if there is none whose does. Blocks."""
    try:
        names = sorted(folder.iterdir())
    except OSError:
        return None
    newer = [
        (version_key(name[1]), file, name[1])
        for file in names
        if (name := WHEEL.fullmatch(file.name)) and version_key(name[1]) > version_key(version)
    ]
    checked = [_checked(file, own, keys) for _, file, own in sorted(newer, reverse=True)]
    return next((each for each in checked if not each.fault), checked[0] if checked else None)


def _checked(file: Path, version: str, keys: Path) -> NewRelease:
    try:
        text = keys.read_text(encoding="utf-8", errors="replace")
        return NewRelease(file, version, check_signed(file, parse_keys(text, str(keys))))
    except SettingsError as error:
        return NewRelease(file, version, fault=str(error))
    except OSError as error:
        fault = f"{error.filename}: {error.strerror}"
        return NewRelease(file, version, fault=one_line(fault))
