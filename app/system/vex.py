"""What a release's VEX file says of the installed software, offline: which weaknesses concern it, in
the form of OpenVEX 0.2.0. A list of statements that is empty is read too: a release of which no
weakness is known has one, with its time.

Source: https://github.com/openvex/spec/blob/main/OPENVEX-SPEC.md
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final, Literal, cast, get_args
from urllib.parse import unquote

from app.system.errors import SettingsError
from app.system.inventory import PYPI, Component, package_name
from app.system.minisign import check_signed, parse_keys
from app.system.printable import one_line

Status = Literal["affected", "under_investigation", "fixed", "not_affected"]
STATUSES: Final = get_args(Status)
# What a statement of a status must have one of.
DETAILS: Final[Mapping[str, Sequence[str]]] = {
    "not_affected": ("justification", "impact_statement"),
    "affected": ("action_statement",),
}
CONTEXT: Final = "https://openvex.dev/ns"
PURL: Final = "pkg:"
MOST_BYTES: Final = 10_000_000
MOST_TEXT: Final = 300


@dataclass(frozen=True, slots=True)
class Statement:
    """`products` are purls, each with those of its subcomponents. `detail` is what to do of "affected",
    and why not of "not_affected"."""

    weakness: str
    status: Status
    products: tuple[tuple[str, tuple[str, ...]], ...]
    detail: str
    at: datetime


@dataclass(frozen=True, slots=True)
class Vex:
    author: str
    at: datetime
    statements: tuple[Statement, ...]


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is said of an installed component."""

    weakness: str
    component: Component
    status: Status
    detail: str


def read_vex(file: Path) -> Vex:
    """SettingsError for what is not OpenVEX. Blocks."""
    return _parsed(_content(file), file)


def _content(file: Path) -> bytes:
    try:
        if file.stat().st_size > MOST_BYTES:
            raise SettingsError(f"{file} is larger than {MOST_BYTES // 1_000_000} MB")
        return file.read_bytes()
    except OSError as error:
        raise SettingsError(f"{file} can't be read: {error.strerror}") from error


def _parsed(data: bytes, file: Path) -> Vex:
    try:
        document = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise SettingsError(f"{file} is not JSON: {error}") from error
    try:
        return parse_vex(document)
    except ValueError as error:
        raise SettingsError(f"{file} is not OpenVEX: {error}") from error


def read_signed_vex(file: Path, keys: Path) -> tuple[Vex, str]:
    """A file that is signed with one of the keys, and what its signature says; SettingsError."""
    data = _content(file)
    try:
        text = keys.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise SettingsError(f"no key is trusted: {keys} can't be read: {error.strerror}") from error
    signed = check_signed(file, parse_keys(text, str(keys)), data)
    return _parsed(data, file), signed


def parse_vex(data: Any) -> Vex:
    """ValueError says where and what is wrong."""
    document = _table(data, "the document")
    if not str(document.get("@context", "")).startswith(CONTEXT):
        raise ValueError(f'"@context" must begin with {CONTEXT}')
    at = _time(document, "the document")
    statements = document.get("statements")
    if not isinstance(statements, list):
        raise ValueError('"statements" must be a list')
    read = tuple(_statement(each, f"statements[{n}]", at) for n, each in enumerate(statements))
    return Vex(_text(document, "author", "the document"), at, read)


def _statement(data: Any, place: str, at: datetime) -> Statement:
    table = _table(data, place)
    weakness = _text(_table(table.get("vulnerability"), f"{place}.vulnerability"), "name", place)
    status = str(table.get("status"))
    if status not in STATUSES:
        raise ValueError(f"{place}.status must be one of {', '.join(STATUSES)}")
    keys = DETAILS.get(status, ())
    detail = next((str(table[key]) for key in keys if table.get(key)), "")
    if keys and not detail:
        raise ValueError(f"{place} is {status}, and has no {' or '.join(keys)}")
    products = table.get("products")
    if not isinstance(products, list) or not products:
        raise ValueError(f"{place}.products must be a list with one entry at least")
    return Statement(
        weakness,
        cast(Status, status),
        tuple(_product(each, f"{place}.products[{n}]") for n, each in enumerate(products)),
        one_line(detail, MOST_TEXT),
        _time(table, place) if "timestamp" in table else at,
    )


def _product(data: Any, place: str) -> tuple[str, tuple[str, ...]]:
    inner = _table(data, place).get("subcomponents", [])
    if not isinstance(inner, list):
        raise ValueError(f"{place}.subcomponents must be a list")
    parts = (_purl(each, f"{place}.subcomponents[{n}]") for n, each in enumerate(inner))
    return _purl(data, place), tuple(parts)


def _purl(data: Any, place: str) -> str:
    table = _table(data, place)
    purl = _table(table.get("identifiers", {}), f"{place}.identifiers").get("purl", table.get("@id"))
    if not isinstance(purl, str) or not purl.startswith(PURL):
        raise ValueError(f'{place} has no purl, such as "pkg:pypi/pillow@12.0.0"')
    return purl


def _table(data: Any, place: str) -> Mapping[str, Any]:
    if not isinstance(data, dict):
        raise ValueError(f"{place} must be an object")
    return data


def _text(table: Mapping[str, Any], key: str, place: str) -> str:
    text = table.get(key)
    if not isinstance(text, str) or not text:
        raise ValueError(f'{place} has no "{key}"')
    return one_line(text, MOST_TEXT)


def _time(table: Mapping[str, Any], place: str) -> datetime:
    try:
        at = datetime.fromisoformat(_text(table, "timestamp", place))
    except ValueError:
        raise ValueError(f'{place} has no "timestamp" in ISO 8601') from None
    return at if at.tzinfo else at.astimezone()


def verdicts(vex: Vex, components: Sequence[Component]) -> list[Verdict]:
    """The newest statement of each weakness about each installed component, what is affected first. A
    product with subcomponents is meant where both are installed: the verdict is of the subcomponent."""
    newest: dict[tuple[str, str], tuple[datetime, Verdict]] = {}
    for statement in vex.statements:
        for component in _meant(statement, components):
            key = statement.weakness, component.purl
            if key not in newest or newest[key][0] <= statement.at:
                verdict = Verdict(statement.weakness, component, statement.status, statement.detail)
                newest[key] = statement.at, verdict
    every = [verdict for _, verdict in newest.values()]
    return sorted(every, key=lambda each: (STATUSES.index(each.status), each.weakness))


def _meant(statement: Statement, components: Sequence[Component]) -> Iterator[Component]:
    for product, inner in statement.products:
        own = [component for component in components if is_meant(product, component)]
        if not inner:
            yield from own
        elif own:
            yield from (c for c in components if any(is_meant(each, c) for each in inner))


def is_meant(purl: str, component: Component) -> bool:
    """Whether a purl names this component; without a version it names all of them."""
    kind, _, rest = purl.removeprefix(PURL).partition("#")[0].partition("?")[0].partition("/")
    name, _, version = rest.partition("@")
    name, version = unquote(name), unquote(version)
    if kind.lower() == PYPI:
        name = package_name(name)
    same = (kind.lower(), name) == (component.kind, component.full_name)
    return same and version in ("", component.version)
