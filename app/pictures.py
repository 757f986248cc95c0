"""The pictures of a panel, which its pages may show."""

import re
from pathlib import Path
from typing import Final

PICTURE: Final = r"^[A-Za-z0-9_-]+\.(svg|png|jpg|jpeg|webp)$"


def picture_files(folder: Path) -> dict[str, Path]:
    """The files of a folder of pictures by their names."""
    files = sorted(folder.iterdir())
    return {file.name: file for file in files if re.fullmatch(PICTURE, file.name) and file.is_file()}
