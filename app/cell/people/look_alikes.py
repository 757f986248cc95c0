"""Names that a person reads as another one, such as "Аnna" with a Cyrillic A: they would stand in the
operator's log, and on a tile, as somebody else. Pure.

Source: Unicode Technical Standard 39, chapters 4 (confusable detection: names with the same skeleton)
and 5.1 (single-script names, with Japanese, Chinese and Korean as one script each).
"""

import unicodedata
from collections.abc import Iterable
from typing import Final

from app.cell.people.users import name_key

# Letters that look like those of the Latin script, from confusables.txt: Cyrillic, Greek and Armenian.
_LIKE_LATIN: Final = {
    "АВЕЅІЈКМНОРСТУХ": "ABESlJKMHOPCTYX",
    "аеіјорсѕухһԁԛԝ": "aeijopcsyxhdqw",
    "ΑΒΕΖΗΙΚΜΝΟΡΤΥΧ": "ABEZHlKMNOPTYX",
    "αινορυχγ": "aivopuxy",
    "ՍօոսցհՏ": "UonuqhS",
    "I1|0": "lllO",
}
_TO_LATIN: Final = {
    ord(letter): like
    for letters, likes in _LIKE_LATIN.items()
    for letter, like in zip(letters, likes, strict=True)
}
LETTERS: Final = frozenset({"Lu", "Ll", "Lt", "Lo"})
# Scripts that one name may mix. The name of a letter in `unicodedata` begins with its script.
_TOGETHER: Final = (
    frozenset({"LATIN", "CJK", "HIRAGANA", "KATAKANA", "HALFWIDTH"}),
    frozenset({"LATIN", "CJK", "HANGUL"}),
    frozenset({"LATIN", "CJK", "BOPOMOFO"}),
)


def mixes_scripts(name: str) -> bool:
    """Whether the letters are of scripts that no language writes in one name, such as Latin with
    Cyrillic."""
    letters = unicodedata.normalize("NFKC", name)
    scripts = {_script(letter) for letter in letters if unicodedata.category(letter) in LETTERS}
    return len(scripts) > 1 and not any(scripts <= together for together in _TOGETHER)


def look_alike(name: str, others: Iterable[str]) -> str:
    """The first of the other names that a person would take this one for; "" for none. The same name
    is none."""
    skeleton = _skeleton(name)
    return next((other for other in others if other != name and _skeleton(other) == skeleton), "")


def _skeleton(name: str) -> str:
    """Equal for names that look alike."""
    compatible = unicodedata.normalize("NFKC", name)
    return name_key("".join(compatible.translate(_TO_LATIN).split()).replace("rn", "m"))


def _script(letter: str) -> str:
    return unicodedata.name(letter, "").partition(" ")[0]
