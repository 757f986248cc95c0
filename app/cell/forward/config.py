"""The settings of the forwarder and of the central database: a TOML file with `[forward]` and
`[central]`, named by `KIOSK_FORWARD`."""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qsl, unquote, urlsplit

from app.panel.file.wording import known_hint
from app.system.errors import SettingsError

STREAMS: Final = ("log", "alarms", "states", "trends", "recipes", "health")
NAME: Final = re.compile(r"[^\x00-\x1f\x7f]{1,80}")
# What a connection string may have: the keys of libpq, without those for secrets.
CONNECTION_KEYS: Final = (
    "host", "hostaddr", "port", "dbname", "user", "sslmode", "sslrootcert", "sslcert", "sslkey",
    "sslcrl", "channel_binding", "require_auth", "gssencmode", "target_session_attrs",
)  # fmt: skip
SECRETS: Final = ("password", "sslpassword")
FILES: Final = ("sslrootcert", "sslcert", "sslkey", "sslcrl")
PAIR: Final = re.compile(r"\s*(\w+)\s*=\s*('(?:[^'\\]|\\.)*'|[^\s']*)(?=\s|$)")
SCHEMES: Final = ("postgresql", "postgres")


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionConfig:
    """How the database is reached: keys of libpq, and the file with the password, None for none."""

    keys: Mapping[str, str]
    password_file: Path | None = None

    @property
    def address(self) -> str:
        """Host and port, as a person reads it."""
        host = self.keys.get("host") or self.keys.get("hostaddr") or "localhost"
        return f"{host}:{self.keys.get('port', '5432')}"

    @property
    def is_encrypted(self) -> bool:
        """Whether the server's certificate is checked, with its name."""
        return self.keys["sslmode"] == "verify-full"


@dataclass(frozen=True, slots=True, kw_only=True)
class ForwardConfig:
    """`[forward]`: `panel` is the name at the centre, `keep_days` and `keep_mb` limit what the cell
    keeps for the centre, `batch` is the most rows of a transaction, `every_s` the time between two
    looks."""

    panel: str
    site: str
    connection: ConnectionConfig
    streams: tuple[str, ...] = STREAMS
    keep_days: float = 35.0
    keep_mb: float = 512.0
    batch: int = 500
    every_s: float = 2.0


# The limits of the numbers: the least, the most, and what they are.
LIMITS: Final[Mapping[str, tuple[float, float, str]]] = {
    "keep_days": (1, 3650, "a number of days"),
    "keep_mb": (16, 1_000_000, "a number of megabytes"),
    "batch": (1, 5000, "a number of rows"),
    "every_s": (0.1, 600, "a number of seconds"),
}
FORWARD_KEYS: Final = ("panel", "site", "connection", "password_file", "streams", *LIMITS)
CENTRAL_KEYS: Final = ("connection", "password_file")
TABLES: Final = {"forward": FORWARD_KEYS, "central": CENTRAL_KEYS}


def read_forward(path: Path) -> ForwardConfig:
    """`[forward]` of a settings' file; SettingsError names the key, its value, and what is right."""
    table = _Table(path, "forward")
    streams = table.values.get("streams", list(STREAMS))
    if not isinstance(streams, list) or not streams or any(name not in STREAMS for name in streams):
        raise table.error("streams", f"a list of {', '.join(STREAMS)}")
    numbers = {name: table.number(name) for name in LIMITS if name in table.values}
    if "batch" in numbers:
        numbers["batch"] = int(numbers["batch"])
    return ForwardConfig(
        panel=table.name("panel"),
        site=table.name("site", ""),
        connection=table.connection(),
        streams=tuple(name for name in STREAMS if name in streams),
        **numbers,
    )


def read_central(path: Path) -> ConnectionConfig:
    """The connection of `[central]`, else that of `[forward]`; SettingsError."""
    tables = _tables(path)
    return _Table(path, "central" if "central" in tables else "forward").connection()


