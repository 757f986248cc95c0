"""What is read of typed texts, for the server and the scripts alike."""

import random
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from app.panel.numbers import decimal_text
from app.system.texts.locales import number_in

LANGUAGES: Final = ("en", "de", "ja")
SIGNS: Final = "0123456789.,-−+e '０１５９．，－＋　ー。、٣x\xa0\u202f"


class Typed(NamedTuple):
    """A text, in what language, and the number that it is; None for none."""

    text: str
    language: str
    number: float | None
    whole: bool = False


# In every language.
READ: Final[Mapping[str, float]] = {
    "0": 0, "5": 5, "120": 120, "1500": 1500, "-0": 0, "−2": -2, "-2": -2, "－２": -2, "+5": 5,
    "＋５": 5, " 5 ": 5, "　５　": 5, "5\n": 5, "9007199254740992": 2**53, "1e-07": 1e-07,
    "1e−07": 1e-07, "1e+22": 1e22, "10000000000000000000000": 1e22, "1" + "0" * 39: 1e39,
}  # fmt: skip
REFUSED: Final = (
    "| |-|−|--5|−-5|-+5|- 5|5-|007|05|-05|1e3|1e-7|1E-07|1e400|1e+400|e5|x|5x|5 m|5%|0x10|1_000|1 000"
    "|1\xa0000|1\u202f000|1'000|٣|½|²|ー５|１。５|１、５|NaN|nan|Infinity|inf|9007199254740993|.|,|5.|5,"
    "|.5|,5|1..5|1,,5|1.2.3|1,2,3|1.2,3|1,2.3|" + "1" * 41 + "|" + "5" * 40
).split("|")
# As in languages with a decimal point; German has both signs the other way round.
READ_WITH_POINT: Final[Mapping[str, float]] = {
    "1.5": 1.5, "-2.5": -2.5, "−2.5": -2.5, "－２．５": -2.5, "１．５": 1.5, "1.50": 1.5, "+1.5": 1.5,
    "0.0": 0, "-0.0": 0, "5.0": 5, "0.001": 0.001, "0.00001": 0.00001, "0.0000001": 1e-07,
    "1.5e-07": 1.5e-07, "1.5e+300": 1.5e300, "0.30000000000000004": 0.30000000000000004,
    "1,500": 1500, "１，５００": 1500, "−1,234.5": -1234.5, "1,234,567.25": 1234567.25,
    "12,345": 12345, "1.500": 1.5, "9,007,199,254,740,992": 2**53,
}  # fmt: skip
REFUSED_WITH_POINT: Final = (
    *("5.0e-324", "0.1000000000000000055511151231257827", "0.12345678901234567890", "1,5", "１，５"),
    *("-1,5", "1,50", "1,5000", "1234,567", "1,234567", "0,500", "00,500", "1,,500", "1.500,5"),
    *("1.500,500", "1,500.", "1,500e+22", "1, 500", "1. 5"),
)
WHOLE: Final[Mapping[str, int]] = {
    "5": 5, "－５": -5, "9007199254740993": 2**53 + 1, "-9223372036854775808": -(2**63),
    "1" * 40: int("1" * 40), "5.0": 5, "1,500": 1500,
}  # fmt: skip
NOT_WHOLE: Final = ("5.5", "1e+22", "007", "", "1" * 41)


# A text with the limits, step and wholeness of an input, and what is read there; None: unclear.
WIDE: Final = ("0", "5000", "", False)
UNCLEAR: Final[Sequence[tuple[str, str, tuple[str, str, str, bool], float | None]]] = (
    ("1.000", "de", WIDE, None),
    ("1.000", "en", WIDE, None),
    ("1,000", "de", WIDE, None),
    ("1,000", "ja", WIDE, None),
    ("1,234", "de", WIDE, None),
    ("１．２５０", "de", WIDE, None),
    ("+1.250", "en", WIDE, None),
    ("-1.250", "en", ("-5000", "5000", "", False), None),
    ("1.000", "de", ("0", "5000", "1", True), None),
    ("1,000", "en", ("0", "5000", "1", True), None),
    # Only one of both is permitted.
    ("1.000", "de", ("10", "5000", "", False), 1000),
    ("1.250", "de", ("0", "5000", "1", True), 1250),
    ("1.250", "en", ("0", "10", "", False), 1.25),
    ("1.250", "en", ("0", "9.999", "0.001", False), 1.25),
    ("1,250", "de", ("0", "9.999", "0.001", False), 1.25),
    ("1.255", "en", ("0", "5000", "0.005", False), None),
    ("1,000", "en", ("0", "5000", "100", True), 1000),
    # No lone group.
    ("1.2500", "en", WIDE, 1.25),
    ("1,2500", "de", WIDE, 1.25),
    ("1.25", "en", WIDE, 1.25),
    ("0.125", "en", WIDE, 0.125),
    ("1000", "de", WIDE, 1000),
    ("1.000,5", "de", WIDE, 1000.5),
    ("1,000.0", "en", WIDE, 1000),
)


def _table() -> Iterator[Typed]:
    for language in LANGUAGES:
        swap = str.maketrans(",.，．", ".,．，") if language == "de" else {}
        everywhere = {**READ, **dict.fromkeys(REFUSED)}
        pointed = {**READ_WITH_POINT, **dict.fromkeys(REFUSED_WITH_POINT)}
        own = {text.translate(swap): number for text, number in pointed.items()}
        for text, number in (everywhere | own).items():
            yield Typed(text, language, number)
        for text, number in {**WHOLE, **dict.fromkeys(NOT_WHOLE)}.items():
            yield Typed(text.translate(swap), language, number, whole=True)


TABLE: Final = tuple(_table())


def generated(number: int, seed: int = 1) -> Iterator[tuple[str, str]]:
    """Texts of the signs of numbers with their languages: half of them changed numbers."""
    chance = random.Random(seed)
    for _ in range(number):
        language = chance.choice(LANGUAGES)
        if chance.random() < 0.3:
            yield "".join(chance.choices(SIGNS, k=chance.randint(1, 9))), language
            continue
        value = round(chance.uniform(-1, 1) * 10 ** chance.randint(-9, 18), chance.randint(0, 9))
        text = f"{value:,}" if chance.random() < 0.5 else decimal_text(value)
        text = number_in(text, chance.choice((language, "de", "en")))
        if chance.random() < 0.5:
            at = chance.randrange(len(text))
            text = (
                text[:at]
                + chance.choice(("", chance.choice(SIGNS)))
                + text[at + chance.randint(0, 1) :]
            )
        yield text, language


def as_sent(number: float | str | None) -> float | str | None:
    """As the scripts send it: whole numbers that are not exact in a browser as text."""
    if isinstance(number, int) and abs(number) > 2**53:
        return str(number)
    return number if isinstance(number, str | None) else float(number)
