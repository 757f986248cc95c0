"""The application with another language, "qps": every sentence of English in brackets."""

import json
import tempfile
from pathlib import Path

from app.i18n import ENGLISH, sentences
from app.i18n.catalogue import catalogues_in

LANGUAGE = "qps"


def bracketed(folder: Path) -> None:
    """The catalogue of that language; separators stay unchanged."""
    texts = {
        code: text if code.startswith("between_") else f"⟦{text}⟧"
        for code, text in sentences(ENGLISH).items()
    }
    entries = (
        f"msgid {json.dumps(code)}\nmsgstr {json.dumps(text, ensure_ascii=False)}\n"
        for code, text in texts.items()
    )
    (folder / f"{LANGUAGE}.po").write_text("\n".join(entries), encoding="utf-8")


_folder = tempfile.TemporaryDirectory()
bracketed(Path(_folder.name))
_catalogues = catalogues_in(Path(_folder.name))
_catalogues.__enter__()

from app.main import app  # noqa: E402 - it reads the catalogues above

__all__ = ["app"]
