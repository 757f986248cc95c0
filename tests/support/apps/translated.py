"""The application with another language, "qps": every sentence of English in brackets."""

from pathlib import Path

from app.system.texts import ENGLISH, sentences
from tests.support.catalogues import app_with, write_catalogue

LANGUAGE = "qps"


def bracketed(folder: Path) -> None:
    """The catalogue of that language; separators stay unchanged."""
    texts = {
        code: text if code.startswith("between_") else f"⟦{text}⟧"
        for code, text in sentences(ENGLISH).items()
    }
    write_catalogue(folder, LANGUAGE, texts)


app = app_with(bracketed)
