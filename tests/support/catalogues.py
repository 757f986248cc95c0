"""Catalogues of sentences that a test writes."""

import json
from collections.abc import Mapping
from pathlib import Path


def write_catalogue(folder: Path, language: str, texts: Mapping[str, str]) -> None:
    """A catalogue with these sentences by their codes."""
    entries = (
        f"msgid {json.dumps(code)}\nmsgstr {json.dumps(text, ensure_ascii=False)}\n"
        for code, text in texts.items()
    )
    (folder / f"{language}.po").write_text("\n".join(entries), encoding="utf-8")
