"""Prints the characters that `make fonts` keeps in the Japanese font: those that the catalogue and the
shipped panels have."""

from collections.abc import Iterable
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
# Kana, punctuation and full-width forms, whether they are used or not.
ALWAYS: Final = (
    range(0x3000, 0x3004),
    range(0x3005, 0x301D),
    range(0x3041, 0x3097),
    range(0x3099, 0x3100),
    range(0xFF01, 0xFF5E),
)
KANJI: Final = range(0x4E00, 0xA000)


def files() -> Iterable[Path]:
    """The files whose texts the font must have."""
    yield ROOT / "app/system/texts/ja.po"
    yield ROOT / "app/panel.toml"
    yield from sorted((ROOT / "docs/examples").rglob("*.toml"))


def characters() -> str:
    """All characters, in their order."""
    used = set().union(*(file.read_text(encoding="utf-8") for file in files()))
    always = {chr(code) for block in ALWAYS for code in block}
    return "".join(sorted(always | {sign for sign in used if ord(sign) in KANJI}))


if __name__ == "__main__":
    print(characters())
