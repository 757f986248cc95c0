"""The files of deploy/ as a wheel has them, and which wheel this program was read from."""

import sys
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Final

from app.errors import SettingsError
from app.settings import PACKAGE, shipped_path

SUFFIX: Final = ".whl"
NAME: Final = "operator_panel-"


class Assets:
    """The shipped files of a wheel; without one those of this program."""

    def __init__(self, wheel: Path | BytesIO | None = None) -> None:
        self._wheel = wheel

    def text(self, name: str) -> str:
        """The text of a file, such as `deploy/kiosk.toml` or `panel.toml`; SettingsError if the wheel
        does not have it."""
        if self._wheel is None:
            return shipped_path(name).read_text()
        try:
            with zipfile.ZipFile(self._wheel) as archive:
                return archive.read(f"app/{name}").decode()
        except (OSError, KeyError, zipfile.BadZipFile) as error:
            name = f"{self._wheel}" if isinstance(self._wheel, Path) else "the release's wheel"
            raise SettingsError(f"{name} is no wheel of the operator panel: {error}") from error


def own_wheel() -> Path | None:
    """The wheel that this program runs from: its file, or that which its release was made of. None in a
    checkout."""
    runs_from = (part for part in PACKAGE.parents if part.name.endswith(SUFFIX))
    return next(runs_from, None) or next(Path(sys.prefix).glob(f"{NAME}*{SUFFIX}"), None)


def checked_wheel(path: Path | None) -> Path:
    """The wheel to install; SettingsError says which is expected."""
    wheel = path or own_wheel()
    if wheel is None:
        raise SettingsError(
            "the wheel is missing: name it, such as dist/operator_panel-0.1.0-py3-none-any.whl"
            " (`make wheel` builds it)"
        )
    if not (wheel.is_file() and wheel.name.startswith(NAME) and wheel.name.endswith(SUFFIX)):
        raise SettingsError(f"{wheel} is no wheel of the operator panel: operator_panel-….whl")
    return wheel.resolve()
