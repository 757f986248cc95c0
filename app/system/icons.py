"""The icons that pages may show: a part of the Lucide set, shipped in `static/icons`."""

import re
from collections.abc import Mapping
from functools import cache
from typing import Final

from markupsafe import Markup

from app.system.settings import shipped_path

SYMBOL: Final = re.compile(r'^<symbol id="([a-z0-9-]+)">(.+)</symbol>$', re.MULTILINE)


@cache
def icons() -> Mapping[str, str]:
    """Name → the elements inside its `<svg>`, drawn in lines on a square of 24 units."""
    text = (shipped_path("static") / "icons/lucide.svg").read_text(encoding="utf-8")
    return dict(SYMBOL.findall(text))


@cache
def icon(name: str) -> Markup:
    """An icon as an element. It says nothing that the text beside it does not. KeyError for an unknown
    one."""
    inside = Markup(icons()[name])
    return Markup('<svg class="icon" viewBox="0 0 24 24" aria-hidden="true">{}</svg>').format(inside)
