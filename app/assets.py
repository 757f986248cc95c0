"""The static files, in memory, under a name that changes with their content.

The stylesheet is the layers of `static/css` in their order, with the panel's millimetres: one
request instead of four; what only the log's page needs is a file of its own. Scripts keep their names,
so that modules find each other, and their lines. Comments and what lines are indented by stay here.
"""

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

LAYERS: Final = ("tokens", "base", "layout", "widgets")
OWN_PAGE: Final = "log"
LEFT_OUT: Final = {
    ".css": re.compile(rb"/\*.*?\*/|^[ \t]+", re.DOTALL | re.MULTILINE),
    ".js": re.compile(rb"^[ \t]*(//.*)?", re.MULTILINE),
}
MEDIA_TYPES: Final = {".css": "text/css", ".js": "text/javascript"}


@dataclass(frozen=True, slots=True)
class Asset:
    content: bytes
    media_type: str


@dataclass(frozen=True, slots=True)
class Assets:
    """`revision` stands in every URL: what a browser keeps under it never changes."""

    files: dict[str, Asset]
    revision: str


def load_assets(static: Path, templates: Path, mm_per_px: float) -> Assets:
    """Reads `static`, and `templates` for the revision only.

    `mm_per_px` (millimetres per CSS pixel) gives the sizes of buttons.
    """
    layers = [(static / "css" / f"{name}.css").read_bytes() for name in LAYERS]
    millimetre = f":root{{--mm:{1 / mm_per_px:.4f}px}}\n".encode()
    files = {"kiosk.css": _asset(".css", b"".join([*layers, millimetre]))}
    own = (static / "css" / f"{OWN_PAGE}.css").read_bytes()
    files[f"{OWN_PAGE}.css"] = _asset(".css", own)
    for script in sorted((static / "js").glob("*.js")):
        files[script.name] = _asset(".js", script.read_bytes())
    digest = hashlib.sha256()
    for name, asset in sorted(files.items()):
        digest.update(name.encode() + b"\0" + asset.content + b"\0")
    for template in sorted(templates.glob("*.html")):
        digest.update(template.read_bytes() + b"\0")
    return Assets(files, digest.hexdigest()[:12])


def _asset(suffix: str, content: bytes) -> Asset:
    return Asset(LEFT_OUT[suffix].sub(b"", content), MEDIA_TYPES[suffix])
