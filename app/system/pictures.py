"""The icons and pictures that pages may show: a part of the Lucide set, shipped in `static/icons`; the
pictures of a panel, and the shipped ones."""

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

from app.system.settings import shipped_path

if TYPE_CHECKING:
    from markupsafe import Markup

SYMBOL: Final = re.compile(r'^<symbol id="([a-z0-9-]+)">(.+)</symbol>$', re.MULTILINE)
PICTURE: Final = r"^[A-Za-z0-9_-]+\.(svg|png|jpg|jpeg|webp)$"
SHIPPED: Final = Path(__file__).with_name("shipped_pictures")


@cache
def icons() -> Mapping[str, str]:
    """Name → the elements inside its `<svg>`, drawn in lines on a square of 24 units."""
    text = (shipped_path("static") / "icons/lucide.svg").read_text(encoding="utf-8")
    return dict(SYMBOL.findall(text))


@cache
def icon(name: str) -> "Markup":
    """An icon as an element. It says nothing that the text beside it does not. KeyError for an unknown
    one."""
    from markupsafe import Markup  # who installs the panel has no packages yet

    inside = Markup(icons()[name])
    return Markup('<svg class="icon" viewBox="0 0 24 24" aria-hidden="true">{}</svg>').format(inside)


def picture_files(folder: Path) -> dict[str, Path]:
    """The files of a folder of pictures by their names."""
    files = sorted(folder.iterdir())
    return {file.name: file for file in files if re.fullmatch(PICTURE, file.name) and file.is_file()}


@cache
def shipped_pictures() -> dict[str, Path]:
    """The pictures that every panel may show, by their names."""
    return picture_files(SHIPPED)
