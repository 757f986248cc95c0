"""`python -m app.i18n`: checks each catalogue: whether it is complete and has each code once, its
translations have the placeholders of the English sentences, its language has a name, and the keypad has
the decimal sign of its numbers.

Exit status: 0 without a fault, 1 with a line for each fault.
"""

import re
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from string import Formatter
from typing import Final

from babel.messages.pofile import PoFileError

from app.system.texts.catalogue import ENGLISH, files, translations
from app.system.texts.locales import own_name, symbols

DECIMAL: Final = "keypad_decimal"
_CODE: Final = re.compile(r'^msgid "(.+)"$', re.MULTILINE)


def faults(catalogues: Mapping[str, Path]) -> Iterator[str]:
    """The faults of the catalogues, each with its language; English is the reference."""
    english = translations(catalogues[ENGLISH])
    for language, path in catalogues.items():
        try:
            translated = translations(path)
        except (PoFileError, UnicodeDecodeError) as error:
            yield f"{path.name}: {error}"
            continue
        codes = Counter(_CODE.findall(path.read_text(encoding="utf-8")))
        yield from (f"{path.name}: {code} is there {n} times" for code, n in codes.items() if n > 1)
        yield from (
            f"{path.name}: {code} is not translated" for code in english if code not in translated
        )
        yield from (f"{path.name}: {fault}" for fault in _language_faults(language, translated))
        for code, sentence in translated.items():
            if fault := _fault(english.get(code), sentence):
                yield f"{path.name}: {code} {fault}"


def _language_faults(language: str, translated: Mapping[str, str]) -> Iterator[str]:
    if own_name(language) == language:
        yield f'"{language}" has no name: it must be a tag of BCP 47 that CLDR knows, like pt-BR'
    sign, decimal = translated.get(DECIMAL), symbols(language).decimal
    if sign is not None and sign != decimal:
        yield f'{DECIMAL} is "{sign}", and numbers in this language have "{decimal}"'


def _fault(english: str | None, sentence: str) -> str:
    if english is None:
        return "is no code of the English catalogue"
    try:
        names, wanted = placeholders(sentence), placeholders(english)
    except ValueError as error:
        return f"can't be filled in: {error}"
    return "" if names == wanted else f"has {_listed(names)}, and English has {_listed(wanted)}"


def placeholders(sentence: str) -> frozenset[str]:
    """The names between braces in a sentence; ValueError for a single brace."""
    parsed = Formatter().parse(sentence)
    return frozenset(
        name + (f"!{conversion}" if conversion else "") + (f":{form}" if form else "")
        for _, name, form, conversion in parsed
        if name is not None
    )


def _listed(names: frozenset[str]) -> str:
    return ", ".join(f"{{{name}}}" for name in sorted(names)) or "nothing"


def main() -> int:
    reported = list(faults(files()))
    for fault in reported:
        print(fault, file=sys.stderr)
    return 1 if reported else 0


if __name__ == "__main__":
    sys.exit(main())
