"""Catalogues of sentences that a test writes."""

import json
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from fastapi import FastAPI

from app.system.texts.catalogue import catalogues_in

KEPT: Final = ExitStack()  # until the process ends


def write_catalogue(folder: Path, language: str, texts: Mapping[str, str]) -> None:
    """A catalogue with these sentences by their codes."""
    entries = (
        f"msgid {json.dumps(code)}\nmsgstr {json.dumps(text, ensure_ascii=False)}\n"
        for code, text in texts.items()
    )
    (folder / f"{language}.po").write_text("\n".join(entries), encoding="utf-8")


def app_with(write: Callable[[Path], None]) -> FastAPI:
    """The application with the catalogues of a folder instead of the project's; it reads them when it
    is imported."""
    folder = Path(KEPT.enter_context(TemporaryDirectory()))
    write(folder)
    KEPT.enter_context(catalogues_in(folder))
    from app.main import app

    return app
