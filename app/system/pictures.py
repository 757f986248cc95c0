"""The pictures that pages may show: those of a panel, and the shipped ones."""

import re
from functools import cache
from pathlib import Path
from typing import Final

PICTURE: Final = r"^[A-Za-z0-9_-]+\.(svg|png|jpg|jpeg|webp)$"
SHIPPED: Final = Path(__file__).with_name("shipped_pictures")


def picture_files(folder: Path) -> dict[str, Path]:
    """The files of a folder of pictures by their names."""
    files = sorted(folder.iterdir())
    return {file.name: file for file in files if re.fullmatch(PICTURE, file.name) and file.is_file()}


@cache
def shipped_pictures() -> dict[str, Path]:
    """The pictures that every panel may show, by their names."""
    return picture_files(SHIPPED)
