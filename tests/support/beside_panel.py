"""Files beside the panel with every kind of widget: a picture and fonts."""

import re
import shutil
from pathlib import Path
from typing import Final

from tests.support.parts import ROOT

FONTS: Final = ROOT / "static/fonts"


def put_beside(folder: Path) -> None:
    """Puts the files that everything.toml names, but its interfaces, into the folder `msgs`."""
    (folder / "msgs/plan.svg").write_text("<svg/>")
    put_fonts(folder / "msgs", "letters.woff2", "bold.woff2")


def put_fonts(folder: Path, regular: str, bold: str) -> None:
    """Shipped fonts, by these names."""
    for name, weight in ((regular, 400), (bold, 700)):
        shutil.copy(FONTS / f"ibm-plex-sans-{weight}.woff2", folder / name)


def put_named_fonts(folder: Path, panel_text: str) -> None:
    """Puts a font where a panel file names one."""
    for name in re.findall(r'^(?:regular|bold) = "(.+)"', panel_text, re.MULTILINE):
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy(FONTS / "ibm-plex-sans-400.woff2", folder / name)