def _tables(path: Path) -> Mapping[str, Any]:
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(f"{path} (KIOSK_FORWARD) can't be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise SettingsError(f"{path} (KIOSK_FORWARD) is not a TOML file: {error}") from None
    for name, table in tables.items():
        if name not in TABLES:
            raise SettingsError(f'{path} has "{name}": there are [forward] and [central]')
        if not isinstance(table, dict):
            raise SettingsError(f"{path}: {name} must be a table, [{name}]")
        for key in table:
            if key not in TABLES[name]:
                raise SettingsError(
                    f"{path}: [{name}] has no key {key}: {known_hint(key, TABLES[name])}"
                )
    return tables


class _Table:
    """A table of the file."""

    def __init__(self, path: Path, name: str) -> None:
        tables = _tables(path)
        if name not in tables:
            raise SettingsError(f"{path} (KIOSK_FORWARD) has no table [{name}]")
        self._path = path
        self._name = name
        self.values: Mapping[str, Any] = tables[name]

    def error(self, key: str, right: str) -> SettingsError:
        place = f"{self._path}: [{self._name}] {key}"
        if key not in self.values:
            return SettingsError(f"{place} is missing: {right}")
        return SettingsError(f"{place} is {_as_text(self.values[key])}: it must be {right}")

    def name(self, key: str, default: str | None = None) -> str:
        value = self.values.get(key, default)
        if value == "" and default == "":
            return ""
        if not isinstance(value, str) or not NAME.fullmatch(value) or value != value.strip():
            raise self.error(key, 'a name of 1 to 80 characters, such as "cell 12"')
        return value

    def number(self, key: str) -> Any:
        value, (least, most, noun) = self.values[key], LIMITS[key]
        whole = key == "batch"
        is_number = isinstance(value, int) or (isinstance(value, float) and not whole)
        if isinstance(value, bool) or not is_number or not least <= value <= most:
            raise self.error(key, f"{noun} from {least:g} to {most:g}")
        return value

    def connection(self) -> ConnectionConfig:
        text = self.values.get("connection")
        right = 'a connection string, such as "host=history.plant dbname=plant user=cell12"'
        if not isinstance(text, str) or not text.strip():
            raise self.error("connection", right)
        place = f"{self._path}: [{self._name}] connection"
        try:
            keys = parse_connection(text)
        except ValueError as error:
            raise SettingsError(f"{place} {error}: it must be {right}") from None
        for name in FILES:
            if keys.get(name) and keys[name] != "system":
                keys[name] = str(self._beside(keys[name]))
        password_file = self.values.get("password_file")
        if password_file is not None and (not isinstance(password_file, str) or not password_file):
            raise self.error("password_file", "the path of a file with the password alone")
        keys.setdefault("sslmode", "verify-full")
        if keys["sslmode"] == "verify-full":
            keys.setdefault("sslrootcert", "system")
        file = self._beside(password_file) if password_file else None
        return ConnectionConfig(keys=keys, password_file=file)

    def _beside(self, name: str) -> Path:
        return self._path.parent / Path(name).expanduser()


def _as_text(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def parse_connection(text: str) -> dict[str, str]:
    """The keys of a connection string of libpq, in either form; ValueError says what is wrong, without
    the value of a secret."""
    keys = _uri(text) if text.partition("://")[0] in SCHEMES else _pairs(text)
    for name in keys:
        if name in SECRETS:
            raise ValueError(f"has {name}: a secret stands in password_file")
        if name not in CONNECTION_KEYS:
            raise ValueError(f"has {name}: there are {', '.join(CONNECTION_KEYS)}")
    if "dbname" not in keys:
        raise ValueError("has no dbname")
    return keys


def _pairs(text: str) -> dict[str, str]:
    keys, at = {}, 0
    text = text.strip()
    while at < len(text):
        match = PAIR.match(text, at)
        if match is None:
            raise ValueError("is not a list of key=value")
        value = match[2]
        if value.startswith("'"):
            value = re.sub(r"\\(.)", r"\1", value[1:-1])
        keys[match[1]], at = value, match.end()
    return keys


def _uri(text: str) -> dict[str, str]:
    parts = urlsplit(text)
    keys = {
        "host": unquote(parts.hostname or ""),
        "port": str(parts.port or ""),
        "user": unquote(parts.username or ""),
        "dbname": unquote(parts.path.removeprefix("/")),
        "password": parts.password or "",
        **dict(parse_qsl(parts.query)),
    }
    return {name: value for name, value in keys.items() if value}
