"""The icons that pages may show: a part of the Lucide set, shipped in `static/icons`."""

import re
from collections.abc import Mapping
from functools import cache
from typing import Final

from app.settings import shipped_path

SYMBOL: Final = re.compile(r'^<symbol id="([a-z0-9-]+)">(.+)</symbol>$', re.MULTILINE)


@cache
def icons() -> Mapping[str, str]:
    """Name → the elements inside its `<svg>`, drawn in lines on a square of 24 units."""
    text = (shipped_path("static") / "icons/lucide.svg").read_text(encoding="utf-8")
    return dict(SYMBOL.findall(text))
