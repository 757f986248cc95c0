"""Sets of fonts as installed on kiosks, one set per browser."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

DEJAVU: Final = "/usr/share/fonts/truetype/dejavu"
NOTO: Final = "/usr/share/fonts/truetype/noto"
CJK: Final = "/usr/share/fonts/opentype/noto"

SETS: Final[Mapping[str, Sequence[str]]] = {
    "noto": (NOTO, CJK, DEJAVU),
    "dejavu": (DEJAVU,),  # a bare Debian
    "cjk": (CJK, DEJAVU),  # the same, and what Japanese needs
}


WITHOUT_OWN: Final = " without the panel's own"  # behind the name of a set


def fonts_file(name: str, folder: Path) -> Path:
    """A fontconfig file with only one of the sets."""
    folders = "".join(f"<dir>{folder}</dir>" for folder in SETS[name.removesuffix(WITHOUT_OWN)])
    path = folder / "fonts.conf"
    path.write_text(
        '<?xml version="1.0"?><!DOCTYPE fontconfig SYSTEM "fonts.dtd">'
        f"<fontconfig>{folders}<cachedir>{folder}</cachedir></fontconfig>"
    )
    return path
